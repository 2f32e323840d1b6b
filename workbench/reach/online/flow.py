"""Taylor coefficients along the flow, of the state and of what the field varies by."""

from __future__ import annotations

import casadi as ca

from workbench.reach.online.algebras import Points
from workbench.reach.online.model import OPERATIONS, OnlineModel
from workbench.reach.online.series import GraphSeries


def horner(coefficients: list[ca.SX | None], h: ca.SX) -> ca.SX:
    """sum of h^i coefficients[i]; None is 0."""
    total: ca.SX | None = None
    for coefficient in reversed(coefficients):
        if total is not None:
            total = h * total
        if coefficient is not None:
            total = coefficient if total is None else coefficient + total
    return ca.SX(0) if total is None else total


def state_series(
    model: OnlineModel, point: tuple[ca.SX, ...], order: int
) -> list[dict[int, ca.SX]]:
    """Taylor coefficients 0 .. order of every state along the flow."""
    inputs = model.point_inputs(point)
    series = GraphSeries(model.graph, Points(OPERATIONS), inputs)
    for i in range(order):
        series.advance((i, 0))
        for k in range(model.n):
            value = series.output(0, k).get((i, 0))
            if value is not None:
                inputs[0, k][i + 1, 0] = value / (i + 1) if i else value
    return [{i: value for (i, _), value in inputs[0, k].items()} for k in range(model.n)]


def direction(
    model: OnlineModel,
    point: tuple[ca.SX, ...],
    states: list[dict[int, ca.SX]],
    element: tuple[int, int],
    order: int,
) -> dict[tuple[int, int], ca.SX]:
    """(row, i) -> t^i of the field's derivative by one input element along the flow."""
    inputs = model.point_inputs(point)
    for k, coefficients in enumerate(states):
        inputs[0, k] = {(i, 0): value for i, value in coefficients.items()}
    inputs[element][0, 1] = ca.SX(1)
    series = GraphSeries(model.graph, Points(OPERATIONS), inputs)
    found = {}
    for i in range(order):
        series.advance((i, 0))
        series.advance((i, 1))
        for row in range(model.n):
            value = series.output(0, row).get((i, 1))
            if value is not None:
                found[row, i] = value
    return found
