"""Enclosures of sin, cos and tan as SX expressions, without a mathematical library.

One polynomial serves all three: P(r) = r (c1 + c3 r^2 + ... + c15 r^14) for sin r on |r| <= 1.5709.

Error of P (u = 2^-53). Truncation, with the coefficients as stored: below 2 u, proved by ball
arithmetic over a partition of the range in tests/test_elementary_functions.py. Rounding: with
t = fl(r^2) <= 2.4678 half an ulp of t is 2 u, which moves P(r)/r, of slope at most 1/6, by u/3. The
last Horner step adds half an ulp of a number below 1 (u/2) and of its product below 0.37 (u/4);
the step before has a value below 0.17 (u/8) and errors below u/28 from above, times t: 0.4 u. Sum
1.5 u, times r <= 1.5709, plus the last rounding u: 3.4 u. Together |P(r) - sin r| < 5.4 u.

Reduction. With S = S1 + S2 the period (S1 has 40 bits) and a multiple m of 1/4, |m| <= 2^11 (of 1,
|m| <= 2^12 for tan), m S1 is exact and |S - S1 - S2| m < 2^-80. x - m S1 and the second subtraction
each round a number below 4 (below 2) by at most 2 u (u).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.sensitivity.intervals import SymbolicInterval
from workbench.sensitivity.validity import verbatim

ARGUMENT_LIMIT = 1.0e4
SINE_COEFFICIENTS = tuple(
    float.fromhex(digits)
    for digits in (
        "0x1.ffffffffffff7p-1",
        "-0x1.55555555552adp-3",
        "0x1.1111111101fb7p-7",
        "-0x1.a01a01967c3ebp-13",
        "0x1.71de3714eea61p-19",
        "-0x1.ae6316e986ba8p-26",
        "0x1.60de6c7b4cd36p-33",
        "-0x1.9e32843805232p-41",
    )
)
SINE_ERROR = 6.0 * 2.0**-52
TANGENT_ERROR = 2.0**-49
LEAST_COSINE = 2.0**-20
_HALF_PI = float.fromhex("0x1.921fb54442d18p+0")
_PI_HIGH, _PI_LOW = float.fromhex("0x1.921fb54442000p+1"), float.fromhex("0x1.a308d313198a3p-40")
_PER_PI = float.fromhex("0x1.45f306dc9c883p-2")


def cos(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {cos(x)}; error below SINE_ERROR, 1.34e-15, added outward: ends off by twice.

    |x| <= 1e4, otherwise validity 0. With z = x - 2 pi k in [-pi, pi]: cos x = sin(pi/2 - |z|).
    Error: P contributes 5.4 u. Reduction: where |z| >= 2, 4 u |sin z| <= 3.7 u and pi/2 - |z| is
    exact; elsewhere 2 u and u. The double nearest pi/2 is off by 0.56 u. Sum below 9.7 u, plus one
    rounding of at most u when this bound is added: below 12 u = SINE_ERROR.
    Extrema: a minimum (maximum) lies between the ends when floor(x/2pi + 1/2) (floor(x/2pi))
    differs. These floats err by 2e-12 at most, so that a miscounted extremum lies within 2e-11 of
    an end, where cos differs from its extreme value by less than 1e-21, also covered.
    """
    return _cosine_of(x, delay=0.0)


def sin(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {sin(x)}: as `cos`, with z = x - 2 pi (k + 1/4), so that sin x = cos z."""
    return _cosine_of(x, delay=0.25)


@verbatim()
def _cosine_of(x: SymbolicInterval, *, delay: float) -> SymbolicInterval:
    _require_in_range(x)
    low = _folded(x.lower, delay)
    high = low if x.is_point else _folded(x.upper, delay)
    above = SINE_ERROR + 2.0 * (high.maxima - low.maxima)
    below = SINE_ERROR + 2.0 * (high.minima - low.minima)
    lower = ca.fmax(-1.0, ca.fmin(low.value, high.value) - below)
    upper = ca.fmin(1.0, ca.fmax(low.value, high.value) + above)
    return SymbolicInterval(lower, upper, x.validity)


@final
@dataclass(frozen=True, slots=True)
class _Folded:
    value: ca.SX
    minima: ca.SX
    maxima: ca.SX


def _folded(x: ca.SX, delay: float) -> _Folded:
    turns = x * (0.5 * _PER_PI)
    if delay:
        turns = turns - delay
    period = ca.floor(turns + 0.5)
    shift = period + delay if delay else period
    z = (x - shift * (2.0 * _PI_HIGH)) - shift * (2.0 * _PI_LOW)
    return _Folded(sine_polynomial(_HALF_PI - ca.fabs(z)), period, ca.floor(turns))


def sine_polynomial(r: ca.SX) -> ca.SX:
    """P(r), see the module's text."""
    t = r * r
    value = ca.SX(SINE_COEFFICIENTS[-1])
    for coefficient in reversed(SINE_COEFFICIENTS[:-1]):
        value = value * t + coefficient
    return r * value


@verbatim()
def tan(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {tan(x)}; error below 2^-49 (1 + |tan|) / cos, added outward: ends off by twice.

    |x| <= 1e4, no pole inside and cos > 2^-20 at both ends, otherwise validity 0. With
    r = x - pi k: t = s / c, s = P(r), c = P(pi/2 - |r|). s errs by 5.4 u and 2 u of reduction, c by
    1.6 u more: e = 9 u. Then |t - tan| <= e (1 + |t|) / (c - e), and fl(s * fl(1/c)) adds 3 u |t|;
    in sum at most 12.1 u (1 + |t|) / c, below the 16 u that are taken. The rest covers the few
    roundings of the margin and of its addition. Poles: floor(x/pi + 1/2) must agree at both ends; a
    pole that the rounding of this count hides lies within 2e-11 of an end, where cos > 2^-20 fails.
    """
    _require_in_range(x)
    low = _tangent(x.lower)
    high = low if x.is_point else _tangent(x.upper)
    for end in (low,) if x.is_point else (low, high):
        x.validity.require(end.cosine > LEAST_COSINE)
    if not x.is_point:
        x.validity.require(ca.eq(low.period, high.period))
    return SymbolicInterval(low.value - low.margin, high.value + high.margin, x.validity)


@final
@dataclass(frozen=True, slots=True)
class _Tangent:
    period: ca.SX
    cosine: ca.SX
    value: ca.SX
    margin: ca.SX


def _tangent(x: ca.SX) -> _Tangent:
    period = ca.floor(x * _PER_PI + 0.5)
    r = (x - period * _PI_HIGH) - period * _PI_LOW
    cosine = sine_polynomial(_HALF_PI - ca.fabs(r))
    inverse = 1.0 / cosine
    value = sine_polynomial(r) * inverse
    return _Tangent(period, cosine, value, (TANGENT_ERROR * inverse) * (1.0 + ca.fabs(value)))


def _require_in_range(x: SymbolicInterval) -> None:
    x.validity.require(x.lower >= -ARGUMENT_LIMIT)
    x.validity.require(x.upper <= ARGUMENT_LIMIT)
