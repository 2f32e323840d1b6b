"""sin, cos and tan of one float as SX expressions, without a mathematical library.

The polynomial and its error are those of `sensitivity.elementary_trig`; here one value comes out
and the error is left to whoever keeps the budget.
"""

from __future__ import annotations

import casadi as ca

from workbench.sensitivity.elementary_trig import sine_polynomial

_PI_HIGH, _PI_LOW = float.fromhex("0x1.921fb54442000p+1"), float.fromhex("0x1.a308d313198a3p-40")
_HALF_PI = float.fromhex("0x1.921fb54442d18p+0")
_PER_PI = float.fromhex("0x1.45f306dc9c883p-2")

SINE_ERROR = 2.0**-48
"""|sin(x) - exact| and |cos(x) - exact| for |x| <= 1e4 (proved bound 6 2^-52, rounded up)."""
TANGENT_ERROR = 2.0**-48
"""|tan(x) - exact| <= TANGENT_ERROR (1 + |tan x|) / |cos x| for |x| <= 1e4."""


PRINCIPAL_RAD = 1.57
"""Largest argument for which no period needs to be taken off."""


def principal_sin(x: ca.SX) -> ca.SX:
    """sin x for |x| <= PRINCIPAL_RAD; error below SINE_ERROR."""
    return sine_polynomial(x)


def principal_cos(x: ca.SX) -> ca.SX:
    """cos x = sin(pi/2 - |x|) for |x| <= PRINCIPAL_RAD; error below SINE_ERROR."""
    return sine_polynomial(_HALF_PI - ca.fabs(x))


def principal_tan(x: ca.SX) -> ca.SX:
    """tan x for |x| <= PRINCIPAL_RAD; error as TANGENT_ERROR says."""
    return principal_sin(x) / principal_cos(x)


def _reduced(x: ca.SX, shift: float) -> tuple[ca.SX, ca.SX]:
    """r = x - pi (k + shift) in [-pi/2, pi/2] and the whole number k."""
    k = ca.floor(x * _PER_PI + (0.5 - shift))
    turns = k + shift if shift else k
    return (x - turns * _PI_HIGH) - turns * _PI_LOW, k


def _signed(value: ca.SX, k: ca.SX) -> ca.SX:
    """(-1)^k value, exactly: k - 2 floor(k / 2) is 0 or 1."""
    return value * (1.0 - 2.0 * (k - 2.0 * ca.floor(0.5 * k)))


def sin(x: ca.SX) -> ca.SX:
    """sin x; error below SINE_ERROR for |x| <= 1e4."""
    r, k = _reduced(x, 0.0)
    return _signed(sine_polynomial(r), k)


def cos(x: ca.SX) -> ca.SX:
    """cos x = (-1)^k sin(pi/2 - |r|) with r = x - pi k; error below SINE_ERROR for |x| <= 1e4."""
    r, k = _reduced(x, 0.0)
    return _signed(sine_polynomial(_HALF_PI - ca.fabs(r)), k)


def tan(x: ca.SX) -> ca.SX:
    """tan x = sin r / cos r with r = x - pi k; error as TANGENT_ERROR says."""
    r, _ = _reduced(x, 0.0)
    return sine_polynomial(r) / sine_polynomial(_HALF_PI - ca.fabs(r))
