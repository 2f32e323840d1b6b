"""Claim: interval Jacobians of fields with kinks hold every chord, f(b) - f(a) in J (b - a)."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from workbench.models import Ode, Ranged
from workbench.models.signals import Signal
from workbench.sensitivity.inclusion import inclusion
from workbench.sensitivity.jacobian import IntervalJacobian
from workbench.sensitivity.kinks import smooth_form

X = ca.SX.sym("x", 2)
U, V = ca.vertsplit(X)
P = ca.SX.sym("p")
CLIP = ca.fmin(ca.fmax(U, -P), P)

FIELDS: dict[str, ca.SX] = {
    "clip": CLIP,
    "coincident drivers": ca.fmin(U, V) + ca.fmax(U, V) - 2 * ca.fmin(U, V),
    "opposite drivers": ca.fmax(U, 0) - ca.fmax(-U, 0) + ca.fabs(U),
    "nested clips": ca.fmin(ca.fmax(3 * CLIP + V, -0.2), 0.2),
    "kink of a kink": ca.fabs(ca.fabs(U) - ca.fabs(V)),
    "kink that touches": ca.fmax(U**2, 0) + ca.fmin(V**3, 0),
    "product of kinks": ca.fabs(U) * ca.fmax(V, -U),
    "constant driver": ca.fmin(0 * U + 1, 1) * U,
    "same limits": ca.fmin(ca.fmax(U, P), P) + V,
    "crossed limits": ca.fmin(ca.fmax(U, P), -P) + V,
    "if_else, leaky": ca.if_else(U > 0, U, 0.1 * U),
    "if_else, saturation": ca.if_else(U > P, P, ca.if_else(U < -P, -P, U)) * V,
    "if_else, parabola": ca.if_else(U < V, U * V, V * V),
    "if_else, sine": ca.if_else(U < 0, ca.sin(U), U),
    "if_else, power": ca.if_else(U > 0, U**2.5, 0),
    "if_else, dead zone": ca.if_else(U > P, U - P, ca.if_else(U < -P, U + P, 0)) * V,
    "angle": ca.atan2(V, U + 2),
    "angle of kinks": ca.atan2(ca.fabs(V) + 0.1, ca.fmin(U, P)),
    "half power": (1 + U**2) ** 2.5,
    "negative real power": (1.2 + ca.fmin(U, V)) ** -0.3,
    "power of both": (1.5 + U) ** (V - 0.3),
    "exponential": 0.7**U * 3**V,
    "inverse functions": ca.asin(0.9 * ca.tanh(U)) - ca.acos(0.5 * ca.sin(V)),
    "roots and logarithms": ca.sqrt(1.1 + U) * ca.log(2 + V) + ca.sinh(U) * ca.cosh(V),
    "literals that folding would round": 0.3 * (0.1 * ca.fabs(U) ** 2 * 0.7 + 0.2 * U**3.5 * 0),
}


@pytest.mark.parametrize("name", FIELDS)
def test_every_chord_is_held(name: str) -> None:
    signals = (Signal("x", ""), Signal("y", ""))
    parameter = Ranged("p", "", 0.2, 0.125, 0.25)
    field = ca.vertcat(FIELDS[name], U)
    ode = Ode("loop", signals, (parameter,), (), X, P, ca.SX(0, 1), field)
    jacobian, function = IntervalJacobian(ode), ode.function()
    rng = np.random.default_rng(7)
    centre = rng.choice([0.0, 0.2, -0.2, 0.125], size=(60, 2)) + 0.01 * rng.normal(size=(60, 2))
    radius = 10.0 ** rng.uniform(-6, -0.7, size=(60, 1)) * rng.uniform(size=(60, 2))
    lower, upper = centre - radius, centre + radius
    cells = jacobian.on(lower, upper)
    assert np.isfinite(cells.jacobian_lower).all(axis=(1, 2)).mean() > 0.9
    for k in np.flatnonzero(np.isfinite(cells.jacobian_upper).all(axis=(1, 2))):
        for _ in range(10):
            a, b = (lower[k] + rng.uniform(size=2) * (upper[k] - lower[k]) for _ in range(2))
            p = rng.uniform(0.125, 0.25)
            change = np.array(function(b, p, []) - function(a, p, [])).ravel()
            step = b - a
            low = np.minimum(cells.jacobian_lower[k] * step, cells.jacobian_upper[k] * step)
            high = np.maximum(cells.jacobian_lower[k] * step, cells.jacobian_upper[k] * step)
            assert np.all(low.sum(axis=1) - 1e-13 <= change), (name, a, b)
            assert np.all(change <= high.sum(axis=1) + 1e-13), (name, a, b)


def test_decided_kinks_leave_the_branch_alone() -> None:
    signals = (Signal("x", ""), Signal("y", ""))
    field = ca.vertcat(ca.if_else(U > 1, 3 * U - 2, U), ca.fabs(V))
    ode = Ode("loop", signals, (), (), X, ca.SX(0, 1), ca.SX(0, 1), field)
    jacobian = IntervalJacobian(ode)
    cells = jacobian.on(np.array([[0.5, -2.0], [1.5, 1.0]]), np.array([[0.9, -1.0], [2.0, 2.0]]))
    for k, expected in enumerate(([[1.0, 0.0], [0.0, -1.0]], [[3.0, 0.0], [0.0, 1.0]])):
        np.testing.assert_allclose(cells.jacobian_lower[k], expected, atol=1e-14)
        np.testing.assert_allclose(cells.jacobian_upper[k], expected, atol=1e-14)


def test_a_kink_beyond_the_floor_that_stands_for_none_is_not_decided() -> None:
    """min(x, 0) has the slope 1 also at -1e302, where its floor of -1e300 is passed."""
    field = ca.vertcat(ca.fmin(U, 0), ca.fmin(-ca.exp(V), 0))
    signals = (Signal("x", ""), Signal("y", ""))
    jacobian = IntervalJacobian(Ode("loop", signals, (), (), X, ca.SX(0, 1), ca.SX(0, 1), field))
    cells = jacobian.on(np.array([[-1e305, 0.0]]), np.array([[-1e302, 0.5]]))
    assert cells.jacobian_upper[0, 0, 0] >= 1.0
    cells = jacobian.on(np.array([[-1.0, 694.0]]), np.array([[-0.5, 694.5]]))
    assert cells.jacobian_lower[0, 1, 1] <= -np.exp(694.5)


def test_exponents_stay_numbers_only_where_folding_them_is_exact() -> None:
    signals = (Signal("x", ""), Signal("y", ""))
    field = ca.vertcat(U**2.5, U**0.1)
    form = smooth_form(Ode("loop", signals, (), (), X, ca.SX(0, 1), ca.SX(0, 1), field))
    assert 0.1 in form.constants
    second = ca.hessian(form.field[0], form.ode.x)[0][0, 0]
    assert str(second) == "(2.5*(1.5*sqrt(x_0)))" or str(second) == "(3.75*sqrt(x_0))"


SMOOTH = ("angle", "half power", "power of both", "exponential", "inverse functions")


@pytest.mark.parametrize("name", SMOOTH)
def test_second_derivatives_as_casadi_writes_them_hold_every_chord_of_the_first(name: str) -> None:
    signals = (Signal("x", ""), Signal("y", ""))
    parameter = Ranged.exactly("p", "", 0.2)
    field = ca.vertcat(FIELDS[name], U)
    form = smooth_form(Ode("loop", signals, (parameter,), (), X, P, ca.SX(0, 1), field))
    gradient = ca.densify(ca.gradient(form.field[0], X))
    second = ca.densify(ca.jacobian(gradient, X))
    first = ca.Function("first", [X, form.p], [gradient])
    lifted = inclusion(ca.Function("second", [X, form.p], [second]))
    rng, values = np.random.default_rng(11), form.parameter_values()
    examined = 0
    for _ in range(60):
        centre, radius = 0.3 * rng.normal(size=2), 10.0 ** rng.uniform(-4, -1) * rng.uniform(size=2)
        low, high, valid = lifted(centre - radius, centre + radius, values, values)
        if not float(valid):
            continue
        a, b = (centre + radius * rng.uniform(-1, 1, size=2) for _ in range(2))
        change = np.array(first(b, values) - first(a, values)).ravel()
        products = np.array(low) * (b - a), np.array(high) * (b - a)
        assert np.all(np.minimum(*products).sum(axis=1) - 1e-12 <= change)
        assert np.all(change <= np.maximum(*products).sum(axis=1) + 1e-12)
        examined += 1
    assert examined > 50
