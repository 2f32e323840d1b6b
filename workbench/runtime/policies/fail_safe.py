"""Drive on only while a proved way to stop remains; if none follows, carry it out to the end."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.runtime.arc import Interval
from workbench.runtime.decision import Action
from workbench.runtime.policies.cycle import Answer, Cycle, Hypothesis, Outcome, Violation
from workbench.runtime.policies.guards import Relation, Scene, people_violations, remembered
from workbench.runtime.policies.horizon import GRAIN_S, BrakeBounds, Timing
from workbench.runtime.policies.instants import age_violation, arithmetic_violation, clock_violation
from workbench.runtime.policies.phases import (
    FailSafeState,
    Phase,
    Turn,
    braked,
    brakes_s,
    closed,
)
from workbench.runtime.policies.plan import (
    SPEED,
    Plan,
    fault_in_answer,
    proved_standstill_s,
    starts_fault,
    state_violation,
)

_NAME = "FailSafe"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FailSafe:
    """TRACK for one more period only if TRACK, then BRAKE to standstill, keeps clear of the guards.

    A SAFE `stop_guard` makes a plan: TRACK until its switch interval, BRAKE from there. It replaces
    the plan in force if its check ended before that plan's switch interval begins and no hypothesis
    failed. Otherwise the plan in force is carried out: `turn` commands BRAKE within its switch
    interval, and nothing is permitted until the car stands. A violation that refutes the plan in
    force brakes at once. Guarantee, hypotheses and proof: docs/fail-safe-induction.md.

    level: which of the measured nested sets the answers are about; timing, brake: see there;
    required: what each cycle must show of everybody; unseen_speed_mps: speed bound of people beyond
    the watched disc. `step` and `turn` are pure; each gets the state that the last one returned.
    Raises InputError for a negative level, a speed that is not > 0 and finite, or OUTSIDE.
    """

    level: int
    timing: Timing
    brake: BrakeBounds
    required: Relation
    unseen_speed_mps: float

    def __post_init__(self) -> None:
        if self.level < 0 or not 0.0 < self.unseen_speed_mps < math.inf:
            raise InputError(
                "FailSafe: expected level >= 0 and a finite unseen_speed_mps > 0, got "
                f"{self.level!r} and {self.unseen_speed_mps!r}"
            )
        if self.required is Relation.OUTSIDE:
            raise InputError(
                "FailSafe: required must be OVERLAPS or INSIDE; OUTSIDE checks nothing"
            )

    def start(self, now_s: float) -> FailSafeState:
        """BRAKE is to be commanded by the next turn; that the car stands has still to be shown."""
        never = math.inf
        return FailSafeState(Phase.HOLDING, None, None, never, never, never, now_s, -never, None)

    def start_s(self, state: FailSafeState, stamp_s: float) -> Interval | None:
        """When the tube of an observation must let TRACK begin, counted from its stamp.

        None: TRACK has been in force since before. Otherwise the question for `stop_guard` is the
        one that begins at standstill.
        """
        if state.phase is Phase.HOLDING:
            return 0.0, self.timing.latency_s + self.timing.send_gap_s + GRAIN_S
        if state.begun_s <= stamp_s:
            return None
        begun_s = state.begun_s - stamp_s
        return max(begun_s - GRAIN_S, 0.0), begun_s + GRAIN_S

    def turn(self, state: FailSafeState, now_s: float) -> tuple[FailSafeState, Turn]:
        """What to send at now_s. To be called on every turn of the sender, whatever checks do."""
        if not state.clock_s <= now_s < math.inf:
            broken = Violation(Hypothesis.CLOCK, f"{now_s!r} s after {state.clock_s!r} s", True)
            return braked(state), Turn(Action.BRAKE, broken)
        state = dataclasses.replace(state, clock_s=now_s)
        if state.phase is Phase.HOLDING:
            return self._begin(state, now_s)
        if state.plan is None:
            # The car tracks without a plan, because another policy decides; now it need not.
            return braked(state, sent_s=now_s), Turn(Action.BRAKE, None)
        first, last = state.plan.switch_s
        if now_s < first:
            return state, Turn(Action.TRACK, None)
        if now_s > last:
            detail = f"BRAKE is sent {now_s - last:.3f} s after the switch interval"
            missed = Violation(Hypothesis.SENDER, detail, True)
            return braked(state, sent_s=now_s), Turn(Action.BRAKE, missed)
        late = None
        if state.phase is Phase.TRACKING:
            late = Violation(Hypothesis.ON_TIME, "no check ended before the switch", False)
        held = dataclasses.replace(
            state, phase=Phase.HOLDING, offer=None, braking_s=now_s, begun_s=math.inf,
            stands_s=state.plan.standstill_s,
        )  # fmt: skip
        return held, Turn(Action.BRAKE, late)

    def step(
        self, state: FailSafeState, cycle: Cycle, *, consent: bool = True
    ) -> tuple[FailSafeState, Outcome]:
        """Take over the plan of this cycle, or not; consent: False if another policy objects.

        A cycle whose sets or rows do not fit each other raises; the caller then keeps the state it
        has and calls it `missed`.
        """
        answer = cycle.stop_guard.answer
        broken = clock_violation(cycle, clock_s=state.clock_s)
        if broken is not None:
            return self._answered(braked(state), answer, (broken,), "")
        state, found = self._examined(state, cycle)
        new, objection = self._plan(state, cycle)
        if not objection and not consent:
            objection = "another policy objects"
        stamp_s = max(state.stamp_s, cycle.stamp_s)
        state = dataclasses.replace(state, clock_s=cycle.finished_s, stamp_s=stamp_s)
        if any(violation.refutes_plan for violation in found):
            state = braked(state)
        elif found or objection:
            state = closed(state)
        elif state.phase is Phase.TRACKING:
            state = dataclasses.replace(state, plan=new)
        else:
            # HOLDING: while CLOSING there is always an objection.
            state = dataclasses.replace(state, offer=new)
        return self._answered(state, answer, found, objection)

    def missed(
        self, state: FailSafeState, answer: Answer, *, now_s: float
    ) -> tuple[FailSafeState, Outcome]:
        """A cycle of which nothing can be said: no new plan, and the one in force is carried out.

        It is a check that failed, which refutes no hypothesis; but a clock that runs backwards
        does. answer: says why, and is INVALID.
        """
        if not state.clock_s <= now_s < math.inf:
            broken = Violation(Hypothesis.CLOCK, f"{now_s!r} s after {state.clock_s!r} s", True)
            return self._answered(braked(state), answer, (broken,), "")
        state = closed(dataclasses.replace(state, clock_s=now_s))
        return self._answered(state, answer, (), answer.reason)

    def _begin(self, state: FailSafeState, now_s: float) -> tuple[FailSafeState, Turn]:
        """The offered plan begins if this turn is within its start interval."""
        offer = state.offer
        granted = None if offer is None else offer.start_s
        if granted is None or not granted[0] <= now_s <= granted[1]:
            since_s = min(state.braking_s, now_s)
            held = dataclasses.replace(state, offer=None, braking_s=since_s)
            return held, Turn(Action.BRAKE, None)
        begun = dataclasses.replace(
            state, phase=Phase.TRACKING, plan=offer, offer=None, begun_s=now_s, stands_s=math.inf
        )
        return begun, Turn(Action.TRACK, None)

    def _examined(
        self, state: FailSafeState, cycle: Cycle
    ) -> tuple[FailSafeState, tuple[Violation, ...]]:
        """Every hypothesis that this cycle can refute, and what it says of standstill."""
        found = [
            arithmetic_violation(cycle),
            age_violation(cycle, self.timing, stamp_s=state.stamp_s),
            self._late(state, cycle),
        ]
        if not cycle.stamp_s > state.stamp_s:
            # What is known is newer: this says nothing of it, and must not replace it.
            return state, _named(found)
        measured = cycle.measured[self.level]
        least, most = measured.interval(SPEED)
        holding = state.phase is Phase.HOLDING
        if holding and cycle.stamp_s >= state.stands_s:
            # From here on the plan that led here has done its work: whoever comes now is not its
            # concern.
            state = dataclasses.replace(state, plan=None)
            if least > 0.0:
                detail = f"at least {least:.2f} m/s are measured where the car must stand"
                found.append(Violation(Hypothesis.STANDSTILL, detail, True))
        elif holding and cycle.stamp_s >= state.braking_s:
            stands_s = min(state.stands_s, cycle.stamp_s + self.brake.stop_s(most))
            state = dataclasses.replace(state, stands_s=stands_s)
        if state.plan is not None:
            found.append(state_violation(state.plan, measured, cycle.stamp_s))
        found += self._people(state, cycle)
        before = state.scene or _scene(cycle)
        state = dataclasses.replace(state, scene=remembered(before, _scene(cycle)))
        return state, _named(found)

    def _people(self, state: FailSafeState, cycle: Cycle) -> tuple[Violation, ...]:
        """Of the guards of the plan in force; at standstill, of those seen last."""
        now = _scene(cycle)
        before = state.scene if state.plan is None else state.plan.scene
        found = people_violations(
            before or now, now, required=self.required, unseen_speed_mps=self.unseen_speed_mps
        )
        if state.plan is not None:
            return found
        # Whoever joins while the car stands is in the guards from now on, and in none before.
        return tuple(v for v in found if v.hypothesis is not Hypothesis.NOBODY_NEW)

    def _late(self, state: FailSafeState, cycle: Cycle) -> Violation | None:
        if state.phase is Phase.HOLDING or state.plan is None:
            return None
        over_s = cycle.finished_s - state.plan.switch_s[0]
        if over_s < 0.0:
            return None
        return Violation(Hypothesis.ON_TIME, f"the check ended {over_s:.3f} s too late", False)

    def _plan(self, state: FailSafeState, cycle: Cycle) -> tuple[Plan | None, str]:
        """The plan that this cycle's answer makes, or why it makes none."""
        stop, stamp_s = cycle.stop_guard, cycle.stamp_s
        names = cycle.measured[self.level].names
        needed = self.timing.switch_s
        stands_s = proved_standstill_s(
            stop.tube, names, switch_by_s=stop.switch_s[1], brake=self.brake
        )
        objection = self._phase_fault(state, stamp_s) or fault_in_answer(
            cycle, self.level, standstill_s=stands_s, needed=needed
        )
        granted = cycle.finished_s, cycle.finished_s + self.timing.send_gap_s
        holding = state.phase is Phase.HOLDING
        begun_s = None if holding else state.begun_s
        objection = objection or starts_fault(stop, begun_s, stamp_s=stamp_s, granted=granted)
        room_m = cycle.watched.radius_m - stop.farthest_m
        if not objection and not room_m >= self.unseen_speed_mps * stands_s:
            objection = f"only {room_m:.2f} m are watched beyond the tube"
        if objection:
            return None, objection
        switch_s = stamp_s + needed[0] + GRAIN_S, stamp_s + needed[1] - GRAIN_S
        start_s = granted if holding else None
        plan = Plan(stop.tube, names, _scene(cycle), switch_s, start_s, stamp_s + stands_s)
        return plan, ""

    @staticmethod
    def _phase_fault(state: FailSafeState, stamp_s: float) -> str:
        if state.phase is Phase.CLOSING:
            return "the plan in force is being carried out"
        if state.phase is Phase.HOLDING and not stamp_s >= state.stands_s:
            if state.plan is not None:
                return "BRAKE is carried out to standstill"
            return "the car is not known to stand"
        return ""

    def _answered(
        self,
        state: FailSafeState,
        answer: Answer,
        found: tuple[Violation, ...],
        objection: str,
    ) -> tuple[FailSafeState, Outcome]:
        if found:
            reason = "; ".join(map(str, found))
        elif objection:
            reason = f"no new plan: {objection}"
        else:
            reason = answer.reason
        tracks = not found and not objection
        verdict = answer.verdict
        if any(v.hypothesis in (Hypothesis.CLOCK, Hypothesis.ARITHMETIC) for v in found):
            verdict = Verdict.INVALID
        plan = state.offer or state.plan
        waits = state.phase is not Phase.HOLDING or tracks
        brake_from_s = plan.switch_s[0] if waits and plan is not None else brakes_s(state)
        action = Action.TRACK if tracks else Action.BRAKE
        return state, Outcome(_NAME, verdict, action, reason, found, None, brake_from_s)


def _named(found: Sequence[Violation | None]) -> tuple[Violation, ...]:
    return tuple(violation for violation in found if violation is not None)


def _scene(cycle: Cycle) -> Scene:
    return Scene(cycle.stamp_s, cycle.people, cycle.watched)
