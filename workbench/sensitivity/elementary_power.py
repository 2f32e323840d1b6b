"""Enclosures of powers as SX expressions, without a mathematical library."""

from __future__ import annotations

import casadi as ca

from workbench.sensitivity.elementary_exp import LOGARITHM_LEAST, exp, log
from workbench.sensitivity.intervals import HIGHEST_POWER, SymbolicInterval
from workbench.sensitivity.validity import verbatim

# Exponents k / 16 with |k| <= 1024 are powers of repeated roots.
ROOT_DENOMINATOR = 16
HIGHEST_ROOT_POWER = 1024
# Bases below the least b with b^c >= e^-278, inside the range of exp, have powers in [0, b^c].
_LEAST_EXPONENT = 278.0


def power(base: SymbolicInterval, exponent: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {base^exponent}, tight up to rounding where base and exponent are independent.

    Integer constant exponents up to 1000 in size: every base (no 0 for negative ones). Constants
    k / 16 up to 64 in size: base >= 0, > 0 for negative ones, by repeated roots. Other constants
    c > 0: base >= 0, e^(c log b) at both ends. Everything else: base > 0, e^(exponent log base).
    Outside these, or where `exp` and `log` end, validity is 0.
    """
    value = exponent.constant
    if value is not None and value.is_integer() and abs(value) <= HIGHEST_POWER:
        return base.power(int(value))
    if value is not None and is_root_power(value):
        return _root_power(base, value)
    if value is not None and value > 0.0:
        return _increasing_power(base, exponent, value)
    return exp(exponent * log(base))


def is_root_power(exponent: float) -> bool:
    """Whether the exponent is some k / 16 that repeated square roots can make.

    >>> is_root_power(2.5), is_root_power(0.1)
    (True, False)
    """
    count = exponent * ROOT_DENOMINATOR
    return count.is_integer() and abs(count) <= HIGHEST_ROOT_POWER


def _root_power(base: SymbolicInterval, exponent: float) -> SymbolicInterval:
    while not exponent.is_integer():
        base, exponent = base.sqrt(), 2.0 * exponent
    return base.power(int(exponent))


@verbatim()
def _increasing_power(
    base: SymbolicInterval, exponent: SymbolicInterval, value: float
) -> SymbolicInterval:
    least = max(LOGARITHM_LEAST, 2.0 ** -int(min(500.0, _LEAST_EXPONENT / (0.694 * value))))
    base.watched()
    base.validity.require(base.lower >= 0.0)
    low = exp(exponent * log(base.at(ca.fmax(base.lower, least))))
    high = low if base.is_point else exp(exponent * log(base.at(ca.fmax(base.upper, least))))
    lower = ca.if_else(base.lower >= least, low.lower, 0.0)
    return SymbolicInterval(lower, high.upper, base.validity, nonnegative=True)
