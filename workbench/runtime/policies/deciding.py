"""Both policies side by side, every cycle, one of them or both deciding."""

from __future__ import annotations

import dataclasses
import enum
import math
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.decision import Action
from workbench.runtime.policies.cycle import (
    Alert,
    Answer,
    Cycle,
    Hypothesis,
    Outcome,
    Violation,
)
from workbench.runtime.policies.fail_safe import FailSafe
from workbench.runtime.policies.look_ahead import LookAhead, LookAheadState, alert_of, alert_where
from workbench.runtime.policies.phases import FailSafeState, Phase, Turn, braked


class Deciding(enum.Enum):
    """Whose TRACK counts. BOTH: TRACK only if both say so."""

    BOTH = "both"
    LOOK_AHEAD = "LookAhead"
    FAIL_SAFE = "FailSafe"

    @classmethod
    def named(cls, value: Deciding | str) -> Deciding:
        """The member that is given, or whose value is; raises InputError for anything else."""
        try:
            return cls(value)
        except ValueError:
            names = [member.value for member in cls]
            raise InputError(f"deciding: expected one of {names}, got {value!r}") from None


@final
@dataclass(frozen=True, slots=True)
class PoliciesState:
    """What both remember. tracks_until_s: where LookAhead alone decides, when its TRACK expires."""

    look_ahead: LookAheadState
    fail_safe: FailSafeState
    tracks_until_s: float


@final
@dataclass(frozen=True, slots=True)
class PoliciesOutcome:
    """The action, who decided it, and what each said, to be logged. brake_from_s: when BRAKE is
    sent, if no cycle says otherwise before; alert: see `LookAhead`, but for the action taken."""

    action: Action
    brake_from_s: float
    deciding: Deciding
    look_ahead: Outcome
    fail_safe: Outcome
    alert: Alert | None

    @property
    def heard(self) -> tuple[Outcome, ...]:
        """What the deciding policies said."""
        said = {
            Deciding.LOOK_AHEAD: (self.look_ahead,),
            Deciding.FAIL_SAFE: (self.fail_safe,),
            Deciding.BOTH: (self.look_ahead, self.fail_safe),
        }
        return said[self.deciding]

    @property
    def violations(self) -> tuple[Violation, ...]:
        """Every hypothesis that failed, as FailSafe names it if it does, in the order found."""
        found = tuple(dict.fromkeys(self.fail_safe.violations))
        named = {violation.hypothesis for violation in found}
        ahead = dict.fromkeys(self.look_ahead.violations)
        return found + tuple(v for v in ahead if v.hypothesis not in named)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Policies:
    """Runs both policies on each cycle; deciding: whose TRACK counts.

    Where FailSafe decides, alone or with the other, `turn` sends what it says: LookAhead's BRAKE is
    an objection to a new plan, and the plan in force is carried out, because braking at any other
    time is not what was proved. Where LookAhead decides alone, its TRACK expires after period,
    latency and gap, and FailSafe is followed only in the log: its guarantee does not hold then. A
    car that does not do what FailSafe says has left its plan, and the next SAFE makes a new one.
    deciding may be given by its value; raises InputError for any other.
    """

    look_ahead: LookAhead
    fail_safe: FailSafe
    deciding: Deciding

    def __post_init__(self) -> None:
        object.__setattr__(self, "deciding", Deciding.named(self.deciding))

    def start(self, now_s: float) -> PoliciesState:
        """Before the first cycle: BRAKE."""
        return PoliciesState(self.look_ahead.start(now_s), self.fail_safe.start(now_s), -math.inf)

    def step(self, state: PoliciesState, cycle: Cycle) -> tuple[PoliciesState, PoliciesOutcome]:
        """Ask both about one cycle."""
        ahead_state, ahead = self.look_ahead.step(state.look_ahead, cycle)
        consent = self.deciding is not Deciding.BOTH or ahead.action is Action.TRACK
        safe_state, safe = self.fail_safe.step(state.fail_safe, cycle, consent=consent)
        state = PoliciesState(ahead_state, safe_state, state.tracks_until_s)
        if self.deciding is not Deciding.LOOK_AHEAD:
            from_s = cycle.finished_s if safe.brake_from_s is None else safe.brake_from_s
            alert = alert_where(cycle, safe.action)
            return state, PoliciesOutcome(safe.action, from_s, self.deciding, ahead, safe, alert)
        until_s = cycle.finished_s
        if ahead.action is Action.TRACK:
            until_s = cycle.stamp_s + self.fail_safe.timing.switch_s[1]
        state = dataclasses.replace(state, tracks_until_s=until_s)
        alert = ahead.alert
        return state, PoliciesOutcome(ahead.action, until_s, self.deciding, ahead, safe, alert)

    def missed(
        self, state: PoliciesState, answer: Answer, *, now_s: float
    ) -> tuple[PoliciesState, PoliciesOutcome]:
        """Tell both of a cycle of which nothing can be said; answer: INVALID, and why."""
        ahead_state, ahead = self.look_ahead.missed(state.look_ahead, answer, now_s=now_s)
        safe_state, safe = self.fail_safe.missed(state.fail_safe, answer, now_s=now_s)
        from_s = safe_state.clock_s
        state = PoliciesState(ahead_state, safe_state, min(state.tracks_until_s, from_s))
        if self.deciding is not Deciding.LOOK_AHEAD and safe.brake_from_s is not None:
            from_s = safe.brake_from_s
        alert = alert_of(answer)
        return state, PoliciesOutcome(Action.BRAKE, from_s, self.deciding, ahead, safe, alert)

    def turn(self, state: PoliciesState, now_s: float) -> tuple[PoliciesState, Turn]:
        """What to send at now_s; to be called on every turn of the sender."""
        before = state.fail_safe
        safe_state, turn = self.fail_safe.turn(before, now_s)
        state = dataclasses.replace(state, fail_safe=safe_state)
        if self.deciding is not Deciding.LOOK_AHEAD:
            return state, turn
        # A clock that runs backwards would prolong the permission.
        broken = turn.violation is not None and turn.violation.hypothesis is Hypothesis.CLOCK
        tracks = now_s < state.tracks_until_s and not broken
        action = Action.TRACK if tracks else Action.BRAKE
        if action is not turn.action:
            followed = self._followed(before, safe_state, action, now_s)
            state = dataclasses.replace(state, fail_safe=followed)
        return state, Turn(action, turn.violation)

    def held(self, state: PoliciesState, now_s: float) -> PoliciesState:
        """After BRAKE was sent at now_s whatever they said: no plan is in force, nothing is
        permitted."""
        safe = braked(state.fail_safe, sent_s=now_s)
        return PoliciesState(state.look_ahead, safe, -math.inf)

    def _followed(
        self, before: FailSafeState, state: FailSafeState, action: Action, now_s: float
    ) -> FailSafeState:
        """What FailSafe knows of a car that did not do what it said: no plan is in force.

        before, state: FailSafe's own, before and after the turn that the car did not follow.
        """
        if action is Action.BRAKE:
            held = self.fail_safe.start(now_s)
            return dataclasses.replace(
                held, braking_s=now_s, stamp_s=state.stamp_s, scene=state.scene
            )
        begun_s = min(before.begun_s, now_s)
        return dataclasses.replace(state, phase=Phase.TRACKING, plan=None, begun_s=begun_s)
