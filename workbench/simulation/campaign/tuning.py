"""Each baseline's parameter: the least that misses nothing on the training half, by bisection."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.simulation.campaign.baselines import Baseline

_STEPS: Final = 7
_ROUNDS: Final = 4

Misses = Callable[[float, Sequence[int]], list[int]]
"""Indices, of those given, with an avoidable contact at a parameter."""


@final
@dataclass(frozen=True, slots=True)
class Tuned:
    """A parameter and what it was tuned on.

    missed: avoidable contacts that are left on the training half; training: its size. Where missed
    is above 0, the largest parameter leaves no fewer.
    """

    parameter: float
    missed: int
    training: int


def tune(rule: Baseline, training: Sequence[int], hard: Sequence[int], misses: Misses) -> Tuned:
    """The least parameter, to 1/128 of its range, that misses no more than the largest one.

    hard: indices of the training half that are dangerous; bisection asks for these alone, all are
    asked for in the end, and what is missed then is added and the bisection repeated above.
    Supposes that a larger parameter misses less.
    """
    floor = misses(rule.most, training)
    asked = sorted({*hard, *floor})
    low, found, parameter = rule.least, floor, rule.most
    for _ in range(_ROUNDS):
        parameter = _bisected(rule, low, lambda p: len(misses(p, asked)) <= len(floor))  # noqa: B023
        found = misses(parameter, training)
        if len(found) <= len(floor):
            return Tuned(parameter, len(found), len(training))
        asked, low = sorted({*asked, *found}), parameter
    return Tuned(rule.most, len(floor), len(training))


def _bisected(rule: Baseline, low: float, suffices: Callable[[float], bool]) -> float:
    if suffices(low):
        return low
    high, step = rule.most, (rule.most - rule.least) / 2**_STEPS
    while high - low > step:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if suffices(middle) else (middle, high)
    return high
