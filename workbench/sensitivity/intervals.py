"""Interval arithmetic on SX expressions, rounded outward.

Every bound is itself an SX expression of + - * / sqrt fabs fmin fmax and comparisons: it evaluates
in CasADi and compiles to C. Premises at run time: IEEE-754 binary64, round to nearest, no fused or
reassociated operations, denormal operands not taken for zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, final

import casadi as ca

from workbench.errors import InputError
from workbench.sensitivity.validity import Validity, rounded_down, rounded_up, same, verbatim

_Choice = Callable[[ca.SX, ca.SX], ca.SX]
HIGHEST_POWER = 1000


@final
@dataclass(frozen=True, slots=True)
class SymbolicInterval:
    """The real interval [lower, upper] with SX end points (both 1 x 1), sharing one `validity`.

    Operators return intervals that contain the exact result for all exact real operands in the
    given ones, whenever `validity.result()` evaluates to 1; a float operand stands for exactly that
    double. `nonnegative` records that lower >= 0 is known when the graph is built. ENCLOSED under
    the premises of this module. Division by an interval that contains 0, the root of one that
    reaches below 0 and every overflow end in validity 0.

    >>> x = SymbolicInterval.between(ca.SX.sym("a"), ca.SX.sym("b"), Validity())
    >>> area = (x * x + 1.0) / 3.0
    >>> area.nonnegative
    True
    """

    lower: ca.SX
    upper: ca.SX
    validity: Validity = field(repr=False)
    nonnegative: bool = False

    @classmethod
    def between(cls, lower: Any, upper: Any, validity: Validity) -> SymbolicInterval:
        """Interval with given end points, which are checked at run time: finite, lower <= upper."""
        interval = cls(ca.SX(lower), ca.SX(upper), validity)
        validity.watch_input(interval.lower, interval.upper)
        return interval

    @classmethod
    def exactly(cls, value: float, validity: Validity) -> SymbolicInterval:
        """The one double `value`."""
        number = ca.SX(float(value))
        validity.watch(number, number)
        return cls(number, number, validity, nonnegative=float(value) >= 0.0)

    @property
    def is_point(self) -> bool:
        """Whether both end points are the same expression."""
        return same(self.lower, self.upper)

    @property
    def constant(self) -> float | None:
        """The value when this is one double known now."""
        return float(self.lower) if self.is_point and self.lower.is_constant() else None

    def watched(self) -> SymbolicInterval:
        """This interval, after demanding finite end points."""
        self.validity.watch(self.lower, self.upper)
        return self

    def __neg__(self) -> SymbolicInterval:
        with verbatim():
            if self.is_point:
                return self._point(-self.lower)
            return SymbolicInterval(-self.upper, -self.lower, self.validity)

    def __add__(self, other: SymbolicInterval | float) -> SymbolicInterval:
        right = self._coerced(other)
        if self.constant == 0.0:
            return right
        if right.constant == 0.0:
            return self
        with verbatim():
            return self._outward(
                [self.lower + right.lower],
                [self.upper + right.upper],
                nonnegative=self.nonnegative and right.nonnegative,
            )

    def __sub__(self, other: SymbolicInterval | float) -> SymbolicInterval:
        right = self._coerced(other)
        if self.constant == 0.0:
            return -right
        if right.constant == 0.0:
            return self
        with verbatim():
            return self._outward([self.lower - right.upper], [self.upper - right.lower])

    def __mul__(self, other: SymbolicInterval | float) -> SymbolicInterval:
        right = self._coerced(other)
        if right.constant is not None:
            return self.scale(right.constant)
        if self.constant is not None:
            return right.scale(self.constant)
        if same(self.lower, right.lower) and same(self.upper, right.upper):
            return self.square()
        self.watched()
        right.watched()
        with verbatim():
            low, high = _extreme_products(self, right)
            return self._outward(low, high, nonnegative=self.nonnegative and right.nonnegative)

    def __truediv__(self, other: SymbolicInterval | float) -> SymbolicInterval:
        right = self._coerced(other).watched()
        divisor = right.constant
        if divisor is not None and abs(divisor) in (0.5, 1.0):
            return self.scale(1.0 / divisor)
        self.watched()
        with verbatim():
            if divisor is None or divisor == 0.0:
                self.validity.require(right.lower * right.upper > 0.0)
            low, high = _extreme_quotients(self, right)
            return self._outward(low, high, nonnegative=self.nonnegative and right.nonnegative)

    def __radd__(self, other: float) -> SymbolicInterval:
        return self + other

    def __rsub__(self, other: float) -> SymbolicInterval:
        return self._coerced(other) - self

    def __rmul__(self, other: float) -> SymbolicInterval:
        return self * other

    def __rtruediv__(self, other: float) -> SymbolicInterval:
        return self._coerced(other) / self

    def scale(self, factor: float) -> SymbolicInterval:
        """Product with an exact double; not rounded when the product is exact."""
        if factor == 0.0:
            self.watched()
            return SymbolicInterval.exactly(0.0, self.validity)
        if factor < 0.0:
            return -self.scale(-factor)
        if factor == 1.0:
            return self
        with verbatim():
            low, high = factor * self.lower, factor * self.upper
            if math.frexp(factor)[0] == 0.5 and factor >= 1.0:
                return SymbolicInterval(low, high, self.validity, self.nonnegative)
            return self._outward([low], [high], nonnegative=self.nonnegative)

    def square(self) -> SymbolicInterval:
        """{x^2}, tight."""
        return self.power(2)

    def power(self, exponent: int) -> SymbolicInterval:
        """{x^exponent}, tight up to rounding; negative exponents by division.

        An end is a product of |exponent| - 1 roundings. Where an intermediate power underflows, the
        base is below 1, so that the absolute error only shrinks and 2^-1021 covers it.
        """
        if abs(exponent) > HIGHEST_POWER:
            raise InputError(f"expected an exponent of at most {HIGHEST_POWER}, got {exponent}")
        if exponent < 0:
            return 1.0 / self.power(-exponent)
        if exponent == 0:
            return SymbolicInterval.exactly(1.0, self.validity)
        base = self.watched() if exponent % 2 else self.absolute()
        with verbatim():
            low, high = (_repeated_product(end, exponent) for end in (base.lower, base.upper))
            count = max(exponent - 1, 1)
            return base._outward([low], [high], nonnegative=base.nonnegative, roundings=count)

    def sqrt(self) -> SymbolicInterval:
        """{sqrt(x)}; validity 0 when lower < 0."""
        with verbatim():
            self.validity.require(self.lower >= 0.0)
            return self._outward([ca.sqrt(self.lower)], [ca.sqrt(self.upper)], nonnegative=True)

    def absolute(self) -> SymbolicInterval:
        """{|x|}, exact."""
        if self.nonnegative:
            return self
        self.watched()
        with verbatim():
            if self.is_point:
                return self._point(ca.fabs(self.lower), nonnegative=True)
            below = -self.lower
            lower = ca.fmax(0.0, ca.fmax(self.lower, -self.upper))
            return SymbolicInterval(lower, ca.fmax(below, self.upper), self.validity, True)

    def minimum(self, other: SymbolicInterval | float) -> SymbolicInterval:
        """{min(x, y)}, exact."""
        right = self._coerced(other)
        return self._joined(right, ca.fmin, ca.fmin, self.nonnegative and right.nonnegative)

    def maximum(self, other: SymbolicInterval | float) -> SymbolicInterval:
        """{max(x, y)}, exact."""
        right = self._coerced(other)
        return self._joined(right, ca.fmax, ca.fmax, self.nonnegative or right.nonnegative)

    def hull(self, other: SymbolicInterval | float) -> SymbolicInterval:
        """The smallest interval that contains both, exact."""
        right = self._coerced(other)
        return self._joined(right, ca.fmin, ca.fmax, self.nonnegative and right.nonnegative)

    def magnitude(self) -> ca.SX:
        """max |x|, exact."""
        return self.absolute().upper

    def width(self) -> ca.SX:
        """upper - lower, rounded up."""
        with verbatim():
            return rounded_up(self.upper - self.lower, nonnegative=True)

    def _coerced(self, other: SymbolicInterval | float) -> SymbolicInterval:
        if isinstance(other, SymbolicInterval):
            if other.validity is not self.validity:
                raise InputError(
                    "expected operands with one common Validity, got two; make both intervals with "
                    "the same Validity object"
                )
            return other
        return SymbolicInterval.exactly(other, self.validity)

    @verbatim()
    def _joined(
        self, right: SymbolicInterval, low: _Choice, high: _Choice, nonnegative: bool
    ) -> SymbolicInterval:
        self.watched()
        right.watched()
        lower, upper = low(self.lower, right.lower), high(self.upper, right.upper)
        return SymbolicInterval(lower, upper, self.validity, nonnegative)

    def _point(self, value: ca.SX, *, nonnegative: bool = False) -> SymbolicInterval:
        return SymbolicInterval(value, value, self.validity, nonnegative)

    def at(self, end_point: ca.SX) -> SymbolicInterval:
        """The point interval of one of its own end points."""
        return self._point(end_point, nonnegative=self.nonnegative)

    def _outward(
        self,
        low: Sequence[ca.SX],
        high: Sequence[ca.SX],
        *,
        nonnegative: bool = False,
        roundings: int = 1,
    ) -> SymbolicInterval:
        lower, upper = low[0], high[0]
        for candidate in low[1:]:
            lower = ca.fmin(lower, candidate)
        for candidate in high[1:]:
            upper = ca.fmax(upper, candidate)
        if not self.validity.outward:
            return SymbolicInterval(lower, upper, self.validity, nonnegative)
        lower = rounded_down(lower, nonnegative=nonnegative, roundings=roundings)
        upper = rounded_up(upper, nonnegative=nonnegative, roundings=roundings)
        if nonnegative:
            lower = ca.fmax(0.0, lower)
        return SymbolicInterval(lower, upper, self.validity, nonnegative)


def _repeated_product(base: ca.SX, exponent: int) -> ca.SX:
    if exponent == 1:
        return base
    root = _repeated_product(base, exponent // 2)
    return root * root * base if exponent % 2 else root * root


def _extreme_products(
    left: SymbolicInterval, right: SymbolicInterval
) -> tuple[list[ca.SX], list[ca.SX]]:
    if left.nonnegative and right.nonnegative:
        return [left.lower * right.lower], [left.upper * right.upper]
    if right.nonnegative:
        left, right = right, left
    sizes = [left.lower] if left.is_point else [left.lower, left.upper]
    if left.nonnegative:
        return [size * right.lower for size in sizes], [size * right.upper for size in sizes]
    values = [right.lower] if right.is_point else [right.lower, right.upper]
    products = [size * value for size in sizes for value in values]
    return products, products


def _extreme_quotients(
    left: SymbolicInterval, right: SymbolicInterval
) -> tuple[list[ca.SX], list[ca.SX]]:
    if left.nonnegative and right.nonnegative:
        return [left.lower / right.upper], [left.upper / right.lower]
    divisors = [right.lower] if right.is_point else [right.lower, right.upper]
    if right.nonnegative:
        return [left.lower / d for d in divisors], [left.upper / d for d in divisors]
    values = [left.lower] if left.is_point else [left.lower, left.upper]
    quotients = [value / d for value in values for d in divisors]
    return quotients, quotients
