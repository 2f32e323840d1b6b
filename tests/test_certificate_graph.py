"""Rewritten fields equal the model's, and both differentiations of them hold its derivative."""

from __future__ import annotations

import functools
import json

import casadi as ca
import numpy as np
from certificate_cases import rates
from hypothesis import example, given, settings
from hypothesis import strategies as st

from workbench.checker.arithmetic import Interval
from workbench.checker.model import Graph
from workbench.models import system_from_casadi
from workbench.models.system import Ode
from workbench.reach.certified.frame_functions import FieldBounds
from workbench.reach.certified.graph import CertifiedModel, certified_model


@functools.cache
def every_operation() -> tuple[Ode, CertifiedModel, FieldBounds]:
    x = ca.SX.sym("x", 2)
    a, b = x[0], x[1]
    first = ca.asin(a / 4) + ca.acos(b / 4) + ca.atan2(a, b) + ca.sinh(a) + ca.fabs(a - b) + 2 * a
    second = ca.cosh(b) + ca.tanh(a) + ca.sqrt(b) + b**1.5 + b**-2 + a**5 + ca.log(b) + ca.exp(-b)
    third = ca.fmin(a, b) + ca.fmax(a, -b) + 0.1 * ca.tan(a / 3) + ca.atan(b) / (1 + a**2) - a**2
    ode = system_from_casadi(x, ca.vertcat(first + third, second), ("a", "b"))
    model = certified_model(ode)
    return ode, model, FieldBounds(model)


@functools.cache
def derivative() -> ca.Function:
    """(x, direction) -> directional derivative of the model's field, by CasADi."""
    ode, _, _ = every_operation()
    direction = ca.SX.sym("direction", 2)
    return ca.Function("slope", [ode.x, direction], [ca.jtimes(ode.field, ode.x, direction)])


def checker_graph(model: CertifiedModel) -> Graph:
    parts = json.loads(json.dumps(model.document()), parse_int=float)
    return Graph(parts["nodes"], parts["field"], len(model.states), len(model.inputs))


@settings(deadline=None)  # the first call makes the functions
@example(0.20000000000000004, 0.2, 0.0, 0.0)
@example(0.2, 0.20000000000000004, 0.0, 0.0)
@example(-0.5, 0.5, 1.0, 0.01)
@given(
    st.floats(-2.0, 2.0), st.floats(0.2, 2.0), st.floats(-1.0, 1.0), st.sampled_from([0.0, 0.01])
)
def test_values_and_derivatives_are_held(a: float, b: float, s: float, radius: float) -> None:
    ode, model, bounds = every_operation()
    u = np.array([sum(pair) / 2 for pair in model.ranges])
    field, point = ode.function(), np.array([a, b])
    exact = np.array(field(point, [], [])).ravel()
    assert np.allclose(rates(model.document(), point[:, None], u[:, None])[:, 0], exact, rtol=1e-9)
    direction, step = np.array([1.0, s]), 1e-6
    ahead, behind = (
        np.array(field(point + k * step * direction, [], [])).ravel() for k in (1.0, -1.0)
    )
    slope = np.array(derivative()(point, direction)).ravel()
    near_a_kink = min(abs(a - b), abs(a + b)) < 1e-4
    # A quotient across a kink mixes both of its sides.
    if not near_a_kink:
        assert np.allclose((ahead - behind) / (2 * step), slope, rtol=1e-6, atol=1e-6)

    ranges = tuple(np.array(side) for side in zip(*model.ranges, strict=True))
    box = point - radius, point + radius
    graph = checker_graph(model)
    values = graph.values([*map(Interval, *box), *map(Interval, *ranges)])
    change = [*map(Interval, direction), *map(Interval, 0 * u)]
    found = [
        bounds.rates(box, (ranges[0], ranges[1])),
        bounds.tangent(box, (ranges[0], ranges[1]), (direction,) * 2, (0 * u,) * 2),
        np.array([[x.low, x.high] for x in (values[k] for k in graph.field)]).T,
        np.array([[x.low, x.high] for x in graph.tangent(values, change)]).T,
    ]
    for pair, truth in zip(found, (exact, slope, exact, slope), strict=True):
        assert pair is not None
        room = 1e-6 * (1.0 + np.abs(truth))
        assert np.all(pair[0] <= truth + room)
        assert np.all(truth <= pair[1] + room)
        if radius == 0.0 and not near_a_kink:
            assert np.all(pair[1] - pair[0] <= room)
