"""Bounds of a certified model's field and of its directional derivatives, as compiled functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import final

import casadi as ca
import numpy as np

from workbench.reach.certified.graph import CertifiedModel, JsonNode
from workbench.sensitivity import elementary
from workbench.sensitivity.interval_arrays import Interval
from workbench.sensitivity.intervals import SymbolicInterval
from workbench.sensitivity.validity import Validity, verbatim

_BINARY: dict[str, Callable[[SymbolicInterval, SymbolicInterval], SymbolicInterval]] = {
    "add": SymbolicInterval.__add__,
    "sub": SymbolicInterval.__sub__,
    "mul": SymbolicInterval.__mul__,
    "div": SymbolicInterval.__truediv__,
    "fmin": SymbolicInterval.minimum,
    "fmax": SymbolicInterval.maximum,
}


@final
class FieldBounds:
    """Outward-rounded bounds of f(x, u) and of its derivative along (dx, du), generalised at kinks.

    All arguments and results are pairs (lower, upper) of arrays. Each call returns None where the
    bound does not exist (a pole, a domain, an overflow). Rigor ENCLOSED, under the premises of
    `workbench.sensitivity.intervals`.
    """

    __slots__ = ("_field", "_tangent")

    def __init__(self, model: CertifiedModel) -> None:
        n, m = len(model.states), len(model.inputs)
        validity = Validity()
        names = ("x", "u", "dx", "du")
        ends = {
            k: (ca.SX.sym(f"{k}l", s), ca.SX.sym(f"{k}h", s))
            for k, s in zip(names, (n, m) * 2, strict=True)
        }
        known, moved = (
            [
                SymbolicInterval.between(ends[k][0][i], ends[k][1][i], validity)
                for k in pair
                for i in range(ends[k][0].numel())
            ]
            for pair in (("x", "u"), ("dx", "du"))
        )
        for node in model.nodes:
            known.append(_value(node, known, validity))
        rates = [known[k] for k in model.field]
        self._field = _compiled(ends, rates, validity)
        for node in model.nodes:
            moved.append(_derivative(node, known, moved, len(moved)))
        self._tangent = _compiled(ends, [moved[k] for k in model.field], validity)

    def rates(self, x: Interval, u: Interval) -> Interval | None:
        """{f(x, u)}."""
        return _run(self._field, x, u, (0.0 * x[0],) * 2, (0.0 * u[0],) * 2)

    def tangent(self, x: Interval, u: Interval, dx: Interval, du: Interval) -> Interval | None:
        """{df(x, u) (dx, du)}."""
        return _run(self._tangent, x, u, dx, du)

    def jacobian(self, boxes: Sequence[Interval], u: Interval) -> Interval | None:
        """Columns of df/dx, column j over boxes[j]: two (n, n) arrays."""
        none = (np.zeros_like(u[0]),) * 2
        columns = []
        for j, box in enumerate(boxes):
            unit = np.zeros(len(boxes))
            unit[j] = 1.0
            column = self.tangent(box, u, (unit, unit), none)
            if column is None:
                return None
            columns.append(column)
        return np.array([low for low, _ in columns]).T, np.array([high for _, high in columns]).T


def _value(node: JsonNode, known: list[SymbolicInterval], validity: Validity) -> SymbolicInterval:
    name, *operands = node
    if name == "constant":
        return SymbolicInterval.exactly(float(operands[0]), validity)
    x = known[int(operands[0])]
    if name in _BINARY:
        return _BINARY[str(name)](x, known[int(operands[1])])
    if name == "pow":
        return x.power(int(operands[1]))
    return x.sqrt() if name == "sqrt" else getattr(elementary, str(name))(x)


def _derivative(
    node: JsonNode, known: list[SymbolicInterval], moved: list[SymbolicInterval], k: int
) -> SymbolicInterval:
    name, *operands = node
    if name == "constant":
        return SymbolicInterval.exactly(0.0, known[0].validity)
    a = int(operands[0])
    x, dx, g = known[a], moved[a], known[k]
    if name == "pow":
        power = int(operands[1])
        return (x.power(power - 1) if power > 2 else x) * float(power) * dx
    if name not in _BINARY:
        return _slope(str(name), x, g) * dx
    y, dy = known[int(operands[1])], moved[int(operands[1])]
    if name == "mul":
        return dx * y + x * dy
    if name == "div":
        return (dx - g * dy) / y
    if name in ("fmin", "fmax"):
        return _chosen(x, y, dx, dy) if name == "fmin" else _chosen(y, x, dx, dy)
    return _BINARY[str(name)](dx, dy)


def _slope(name: str, x: SymbolicInterval, g: SymbolicInterval) -> SymbolicInterval:
    if name in ("sin", "cos"):
        return elementary.cos(x) if name == "sin" else -elementary.sin(x)
    if name in ("tan", "atan"):
        return 1.0 + g.square() if name == "tan" else 1.0 / (1.0 + x.square())
    if name == "exp":
        return g
    return 1.0 / x if name == "log" else 0.5 / g


def _chosen(
    x: SymbolicInterval, y: SymbolicInterval, dx: SymbolicInterval, dy: SymbolicInterval
) -> SymbolicInterval:
    """dx where x <= y throughout, dy where y <= x throughout, else anything between them."""
    for each in (x, y, dx, dy):
        each.watched()
    both = dx.hull(dy)
    first, second = x.upper <= y.lower, y.upper <= x.lower
    with verbatim():
        lower, upper = (
            ca.if_else(first, a, ca.if_else(second, b, c))
            for a, b, c in ((dx.lower, dy.lower, both.lower), (dx.upper, dy.upper, both.upper))
        )
        return SymbolicInterval(lower, upper, x.validity)


def _compiled(
    ends: dict[str, tuple[ca.SX, ca.SX]],
    outputs: Sequence[SymbolicInterval],
    validity: Validity,
) -> ca.Function:
    for each in outputs:
        each.watched()
    lower, upper = (
        ca.vertcat(*side) for side in zip(*((e.lower, e.upper) for e in outputs), strict=True)
    )
    arguments = [side for pair in ends.values() for side in pair]
    return ca.Function(
        "bounds", arguments, [ca.densify(lower), ca.densify(upper), validity.result()]
    )


def _run(function: ca.Function, *arguments: Interval) -> Interval | None:
    lower, upper, valid = function(*(side for pair in arguments for side in pair))
    if float(valid) != 1.0:
        return None
    return np.array(lower).ravel(), np.array(upper).ravel()
