"""The vehicle's initial set: a box around an estimate, for the monitor to decide on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime.arc import Interval
from workbench.runtime.localiser.car import Car
from workbench.runtime.localiser.states import STATES, VEHICLE_STATES
from workbench.runtime.localiser.steps import Numbers
from workbench.runtime.protocols.localisation import Localised

_N: Final = len(STATES)
# A turn is not quite math.tau, and its remainder is rounded.
_TURNED: Final = 2.0**-46
_ANY_HEADING: Final = (-math.pi, math.pi)


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


def initial_set(car: Car, *, now_s: float, level: float, deviations: float) -> InitialSet | None:
    """The box of an aligned car at its stamp: so many deviations to either side, rounded outward.

    It grows with `deviations`, whatever the estimate. None where numbers are not finite or a
    variance is negative: then nothing is known. Raises InputError where now_s lies before the
    stamp.
    """
    if not now_s >= car.stamp_s:
        raise InputError(
            f"now_s: expected an instant of the estimate's clock, not before its stamp "
            f"{car.stamp_s!r}, got {now_s!r}"
        )
    sides = _sides(car.mean, car.covariance, deviations)
    if sides is None:
        return None
    return InitialSet(level, car.stamp_s, now_s - car.stamp_s, **sides)


def possible_set(car: Car, *, now_s: float, level: float, deviations: float) -> InitialSet | None:
    """The hull of the boxes of every heading of a placed car whose heading is not known yet."""
    if car.aligned:
        found = initial_set(car, now_s=now_s, level=level, deviations=deviations)
        hull = None if found is None else {name: getattr(found, name) for name in _SIDES}
    else:
        hull = _hull(_sides(*each, deviations) for each in _hypotheses(car))
    if hull is None:
        return None
    return InitialSet(level, car.stamp_s, now_s - car.stamp_s, **(hull | {"heading": _ANY_HEADING}))


def localised(found: InitialSet, *, number: int) -> Localised:
    """The set as the vehicle's bus carries it, without steering, which the car itself reports."""
    parts = {name: _middle(getattr(found, name)) for name in ("x", "y", "heading", "speed")}
    heading, radius = parts["heading"]
    return Localised(
        number=number, stamp_s=found.stamp_s, x_m=parts["x"][0], y_m=parts["y"][0],
        heading_rad=math.remainder(heading, math.tau), speed_mps=parts["speed"][0],
        x_radius_m=parts["x"][1], y_radius_m=parts["y"][1],
        heading_radius_rad=min(radius + _TURNED * abs(heading), math.pi),
        speed_radius_mps=parts["speed"][1],
    )  # fmt: skip


_SIDES: Final = STATES[:VEHICLE_STATES]


def _sides(mean: Numbers, covariance: Numbers, deviations: float) -> dict[str, Interval] | None:
    sides = {}
    for k, name in enumerate(_SIDES):
        variance = covariance[(_N + 1) * k]
        if not 0.0 <= variance < math.inf:
            return None
        radius = deviations * math.sqrt(variance)
        ends = mean[k] - radius, mean[k] + radius
        if not all(map(math.isfinite, ends)):
            return None
        sides[name] = math.nextafter(ends[0], -math.inf), math.nextafter(ends[1], math.inf)
    return sides


def _hypotheses(car: Car) -> Iterator[tuple[Numbers, Numbers]]:
    for k in range(len(car.logs)):
        yield (
            car.each_mean[_N * k : _N * (k + 1)],
            car.each_covariance[_N * _N * k : _N * _N * (k + 1)],
        )


def _hull(boxes: Iterator[dict[str, Interval] | None]) -> dict[str, Interval] | None:
    found = list(boxes)
    if not found or None in found:
        return None
    every = [box for box in found if box is not None]
    return {
        name: (min(box[name][0] for box in every), max(box[name][1] for box in every))
        for name in _SIDES
    }


def _middle(side: Interval) -> tuple[float, float]:
    """Middle and a radius that reaches both ends."""
    middle = 0.5 * (side[0] + side[1])
    return middle, math.nextafter(max(middle - side[0], side[1] - middle), math.inf)
