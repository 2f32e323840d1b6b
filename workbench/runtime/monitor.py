"""The monitor: one observation in, one decision out, and a safe answer whenever it cannot judge."""

from __future__ import annotations

import math
import numbers
import time
from collections.abc import Callable, Mapping, Sequence
from typing import final

from workbench.claims import Rigor, weakest
from workbench.runtime.arc import Interval
from workbench.runtime.bundle import Bundle
from workbench.runtime.decision import Action, Decision
from workbench.runtime.floats import float_mode_fault
from workbench.runtime.grounds import grounds
from workbench.runtime.judgement import (
    CannotJudgeError,
    Judgement,
    KernelFaultError,
    Question,
    judge,
    unjudged,
)
from workbench.runtime.layout import KERNEL_VERDICTS
from workbench.runtime.measuring import STATES, Measuring, check_region, initial_sets
from workbench.runtime.observation import (
    Observation,
    fault_in_observation,
    held_to,
    seen_people,
    tracked_people,
    watched_at_stamp,
)
from workbench.runtime.path import PathTable
from workbench.runtime.person_guard import MotionLimits
from workbench.runtime.person_tubes import TrackedPerson
from workbench.runtime.policies import (
    Cycle,
    Deciding,
    Ground,
    LookAhead,
    Phase,
    Policies,
    PoliciesOutcome,
    Timing,
    Turn,
)
from workbench.runtime.policies.plan import SPEED
from workbench.runtime.query import PathWindows, check_interface, crowd_values, parameter_values
from workbench.runtime.settings import check_settings, fail_safe_of, fixed_values, started
from workbench.sets import Box

__all__ = ["STATES", "Action", "Decision", "Monitor", "Observation"]


@final
class Monitor:
    """Decides, observation by observation, whether the vehicle may go on tracking its path.

    bundle: the compiled proof. path: the whole route; each query gets a window of it around the
    vehicle. release_steps: how many SAFE verdicts in a row end braking once `LookAhead` decided it
    (1: the first does; a monitor that never braked needs one). clearance_required_m >= 0: distance
    between body and person that SAFE must prove. timing: how often and how late it is asked, and
    how often `turn` is. deciding: whose TRACK counts, a `Deciding` or its value, None for what the
    bundle says.
    start_station_m: where on the path the vehicle starts, needed only where the path meets itself;
    None finds it out. clock: the monotonic clock of all stamps, in s below 1e9. Raises InputError
    when the bundle's kernel does not take or give what a monitor needs.

    Of the people's guards it asks what the theorem of docs/fail-safe-induction.md needs, that they
    overlap from cycle to cycle, not that each lies inside the one before.
    """

    def __init__(  # noqa: PLR0913 - what the vehicle sets; none of it has a home elsewhere
        self,
        bundle: Bundle,
        path: PathTable,
        *,
        release_steps: int,
        clearance_required_m: float,
        timing: Timing,
        deciding: Deciding | None = None,
        start_station_m: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        check_settings(clearance_required_m, start_station_m)
        manifest = bundle.manifest
        check_interface(manifest)
        levels = manifest.levels
        self._bundle = bundle
        self._limits = MotionLimits(manifest.guard_speed_max_mps, manifest.guard_accel_max_mps2)
        self._clock = clock
        self._clearance_m = clearance_required_m
        self._level = [level.name for level in levels].index(manifest.deciding_level)
        shares = [level.share for level in levels]
        self._measuring = Measuring(path, shares, station_m=start_station_m)
        nodes = next(field.count for field in manifest.query if field.name == "path_x")
        self._windows = PathWindows(path, nodes=nodes)
        self._times_s = tuple(k * manifest.step_s for k in range(manifest.steps + 1))
        self._policies = Policies(
            look_ahead=LookAhead(
                horizon_s=min(manifest.horizon_s, self._times_s[-1]),
                release_steps=release_steps,
                timing=timing,
            ),
            fail_safe=fail_safe_of(manifest, self._level, timing),
            deciding=Deciding.named(manifest.deciding if deciding is None else deciding),
        )
        self._state = self._policies.start(started(self._now()))
        self._fixed = fixed_values(manifest.vehicle, clearance_required_m, timing)
        # Path coordinates are proved up to a fixed allowance for rounding, hence at most NUMERICAL.
        self._rigor = weakest(manifest.rigor, Rigor.NUMERICAL)

    def step(self, observation: Observation) -> Decision:
        """Judge one observation; never raises, whatever the observation holds.

        What cannot be judged is INVALID: `LookAhead` brakes, `FailSafe` carries out the plan in
        force. All calls, of `turn` too, must come from the same thread.
        """
        begun_s, started_s = time.perf_counter(), self._now()
        try:
            cycle, judgement = self._cycle(observation, started_s)
            state, outcome = self._policies.step(self._state, cycle)
            decision = self._decision(outcome, judgement, begun_s)
        except Exception as error:
            # Whatever went wrong, the vehicle must get an answer.
            judgement = unjudged(_said(error), _ground(error))
            state, outcome = self._policies.missed(
                self._state, judgement.track_intent, now_s=self._now()
            )
            decision = self._decision(outcome, judgement, begun_s)
        # Last, so that no failure leaves half a step behind.
        self._state = state
        return decision

    def turn(self, now_s: float | None = None) -> Turn:
        """What to send now (now_s: None reads the clock); to be called on every turn of the sender.

        Never raises; an instant that is no number, or before the last one, brakes.
        """
        now_s = self._now() if now_s is None else _instant(now_s)
        self._state, turn = self._policies.turn(self._state, now_s)
        return turn

    def hold(self, now_s: float) -> None:
        """In place of `turn`, where BRAKE is sent for a reason that the monitor does not know.

        A car that brakes by itself has left its plan; only a measured standstill leads to the next
        one. Never raises.
        """
        if self.turn(now_s).action is Action.TRACK:
            self._state = self._policies.held(self._state, _instant(now_s))

    def _now(self) -> float:
        try:
            return _instant(self._clock())
        except Exception:
            return math.nan

    def _cycle(self, observation: Observation, started_s: float) -> tuple[Cycle, Judgement]:
        """What is measured and what the kernel says of it; raises where nothing is measured."""
        people = tracked_people(observation)
        fault = fault_in_observation(observation, people)
        if fault is not None:
            raise CannotJudgeError(fault)
        observation = held_to(observation, self._limits)
        people = tracked_people(observation)
        measured = self._measuring.boxes(observation)
        fault = float_mode_fault()
        if fault is None:
            judgement, fault = self._judged(observation, people, measured)
        else:
            judgement = unjudged(fault, Ground.ARITHMETIC)
        cycle = Cycle(
            stamp_s=observation.stamp_s,
            started_s=started_s,
            finished_s=self._now(),
            measured=measured,
            people=seen_people(observation),
            watched=watched_at_stamp(
                observation, unseen_speed_mps=self._policies.fail_safe.unseen_speed_mps
            ),
            track_intent=judgement.track_intent,
            brake_intent=judgement.brake_intent,
            brake_guard=judgement.brake_guard,
            stop_guard=judgement.stop_guard,
            fault=fault,
        )
        return cycle, judgement

    def _judged(
        self, observation: Observation, people: Sequence[TrackedPerson], measured: tuple[Box, ...]
    ) -> tuple[Judgement, str | None]:
        """The kernel's answer, and why its arithmetic cannot be trusted."""
        try:
            values, question = self._query(observation, people, measured)
            result = self._bundle.call(values)
            fault = float_mode_fault()
            if fault is not None:
                raise KernelFaultError(f"the kernel changed the processor's mode: {fault}")
            return judge(result, question), None
        except CannotJudgeError as error:
            return unjudged(str(error), error.ground), None
        except KernelFaultError as error:
            return unjudged(str(error), Ground.ARITHMETIC), str(error)

    def _query(
        self, observation: Observation, people: Sequence[TrackedPerson], measured: tuple[Box, ...]
    ) -> tuple[Mapping[str, Sequence[float]], Question]:
        manifest = self._bundle.manifest
        check_region(manifest, measured[0])
        start_s = self._start_s(observation.stamp_s, measured[0])
        values = {
            **self._fixed,
            **self._windows.around(measured[0].interval("station")[0]),
            **crowd_values(people),
            **initial_sets(measured),
            "parameters": parameter_values(manifest, observation.reference_speed_mps),
            "skew_s": observation.skew_s,
            "start_s": start_s or (0.0, 0.0),
        }
        question = Question(
            measured,
            self._level,
            tuple(person.name for person in people),
            self._clearance_m,
            self._times_s,
            manifest.budget,
            observation.watched,
            self._policies.fail_safe.timing.switch_s,
            start_s,
        )
        return values, question

    def _start_s(self, stamp_s: float, measured: Box) -> Interval | None:
        """When the tubes of TRACK begin; None: at the stamp, as for every car that may move then.

        Without a proved standstill there is no plan, whatever the kernel says of the stop tube.
        """
        state = self._state.fail_safe
        rolls = state.phase is Phase.HOLDING and not stamp_s >= state.stands_s
        least, most = measured.interval(SPEED)
        if rolls or not least <= 0.0 <= most:
            return None
        return self._policies.fail_safe.start_s(state, stamp_s)

    def _decision(self, outcome: PoliciesOutcome, judgement: Judgement, begun_s: float) -> Decision:
        heard, track = outcome.heard, judgement.track_intent
        reasons = dict.fromkeys(each.reason for each in heard)
        named = (f"{each.policy}: {each.reason}" for each in heard)
        return Decision(
            verdict=max((each.verdict for each in heard), key=KERNEL_VERDICTS.index),
            action=outcome.action,
            reason=next(iter(reasons)) if len(reasons) == 1 else "; ".join(named),
            brake_from_s=outcome.brake_from_s,
            look_ahead=outcome.look_ahead,
            fail_safe=outcome.fail_safe,
            violations=outcome.violations,
            alert=outcome.alert,
            clearance_m=track.clearance_m,
            clearance_time_s=track.clearance_time_s,
            clearance_person=track.clearance_person,
            occupancy=judgement.occupancy,
            tube_lower=judgement.tube_lower,
            tube_upper=judgement.tube_upper,
            stop_occupancy=judgement.stop_occupancy,
            level_verdicts=judgement.level_verdicts,
            deciding_level=self._bundle.manifest.deciding_level,
            assumptions=self._bundle.manifest.assumptions,
            elapsed_s=time.perf_counter() - begun_s,
            rigor=self._rigor,
            grounds=grounds(outcome, judgement),
        )


def _instant(value: object) -> float:
    """The value where it is a number, otherwise NaN, which every clock check refuses."""
    try:
        return float(value) if isinstance(value, numbers.Real) else math.nan
    except Exception:
        # An int may be too large for a float, and other numbers may raise what they like.
        return math.nan


def _said(error: Exception) -> str:
    """The error in words, whatever it holds."""
    try:
        return f"{error}" if isinstance(error, CannotJudgeError) else f"{_kind(error)}: {error}"
    except Exception:
        return _kind(error)


def _ground(error: Exception) -> Ground:
    return error.ground if isinstance(error, CannotJudgeError) else Ground.ARITHMETIC


def _kind(error: Exception) -> str:
    return type(error).__name__
