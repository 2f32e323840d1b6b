"""What every Function of the online kernel starts from: the relaxed field and its graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.models.graph import Graph, graph_of
from workbench.models.system import Ode
from workbench.reach.online import point_trig
from workbench.reach.online.algebras import Points
from workbench.reach.online.series import GraphSeries, Terms
from workbench.sensitivity.kinks import RelaxedForm, SmoothForm, relax, smooth_form
from workbench.sensitivity.validity import verbatim

OPERATIONS: Mapping[str, Callable[[ca.SX], ca.SX]] = {
    "sin": ca.sin, "cos": ca.cos, "tan": ca.tan,
}  # fmt: skip
"""CasADi's own operations: what the graphs that are analysed hold."""
POLYNOMIALS: Mapping[str, Callable[[ca.SX], ca.SX]] = {
    "sin": point_trig.sin, "cos": point_trig.cos, "tan": point_trig.tan, "fabs": ca.fabs,
}  # fmt: skip
"""What stands for them in the generated code."""
PRINCIPAL: Mapping[str, Callable[[ca.SX], ca.SX]] = {
    "sin": point_trig.principal_sin, "cos": point_trig.principal_cos,
    "tan": point_trig.principal_tan, "fabs": ca.fabs,
}  # fmt: skip
"""The same where no argument exceeds point_trig.PRINCIPAL_RAD."""


@final
@dataclass(frozen=True, slots=True)
class OnlineModel:
    """The relaxed field g(x, v), v = (w, kink errors), with drivers, as one graph.

    inputs: x (n), p (n_p, constants included), w (n_w), slope, offset, error (n_k each); graph:
    outputs 0 (the field, n) and 1 (the drivers, n_k), both dense.
    """

    form: SmoothForm
    relaxed: RelaxedForm
    inputs: tuple[ca.SX, ...]
    graph: Graph

    @classmethod
    def of(cls, ode: Ode) -> OnlineModel:
        """Take the kinks out of `ode` and read the graph of what is left."""
        form = smooth_form(ode)
        relaxed = relax(form)
        inputs = (ode.x, form.p, ode.w, relaxed.slope, relaxed.offset, relaxed.error)
        outputs = [ca.densify(relaxed.field), ca.densify(relaxed.drivers)]
        return cls(form, relaxed, inputs, graph_of(ca.Function("relaxed", [*inputs], outputs)))

    @property
    def ode(self) -> Ode:
        """The equation."""
        return self.form.ode

    @property
    def n(self) -> int:
        """States."""
        return int(self.ode.x.numel())

    @property
    def n_w(self) -> int:
        """Disturbances."""
        return int(self.ode.w.numel())

    @property
    def n_k(self) -> int:
        """Kinks."""
        return int(self.form.kappa.numel())

    @property
    def n_v(self) -> int:
        """Exogenous inputs: disturbances, then kink errors."""
        return self.n_w + self.n_k

    def point_inputs(self, values: tuple[ca.SX, ...]) -> dict[tuple[int, int], Terms[ca.SX]]:
        """Series of order 0 for the inputs x, p, w, slope, offset; the errors are 0."""
        return {
            (i, k): {(0, 0): ca.vec(block)[k]}
            for i, block in enumerate(values)
            for k in range(block.numel())
        } | {(5, k): {} for k in range(self.n_k)}


def emitted(function: ca.Function, *, principal: bool) -> ca.Function:
    """`function` with our polynomials for sin, cos and tan, operation by operation otherwise.

    principal: no argument exceeds `point_trig.PRINCIPAL_RAD`.
    """
    graph = graph_of(function)
    symbols = [ca.SX.sym(function.name_in(i), function.size_in(i)) for i in range(function.n_in())]
    inputs = {
        (i, k): {(0, 0): ca.vec(block)[k]}
        for i, block in enumerate(symbols)
        for k in range(block.numel())
    }
    with verbatim():
        series = GraphSeries(graph, Points(PRINCIPAL if principal else POLYNOMIALS), inputs)
        series.advance((0, 0))
        outputs = []
        for j, row in enumerate(graph.outputs):
            values = [series.output(j, k).get((0, 0), ca.SX(0)) for k in range(len(row))]
            packed = ca.vertcat(*values) if values else ca.SX(0, 1)
            outputs.append(ca.SX(function.sparsity_out(j), packed))
        merged = list(ca.cse(outputs))
    return ca.Function(function.name(), symbols, merged, function.name_in(), function.name_out())
