"""Upward-rounded arithmetic for the few operations that evaluate a bound."""

from __future__ import annotations

import math
from collections.abc import Iterable
from decimal import Context, Decimal

# Decimal's exp is correctly rounded by its specification; no libm is trusted.
_DIGITS = Context(prec=25, Emin=-999_999, Emax=999_999)


def up(value: float) -> float:
    """The next double above a result that was rounded to nearest: not below the exact one."""
    return math.nextafter(value, math.inf)


def sum_up(terms: Iterable[float]) -> float:
    """Upper bound on the sum of terms."""
    total = 0.0
    for term in terms:
        total = total if term == 0.0 else up(total + term)
    return total


def mul_up(*factors: float) -> float:
    """Upper bound on a product of factors >= 0; exactly 0 where one of them is 0."""
    product = 1.0
    for factor in factors:
        product = 0.0 if 0.0 in (factor, product) else up(product * factor)
    return product


def exp_up(exponent: float) -> float:
    """Upper bound on e^exponent; inf where it leaves the doubles.

    >>> exp_up(0.0) >= 1.0
    True
    """
    if exponent > 709.0:
        return math.inf
    if exponent < -745.0:
        return up(0.0)
    return up(float(Decimal(exponent).exp(_DIGITS).next_plus(_DIGITS)))
