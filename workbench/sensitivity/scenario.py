"""What independent samples prove about the next one: the scenario bound."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from scipy.special import bdtr, bdtri

from workbench.errors import InputError


def pairs_needed(epsilon: float, *, delta: float, parameters: int) -> int:
    """Smallest N with sum_{i < d} C(N, i) eps^i (1 - eps)^(N - i) <= delta, d = `parameters`.

    Source: Campi and Garatti, "The exact feasibility of randomized solutions of uncertain convex
    programs", SIAM J. Optim. 19(3), 2008.

    >>> pairs_needed(1e-3, delta=1e-6, parameters=2)
    16681
    """
    _check(epsilon, delta, parameters)
    low, high = parameters - 1, parameters
    while bdtr(parameters - 1, high, epsilon) > delta:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        if bdtr(parameters - 1, middle, epsilon) > delta:
            low = middle
        else:
            high = middle
    return high


def violation_bound(pairs: int, *, delta: float, parameters: int) -> float:
    """Smallest epsilon that `pairs` samples support with confidence 1 - delta; 1 if none."""
    _check(0.5, delta, parameters)
    if pairs < parameters:
        return 1.0
    epsilon = float(bdtri(parameters - 1, pairs, delta))
    while epsilon < 1.0 and bdtr(parameters - 1, pairs, epsilon) > delta:
        epsilon = math.nextafter(epsilon * (1.0 + 1e-12), math.inf)
    return min(epsilon, 1.0)


def _check(epsilon: float, delta: float, parameters: int) -> None:
    if not (0.0 < epsilon < 1.0 and 0.0 < delta < 1.0 and parameters >= 1):
        raise InputError(
            "expected 0 < epsilon < 1, 0 < delta < 1 and at least one parameter, "
            f"got epsilon={epsilon!r}, delta={delta!r}, parameters={parameters!r}"
        )


@final
@dataclass(frozen=True, slots=True)
class ScenarioStatement:
    """With confidence 1 - delta, a further pair from `distribution` violates with probability <=
    epsilon.

    pairs: independent samples used; parameters: all that were fitted to them.
    """

    epsilon: float
    delta: float
    pairs: int
    parameters: int
    distribution: str

    def __str__(self) -> str:
        return (
            f"with confidence 1 - {self.delta:g}, a further pair drawn as the {self.pairs} were "
            f"({self.distribution}) leaves the bound at some step instant with probability at most "
            f"{self.epsilon:.3g} ({self.parameters} fitted parameters); nothing is claimed between "
            "the instants nor for other distributions, such as vertices"
        )
