"""Proof that the loop of one car is not stable: roots counted as the delay grows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Final

import casadi as ca
import numpy as np

from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.ranged_loop import (
    Car,
    crossings,
    exact_coefficients,
    stable_without_delay,
)
from workbench.sensitivity.inclusion import inclusion

_LARGEST_TURNS: Final = 10_000


def proved_unstable(loop: LateralLoop, car: Car) -> bool:
    """Whether the linearised loop of this car is proved not to be asymptotically stable.

    Without delay by Hurwitz' conditions, exact. With one, two roots cross the imaginary axis at
    each crossing delay (angle of M + 2 pi m) / w, in a direction that does not depend on m; see
    `crossings`. Starting from the exact count without delay, more than none on the right at the
    car's delay is the proof. False says nothing: the count may be 0, or the arithmetic too coarse.
    """
    if car.delay_s == 0.0:
        return not stable_without_delay(loop, car)
    count = 0 if stable_without_delay(loop, car) else _right_roots(exact_coefficients(loop, car))
    if count is None:
        return False
    for low, high, direction in crossings(loop, car):
        passed = _passed(loop, car, (low, high))
        if direction == 0 or passed is None:
            return False
        count += 2 * direction * passed
    return count > 0


def _right_roots(c: Sequence[Fraction]) -> int | None:
    """Roots with real part > 0 of s^4 + c3 s^3 + ..., or of the cubic where c0 = 0: sign changes
    of Routh's first column; None where that has a zero, and 0 may be on the axis."""
    terms = [Fraction(1), *c] if c[-1] else [Fraction(1), *c[:-1]]
    upper, lower = terms[0::2], terms[1::2]
    column = [upper[0]]
    while lower:
        if lower[0] == 0:
            return None
        column.append(lower[0])
        padded = [*lower, *[Fraction(0)] * (len(upper) - len(lower))]
        ratio = upper[0] / lower[0]
        upper, lower = lower, [a - ratio * b for a, b in zip(upper[1:], padded[1:], strict=True)]
    return sum(a * b < 0 for a, b in pairwise(column))


def _crossing_delay() -> ca.Function:
    """(w, c, 1) -> the angle of M, and a full turn, by w; c: (c3, c2, c1, c0)."""
    w, c, one = ca.SX.sym("w"), ca.SX.sym("c", 4), ca.SX.sym("one")
    real, imaginary = c[1] * w * w - c[3], w * (c[0] * w * w - c[2])
    turn = 8 * ca.atan(one) / w
    return inclusion(
        ca.Function("delay", [w, c, one], [ca.vertcat(ca.atan2(imaginary, real) / w, turn)])
    )


_DELAY: Final = _crossing_delay()


def _passed(loop: LateralLoop, car: Car, squares: tuple[Fraction, Fraction]) -> int | None:
    """How many crossing delays of one frequency lie in (0, delay); None where one may be at an
    end."""
    exact = exact_coefficients(loop, car)
    c = [np.array([_float(value, up=up) for value in exact]) for up in (False, True)]
    roots = [
        math.sqrt(_float(value, up=up)) for value, up in zip(squares, (False, True), strict=True)
    ]
    w = math.nextafter(roots[0], 0.0), math.nextafter(roots[1], math.inf)
    low, high, valid = (each.full().ravel() for each in _DELAY(*w, *c, 1.0, 1.0))
    if valid[0] != 1.0 or car.delay_s / low[1] > _LARGEST_TURNS:
        return None
    found = 0
    for turns in range(int(car.delay_s / low[1]) + 2):
        # Nothing but outward rounding: products and sums of two doubles each.
        first = math.nextafter(low[0] + math.nextafter(turns * low[1], 0.0), -math.inf)
        last = math.nextafter(high[0] + math.nextafter(turns * high[1], math.inf), math.inf)
        if last < 0.0 or first > car.delay_s:
            continue
        if first <= 0.0 or last >= car.delay_s:
            return None
        found += 1
    return found


def _float(value: Fraction, *, up: bool) -> float:
    """The nearest double, moved outward where it is not exact."""
    near = float(value)
    if Fraction(near) == value:
        return near
    return math.nextafter(near, math.inf if up else -math.inf)
