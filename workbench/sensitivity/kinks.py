"""Kinks (fmin, fmax, fabs) taken out of a field, so that the rest can be differentiated soundly.

CasADi differentiates a clip to c1/(c1+c2), an undecided 0/0, and gives comparisons the derivative
0. Here every kink becomes one symbol kappa_i = clip(d_i, floor_i, ceiling_i) with its driver d_i;
a clip whose limits depend on parameters only stays one, everything else uses min(d, 0) =
clip(d, -1e300, 0):

    fmin(a, b) = b + min(a - b, 0),   fmax(a, b) = b - min(b - a, 0),   fabs(a) = a - 2 min(a, 0).

An if_else whose continuity is proved is written with these first (`models.continuity`).

The remaining graph is smooth in (x, p, w, kappa). Constants that folding could round become extra
parameters, so that CasADi cannot merge them ((0.1 x) 0.3 would become 0.03 x). Only integer
exponents and k / 16 stay: the first derivatives c b^(c - 1), c (c - 1) b^(c - 2), ... fold exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.models.graph import Graph, Node
from workbench.models.literals import Literals
from workbench.models.operations import checked_graph
from workbench.models.system import Ode
from workbench.sensitivity.elementary_power import is_root_power
from workbench.sensitivity.intervals import HIGHEST_POWER

# A clip without lower limit; far below every driver and far from overflow in every product.
_NO_FLOOR = ca.SX(-1e300)
_NO_CEILING = ca.SX(0)


@final
@dataclass(frozen=True, slots=True)
class SmoothForm:
    """x' = field(x, p, w, kappa) with kappa_i = clip(drivers_i, floor_i, ceiling_i).

    p (n_p + n_constants): the parameters followed by the graph's own constants, whose values are
    `constants`; field (n x 1) is smooth in its arguments; drivers (n_kinks x 1) are smooth, driver
    i in (x, p, w, kappa_0 .. kappa_{i-1}); floor, ceiling (n_kinks x 1) depend on p alone.
    limited: which kinks are limits of the model: constants or parameters in fmin and fmax. Of two
    moving operands none is known to be the limit of the other.
    """

    ode: Ode
    p: ca.SX
    constants: tuple[float, ...]
    kappa: ca.SX
    field: ca.SX
    drivers: ca.SX
    floor: ca.SX
    ceiling: ca.SX
    limited: tuple[bool, ...]

    def parameter_values(self) -> list[float]:
        """Nominal values of `p`: the model's parameters, then the constants."""
        return [*self.ode.parameter_values(), *self.constants]


@final
@dataclass(frozen=True, slots=True)
class RelaxedForm:
    """The smooth field with every kink replaced by kappa_i = slope_i d_i + offset_i + error_i.

    field (n x 1) and drivers (n_kinks x 1) in terms of x, p, w, slope, offset and error; it
    encloses the kink whenever |error_i| is allowed up to the half gap of the chosen line.
    """

    slope: ca.SX
    offset: ca.SX
    error: ca.SX
    field: ca.SX
    drivers: ca.SX


def smooth_form(ode: Ode) -> SmoothForm:
    """Take the kinks out of `ode`, whose operations were checked when it was made."""
    branchless = ode.branchless_field()
    literals = Literals() if branchless is None else branchless.literals
    inputs = [ode.x, ode.p, ode.w, *literals.symbols]
    field = ode.field
    if branchless is not None:
        field = ca.densify(ca.SX(field.sparsity(), ca.vertcat(*branchless.outputs[0])))
    builder = _Builder(ode, inputs, literals, rewritten=branchless is not None)
    outputs = builder.run(ca.Function("field", inputs, [field]))
    return SmoothForm(
        ode=ode,
        p=ca.vertcat(ode.p, *literals.symbols),
        constants=tuple(literals.values),
        kappa=_stacked(builder.kappa),
        field=outputs,
        drivers=_stacked(builder.drivers),
        floor=_stacked([low for low, _ in builder.limits]),
        ceiling=_stacked([high for _, high in builder.limits]),
        limited=tuple(builder.limited),
    )


def relax(form: SmoothForm) -> RelaxedForm:
    """Substitute an affine relaxation for every kink, in the order of their dependence."""
    count = form.kappa.numel()
    slope, offset, error = (ca.SX.sym(name, count) for name in ("slope", "offset", "error"))
    drivers: list[ca.SX] = []
    lines: list[ca.SX] = []
    for i in range(count):
        driver = _substitute(form.drivers[i], form.kappa, lines)
        drivers.append(driver)
        lines.append(slope[i] * driver + offset[i] + error[i])
    field = _substitute(form.field, form.kappa, lines)
    return RelaxedForm(slope, offset, error, field, _stacked(drivers))


def generalised_jacobian(form: SmoothForm) -> tuple[ca.SX, ca.SX]:
    """Jacobian of the field in x (n x n) and its selectors (n_kinks x 1), one per kink.

    d kappa_i = selector_i d d_i; selector_i is 1 where driver i lies strictly between its limits, 0
    where strictly outside, and ranges over [0, 1] where that is undecided. Rigor: with selectors
    that range so, the range of the expression is an outer bound of Clarke's generalised Jacobian
    (chain rule); how it is rounded is up to whoever evaluates it.
    """
    count = form.kappa.numel()
    selector = ca.SX.sym("selector", count)
    x = form.ode.x
    rows: list[ca.SX] = []
    for i in range(count):
        row = ca.jacobian(form.drivers[i], x)
        through = ca.jacobian(form.drivers[i], form.kappa)
        for j in range(i):
            row = row + through[j] * rows[j]
        rows.append(selector[i] * row)
    jacobian = ca.jacobian(form.field, x)
    if rows:
        jacobian = jacobian + ca.jacobian(form.field, form.kappa) @ ca.vertcat(*rows)
    return ca.sparsify(jacobian), selector


def _stacked(expressions: list[ca.SX]) -> ca.SX:
    return ca.vertcat(*expressions) if expressions else ca.SX(0, 1)


def _substitute(expression: ca.SX, symbols: ca.SX, values: list[ca.SX]) -> ca.SX:
    if not values:
        return expression
    return ca.substitute(expression, symbols[: len(values)], ca.vertcat(*values))


class _Builder:
    """Rebuilds a Function's graph instruction by instruction."""

    def __init__(
        self, ode: Ode, inputs: list[ca.SX], literals: Literals, *, rewritten: bool
    ) -> None:
        resting = {constant.name for constant in ode.constants}
        self._resting = [
            x for x, name in zip(ca.vertsplit(ode.x), ode.names, strict=True) if name in resting
        ]
        self._inputs = inputs
        self._literals = literals
        self._rewritten = rewritten
        self.kappa: list[ca.SX] = []
        self.drivers: list[ca.SX] = []
        self.limits: list[tuple[ca.SX, ca.SX]] = []
        self.limited: list[bool] = []

    def run(self, function: ca.Function) -> ca.SX:
        graph = checked_graph(function, "the field")
        values: list[ca.SX] = []
        uses = [operand for node in graph.nodes for operand in node.operands]
        for node in graph.nodes:
            values.append(self._value(node, graph, values, uses))
        rows = function.sparsity_out(0).row()
        result = [ca.SX(0)] * function.numel_out(0)
        for row, index in zip(rows, graph.outputs[0], strict=True):
            result[row] = values[index]
        return ca.vertcat(*result)

    def _value(self, node: Node, graph: Graph, values: list[ca.SX], uses: list[int]) -> ca.SX:
        if node.element is not None:
            return ca.vec(self._inputs[node.element[0]])[node.element[1]]
        if node.constant is not None:
            return self._literals.of(node.constant)
        operands = [values[index] for index in node.operands]
        if node.name == "fmin":
            clip = self._clip(node, graph, values, uses)
            if clip is not None:
                return clip
            moving, limit = self._limit_last(*operands)
            return limit + self._kink(moving - limit, limited=self._is_limit(limit))
        if node.name == "fmax":
            # One half of a clip is left to the fmin that consumes it.
            if self._is_inner(len(values), graph, uses) and self._fixed(operands[1]):
                return ca.SX.nan()
            moving, limit = self._limit_last(*operands)
            return limit - self._kink(limit - moving, limited=self._is_limit(limit))
        if node.name == "fabs":
            return operands[0] - 2 * self._kink(operands[0], limited=False)
        if len(operands) == 1:
            return ca.SX.unary(node.operation, operands[0])
        if node.name in ("pow", "constpow"):
            return _power(operands, graph.nodes[node.operands[1]].constant)
        return ca.SX.binary(node.operation, operands[0], operands[1])

    def _is_inner(self, index: int, graph: Graph, uses: list[int]) -> bool:
        """Whether value `index` is only used as the first operand of an fmin with fixed limit."""
        users = [node for node in graph.nodes if index in node.operands]
        return (
            uses.count(index) == 1
            and not any(index in row for row in graph.outputs)
            and users[0].name == "fmin"
            and users[0].operands[0] == index
            and self._is_parameter(users[0].operands[1], graph)
        )

    def _is_parameter(self, index: int, graph: Graph) -> bool:
        node = graph.nodes[index]
        # Input 1 holds the parameters, inputs from 3 on constants.
        return node.constant is not None or (
            node.element is not None and node.element[0] not in (0, 2)
        )

    def _fixed(self, value: ca.SX, *more: ca.SX) -> bool:
        symbols = (*ca.vertsplit(self._inputs[1]), *self._literals.symbols, *more)
        known = {symbol.element_hash() for symbol in symbols}
        return all(s.element_hash() in known for s in ca.symvar(value))

    def _clip(self, node: Node, graph: Graph, values: list[ca.SX], uses: list[int]) -> ca.SX | None:
        inner, limit = node.operands
        below = graph.nodes[inner]
        if below.name != "fmax" or not self._is_inner(inner, graph, uses):
            return None
        driver, floor = (values[index] for index in below.operands)
        if not self._fixed(floor):
            return None
        return self._kink(driver, floor, values[limit], limited=True)

    def _limit_last(self, first: ca.SX, second: ca.SX) -> tuple[ca.SX, ca.SX]:
        """The operands of a minimum or maximum, one that does not move behind one that does."""
        resting = self._resting
        swapped = self._fixed(first, *resting) and not self._fixed(second, *resting)
        return (second, first) if swapped else (first, second)

    def _is_limit(self, limit: ca.SX) -> bool:
        # A correction of an if_else is the minimum of its condition and 0, whatever its branches.
        return self._fixed(limit, *self._resting) and not (self._rewritten and limit.is_zero())

    def _kink(
        self,
        driver: ca.SX,
        floor: ca.SX = _NO_FLOOR,
        ceiling: ca.SX = _NO_CEILING,
        *,
        limited: bool,
    ) -> ca.SX:
        symbol = ca.SX.sym(f"kappa_{len(self.kappa)}")
        self.kappa.append(symbol)
        self.drivers.append(driver)
        self.limits.append((floor, ceiling))
        self.limited.append(limited)
        return symbol


def _power(operands: list[ca.SX], exponent: float | None) -> ca.SX:
    if exponent is not None and (
        is_root_power(exponent) or (exponent.is_integer() and abs(exponent) <= HIGHEST_POWER)
    ):
        return ca.SX.binary(ca.OP_CONSTPOW, operands[0], ca.SX(exponent))
    return ca.SX.binary(ca.OP_POW, operands[0], operands[1])
