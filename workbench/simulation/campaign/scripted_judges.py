"""Judges that decide by rule instead of by proof, and one that counts what another decides."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import final

from workbench.claims import Rigor, Verdict
from workbench.runtime import Action, Decision, Observation
from workbench.runtime.policies import Ground, Outcome, Turn
from workbench.simulation.measures import Judge


def plain_decision(action: Action, reason: str) -> Decision:
    """A decision without any proof behind it: SAFE and UNPROVED say TRACK and BRAKE."""
    verdict = Verdict.SAFE if action is Action.TRACK else Verdict.UNPROVED
    said = Outcome("rule", verdict, action, reason, (), None, None)
    return Decision(
        verdict=verdict, action=action, reason=reason, brake_from_s=float("inf"), look_ahead=said,
        fail_safe=said, violations=(), alert=None, clearance_m=None, clearance_time_s=None,
        clearance_person=None, occupancy=(), tube_lower=(), tube_upper=(), stop_occupancy=(),
        level_verdicts={}, deciding_level="", assumptions=(), elapsed_s=0.0, rigor=Rigor.SAMPLED,
    )  # fmt: skip


@final
@dataclass(slots=True)
class Script:
    """What was sent at every turn and said at every decision of a drive."""

    turns: list[Action] = field(default_factory=list)
    decisions: list[Action] = field(default_factory=list)


@final
class Repeating:
    """Does what another drive did up to one of its turns, and from then on BRAKE.

    until: number of turns to repeat; TRACK where the other drive was shorter.
    """

    def __init__(self, script: Script, until: int) -> None:
        self._script, self._until = script, until
        self._turns = self._decisions = 0

    def turn(self, now_s: float) -> Turn:  # noqa: ARG002
        """As `Judge` says."""
        k, turns = self._turns, self._script.turns
        self._turns += 1
        if k >= self._until:
            return Turn(Action.BRAKE, None)
        return Turn(turns[k] if k < len(turns) else Action.TRACK, None)

    def step(self, observation: Observation) -> Decision:  # noqa: ARG002
        """As `Judge` says."""
        k, decisions = self._decisions, self._script.decisions
        self._decisions += 1
        if self._turns > self._until:
            return plain_decision(Action.BRAKE, "brakes for good")
        return plain_decision(decisions[k] if k < len(decisions) else Action.TRACK, "as before")


@final
class NeverBrakes:
    """TRACK, whatever happens."""

    def turn(self, now_s: float) -> Turn:  # noqa: ARG002
        """As `Judge` says."""
        return Turn(Action.TRACK, None)

    def step(self, observation: Observation) -> Decision:  # noqa: ARG002
        """As `Judge` says."""
        return plain_decision(Action.TRACK, "never brakes")


@final
class Counted:
    """A judge whose decisions are counted and whose turns are remembered.

    verdicts: of the deciding policies; out_of_region: decisions refused for leaving the region of
    the proof; violations: decisions that named each hypothesis; alerts: decisions that warned.
    """

    def __init__(self, judge: Judge) -> None:
        self._judge = judge
        self.verdicts: Counter[Verdict] = Counter()
        self.violations: Counter[str] = Counter()
        self.out_of_region = 0
        self.alerts = 0
        self.script = Script()

    def turn(self, now_s: float) -> Turn:
        """As `Judge` says."""
        turn = self._judge.turn(now_s)
        self.script.turns.append(turn.action)
        if turn.violation is not None:
            self.violations[turn.violation.hypothesis.name] += 1
        return turn

    def step(self, observation: Observation) -> Decision:
        """As `Judge` says."""
        decision = self._judge.step(observation)
        self.script.decisions.append(decision.action)
        self.verdicts[decision.verdict] += 1
        self.out_of_region += Ground.REGION in decision.grounds
        self.violations.update({each.hypothesis.name for each in decision.violations})
        self.alerts += decision.alert is not None
        return decision
