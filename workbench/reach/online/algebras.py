"""Number systems for one evaluation of a graph: points, magnitudes, magnitudes with a derivative.

A graph evaluated in `Points` gives floats; in `Magnitudes` upper bounds of the absolute values of
everything it computes; in `Duals` also of derivatives in a direction. All build SX expressions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeVar, final

import casadi as ca

from workbench.errors import InputError
from workbench.reach.online.point_trig import tan
from workbench.sensitivity.validity import RELATIVE, verbatim

T = TypeVar("T")

# Below this the size of a sine is not followed: sines carry absolute rounding errors, and budgets
# are shares of sizes.
_LEAST_SINE = 2.0**-12
# Exponents of two: what is added to numbers from outside; below what a result gets the other added.
_FLOOR, _LEAST, _DEEP = -60, -480, -300
_LARGEST_ANGLE = 1.55


class Algebra(Protocol[T]):
    """Numbers of one kind; every result bounds (or computes) what the same real operation gives."""

    def constant(self, value: float) -> T:
        """The double `value`."""

    def add(self, left: T, right: T) -> T:
        """left + right."""

    def sub(self, left: T, right: T) -> T:
        """left - right."""

    def mul(self, left: T, right: T) -> T:
        """left * right."""

    def neg(self, value: T) -> T:
        """-value."""

    def times(self, value: T, factor: int) -> T:
        """value * factor, factor >= 1."""

    def over(self, value: T, divisor: int) -> T:
        """value / divisor, divisor >= 1."""

    def inverse(self, value: T) -> T:
        """1 / value."""

    def function(self, name: str, value: T) -> T:
        """sin, cos or tan."""


@final
class Points:
    """Floats as the generated code computes them.

    functions: what stands for sin, cos and tan: CasADi's own operations, or our polynomials.
    """

    def __init__(self, functions: Mapping[str, Callable[[ca.SX], ca.SX]]) -> None:
        self._functions = functions

    def constant(self, value: float) -> ca.SX:
        """The double `value`."""
        return ca.SX(value)

    def add(self, left: ca.SX, right: ca.SX) -> ca.SX:
        """left + right."""
        return left + right

    def sub(self, left: ca.SX, right: ca.SX) -> ca.SX:
        """left - right."""
        return left - right

    def mul(self, left: ca.SX, right: ca.SX) -> ca.SX:
        """left * right."""
        return left * right

    def neg(self, value: ca.SX) -> ca.SX:
        """-value."""
        return -value

    def times(self, value: ca.SX, factor: int) -> ca.SX:
        """value * factor."""
        return value if factor == 1 else factor * value

    def over(self, value: ca.SX, divisor: int) -> ca.SX:
        """value / divisor."""
        return value if divisor == 1 else value / divisor

    def inverse(self, value: ca.SX) -> ca.SX:
        """1 / value."""
        return 1 / value

    def function(self, name: str, value: ca.SX) -> ca.SX:
        """The function of that name."""
        return self._functions[name](value)


@final
class Magnitudes:
    """Non-negative bounds |value| <= m, for every value the operands' bounds allow.

    upward: round each operation up by a factor 1 + 2^-51. With r = fl(e) in the normal range,
    e <= r (1 + 2^-53) <= r (1 + 2^-51) (1 - 2^-53) <= fl(r (1 + 2^-51)). Nothing leaves that range
    downwards: numbers from outside get 2^-60 added (a rounded sum is never below its terms), and
    each result carries a power of two known to be below it. Without `upward` a result is too small
    by at most a relative 2^-53 for each operation on the longest path to it, which whoever uses it
    must cover.
    `conditions`: expressions that must be 1 for the bounds to hold.
    """

    def __init__(self, *, upward: bool) -> None:
        self.upward = upward
        self.conditions: list[ca.SX] = []
        # By node: the node itself, which must stay alive for its hash to be its own, the number
        # that stands for it, and an exponent of two below that.
        self._seen: dict[int, tuple[ca.SX, ca.SX, int]] = {}

    @verbatim()
    def _known(self, value: ca.SX) -> tuple[ca.SX, int]:
        """The number that stands for `value` and the exponent of a power of two below it."""
        if not self.upward:
            return value, 0
        if value.is_constant() and float(value) > 0.0:
            return value, math.frexp(float(value))[1] - 1
        key = value.element_hash()
        if key not in self._seen:
            self._seen[key] = (value, value + 2.0**_FLOOR, _FLOOR)
        _, known, least = self._seen[key]
        return known, least

    @verbatim()
    def _up(self, value: ca.SX, least: int) -> ca.SX:
        if not self.upward:
            return value
        result = value * (1 + 2 * RELATIVE)
        if least < _LEAST:
            result, least = result + 2.0**_DEEP, _DEEP
        self._seen[result.element_hash()] = (result, result, least)
        return result

    def constant(self, value: float) -> ca.SX:
        """The double `value`."""
        return ca.SX(abs(value))

    @verbatim()
    def add(self, left: ca.SX, right: ca.SX) -> ca.SX:
        """left + right."""
        (one, least), (other, further) = self._known(left), self._known(right)
        return self._up(one + other, max(least, further))

    def sub(self, left: ca.SX, right: ca.SX) -> ca.SX:
        """left - right."""
        return self.add(left, right)

    @verbatim()
    def mul(self, left: ca.SX, right: ca.SX) -> ca.SX:
        """left * right."""
        for one, other in ((left, right), (right, left)):
            if one.is_constant() and float(one) == 1.0:
                return other
        (first, least), (second, further) = self._known(left), self._known(right)
        return self._up(first * second, least + further)

    def neg(self, value: ca.SX) -> ca.SX:
        """-value."""
        return value

    @verbatim()
    def times(self, value: ca.SX, factor: int) -> ca.SX:
        """value * factor."""
        known, least = self._known(value)
        return value if factor == 1 else self._up(factor * known, least)

    @verbatim()
    def over(self, value: ca.SX, divisor: int) -> ca.SX:
        """value / divisor."""
        known, least = self._known(value)
        # A divisor takes off fewer bits than it counts.
        return value if divisor == 1 else self._up(known / divisor, least - divisor)

    @verbatim()
    def inverse(self, value: ca.SX) -> ca.SX:
        """1 / value, for a `value` that is a lower bound of the magnitude."""
        self.conditions.append(value > 0)
        if self.upward:
            self.conditions.append(value <= 2.0**-_FLOOR)
        return self._up(1 / value, _FLOOR - 1)

    def function(self, name: str, value: ca.SX) -> ca.SX:
        """The function of that name."""
        if name == "cos":
            return ca.SX(1.0)
        if name == "sin":
            return ca.fmin(value + _LEAST_SINE, 1.0)
        if name == "tan":
            self.conditions.append(value <= _LARGEST_ANGLE)
            # tan grows faster than its argument, and 2^-40 covers the rounding of our own tangent.
            return tan(ca.fmin(value, _LARGEST_ANGLE)) * (1 + 2.0**-40) + _LEAST_SINE
        raise InputError(f"the online kernel has no bound of {name}; use sin, cos or tan")


@final
@dataclass(frozen=True, slots=True)
class Dual:
    """A bound of a value, and of its derivative in a direction."""

    value: ca.SX
    along: ca.SX


@final
class Duals:
    """Magnitudes with the magnitude of a directional derivative beside each."""

    def __init__(self, numbers: Magnitudes) -> None:
        self._numbers = numbers

    def constant(self, value: float) -> Dual:
        """The double `value`."""
        return Dual(self._numbers.constant(value), ca.SX(0))

    def add(self, left: Dual, right: Dual) -> Dual:
        """left + right."""
        return Dual(self._sum(left.value, right.value), self._sum(left.along, right.along))

    def sub(self, left: Dual, right: Dual) -> Dual:
        """left - right."""
        return self.add(left, right)

    def mul(self, left: Dual, right: Dual) -> Dual:
        """left * right."""
        along = self._sum(
            self._product(left.value, right.along), self._product(left.along, right.value)
        )
        return Dual(self._product(left.value, right.value), along)

    def neg(self, value: Dual) -> Dual:
        """-value."""
        return value

    def times(self, value: Dual, factor: int) -> Dual:
        """value * factor."""
        numbers = self._numbers
        return Dual(numbers.times(value.value, factor), numbers.times(value.along, factor))

    def over(self, value: Dual, divisor: int) -> Dual:
        """value / divisor."""
        numbers = self._numbers
        return Dual(numbers.over(value.value, divisor), numbers.over(value.along, divisor))

    def inverse(self, value: Dual) -> Dual:
        """1 / value, for a `value` that is a lower bound of the magnitude."""
        inverse = self._numbers.inverse(value.value)
        return Dual(inverse, self._product(self._product(inverse, inverse), value.along))

    def function(self, name: str, value: Dual) -> Dual:
        """The function of that name; sines and cosines have slopes of at most 1."""
        found = self._numbers.function(name, value.value)
        if name != "tan":
            return Dual(found, value.along)
        slope = self._sum(ca.SX(1.0), self._product(found, found))
        return Dual(found, self._product(slope, value.along))

    def _sum(self, left: ca.SX, right: ca.SX) -> ca.SX:
        if left.is_zero():
            return right
        return left if right.is_zero() else self._numbers.add(left, right)

    def _product(self, left: ca.SX, right: ca.SX) -> ca.SX:
        if left.is_zero() or right.is_zero():
            return ca.SX(0)
        return self._numbers.mul(left, right)
