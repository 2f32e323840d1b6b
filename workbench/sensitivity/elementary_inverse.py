"""Enclosures of atan, asin, acos and atan2 as SX expressions, without a mathematical library."""

from __future__ import annotations

import math

import casadi as ca

from workbench.sensitivity.intervals import SymbolicInterval
from workbench.sensitivity.validity import verbatim

ARC_TANGENT_ERROR = 2.0**-49
ANGLE_ERROR = 2.0**-48
_HALF_PI_BELOW = float.fromhex("0x1.921fb54442d18p+0")
_HALF_PI_ABOVE = math.nextafter(_HALF_PI_BELOW, math.inf)


@verbatim()
def atan(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {atan(x)}, for every finite x.

    Error below 2^-49, added outward, so that each end is off by at most twice that. With u = 2^-53,
    w = min(|x|, 1/|x|) errs by u relatively. Halving the angle by h = w / (1 + sqrt(1 + w^2)) adds
    3.2 u each of two times: atan w = 4 atan g, |g| < 0.2, with g off by 7.4 u relatively. The
    series to g^25 leaves less than 2^-65, its Horner form and product add 2.1 u: 7.5 u in atan w.
    pi/2 - atan w for |x| > 1 adds 0.6 u and u, adding the margin one rounding: below 12 u in all.
    """
    x.watched()
    low = _arc_tangent(x.lower)
    high = low if x.is_point else _arc_tangent(x.upper)
    return SymbolicInterval(low - ARC_TANGENT_ERROR, high + ARC_TANGENT_ERROR, x.validity)


def _arc_tangent(x: ca.SX) -> ca.SX:
    size = ca.fabs(x)
    w = ca.fmin(size, 1.0 / size)
    h = w / (1.0 + ca.sqrt(1.0 + w * w))
    g = h / (1.0 + ca.sqrt(1.0 + h * h))
    t = -(g * g)
    value = ca.SX(1.0 / 25.0)
    for odd in range(23, 0, -2):
        value = value * t + 1.0 / odd
    angle = 4.0 * (g * value)
    angle = ca.if_else(size > 1.0, _HALF_PI_BELOW - angle, angle)
    return ca.if_else(x < 0.0, -angle, angle)


def asin(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {asin(x)} = {2 atan(x / (1 + sqrt(1 - x^2)))} by intervals at both ends.

    Validity 0 unless -1 <= x <= 1. The ends are off by less than 1e-14 for |x| <= 0.9, 1e-7 beyond.
    """
    with verbatim():
        x.validity.require(x.lower >= -1.0)
        x.validity.require(x.upper <= 1.0)
    low = _arc_sine(x.at(x.lower))
    high = low if x.is_point else _arc_sine(x.at(x.upper))
    return SymbolicInterval(low.lower, high.upper, x.validity)


def acos(x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {acos(x)} = {pi/2 - asin(x)}, as `asin`."""
    half_pi = SymbolicInterval(ca.SX(_HALF_PI_BELOW), ca.SX(_HALF_PI_ABOVE), x.validity)
    return half_pi - asin(x)


def _arc_sine(x: SymbolicInterval) -> SymbolicInterval:
    cosine = (1.0 - x.square()).maximum(0.0).sqrt()
    return atan(x / (cosine + 1.0)).scale(2.0)


@verbatim()
def atan2(y: SymbolicInterval, x: SymbolicInterval) -> SymbolicInterval:
    """Enclosure of {atan2(y, x)}; error below 2^-48, added outward: ends off by twice that.

    Validity 0 where the box touches the cut {x <= 0, y = 0}. Off it the angle rises with y where
    x > 0 and falls where x < 0, rises with x where y < 0 and falls where y > 0. So it is monotone
    on every axis-parallel segment in the box, and its extremes lie in corners, chosen by signs.
    Error (u = 2^-53): quotient of at most 1 in size u, arc tangent 7.5 u, the double of pi 1.1 u,
    sums up to 4 in size 2 u, adding the margin 2 u: below 14 u, 32 u taken.
    """
    y.watched()
    x.watched()
    beside = ca.logic_or(y.lower > 0.0, y.upper < 0.0)
    x.validity.require(ca.logic_or(x.lower > 0.0, beside))
    low_x = ca.if_else(y.lower >= 0.0, x.upper, x.lower)
    low_y = ca.if_else(low_x > 0.0, y.lower, y.upper)
    high_x = ca.if_else(y.upper <= 0.0, x.upper, x.lower)
    high_y = ca.if_else(high_x > 0.0, y.upper, y.lower)
    low = _angle(low_y, low_x)
    high = low if x.is_point and y.is_point else _angle(high_y, high_x)
    return SymbolicInterval(low - ANGLE_ERROR, high + ANGLE_ERROR, x.validity)


def _angle(y: ca.SX, x: ca.SX) -> ca.SX:
    """atan(y / x) turned by 0 or +-pi where |y| <= |x|, atan(-x / y) by +-pi/2 elsewhere."""
    flat = ca.fabs(y) <= ca.fabs(x)
    quotient = ca.if_else(flat, y, -x) / ca.if_else(flat, x, y)
    turn = ca.if_else(flat, ca.if_else(x < 0.0, 2.0 * _HALF_PI_BELOW, 0.0), _HALF_PI_BELOW)
    return ca.if_else(y < 0.0, -turn, turn) + _arc_tangent(quotient)
