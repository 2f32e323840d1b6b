"""Margins that every car of the ranges keeps: proved bounds on phase, gain, delay and disk."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Final, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.ranged_loop import Car, Ranges, exact_coefficients
from workbench.models.gains.ranged_search import MOST_GAIN
from workbench.reach.robustness.inclusions import LoopInclusion, LoopRanges
from workbench.reach.robustness.minimise import Bounded, Bounds, lower_bound
from workbench.sensitivity.inclusion import inclusion
from workbench.sensitivity.interval_arrays import Interval

Array = NDArray[np.float64]

# Share of what the search found that a proof is content with.
_CONTENT: Final = 0.999
_PIECES: Final = 48
# 2 |M| / (1 + |M|^2) where |M| is 20 or more, or 1 / 20 or less, rounded up.
_FAR_NEAR: Final = 0.1


@final
@dataclass(frozen=True, slots=True)
class Proved:
    """A bound that every car of the ranges keeps, None where none was reached; boxes: its cost.

    Rigor ENCLOSED, about the linearised loop with its delay, at a speed that keeps.
    """

    value: float | None
    boxes: int


@final
class MarginProofs:
    """Bounds over the ranges by branch and bound over frequency, wheelbase, scale and delay.

    With M = -L(j w) the loop is on the brink of stability exactly where M = 1. Frequencies beyond
    [w0, w1], where |M| >= 20 or |M| <= 1 / 20 for every car (exact), cannot come near it. Demands
    that every car is stable without delay; see `everywhere_stable_without_delay`. most: boxes per
    bound.
    """

    def __init__(self, loop: LateralLoop, ranges: Ranges, *, most: int) -> None:
        self._ranges, self._most = ranges, most
        self._ranged = LoopInclusion(loop)
        edges = np.geomspace(*frequency_range(loop, ranges), _PIECES + 1)
        edges[[0, -1]] = frequency_range(loop, ranges)
        self._edges = edges

    def total_delay(self, limit_s: float) -> Proved:
        """The least delay, up to `limit_s`, with which a car of the ranges gets on the brink.

        Every car is stable with every delay below it, since the roots of the loop move with the
        delay without a jump and start on the left (the loop is of retarded type).
        """

        def bounds(lower: Array, upper: Array) -> tuple[Array, Array]:
            found = self._ranged(lower, upper)
            on_brink = _holds(found.real, 1.0) & _holds(found.imaginary, 0.0)
            on_brink &= _holds(found.square, 1.0)
            gain = found.changes[:, 0] + found.changes[:, 1]
            return np.where(on_brink, lower[:, 3], np.inf), gain

        bounded = self._bound(bounds, aim=_CONTENT * limit_s, delays=(0.0, limit_s))
        return Proved(min(bounded.value, limit_s), bounded.boxes)

    def phase(self, found_deg: float) -> Proved:
        """The least angle (deg) by which the loop of any car may turn, either way."""

        def bounds(lower: Array, upper: Array) -> tuple[Array, Array]:
            found = self._ranged(lower, upper)
            crossed = _holds(found.square, 1.0)
            gain = found.changes[:, 2] + found.changes[:, 3]
            return np.where(crossed, -found.near[1], np.inf), gain

        aim = -math.cos(math.radians(_CONTENT * found_deg))
        bounded = self._bound(bounds, aim=aim)
        return Proved(_converted(_ANGLE, -bounded.value), bounded.boxes)

    def disk(self, found: float) -> Proved:
        """The least disk margin (skew 0) of any car, as far as 1.8."""

        def bounds(lower: Array, upper: Array) -> tuple[Array, Array]:
            ranged = self._ranged(lower, upper)
            return -ranged.near[1], ranged.changes[:, 3]

        share = (_CONTENT * found / 2.0) ** 2
        bounded = self._bound(bounds, aim=-min((1.0 - share) / (1.0 + share), 1.0))
        return Proved(_converted(_DISK, max(-bounded.value, _FAR_NEAR)), bounded.boxes)

    def gain_high(self, found: float) -> Proved:
        """The factor, at most 20, up to which the gain of any car's loop may rise."""

        def bounds(lower: Array, upper: Array) -> tuple[Array, Array]:
            ranged = self._ranged(lower, upper)
            real, counts = ranged.real, _holds(ranged.imaginary, 0.0)
            counts &= (real[1] > 0.0) & (real[0] <= 1.0)
            factor = np.nextafter(1.0 / np.minimum(np.maximum(real[1], 1e-9), 1.0), 0.0)
            return np.where(counts, factor, np.inf), _crossing_gain(ranged)

        bounded = self._bound(bounds, aim=min(1.0 + _CONTENT * (found - 1.0), MOST_GAIN))
        return _beyond_one(bounded)

    def gain_low(self, found: float) -> Proved:
        """The factor, at least 1 / 20, down to which the gain of any car's loop may fall."""

        def bounds(lower: Array, upper: Array) -> tuple[Array, Array]:
            ranged = self._ranged(lower, upper)
            counts = _holds(ranged.imaginary, 0.0) & (ranged.real[1] >= 1.0)
            return np.where(counts, np.maximum(ranged.real[0], 1.0), np.inf), _crossing_gain(ranged)

        most = 1.0 / found if found > 0.0 else MOST_GAIN
        rise = _beyond_one(self._bound(bounds, aim=1.0 + _CONTENT * (most - 1.0)))
        fall = None if rise.value is None else float(np.nextafter(1.0 / rise.value, 1.0))
        return Proved(fall, rise.boxes)

    def _bound(
        self, bounds: Bounds, *, aim: float, delays: tuple[float, float] | None = None
    ) -> Bounded:
        wheelbase, scale, delay = self._ranges.ends
        ends = [wheelbase, scale, delay if delays is None else delays]
        lower = np.array([[w, *(low for low, _ in ends)] for w in self._edges[:-1]])
        upper = np.array([[w, *(high for _, high in ends)] for w in self._edges[1:]])
        return lower_bound(bounds, (lower, upper), aim=aim, most=self._most)


def frequency_range(loop: LateralLoop, ranges: Ranges) -> tuple[float, float]:
    """(w0, w1) in rad/s: |L| >= 20 below w0 and |L| <= 1 / 20 above w1, for every car; exact.

    |Im L| = |c1 / w^3 - c3 / w| and |L| <= c3 / w + c2 / w^2 + c1 / w^3 + c0 / w^4, all
    coefficients above 0. c2 and c0 are least and largest at corners; c1 is scale / L times an
    affine function of the scale, each at its ends.
    """
    corners = [exact_coefficients(loop, car) for car in ranges.corners()]
    c3, c2, c0 = (max(c[k] for c in corners) for k in (0, 1, 3))
    least, most = _c1_range(loop, ranges)
    low, high, limit = Fraction(1), Fraction(1), Fraction(MOST_GAIN)
    while least / low**3 - c3 / low < limit:
        low /= 2
    while c3 / high + c2 / high**2 + most / high**3 + c0 / high**4 > 1 / limit:
        high *= 2
    return float(low), float(high)


def _c1_range(loop: LateralLoop, ranges: Ranges) -> tuple[Fraction, Fraction]:
    (base_low, base_high), scales = ranges.wheelbase_m, ranges.speed_scale
    # c1 L / scale, at both scales.
    slopes = [
        exact_coefficients(loop, Car(base_low, scale, 0.0))[2]
        * Fraction(base_low)
        / Fraction(scale)
        for scale in scales
    ]
    low, high = Fraction(scales[0]), Fraction(scales[1])
    return low * min(slopes) / Fraction(base_high), high * max(slopes) / Fraction(base_low)


def _holds(interval: Interval, value: float) -> NDArray[np.bool_]:
    """Whether the value may be in it; also where the end is not a number."""
    return np.asarray(~((interval[0] > value) | (interval[1] < value)))


def _crossing_gain(found: LoopRanges) -> Array:
    return np.asarray(found.changes[:, 0] + found.changes[:, 1])


def _beyond_one(bounded: Bounded) -> Proved:
    value = min(bounded.value, MOST_GAIN)
    return Proved(value if value > 1.0 else None, bounded.boxes)


def _conversion(*, angle: bool) -> ca.Function:
    """From an upper bound on `near` to a margin, as an inclusion function."""
    near, one = ca.SX.sym("near"), ca.SX.sym("one")
    if angle:
        value = 90 * ca.atan2(ca.sqrt(one - near), ca.sqrt(one + near)) / ca.atan(one)
    else:
        value = 2 * ca.sqrt((one - near) / (one + near))
    return inclusion(ca.Function("margin", [near, one], [value]))


_ANGLE: Final = _conversion(angle=True)
_DISK: Final = _conversion(angle=False)


def _converted(conversion: ca.Function, near: float) -> float | None:
    """The least margin that goes with a `near` of at most this; None where it proves nothing."""
    if not -1.0 < near < 1.0:
        return None
    lower, _, valid = (float(each) for each in conversion(near, near, 1.0, 1.0))
    return lower if valid == 1.0 and lower > 0.0 else None
