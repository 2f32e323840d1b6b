"""A bound of what one Runge-Kutta step leaves out, of the nominal state and of its sensitivity.

For the classical step Psi the error after a step h is h^5/5! (x^(5)(theta) - Psi^(5)(theta')),
componentwise, with theta, theta' in [0, h] (both sides agree to order 4; Taylor's theorem in h).
The derivative of both sides along a direction (e, v) bounds the error of the sensitivities applied
to that direction.
Source: E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential Equations I, section II.3.
"""

from __future__ import annotations

import casadi as ca

from workbench.reach.majorants import magnitude
from workbench.reach.step_functions import StepFunctions
from workbench.reach.step_symbols import rk4, shared
from workbench.sensitivity.inclusion import lift

_ORDER = 5
_FACTORIAL = 120.0


def truncation_function(steps: StepFunctions) -> ca.Function:
    """Function from ranges over a step (or over a region) to (bound (n), ok).

    box (n): encloses nominal and tube; radius (n): bound of |e| over the step; v_rad (n_v): radii
    of disturbances and kink errors; p, w, slope, offset as intervals; step: the longest step in s.
    """
    form, relaxed = steps.form, steps.relaxed
    x, p, w = form.ode.x, form.p, form.ode.w
    v = ca.vertcat(w, relaxed.error)
    n, n_v = x.numel(), v.numel()
    h, step = ca.SX.sym("h"), ca.SX.sym("step")
    direction = ca.vertcat(ca.SX.sym("e", n), ca.SX.sym("dv", n_v))
    exact = _exact_derivative(relaxed.field, x)
    field = ca.Function(
        "g", [x, p, w, relaxed.slope, relaxed.offset, relaxed.error], [relaxed.field]
    )
    method = rk4(field, x, h, [p, w, relaxed.slope, relaxed.offset, relaxed.error])
    for _ in range(_ORDER):
        method = ca.cse(ca.jtimes(method, h, ca.SX(1)))
    along = [ca.cse(ca.jtimes(f, ca.vertcat(x, v), direction)) for f in (exact, method)]

    symbols = {"box": x, "p": p, "w": w, "slope": relaxed.slope, "offset": relaxed.offset}
    lower = {name: ca.SX.sym(f"{name}_lower", s.numel()) for name, s in symbols.items()}
    upper = {name: ca.SX.sym(f"{name}_upper", s.numel()) for name, s in symbols.items()}
    radius, v_rad = ca.SX.sym("radius", n), ca.SX.sym("v_rad", n_v)
    spread, zero = ca.vertcat(radius, v_rad), ca.SX.zeros(relaxed.error.numel())
    lifted = lift(
        [exact, method, *along],
        [*symbols.values(), relaxed.error, direction, h],
        [*lower.values(), zero, -spread, ca.SX(0)],
        [*upper.values(), zero, spread, step],
    )
    bound = ca.SX.zeros(n)
    for low, high in zip(lifted.lower, lifted.upper, strict=True):
        bound = bound + magnitude(low, high)
    inputs = [*lower.values(), *upper.values(), radius, v_rad, step]
    names = [*(f"{s}_lower" for s in symbols), *(f"{s}_upper" for s in symbols)]
    return ca.Function(
        "truncation", inputs, shared([step**_ORDER / _FACTORIAL * bound, lifted.valid]),
        [*names, "radius", "v_rad", "h"], ["bound", "ok"],
    )  # fmt: skip


def _exact_derivative(field: ca.SX, x: ca.SX) -> ca.SX:
    """x^(5) = L_f^4 f, the fifth time derivative of the solution (n x 1)."""
    derivative = field
    for _ in range(_ORDER - 1):
        derivative = ca.cse(ca.jtimes(derivative, x, field))
    return derivative
