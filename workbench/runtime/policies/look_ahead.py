"""The paper's policy: TRACK while TRACK keeps clear of where people are expected to go."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import final

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.runtime.decision import Action
from workbench.runtime.policies.cycle import Alert, Answer, Cycle, Outcome, Violation
from workbench.runtime.policies.horizon import Timing
from workbench.runtime.policies.instants import age_violation, arithmetic_violation, clock_violation

_NAME = "LookAhead"


@final
@dataclass(frozen=True, slots=True)
class LookAheadState:
    """What `LookAhead` remembers: SAFE verdicts in a row, the latest instant and stamp."""

    safe_in_a_row: int
    clock_s: float
    stamp_s: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LookAhead:
    """TRACK iff TRACK over horizon_s (s) is SAFE against the intent tubes, BRAKE otherwise.

    release_steps: how many SAFE in a row end braking once it was decided (1: the first does; who
    never braked needs one). An answer that holds for less than horizon_s is UNPROVED; a clock, age
    or arithmetic that is out of order makes it INVALID. Nothing is said about whether braking, once
    chosen, still helps. So BRAKE to standstill is looked at too, and a person is alerted if it is
    not SAFE against the intent tubes, or, where the action is BRAKE, not against the guards.
    Source: decision module of the paper. Raises InputError for a horizon that is not > 0 and finite
    and for release_steps < 1.
    """

    horizon_s: float
    release_steps: int
    timing: Timing

    def __post_init__(self) -> None:
        # Written so that NaN is refused.
        if not (0.0 < self.horizon_s < math.inf and 1 <= self.release_steps < math.inf):
            raise InputError(
                "LookAhead: expected a finite horizon_s > 0 and release_steps >= 1, got "
                f"{self.horizon_s!r} and {self.release_steps!r}"
            )

    def start(self, now_s: float) -> LookAheadState:
        """Nothing was decided yet."""
        return LookAheadState(self.release_steps, now_s, -math.inf)

    def step(self, state: LookAheadState, cycle: Cycle) -> tuple[LookAheadState, Outcome]:
        """The action for this cycle, from the state that the last one returned."""
        found = self._violations(state, cycle)
        answer = cycle.track_intent
        if found:
            verdict, reason = Verdict.INVALID, "; ".join(map(str, found))
        elif answer.verdict is Verdict.SAFE and not answer.holds_s >= self.horizon_s:
            verdict = Verdict.UNPROVED
            reason = f"unproved: {answer.holds_s:.2f} s of {self.horizon_s:.2f} s were compared"
        else:
            verdict, reason = answer.verdict, answer.reason
        safe = verdict is Verdict.SAFE
        run = min(state.safe_in_a_row + 1, self.release_steps) if safe else 0
        tracks = run == self.release_steps
        if safe and not tracks:
            reason += f"; braking until {self.release_steps} SAFE in a row, this is number {run}"
        if not any(violation.refutes_plan for violation in found):
            stamp_s = max(state.stamp_s, cycle.stamp_s)
            state = dataclasses.replace(state, clock_s=cycle.finished_s, stamp_s=stamp_s)
        state = dataclasses.replace(state, safe_in_a_row=run)
        action = Action.TRACK if tracks else Action.BRAKE
        alert = alert_where(cycle, action)
        return state, Outcome(_NAME, verdict, action, reason, found, alert, None)

    def missed(
        self, state: LookAheadState, answer: Answer, *, now_s: float
    ) -> tuple[LookAheadState, Outcome]:
        """BRAKE, and an alert to everybody: a cycle of which nothing can be said, for the reason
        that `answer` gives."""
        clock_s = now_s if state.clock_s <= now_s < math.inf else state.clock_s
        state = dataclasses.replace(state, safe_in_a_row=0, clock_s=clock_s)
        alert = alert_of(answer)
        return state, Outcome(_NAME, Verdict.INVALID, Action.BRAKE, answer.reason, (), alert, None)

    def _violations(self, state: LookAheadState, cycle: Cycle) -> tuple[Violation, ...]:
        found = (
            clock_violation(cycle, clock_s=state.clock_s),
            age_violation(cycle, self.timing, stamp_s=state.stamp_s),
            arithmetic_violation(cycle),
        )
        return tuple(violation for violation in found if violation is not None)


def alert_where(cycle: Cycle, action: Action) -> Alert | None:
    """To whom braking is not proved to keep clear of; where nothing can be judged, to everybody."""
    if cycle.brake_intent.verdict is not Verdict.SAFE:
        return alert_of(cycle.brake_intent)
    if action is Action.BRAKE and cycle.brake_guard.verdict is not Verdict.SAFE:
        return alert_of(cycle.brake_guard)
    return None


def alert_of(answer: Answer) -> Alert:
    """An alert for the reason that an answer gives."""
    return Alert(answer.clearance_person, f"braking is not proved to keep clear: {answer.reason}")
