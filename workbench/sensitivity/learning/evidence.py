"""Three ways to state what pairs of runs say about further ones; choose one before the runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, final

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.learning.form import Fit, distance_blocks
from workbench.sensitivity.learning.pairs import PairSource
from workbench.sensitivity.learning.statement import Argument, Statement
from workbench.sensitivity.scenario import (
    hold_out_bound,
    judged_bound,
    judged_pairs_needed,
    pairs_needed,
    violation_bound,
)


class Evidence(Protocol):
    """A reason to believe in a fitted bound."""

    def state(self, fit: Fit, pairs: PairSource, count: int) -> Statement:
        """What the fit to pairs number 0 .. count - 1 is worth."""


def _check(delta: float) -> None:
    if not 0.0 < delta < 1.0:
        raise InputError(f"expected 0 < delta < 1, got {delta!r}")


@final
@dataclass(frozen=True, slots=True)
class APriori:
    """By the number of all fitted parameters: known before the first run.

    Needs independent pairs. The bound is the unique solution of a convex program, to its solver's
    accuracy, lifted by more than that. Source as in `scenario.pairs_needed`.
    """

    delta: float

    def __post_init__(self) -> None:
        _check(self.delta)

    def needed(self, epsilon: float, *, parameters: int) -> int:
        """Number of pairs that gives this epsilon."""
        return pairs_needed(epsilon, delta=self.delta, parameters=parameters)

    def state(self, fit: Fit, pairs: PairSource, count: int) -> Statement:
        """From the number of fitted parameters."""
        epsilon = violation_bound(count, delta=self.delta, parameters=fit.parameters)
        return _of_the_fit(Argument.A_PRIORI, epsilon, self.delta, (count, fit.parameters), pairs)


@final
@dataclass(frozen=True, slots=True)
class WaitAndJudge:
    """By the number of pairs that turned out to carry the bound.

    Needs independent pairs, as many as were decided on beforehand. Source as in
    `scenario.judged_bound`.
    """

    delta: float

    def __post_init__(self) -> None:
        _check(self.delta)

    def needed(self, epsilon: float, *, support: int) -> int:
        """Number of pairs that gives this epsilon if `support` of them carry the bound."""
        return judged_pairs_needed(epsilon, delta=self.delta, support=support)

    def state(self, fit: Fit, pairs: PairSource, count: int) -> Statement:
        """From the number of pairs that carry the fit."""
        support = len(fit.support)
        epsilon = judged_bound(count, delta=self.delta, support=support)
        return _of_the_fit(Argument.WAIT_AND_JUDGE, epsilon, self.delta, (count, support), pairs)


def _of_the_fit(
    argument: Argument, epsilon: float, delta: float, numbers: tuple[int, int], pairs: PairSource
) -> Statement:
    # One instant's violation is a violation at some instant.
    return Statement(argument, epsilon, epsilon, delta, *numbers, pairs.distribution)


@final
@dataclass(frozen=True, slots=True)
class HoldOut:
    """By violations counted on the next `pairs` pairs of the source, which the fit has not seen.

    Needs nothing of the fit. Exact binomial limits: of pairs that leave the bound at any instant,
    and of pairs that leave it at the instant where most do, each instant taken by itself. Source as
    in `scenario.hold_out_bound`.
    """

    delta: float
    pairs: int

    def __post_init__(self) -> None:
        _check(self.delta)
        if self.pairs < 1:
            raise InputError(f"expected at least 1 fresh pair, got {self.pairs}")

    def needed(self, epsilon: float) -> int:
        """Number of fresh pairs that gives this epsilon if none of them leaves the bound."""
        return pairs_needed(epsilon, delta=self.delta, parameters=1)

    def state(self, fit: Fit, pairs: PairSource, count: int) -> Statement:
        """From pairs number count .. count + self.pairs - 1."""
        anywhere, worst = 0, np.zeros(len(pairs.times), dtype=int)
        for _, distances in distance_blocks(pairs, self.pairs, start=count):
            bounds = fit.growth.bounds(distances[:, 0], pairs.times)
            outside = np.any(distances > bounds, axis=2)
            anywhere += int(np.any(outside, axis=1).sum())
            worst += np.sum(outside, axis=0)
        at_one = int(worst.max())
        return Statement(
            Argument.HOLD_OUT,
            hold_out_bound(anywhere, pairs=self.pairs, delta=self.delta),
            hold_out_bound(at_one, pairs=self.pairs, delta=self.delta),
            self.delta,
            self.pairs,
            anywhere,
            pairs.distribution,
        )
