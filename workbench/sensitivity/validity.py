"""Outward rounding of single operations, and what must hold for intervals to be valid."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import final

import casadi as ca

RELATIVE = 2.0**-52
ABSOLUTE = 2.0**-1021
LARGEST = 1.7976931348623157e308


@contextmanager
def verbatim() -> Iterator[None]:
    """Build SX operations exactly as written (also usable as a decorator).

    CasADi otherwise rewrites (a - b) + b to a, x - x to 0 and 3 (x / 3) to x while an expression is
    built. These hold for reals, not for the rounded numbers that the error terms refer to.
    """
    before = ca.GlobalOptions.getSimplificationOnTheFly()
    ca.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(before)


def rounded_up(result: ca.SX, *, nonnegative: bool = False, roundings: int = 1) -> ca.SX:
    """Upper bound of the exact value of one correctly rounded operation with float `result`.

    r + (2^-52 |r| + 2^-1021). With ulp u of r, 2^-52 |r| >= u, so the float sum is at least the
    successor of r; below the normal range 2^-1021 exceeds every rounding or flushing error. For
    a product made with n `roundings`, n 2^-52 covers its error 1.01 n 2^-53 |r| and the sum's.
    """
    return result + _margin(result, nonnegative, roundings)


def rounded_down(result: ca.SX, *, nonnegative: bool = False, roundings: int = 1) -> ca.SX:
    """Lower bound, the mirror image of `rounded_up`."""
    return result - _margin(result, nonnegative, roundings)


def _margin(result: ca.SX, nonnegative: bool, roundings: int) -> ca.SX:
    return (roundings * RELATIVE) * (result if nonnegative else ca.fabs(result)) + ABSOLUTE


def same(left: ca.SX, right: ca.SX) -> bool:
    """Whether both are the same node."""
    return bool(left.element_hash() == right.element_hash())


@final
class Validity:
    """Collects what must hold for a set of intervals; shared by all intervals of one computation.

    Invariant: an infinity or NaN in an end point either stays in the pair (lower, upper) through an
    operation, or the operation has watched the pair before fmin, fmax, a comparison or a quotient
    could drop it. Widths are never negative, so their sum turns inf or NaN for good.

    outward: round every bound outward; without it ranges hold for exact arithmetic only
    (NUMERICAL), at about half the operations.
    """

    __slots__ = ("_condition", "_seen", "_total", "outward")

    def __init__(self, *, outward: bool = True) -> None:
        self.outward = outward
        self._total = ca.SX(0.0)
        self._condition: ca.SX | None = None
        self._seen: dict[tuple[int, int], tuple[ca.SX, ca.SX]] = {}

    def watch(self, lower: ca.SX, upper: ca.SX) -> None:
        """Demand that both end points are finite; costs two operations once per interval."""
        key = (lower.element_hash(), upper.element_hash())
        if key in self._seen or (_is_finite_constant(lower) and _is_finite_constant(upper)):
            return
        self._seen[key] = (lower, upper)
        with verbatim():
            self._add(ca.fabs(lower) if same(lower, upper) else upper - lower)

    def watch_input(self, lower: ca.SX, upper: ca.SX) -> None:
        """Demand finite end points with lower <= upper."""
        with verbatim():
            self._seen[lower.element_hash(), upper.element_hash()] = (lower, upper)
            self._add(ca.fabs(lower))
            if not same(lower, upper):
                self._add(ca.fabs(upper))
                self.require(lower <= upper)

    def require(self, condition: ca.SX) -> None:
        """Demand that `condition` is true; write it so that NaN makes it false."""
        with verbatim():
            self._condition = (
                condition if self._condition is None else ca.logic_and(self._condition, condition)
            )

    def result(self) -> ca.SX:
        """1 when everything demanded so far holds, else 0; never NaN."""
        with verbatim():
            finite = self._total <= LARGEST
            return finite if self._condition is None else ca.logic_and(self._condition, finite)

    def _add(self, term: ca.SX) -> None:
        self._total = term if self._total.is_zero() else self._total + term


def _is_finite_constant(value: ca.SX) -> bool:
    return bool(value.is_constant()) and math.isfinite(float(value))
