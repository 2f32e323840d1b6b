"""Ranges of the open loop and of its slopes over boxes of frequencies and cars, rounded outward."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.models.gains.lateral import LateralLoop
from workbench.sensitivity.inclusion import inclusion
from workbench.sensitivity.interval_arrays import Interval, add, multiply, negate, point

Array = NDArray[np.float64]

AXES: Final = 4
"""Frequency (rad/s), wheelbase (m), speed scale (none), delay (s): the axes of a box."""
QUANTITIES: Final = 4
_BATCH: Final = 512


@final
@dataclass(frozen=True, slots=True, eq=False)
class LoopRanges:
    """With M = -L(j w), L the open loop: ranges of four quantities over n boxes.

    real, imaginary: of M; square: |M|^2; near: 2 Re M / (1 + |M|^2), at most 1, and 1 exactly where
    M = 1, on the brink of stability. Each two (n,); slopes: how much each quantity changes along
    each axis of the box (n x 4 x 4), only to choose where to split.
    """

    real: Interval
    imaginary: Interval
    square: Interval
    near: Interval
    changes: Array


@final
class LoopInclusion:
    """Natural inclusion met with the mean-value form about the middle; rigor ENCLOSED."""

    def __init__(self, loop: LateralLoop) -> None:
        box, p = ca.SX.sym("box", AXES), ca.SX.sym("p", 6)
        values = _quantities(box, p)
        slopes = ca.reshape(ca.jacobian(values, box), QUANTITIES * AXES, 1)
        self._p = np.array([
            loop.wheelbase_m, loop.speed_mps, loop.look_ahead_m, loop.proportional, loop.integral,
            loop.derivative,
        ])  # fmt: skip
        self._values = inclusion(ca.Function("values", [box, p], [values])).map(_BATCH)
        self._slopes = inclusion(ca.Function("slopes", [box, p], [ca.densify(slopes)])).map(_BATCH)

    def __call__(self, lower: Array, upper: Array) -> LoopRanges:
        """Over boxes (n x 4 each); an end without a bound is infinite."""
        natural = self._ranged(self._values, lower, upper, QUANTITIES)
        middle = np.clip(0.5 * (lower + upper), lower, upper)
        centre = self._ranged(self._values, middle, middle, QUANTITIES)
        flat = self._ranged(self._slopes, lower, upper, QUANTITIES * AXES)
        # CasADi's columns come first: axis by axis, the quantities within.
        shape = (len(lower), AXES, QUANTITIES)
        slopes = flat[0].reshape(shape), flat[1].reshape(shape)
        away = add(point(lower), negate(point(middle))), add(point(upper), negate(point(middle)))
        span = np.minimum(away[0][0], 0.0)[:, :, None], np.maximum(away[1][1], 0.0)[:, :, None]
        with np.errstate(all="ignore"):
            moved = multiply(slopes, span)
            total = centre
            for axis in range(AXES):
                total = add(total, (moved[0][:, axis], moved[1][:, axis]))
            changes = np.maximum(np.abs(slopes[0]), np.abs(slopes[1])) * (upper - lower)[:, :, None]
        # fmax and fmin leave out what is not a number.
        low, high = np.fmax(natural[0], total[0]), np.fmin(natural[1], total[1])
        real, imaginary, square, near = ((low[:, k], high[:, k]) for k in range(QUANTITIES))
        return LoopRanges(real, imaginary, square, near, np.swapaxes(changes, 1, 2))

    def _ranged(self, function: ca.Function, lower: Array, upper: Array, size: int) -> Interval:
        """Ranges (n x size); infinite where the inclusion function is not valid."""
        low, high = np.full((len(lower), size), -np.inf), np.full((len(lower), size), np.inf)
        p = np.tile(self._p[:, None], (1, _BATCH))
        for first in range(0, len(lower), _BATCH):
            rows = slice(first, min(first + _BATCH, len(lower)))
            count = rows.stop - first
            ends = [np.empty((AXES, _BATCH)) for _ in range(2)]
            for end, given in zip(ends, (lower, upper), strict=True):
                end[:, :count], end[:, count:] = given[rows].T, given[rows][:1].T
            a, b, valid = (np.asarray(each.full()) for each in function(*ends, p, p))
            good = valid[0, :count] == 1.0
            low[rows][good], high[rows][good] = a.T[:count][good], b.T[:count][good]
        return low, high


def _quantities(box: ca.SX, p: ca.SX) -> ca.SX:
    """Real and imaginary part of M, |M|^2 and `near`; see `coefficients` for the model."""
    w, wheelbase, scale, delay = ca.vertsplit(box)
    known_base, known, ahead, kp, ki, kd = ca.vertsplit(p)
    # v / w and L w once each: a symbol that stands twice makes ranges wide.
    share = scale * known / (wheelbase * w)
    flat = share * ((kd * known + kp * ahead) / w - ki * scale * known / (w * w * w))
    steep = kd * ahead * known / (known_base * w) - share * (
        (kp * scale * known + ki * ahead) / (w * w)
    )
    cosine, sine = ca.cos(w * delay), ca.sin(w * delay)
    real = flat * cosine + steep * sine
    imaginary = steep * cosine - flat * sine
    square = flat * flat + steep * steep
    return ca.vertcat(real, imaginary, square, 2 * real / (1 + square))
