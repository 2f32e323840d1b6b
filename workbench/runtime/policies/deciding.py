"""Both policies side by side, every cycle, one of them or both deciding."""

from __future__ import annotations

import dataclasses
import enum
import math
from dataclasses import dataclass
from typing import final

from workbench.runtime.decision import Action
from workbench.runtime.policies.cycle import Alert, Cycle, Hypothesis, Outcome, Violation
from workbench.runtime.policies.fail_safe import FailSafe, FailSafeState, Phase, Turn
from workbench.runtime.policies.look_ahead import LookAhead, LookAheadState


class Deciding(enum.Enum):
    """Whose TRACK counts. BOTH: TRACK only if both say so."""

    BOTH = "both"
    LOOK_AHEAD = "LookAhead"
    FAIL_SAFE = "FailSafe"


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
    sent, if no cycle says otherwise before; alert: from LookAhead, whoever decides."""

    action: Action
    brake_from_s: float
    deciding: Deciding
    look_ahead: Outcome
    fail_safe: Outcome

    @property
    def alert(self) -> Alert | None:
        """To warn a person whom not even braking is proved to keep clear of."""
        return self.look_ahead.alert

    @property
    def violations(self) -> tuple[Violation, ...]:
        """Every hypothesis that failed, each once, in the order found."""
        return tuple(dict.fromkeys((*self.fail_safe.violations, *self.look_ahead.violations)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Policies:
    """Runs both policies on each cycle; deciding: whose TRACK counts.

    Where FailSafe decides, alone or with the other, `turn` sends what it says: LookAhead's BRAKE is
    an objection to a new plan, and the plan in force is carried out, because braking at any other
    time is not what was proved. Where LookAhead decides alone, its TRACK expires after period and
    latency, and FailSafe is followed only in the log: its guarantee does not hold then. A car that
    does not do what FailSafe says has left its plan, and the next SAFE makes a new one.
    """

    look_ahead: LookAhead
    fail_safe: FailSafe
    deciding: Deciding

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
            return state, PoliciesOutcome(safe.action, from_s, self.deciding, ahead, safe)
        until_s = cycle.finished_s
        if ahead.action is Action.TRACK:
            until_s = cycle.stamp_s + self.fail_safe.timing.switch_s[1]
        state = dataclasses.replace(state, tracks_until_s=until_s)
        return state, PoliciesOutcome(ahead.action, until_s, self.deciding, ahead, safe)

    def turn(self, state: PoliciesState, now_s: float) -> tuple[PoliciesState, Turn]:
        """What to send at now_s; to be called on every turn of the sender."""
        safe_state, turn = self.fail_safe.turn(state.fail_safe, now_s)
        state = dataclasses.replace(state, fail_safe=safe_state)
        if self.deciding is not Deciding.LOOK_AHEAD:
            return state, turn
        # A clock that runs backwards would prolong the permission.
        broken = turn.violation is not None and turn.violation.hypothesis is Hypothesis.CLOCK
        tracks = now_s < state.tracks_until_s and not broken
        action = Action.TRACK if tracks else Action.BRAKE
        if action is not turn.action:
            followed = self._followed(state.fail_safe, action, now_s)
            state = dataclasses.replace(state, fail_safe=followed)
        return state, Turn(action, turn.violation)

    def _followed(self, state: FailSafeState, action: Action, now_s: float) -> FailSafeState:
        """What FailSafe knows of a car that did not do what it said: no plan is in force."""
        if action is Action.BRAKE:
            held = self.fail_safe.start(now_s)
            return dataclasses.replace(held, stamp_s=state.stamp_s, scene=state.scene)
        if state.phase is Phase.TRACKING:
            return state
        begun_s = min(state.begun_s, now_s)
        return dataclasses.replace(state, phase=Phase.TRACKING, plan=None, begun_s=begun_s)
