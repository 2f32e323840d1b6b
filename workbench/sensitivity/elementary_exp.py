"""Enclosures of exp, log, sinh, cosh and tanh as SX expressions, without a mathematical library."""

from __future__ import annotations

import math
from collections.abc import Callable

import casadi as ca

from workbench.sensitivity.intervals import SymbolicInterval
from workbench.sensitivity.validity import verbatim

EXPONENT_LIMIT = 300.0
LOGARITHM_LEAST, LOGARITHM_LARGEST = 2.0**-500, 2.0**500
EXPONENTIAL_ERROR = 2.0**-50
LOGARITHM_ERROR = 2.0**-50
_LN2_HIGH = float.fromhex("0x1.62e42fefa3800p-1")
_LN2_LOW = float.fromhex("0x1.ef35793c76730p-45")
_PER_LN2 = float.fromhex("0x1.71547652b82fep+0")
_DIGITS = tuple(range(8, -1, -1))


@verbatim()
def exp(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {exp(x)}; relative error below 2^-50, added outward: each end off by twice.

    |x| <= 300, otherwise validity 0. exp x = 2^k exp r, r = x - k ln 2, |r| < 0.347, |k| < 512.
    With u = 2^-53: k times the 44 leading bits of ln 2 and its subtraction are exact, the rest errs
    by u/4; Taylor to degree 13 leaves 0.347^14 / 14! e^0.347 < 0.1 u; Horner: the last sum u (u/2
    below 1), its product u/4, the step before 0.35 u, all others 0.2 u, relative to at least 0.7:
    below 1.9 u. 2^k is exact. Sum below 2.3 u and one rounding of the margin's addition; 8 u taken.
    """
    x.validity.require(x.lower >= -EXPONENT_LIMIT)
    x.validity.require(x.upper <= EXPONENT_LIMIT)
    low = _exponential(x.lower)
    high = low if x.is_point else _exponential(x.upper)
    lower, upper = low - EXPONENTIAL_ERROR * low, high + EXPONENTIAL_ERROR * high
    return SymbolicInterval(lower, upper, x.validity, nonnegative=True)


def _exponential(x: ca.SX) -> ca.SX:
    k = ca.floor(x * _PER_LN2 + 0.5)
    r = (x - k * _LN2_HIGH) - k * _LN2_LOW
    value = ca.SX(1.0 / math.factorial(13))
    for degree in range(12, -1, -1):
        value = value * r + 1.0 / math.factorial(degree)
    rest, scale = ca.fabs(k), ca.SX(1.0)
    for digit in _DIGITS:
        present = rest >= 2.0**digit
        rest = rest - present * 2.0**digit
        scale = scale * ca.if_else(present, 2.0 ** (2**digit), 1.0)
    return ca.if_else(k < 0.0, value / scale, value * scale)


@verbatim()
def log(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {log(x)}; error below 2^-50 (1 + |log x|), added outward: each end off by twice.

    2^-500 <= x <= 2^500, otherwise validity 0. For x < 1: -log(1/x), which errs by u = 2^-53.
    y = 2^k m with m in [0.7, 1.42] is exact; log m = 2 atanh s, s = (m - 1) / (m + 1), |s| < 0.172,
    by its series to s^21 (rest below 2^-60). s errs by 2 u relatively, its polynomial and product
    by 2.2 u: 1.5 u absolutely. k times the leading bits of ln 2 is exact, the small part and its
    sum err by u/2, the last sum by u |log x|. In all u (3 + |log x|); 8 u (1 + |log x|) taken.
    """
    x.validity.require(x.lower >= LOGARITHM_LEAST)
    x.validity.require(x.upper <= LOGARITHM_LARGEST)
    low = _logarithm(x.lower)
    high = low if x.is_point else _logarithm(x.upper)
    return SymbolicInterval(
        low - LOGARITHM_ERROR * (1.0 + ca.fabs(low)),
        high + LOGARITHM_ERROR * (1.0 + ca.fabs(high)),
        x.validity,
    )


def _logarithm(x: ca.SX) -> ca.SX:
    small = x < 1.0
    m, k = ca.if_else(small, 1.0 / x, x), ca.SX(0.0)
    for digit in _DIGITS:
        large = m >= 2.0 ** (2**digit)
        m = m * ca.if_else(large, 2.0 ** -(2**digit), 1.0)
        k = k + large * 2.0**digit
    upper_half = m > math.sqrt(2.0)
    m, k = m * ca.if_else(upper_half, 0.5, 1.0), k + upper_half
    s = (m - 1.0) / (m + 1.0)
    t = s * s
    value = ca.SX(1.0 / 21.0)
    for odd in range(19, 0, -2):
        value = value * t + 1.0 / odd
    result = k * _LN2_HIGH + (2.0 * (s * value) + k * _LN2_LOW)
    return ca.if_else(small, -result, result)


def sinh(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {sinh(x)} = {(e^x - e^-x) / 2} by intervals at both ends; |x| <= 300."""

    def at(point: SymbolicInterval) -> SymbolicInterval:
        power = exp(point)
        return (power - 1.0 / power).scale(0.5)

    return _increasing(x, at)


def cosh(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {cosh(x)} = {(e^|x| + e^-|x|) / 2} by intervals at both ends; |x| <= 300."""

    def at(point: SymbolicInterval) -> SymbolicInterval:
        power = exp(point)
        return (power + 1.0 / power).scale(0.5)

    return _increasing(x.absolute(), at).maximum(1.0)


def tanh(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {tanh(x)} = {1 - 2 / (e^2x + 1)} by intervals at both ends; |x| <= 150."""

    def at(point: SymbolicInterval) -> SymbolicInterval:
        return 1.0 - 2.0 / (exp(point.scale(2.0)) + 1.0)

    return _increasing(x, at).maximum(-1.0).minimum(1.0)


def _increasing(
    x: SymbolicInterval, at: Callable[[SymbolicInterval], SymbolicInterval]
) -> SymbolicInterval:
    low = at(x.at(x.lower))
    high = low if x.is_point else at(x.at(x.upper))
    return SymbolicInterval(low.lower, high.upper, x.validity)
