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
from workbench.estimation.localisation_states import STATES, VEHICLE_STATES
from workbench.runtime.arc import Interval
from workbench.runtime.protocols.localisation import Localised

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


@final
@dataclass(frozen=True, slots=True)
class InitialSet:
    """Intervals that jointly hold the middle of the rear axle (m), heading, steering (rad) and
    speed (m/s) at stamp_s with probability >= level; age_s: how long ago that was.

    The names are those of `Observation`.
    """

    level: float
    stamp_s: float
    age_s: float
    x: Interval
    y: Interval
    heading: Interval
    steering: Interval
    speed: Interval

    def contains(self, other: InitialSet) -> bool:
        """Does it hold every state that the other one holds?"""
        return all(
            getattr(self, name)[0] <= getattr(other, name)[0]
            and getattr(other, name)[1] <= getattr(self, name)[1]
            for name in STATES[:VEHICLE_STATES]
        )


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
    if not now_s >= known.stamp_s:
        raise InputError(
            f"now_s: expected an instant of the estimate's clock, not before its stamp "
            f"{known.stamp_s!r}, got {now_s!r}"
        )
    status = localiser.status(known, car, now_s=now_s)
    if status is not Status.VALID:
        return status
    mean = known.belief.mean[car]
    variances = known.belief.covariance[car].diagonal()
    deviations = [math.sqrt(variances[k]) for k in range(VEHICLE_STATES)]
    found = []
    for level in levels:
        wide = shape.deviations(level, VEHICLE_STATES)
        sides = {
            name: _around(float(mean[k]), wide * deviations[k])
            for k, name in enumerate(STATES[:VEHICLE_STATES])
        }
        found.append(InitialSet(level, known.stamp_s, now_s - known.stamp_s, **sides))
    return tuple(found)


def localised(found: InitialSet, *, number: int) -> Localised:
    """The set as the vehicle's bus carries it, without steering, which the car itself reports."""
    parts = {name: _middle(getattr(found, name)) for name in ("x", "y", "heading", "speed")}
    return Localised(
        number=number, stamp_s=found.stamp_s, x_m=parts["x"][0], y_m=parts["y"][0],
        heading_rad=parts["heading"][0], speed_mps=parts["speed"][0],
        x_radius_m=parts["x"][1], y_radius_m=parts["y"][1],
        heading_radius_rad=parts["heading"][1], speed_radius_mps=parts["speed"][1],
    )  # fmt: skip


def _around(middle: float, radius: float) -> Interval:
    return math.nextafter(middle - radius, -math.inf), math.nextafter(middle + radius, math.inf)


def _middle(side: Interval) -> tuple[float, float]:
    """Middle and a radius that reaches both ends."""
    middle = 0.5 * (side[0] + side[1])
    return middle, math.nextafter(max(middle - side[0], side[1] - middle), math.inf)
