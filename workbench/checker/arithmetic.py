"""Outward-rounded intervals. Trusted: integers, fractions, binary64 + - * / rounded to nearest.

A series encloses its rounding; Lagrange's remainder is the innermost factor of its Horner form."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction


class UnprovedError(Exception):
    """The file is a certificate, and its proof does not show its claim."""


def require(holds: bool, sentence: str) -> None:
    """Refuse the proof with this sentence unless the condition holds."""
    if not holds:
        raise UnprovedError(sentence)


class Interval:
    """[low, high]; every operation returns an interval that holds all exact results."""

    __slots__ = ("high", "low")

    def __init__(self, low: float, high: float | None = None) -> None:
        self.low, self.high = float(low), float(low if high is None else high)

    def __bool__(self) -> bool:
        return self.low != 0.0 or self.high != 0.0

    def __add__(self, other: Interval) -> Interval:
        if not self or not other:
            return self if self else other
        return _outward(self.low + other.low, self.high + other.high)

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Interval) -> Interval:
        return self + -other

    def __mul__(self, other: Interval) -> Interval:
        a, b, c, d = self.low, self.high, other.low, other.high
        if not self or not other:
            return ZERO
        return _outward(a * c, a * d, b * c, b * d)

    def __truediv__(self, other: Interval) -> Interval:
        a, b, c, d = self.low, self.high, other.low, other.high
        require(d < 0.0 or c > 0.0, "a divisor may be 0")
        return _outward(a / c, a / d, b / c, b / d)

    def __pow__(self, exponent: int) -> Interval:
        a, b, least = self.low, self.high, -math.inf
        if exponent % 2 == 0:
            a, b, least = max(0.0, a, -b), self.size(), 0.0
        low = high = ONE
        for _ in range(exponent):
            low, high = low * Interval(a), high * Interval(b)
        return Interval(max(least, low.low), high.high)

    def size(self) -> float:
        """max |x|."""
        return max(-self.low, self.high)

    def hull(self, other: Interval) -> Interval:
        """The smallest interval that holds both."""
        return Interval(min(self.low, other.low), max(self.high, other.high))

    def inside(self, least: float = -math.inf, most: float = math.inf) -> Interval:
        """This interval, required to lie in [least, most] and to be known."""
        require(least <= self.low <= self.high <= most, "a value leaves the bounds it needs")
        return self

    def function(self, name: str) -> Interval:
        """{f(x)}; all but sin, cos and tan are increasing and need the end points only."""
        if name in ("sin", "cos", "tan"):
            return self.tan() if name == "tan" else self._wave(name == "sin")
        low, high = (getattr(Interval(end), name)() for end in (self.low, self.high))
        return Interval(low.low, high.high)

    def sqrt(self) -> Interval:
        """Of one number; the candidate bounds are squared exactly."""
        root = math.sqrt(self.inside(0.0, math.inf).low)
        low, high = math.nextafter(root, 0.0), math.nextafter(root, math.inf)
        require(Fraction(low) ** 2 <= Fraction(self.low) <= Fraction(high) ** 2, "a wrong root")
        return Interval(low, high)

    def exp(self) -> Interval:
        """x = k ln 2 + r, |r| < 0.36: e^r to degree 17, the rest r^18 / 18! e^s with |s| <= |r|."""
        k = round(self.inside(-700.0, 700.0).low / _LN2.low)
        r, value = (self - Interval(k) * _LN2).inside(-0.36, 0.36), Interval(0.69, 1.44)
        for i in range(18, 0, -1):
            value = ONE + r * value / Interval(i)
        return _outward(math.ldexp(value.low, k), math.ldexp(value.high, k))

    def log(self) -> Interval:
        """x = 2^k m, 0.7 <= m < 1.4: log m = 2 atanh((m - 1) / (m + 1))."""
        m, k = math.frexp(self.inside(5e-324, math.inf).low)
        m, k = (2.0 * m, k - 1) if m < 0.7 else (m, k)
        ratio = (Interval(m) - ONE) / (Interval(m) + ONE)
        return Interval(k) * _LN2 + Interval(2) * ratio._odd_series(ONE)

    def atan(self) -> Interval:
        """Above 1 through 1 / x; halved twice: atan r = 2 atan(r / (1 + sqrt(1 + r^2)))."""
        r = ONE / self if abs(self.low) > 1.0 else self
        for _ in range(2):
            r = r / (ONE + (ONE + r**2).function("sqrt"))
        angle = Interval(4) * r._odd_series(-ONE)
        right = _HALF_PI if self.low > 0.0 else -_HALF_PI
        return right - angle if abs(self.low) > 1.0 else angle

    def _odd_series(self, sign: Interval) -> Interval:
        """r sum_i (sign r^2)^i / (2 i + 1), |r| < 0.21; beyond i = 13 the sum lies in [0, 0.07]."""
        square, value = sign * self.inside(-0.21, 0.21) ** 2, Interval(0.0, 0.07)
        for i in range(13, -1, -1):
            value = ONE / Interval(2 * i + 1) + square * value
        return self * value

    def _wave(self, quarters: int) -> Interval:
        """cos(x - quarters pi / 2): the ends, and +-1 at the multiples of pi between them."""
        ends = Interval(self.low)._cosine(quarters).hull(Interval(self.high)._cosine(quarters))
        turns = self / _PI - Interval(quarters / 2)
        first = math.ceil(turns.low)
        for n in range(first, min(math.floor(turns.high), first + 1) + 1):
            ends = ends.hull(Interval(1.0 if n % 2 == 0 else -1.0))
        return Interval(max(ends.low, -1.0), min(ends.high, 1.0))

    def tan(self) -> Interval:
        """sin / cos at the ends, increasing between them; refused where a pole may lie inside."""
        halves = self / _PI + Interval(0.5)
        require(math.ceil(halves.low) > math.floor(halves.high), "a pole of tan")
        a, b = Interval(self.low), Interval(self.high)
        return Interval((a._cosine(1) / a._cosine(0)).low, (b._cosine(1) / b._cosine(0)).high)

    def _cosine(self, quarters: int) -> Interval:
        """cos(x - quarters pi / 2), x = q pi / 2 + r, |r| < 0.8: series to degree 16 or 17."""
        q = round(self.inside(-1e6, 1e6).low / _HALF_PI.low)
        r = (self - Interval(q) * _HALF_PI).inside(-0.8, 0.8)
        turn, value = (q - quarters) % 4, Interval(0.69, 1.0)
        for i in range(18 + turn % 2, 1, -2):
            value = ONE - r**2 * value / Interval(i * (i - 1))
        value = r * value if turn % 2 else value
        return -value if turn in (1, 2) else value


def _outward(*ends: float) -> Interval:
    """The next doubles outside results that were rounded to nearest."""
    low, high = math.nextafter(min(ends), -math.inf), math.nextafter(max(ends), math.inf)
    require(-math.inf < low <= high < math.inf, "a value has no finite bound")
    return Interval(low, high)


ZERO, ONE = Interval(0.0), Interval(1.0)
# The doubles nearest to pi and ln 2 lie below them.
_PI = Interval(math.pi, math.nextafter(math.pi, 4.0))
_HALF_PI = Interval(_PI.low / 2, _PI.high / 2)
_LN2 = Interval(float.fromhex("0x1.62e42fefa39efp-1"), float.fromhex("0x1.62e42fefa39f0p-1"))
Vector = Sequence[Interval]
Matrix = Sequence[Vector]


def dot(a: Iterable[Interval], b: Iterable[Interval]) -> Interval:
    """{sum of x_i y_i}."""
    return sum((x * y for x, y in zip(a, b, strict=True)), ZERO)


def apply(a: Matrix, v: Vector) -> list[Interval]:
    """{A v}."""
    return [dot(row, v) for row in a]


def product(a: Matrix, b: Matrix) -> list[list[Interval]]:
    """{A B}."""
    return [[dot(row, column) for column in zip(*b, strict=True)] for row in a]


def positive(matrix: Matrix) -> bool:
    """Whether elimination shows every symmetric matrix in here to be positive definite."""
    rows = [list(row) for row in matrix]
    for k, pivot in enumerate(rows):
        if pivot[k].low <= 0.0:
            return False
        for row in rows[k + 1 :]:
            factor = row[k] / pivot[k]
            row[:] = [x - factor * y for x, y in zip(row, pivot, strict=True)]
    return True


def grown(matrix: Matrix, drift: Vector, start: Vector, t: Interval) -> list[Interval]:
    """Upper bounds of e^(M t) start + integral of e^(M s) drift over [0, t], M Metzler.

    M is bordered by drift and shifted to N = M + s I >= 0: e^(-s t) e^(N t) does not cancel; once
    k > 2 |N t| what is left of the series is at most the last term's largest entry."""
    shift = Interval(max(0.0, *(-row[i].high for i, row in enumerate(matrix))))
    rows = [[*row, w] for row, w in zip(matrix, drift, strict=True)] + [[ZERO] * (len(start) + 1)]
    for i, row in enumerate(rows):
        rows[i] = [Interval((x + shift).high if i == j else x.high) for j, x in enumerate(row)]
    norm = max((dot(row, [ONE] * len(row)) * t).inside(-1.0, 600.0).high for row in rows)
    total = term = [*(Interval(v.high) for v in start), ONE]
    for k in range(1, 2 * int(norm) + 23):
        term = [dot(row, term) * t / Interval(k) for row in rows]
        total = [x + y for x, y in zip(total, term, strict=True)]
    rest, decay = Interval(max(x.high for x in term)), (-shift * t).exp()
    return [Interval((decay * (value + rest)).high) for value in total[:-1]]
