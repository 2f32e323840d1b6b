"""Upward-rounded arithmetic for the few operations that evaluate a bound."""

from __future__ import annotations

import math
from collections.abc import Iterable
from decimal import Context, Decimal

# Decimal's exp is correctly rounded by its specification; no libm is trusted.
_DIGITS = Context(prec=25, Emin=-999_999, Emax=999_999)
_MANY_DIGITS = Context(prec=60, Emin=-999_999, Emax=999_999)


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


def sqrt_up(value: float) -> float:
    """Upper bound on the root of a value >= 0; exactly 0 for 0."""
    return up(math.sqrt(value)) if value else 0.0


def exp_integral_up(rate: float, t: float) -> float:
    """Upper bound on the integral of e^(rate s) over s in [0, t], t >= 0; inf beyond the doubles.

    It is t (e^z - 1) / z and increases with z = rate t, which is rounded up. 60 digits leave at
    least 40 after the cancellation; for |z| <= 1e-16 the quotient is at most e^z or 1. Rounding the
    last double up covers what digits are lost.

    >>> 1.0 <= exp_integral_up(0.0, 1.0) < 1.0 + 1e-15
    True
    """
    exponent = up(rate * t) if t else 0.0
    if exponent > 700.0:
        return math.inf
    if abs(exponent) <= 1e-16:
        return mul_up(t, exp_up(max(exponent, 0.0)))
    digits, z = _MANY_DIGITS, Decimal(exponent)
    grown = z.exp(digits) if exponent > -1000.0 else Decimal(0)
    return mul_up(t, up(float(digits.divide(digits.subtract(grown, Decimal(1)), z))))
