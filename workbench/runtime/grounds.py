"""What stands against TRACK, as values in place of sentences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from workbench.runtime.decision import Action
from workbench.runtime.judgement import Judgement
from workbench.runtime.policies import Deciding, Ground, Hypothesis, PoliciesOutcome

_OF: Final[Mapping[Hypothesis, Ground]] = {
    Hypothesis.CLOCK: Ground.TIME,
    Hypothesis.ARITHMETIC: Ground.ARITHMETIC,
    Hypothesis.AGE: Ground.TIME,
    Hypothesis.ON_TIME: Ground.TIME,
    Hypothesis.SENDER: Ground.TIME,
    Hypothesis.STATE: Ground.MOTION,
    Hypothesis.PEOPLE: Ground.PEOPLE,
    Hypothesis.NOBODY_NEW: Ground.PEOPLE,
    Hypothesis.NOBODY_LOST: Ground.PEOPLE,
    Hypothesis.STANDSTILL: Ground.MOTION,
}


def ground_of(hypothesis: Hypothesis) -> Ground:
    """What a hypothesis that failed is about."""
    return _OF[hypothesis]


def grounds(outcome: PoliciesOutcome, judgement: Judgement) -> tuple[Ground, ...]:
    """Of every deciding policy that says BRAKE: its violations' and its answer's, each once.

    () where a policy says BRAKE although its answer is SAFE: it counts SAFE in a row, or carries
    out a plan.
    """
    found: dict[Ground, None] = {}
    said = (
        (Deciding.LOOK_AHEAD, outcome.look_ahead, judgement.track_intent),
        (Deciding.FAIL_SAFE, outcome.fail_safe, judgement.stop_guard.answer),
    )
    for policy, each, answer in said:
        if outcome.deciding not in (policy, Deciding.BOTH) or each.action is Action.TRACK:
            continue
        found |= dict.fromkeys(ground_of(violation.hypothesis) for violation in each.violations)
        if answer.ground is not None:
            found[answer.ground] = None
    return tuple(found)
