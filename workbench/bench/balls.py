"""Real intervals [mid - rad, mid + rad] in fixed point of 160 binary places, rounded outward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import mul
from typing import final

PLACES = 160
ONE = 1 << PLACES
# Sines are summed with this many further places; angles beyond the limit are refused.
_GUARD = 64
_LARGEST_ANGLE = 16 << PLACES


class UndecidedError(Exception):
    """An operation has no enclosure here: a kink, a pole, or a number out of range."""


@final
@dataclass(frozen=True, slots=True)
class Ball:
    """{z : |z - mid| <= rad}, both in units of 2^-160; every operation contains the exact result.

    Rounding a midpoint moves it by less than one unit, which is added to the radius; what needs no
    rounding stays exact, so that a state that rests is the point it started from.
    """

    mid: int
    rad: int

    @classmethod
    def of(cls, value: float | Fraction) -> Ball:
        """The number itself, exactly where it has at most 160 binary places."""
        exact = Fraction(value) * ONE
        mid = exact.numerator // exact.denominator
        return cls(mid, 0 if exact == mid else 1)

    @property
    def lower(self) -> int:
        """Lower end, in units."""
        return self.mid - self.rad

    @property
    def upper(self) -> int:
        """Upper end, in units."""
        return self.mid + self.rad

    def __neg__(self) -> Ball:
        return Ball(-self.mid, self.rad)

    def __add__(self, other: Ball) -> Ball:
        return Ball(self.mid + other.mid, self.rad + other.rad)

    def __sub__(self, other: Ball) -> Ball:
        return Ball(self.mid - other.mid, self.rad + other.rad)

    def __mul__(self, other: Ball | int) -> Ball:
        if isinstance(other, int):
            return Ball(self.mid * other, self.rad * abs(other))
        spread = abs(self.mid) * other.rad + self.rad * (abs(other.mid) + other.rad)
        return _rounded(self.mid * other.mid, spread)

    def __truediv__(self, other: Ball | int) -> Ball:
        if isinstance(other, int):
            mid, rest = divmod(self.mid, other)
            return Ball(mid, -(-self.rad // abs(other)) + (rest != 0))
        least = abs(other.mid) - other.rad
        if least <= 0:
            raise UndecidedError("division by an interval with 0")
        mid = (self.mid << PLACES) // other.mid
        # |a/b - m| <= (|a - m b0| + |m| |b - b0|) / |b| with |a - m b0| <= rad(a) + one unit of b0.
        spread = (self.rad << PLACES) + abs(other.mid) + (abs(mid) + 1) * other.rad
        return Ball(mid, spread // least + 2)


def _rounded(mid: int, rad: int) -> Ball:
    """The ball whose midpoint and radius are given in units of 2^-320."""
    return Ball(mid >> PLACES, -(-rad >> PLACES) + ((mid & (ONE - 1)) != 0))


def hull(left: Ball, right: Ball) -> Ball:
    """A ball around both."""
    lower, upper = min(left.lower, right.lower), max(left.upper, right.upper)
    mid = (lower + upper) >> 1
    return Ball(mid, upper - mid)


@final
@dataclass(frozen=True, slots=True)
class BallAlgebra:
    """Balls for the Taylor recurrences.

    An undecided minimum is the hull of both branches. That holds for the value and for the rate of
    change (almost everywhere one of the branches'), not for higher coefficients: UndecidedError.
    """

    def number(self, value: float) -> Ball:
        """The constant."""
        return Ball.of(value)

    def sine_cosine(self, angle: Ball) -> tuple[Ball, Ball]:
        """Both have slope at most 1, so the radius carries over."""
        sine, cosine = _sine_cosine(angle.mid)
        return Ball(sine, angle.rad + 2), Ball(cosine, angle.rad + 2)

    def convolve(self, left: Sequence[Ball], right: Sequence[Ball]) -> Ball:
        """One rounding for the whole sum."""
        mids_left, mids_right = [b.mid for b in left], [b.mid for b in right]
        mids_right.reverse()
        rads_left, rads_right = [b.rad for b in left], [b.rad for b in right]
        rads_right.reverse()
        reach = map(sum, zip(map(abs, mids_right), rads_right, strict=True))
        spread = sum(map(mul, map(abs, mids_left), rads_right)) + sum(map(mul, rads_left, reach))
        return _rounded(sum(map(mul, mids_left, mids_right)), spread)

    def least(self, sides: tuple[Ball, Ball], branch: tuple[Ball, Ball], order: int) -> Ball:
        """The branch of the lower side, or the hull."""
        if sides[0].upper < sides[1].lower:
            return branch[0]
        if sides[1].upper < sides[0].lower:
            return branch[1]
        if order > 1:
            raise UndecidedError("a kink lies within the step")
        return hull(*branch)


def _sine_cosine(angle: int) -> tuple[int, int]:
    """Sine and cosine of a fixed-point angle, in error by less than two units.

    Each term of the two power series errs by less than 2 guard units plus the growth of the error
    before it, in all by less than e^16 times a few units, and e^16 < 2^24 of the 2^64 guard units.
    """
    if abs(angle) > _LARGEST_ANGLE:
        raise UndecidedError("an angle out of range")
    places = PLACES + _GUARD
    x = abs(angle) << _GUARD
    square = (x * x) >> places
    sums = [0, 0]
    for start, term in ((0, 1 << places), (1, x)):
        k, sign = start, 1
        while term:
            sums[start] += sign * term
            term = ((term * square) >> places) // ((k + 1) * (k + 2))
            k, sign = k + 2, -sign
    cosine, sine = sums[0] >> _GUARD, sums[1] >> _GUARD
    return (sine if angle >= 0 else -sine), cosine
