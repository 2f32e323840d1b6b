"""Balls: a double and a bound of its distance to the exact value, for straight-line code.

A ball stands for the interval [value - r, value + r], r = count 2^-53 size. `value` is the double
that the plain code computes, by the same operations. `size` is a double too, and `count` and `gap`
are known when the code is made. Invariants, u = 2^-53:

    |exact| <= (1 + gap u) size,  |value - exact| <= count u size,  size >= 2^least >= 2^-900.

Every rule keeps them for all exact values in the operands' balls, so what comes out is an interval
evaluation rounded outward. Each rounds `size` and `value` once or a few times; terms of second
order are below 2^-31 of the first, because counts and gaps stay below 2^20, and `_sum` covers them.
With `size` above 2^-900, an underflow of `value` (at most 2^-1075) is below 2^-100 u size. A larger
`size` keeps all three. Premises at run time are those of `sensitivity.intervals`.
Source: midpoint-radius arithmetic (S. Rump, BIT 39, 1999) with running error bounds (N. Higham,
Accuracy and Stability of Numerical Algorithms, section 3.3).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import casadi as ca

from workbench.errors import InputError
from workbench.reach.online.model import POLYNOMIALS, PRINCIPAL
from workbench.reach.online.point_trig import PRINCIPAL_RAD
from workbench.sensitivity.elementary_trig import ARGUMENT_LIMIT, LEAST_COSINE

UNIT = 2.0**-53
_FLOOR_EXPONENT, _LEAST_EXPONENT = -60, -900
_LARGEST_COUNT = 2.0**20
# SINE_ERROR and TANGENT_ERROR of `point_trig` are 2^-48 = 32 u.
_TRIGONOMETRY = 32.0
_LARGEST_DENOMINATOR = 10**6


@final
@dataclass(frozen=True, slots=True)
class Ball:
    """A value, its size and what is known of both, as the module's text says."""

    value: ca.SX
    size: ca.SX
    count: float
    gap: float
    least: int

    @property
    def exact(self) -> bool:
        """Whether the double is the exact value."""
        return self.count == 0.0

    def radius(self) -> ca.SX:
        """Upper bound of |value - exact|; 0 where the value is exact."""
        if self.exact:
            return ca.SX(0.0)
        return (self.count * UNIT * (1 + 2.0**-30)) * self.size


def _sum(*counts: float) -> float:
    """Sum of counts of first order, with 2^-30 of it for everything of second order."""
    total = sum(counts) * (1 + 2.0**-30)
    if total > _LARGEST_COUNT:
        raise InputError(
            f"more than {_LARGEST_COUNT:g} roundings lead to one value of the online kernel; the "
            "model is too deep for its enclosed form"
        )
    return total


@final
class Balls:
    """The algebra of `Ball`; `conditions` must all be 1 for the invariants to hold.

    principal: sines and tangents are computed without taking periods off, as `point_trig` says.
    Values that overflow are not caught here: whoever uses results demands finite ones.
    """

    def __init__(self, *, principal: bool) -> None:
        self._functions = PRINCIPAL if principal else POLYNOMIALS
        self._largest_argument = PRINCIPAL_RAD if principal else ARGUMENT_LIMIT
        self.conditions: list[ca.SX] = []

    def known(self, value: ca.SX) -> Ball:
        """An exact double; a NaN stays one."""
        size = ca.fabs(value) + 2.0**_FLOOR_EXPONENT
        return Ball(value, size, 0.0, 0.0, _FLOOR_EXPONENT)

    def constant(self, value: float) -> Ball:
        """A literal. One that is no short binary fraction was folded when the graph was made, from
        small whole numbers: its exact value is the only fraction near it with a small denominator.
        """
        short = (Fraction(value) * 2**20).denominator == 1 and abs(value) < 2.0**20
        if not short:
            near = Fraction(value).limit_denominator(_LARGEST_DENOMINATOR)
            if abs(near - Fraction(value)) > Fraction(2**-50) * abs(near):
                raise InputError(
                    f"the literal {value!r} in the field's derivatives is no quotient of small "
                    "whole numbers; make it a parameter"
                )
        size = abs(value) or 2.0**_FLOOR_EXPONENT
        count = 0.0 if short else 16.0
        return Ball(ca.SX(value), ca.SX(size), count, count, math.frexp(size)[1] - 1)

    def add(self, left: Ball, right: Ball) -> Ball:
        """left + right."""
        return self._added(left, right, left.value + right.value)

    def sub(self, left: Ball, right: Ball) -> Ball:
        """left - right."""
        return self._added(left, right, left.value - right.value)

    def _added(self, left: Ball, right: Ball, value: ca.SX) -> Ball:
        gap, count = max(left.gap, right.gap), max(left.count, right.count)
        least = max(left.least, right.least)
        return Ball(value, left.size + right.size, _sum(count, 1), _sum(gap, 1), least)

    def mul(self, left: Ball, right: Ball) -> Ball:
        """left * right; times a power of two exactly, but for underflow."""
        value = left.value * right.value
        for one, other in ((left, right), (right, left)):
            if one.exact and _is_power_of_two(one.value):
                return self._scaled(other, value, abs(float(one.value)))
        size = self._product(left.size, right.size)
        count, gap = _sum(left.count, right.count, 1), _sum(left.gap, right.gap, 1)
        return self._raised(Ball(value, size, count, gap, left.least + right.least))

    @staticmethod
    def _product(left: ca.SX, right: ca.SX) -> ca.SX:
        for one, other in ((left, right), (right, left)):
            if one.is_constant() and float(one) == 1.0:
                return other
        return left * right

    def _scaled(self, ball: Ball, value: ca.SX, factor: float) -> Ball:
        """Times a power of two, which is exact but for underflow."""
        least = ball.least + math.frexp(factor)[1] - 1
        size = self._product(ball.size, ca.SX(factor))
        # An underflow of `value` costs a part of one rounding.
        return self._raised(Ball(value, size, _sum(ball.count, 0.25), ball.gap, least))

    @staticmethod
    def _raised(ball: Ball) -> Ball:
        """The same ball with a size that cannot come near underflow."""
        if ball.least >= _LEAST_EXPONENT:
            return ball
        size = ball.size + 2.0**_FLOOR_EXPONENT
        return Ball(ball.value, size, ball.count, ball.gap, _FLOOR_EXPONENT)

    def neg(self, value: Ball) -> Ball:
        """-value, exactly."""
        return Ball(-value.value, value.size, value.count, value.gap, value.least)

    def times(self, value: Ball, factor: int) -> Ball:
        """value * factor, factor >= 1."""
        return value if factor == 1 else self.mul(self.constant(float(factor)), value)

    def over(self, value: Ball, divisor: int) -> Ball:
        """value / divisor, divisor >= 1."""
        if divisor == 1:
            return value
        size = value.size / divisor
        least = value.least - math.frexp(divisor)[1]
        count, gap = _sum(value.count, 1), _sum(value.gap, 1)
        return self._raised(Ball(value.value / divisor, size, count, gap, least))

    def inverse(self, value: Ball) -> Ball:
        """1 / value, where that is far enough from 0 for its radius and below 2^100.

        Exact d: size = |fl(1/d)|. Else radius <= 2^-20 |d| is demanded and size =
        fl(1/d)^2 size(d) (1 + 2^-10), which covers 1/|exact| and the error u/|d| +
        count u size(d) / (|d| |exact|) in spite of its own three roundings.
        """
        inverse = 1 / value.value
        if value.value.is_constant() and value.exact:
            rounded = 0.0 if _is_power_of_two(value.value) else 1.0
            size = abs(float(inverse))
            return Ball(inverse, ca.SX(size), rounded, rounded, math.frexp(size)[1] - 1)
        self.conditions.append(value.size <= 2.0**100)
        if value.exact:
            self.conditions.append(ca.fabs(inverse) <= 2.0**100)
            return Ball(inverse, ca.fabs(inverse), 1.0, 2.0, -102)
        room = value.count * UNIT * 2.0**20 * (1 + 2.0**-30)
        self.conditions.append(room * value.size <= ca.fabs(value.value))
        size = ((inverse * inverse) * value.size) * (1 + 2.0**-10)
        least = value.least - 204
        return self._raised(Ball(inverse, size, _sum(value.count, 1), 0.0, least))

    def function(self, name: str, value: Ball) -> Ball:
        """fabs, exactly; sin and cos, of slope 1 at most; tan."""
        if name == "fabs":
            return Ball(ca.fabs(value.value), value.size, value.count, value.gap, value.least)
        if name not in ("sin", "cos", "tan"):
            raise InputError(f"the online kernel has no bound of {name}; use sin, cos or tan")
        self.conditions.append(ca.fabs(value.value) <= self._largest_argument)
        result = self._functions[name](value.value)
        if name == "tan":
            return self._tangent(value, result)
        if value.exact:
            return Ball(result, ca.SX(1.0), _TRIGONOMETRY, 0.0, 0)
        count = _sum(max(_TRIGONOMETRY, value.count))
        return Ball(result, 1.0 + value.size, count, 0.0, -1)

    def _tangent(self, argument: Ball, tangent: ca.SX) -> Ball:
        """With c the computed cosine, c > 2^-20: error 32 u (1 + |tan|) / |cos| of the double's
        tangent, and (1 + tan^2) |error of the argument|, 1.01 of it where that is below 2^-20.
        """
        cosine = ca.fabs(self._functions["cos"](argument.value))
        self.conditions.append(cosine > LEAST_COSINE)
        inverse = 1 / cosine
        size = (1.0 + ca.fabs(tangent)) * inverse
        if argument.exact:
            return Ball(tangent, size, _sum(_TRIGONOMETRY, 1), 80.0, -1)
        moved = (inverse * inverse) * argument.size
        room = argument.count * UNIT * 2.0**20 * (1 + 2.0**-30)
        self.conditions.append(room * moved <= 1.0)
        count = _sum(max(_TRIGONOMETRY, argument.count), 1)
        return Ball(tangent, size + 1.01 * moved, count, 80.0, -1)


def _is_power_of_two(value: ca.SX) -> bool:
    return bool(value.is_constant()) and abs(math.frexp(float(value))[0]) == 0.5


def inputs_of(algebra: Balls, symbols: list[ca.SX]) -> Mapping[tuple[int, int], Ball]:
    """Every nonzero of every input as an exact double."""
    return {
        (i, k): algebra.known(value)
        for i, block in enumerate(symbols)
        for k, value in enumerate(block.nonzeros())
    }
