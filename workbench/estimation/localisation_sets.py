"""The vehicle's initial set: nested boxes around an estimate, for the monitor to decide on."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol, final

from scipy import stats

from workbench.errors import InputError
from workbench.estimation.localisation import Localisation, Localiser, Status
from workbench.estimation.localisation_states import VEHICLE_STATES
from workbench.runtime.localiser.sets import InitialSet, initial_set, localised

__all__ = [
    "LEVELS", "EllipsoidHull", "InitialSet", "Shape", "UnionBound", "initial_sets", "localised"
]  # fmt: skip
LEVELS: Final = (0.9, 0.99, 0.999)
"""Joint confidences of the three nested sets."""


class Shape(Protocol):
    """How a joint confidence becomes a box."""

    def deviations(self, level: float, count: int) -> float:
        """Half the box's width, in deviations of each of `count` states; grows with the level."""


@final
@dataclass(frozen=True, slots=True)
class EllipsoidHull:
    """Hull of the ellipsoid that holds the state with this probability: sqrt(chi2_n(level)).

    For Gaussian errors. The box holds more than the ellipsoid does.
    """

    def deviations(self, level: float, count: int) -> float:
        """3.04, 3.88, 4.53 for five states and `LEVELS`."""
        return math.sqrt(float(stats.chi2.ppf(level, count)))


@final
@dataclass(frozen=True, slots=True)
class UnionBound:
    """Each state's share (1 - level) / n of what may fail, two-sided.

    For errors each of which is Gaussian, however they depend on each other.
    """

    def deviations(self, level: float, count: int) -> float:
        """2.33, 3.09, 3.72 for five states and `LEVELS`."""
        return float(stats.norm.isf(0.5 * (1.0 - level) / count))


def initial_sets(
    localiser: Localiser, known: Localisation, *, now_s: float, levels: Sequence[float],
    shape: Shape, car: int = 0,
) -> tuple[InitialSet, ...] | Status:  # fmt: skip
    """The nested sets of one car, the smallest first, or why there are none.

    Half-widths `shape.deviations(level, 5)` times the deviation, rounded outward: each set holds
    the ones before it, whatever the estimate. They hold at the estimate's stamp; whoever wants them
    at another instant moves the estimate on first (`Localiser.moved_on`), or the set, as the
    monitor on the vehicle does by dead reckoning. Rigor: SAMPLED, the errors are Gaussian as far as
    NEES shows. Raises InputError unless the levels rise within (0, 1) and now_s is not before the
    stamp.
    """
    if not levels or not all(0.0 < level < 1.0 for level in levels) or any(
        a >= b for a, b in itertools.pairwise(levels)
    ):  # fmt: skip
        raise InputError(f"levels: expected rising confidences in (0, 1), got {levels!r}")
    status = localiser.status(known, car, now_s=now_s)
    if status is not Status.VALID:
        return status
    found = [
        initial_set(
            known.cars[car], now_s=now_s, level=level,
            deviations=shape.deviations(level, VEHICLE_STATES),
        )
        for level in levels
    ]  # fmt: skip
    sets = tuple(each for each in found if each is not None)
    return sets if len(sets) == len(found) else Status.LOST
