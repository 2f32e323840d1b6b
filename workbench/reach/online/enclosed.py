"""The `enclosed` kernel's Functions: what is computed at points comes with its own error bounds.

Nothing here depends on an operating region: the bounds belong to the numbers at hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.errors import InputError
from workbench.models.graph import graph_of
from workbench.models.system import Ode
from workbench.reach.online.balls import Ball, Balls, inputs_of
from workbench.reach.online.budget import Ranges
from workbench.reach.online.functions import ORDER, OnlineFunctions, exact_limits
from workbench.reach.online.majorants import majorant_function
from workbench.reach.online.model import OnlineModel
from workbench.reach.online.point_trig import PRINCIPAL_RAD
from workbench.reach.online.series import GraphSeries
from workbench.reach.online.step import (
    advance_function,
    driver_function,
    input_function,
    pairs_of,
    second_function,
    source_function,
)
from workbench.sensitivity.validity import verbatim

# Covers the roundings of a sum of fewer than 2^11 products of non-negative doubles, relative, and
# what underflows in it, absolute.
_WIDER, _TINY = 1 + 2.0**-40, 2.0**-1000
_LARGEST = 1e300


@final
@dataclass(frozen=True, slots=True)
class Enclosed:
    """A point Function evaluated in balls.

    symbols: its inputs, exact doubles; balls: every nonzero of every output, in their order;
    sparsities: of the outputs; conditions: must all be 1.
    """

    function: ca.Function
    symbols: list[ca.SX]
    balls: list[list[Ball]]
    conditions: list[ca.SX]

    @classmethod
    def of(cls, function: ca.Function, *, principal: bool) -> Enclosed:
        """Evaluate the graph of `function`, whose sin, cos and tan become our polynomials."""
        count = function.n_in()
        symbols = [ca.SX.sym(function.name_in(i), function.sparsity_in(i)) for i in range(count)]
        graph = graph_of(function)
        with verbatim():
            algebra = Balls(principal=principal)
            inputs = {key: {(0, 0): ball} for key, ball in inputs_of(algebra, symbols).items()}
            series = GraphSeries(graph, algebra, inputs)
            series.advance((0, 0))
            zero = algebra.constant(0.0)
            balls = [
                [series.output(j, k).get((0, 0), zero) for k in range(len(row))]
                for j, row in enumerate(graph.outputs)
            ]
        return cls(function, symbols, balls, algebra.conditions)

    def radii(self, output: str) -> list[ca.SX]:
        """Bound of every nonzero's error."""
        with verbatim():
            return [ball.radius() for ball in self.balls[self.function.index_out(output)]]

    def finished(self, bounds: dict[str, ca.SX]) -> ca.Function:
        """The Function with `bounds` and `ok` as further outputs.

        ok is 1 if all conditions hold and everything that comes out is finite: an overflow on the
        way either stays in a sum or product to the end or fails a condition.
        """
        function = self.function
        values = [
            ca.SX(function.sparsity_out(j), _column([ball.value for ball in row]))
            for j, row in enumerate(self.balls)
        ]
        with verbatim():
            total = ca.SX(0.0)
            for block in [*values, *bounds.values()]:
                for value in block.nonzeros():
                    if not value.is_constant():
                        total = total + ca.fabs(value)
            ok = total <= _LARGEST
            for condition in self.conditions:
                ok = ca.logic_and(ok, condition)
            outputs = list(ca.cse([*values, *bounds.values(), ok]))
        names = [*function.name_out(), *bounds, "ok"]
        return ca.Function(function.name(), self.symbols, outputs, function.name_in(), names)


def _column(values: Sequence[ca.SX]) -> ca.SX:
    return ca.vertcat(*values) if values else ca.SX(0, 1)


def _total(terms: Sequence[ca.SX]) -> ca.SX:
    """Upper bound of a sum of non-negative terms that are computed or products of two such."""
    present = [term for term in terms if not term.is_zero()]
    if not present:
        return ca.SX(0.0)
    with verbatim():
        total = present[0]
        for term in present[1:]:
            total = total + term
        return total * _WIDER + _TINY


def enclosed_advance(model: OnlineModel, order: int, *, principal: bool) -> ca.Function:
    """`wb_advance` with bounds: round_state (n), round_transition (nonzeros of transition), ok.

    The exact values are those of one Taylor step of this order from the doubles given.
    """
    found = Enclosed.of(advance_function(model, order), principal=principal)
    state, transition = (_column(found.radii(name)) for name in ("x_end", "transition"))
    return found.finished({"round_state": state, "round_transition": transition})


def enclosed_inputs(model: OnlineModel, *, principal: bool) -> ca.Function:
    """`wb_inputs` with a bound for every nonzero: round_input, ok."""
    found = Enclosed.of(input_function(model), principal=principal)
    return found.finished({"round_input": _column(found.radii("by_input"))})


def enclosed_second(
    model: OnlineModel, columns: tuple[int, ...], *, principal: bool
) -> ca.Function:
    """`wb_second` with bounds: round_hessian (nonzeros), with columns also round_source and
    round_bent (n each), summed over the pairs; ok.
    """
    found = Enclosed.of(second_function(model, columns), principal=principal)
    bounds = {"round_hessian": _column(found.radii("hessian"))}
    if columns:
        pairs = len(pairs_of(model, columns))
        for name, output in (("round_source", "source"), ("round_bent", "bent_source")):
            radii = found.radii(output)
            rows = [radii[i * pairs : (i + 1) * pairs] for i in range(model.n)]
            bounds[name] = _column([_total(row) for row in rows])
    return found.finished(bounds)


def enclosed_drivers(
    model: OnlineModel, columns: tuple[int, ...], *, principal: bool
) -> ca.Function:
    """`wb_drivers` with round_driver (n_k) and ok.

    round_driver: error of the driver plus that of all it varies by over the set: |error of the
    gradient| (linear + rest), error of second, errors of the pairs.
    """
    found = Enclosed.of(driver_function(model, columns), principal=principal)
    names = found.function.name_in()
    linear, rest = (found.symbols[names.index(name)] for name in ("linear", "rest"))
    driver, gradient, second = (found.radii(name) for name in ("driver", "gradient", "second"))
    pairs = found.radii("pairs") if columns else []
    per_driver, n, bounds = len(pairs) // max(model.n_k, 1), model.n, []
    with verbatim():
        radius = [linear[j] + rest[j] for j in range(n)]
        for k in range(model.n_k):
            slopes = [
                slope * radius[j]
                for j, slope in enumerate(gradient[k * n : (k + 1) * n])
                if not slope.is_zero()
            ]
            own = pairs[k * per_driver : (k + 1) * per_driver]
            bounds.append(_total([driver[k], *slopes, second[k], *own]))
    return found.finished({"round_driver": _column(bounds)})


def enclosed_functions(ode: Ode, ranges: Ranges, *, quadratic: tuple[str, ...]) -> OnlineFunctions:
    """Build the `enclosed` kernel's Functions of `ode`.

    ranges: only where the loop ends and whether angles need their periods taken off; no bound is
    derived from them. quadratic: states whose initial deviations enter to second order; none: the
    linear form. All bounds are ENCLOSED under the premises of `sensitivity.intervals`, as long as
    `ok` is 1. InputError where an operation has no rule or a limit is not a parameter itself.
    """
    model = OnlineModel.of(ode)
    unknown = [name for name in quadratic if name not in ode.names]
    if unknown:
        raise InputError(f"expected states of {ode.names}, got {unknown}")
    columns = tuple(ode.names.index(name) for name in quadratic)
    principal, n_k = _is_principal(model, ranges), model.n_k
    advance = enclosed_advance(model, ORDER, principal=principal)
    return OnlineFunctions(
        model=model,
        ranges=ranges,
        rounding=None,
        columns=columns,
        pairs=tuple(pairs_of(model, columns)) if columns else (),
        jacobians=(),
        transition=advance.sparsity_out("transition"),
        advance=advance,
        inputs=enclosed_inputs(model, principal=principal) if model.n_v else None,
        second=enclosed_second(model, columns, principal=principal),
        source=source_function(model, upward=True, quadratic=bool(columns)),
        majorant=majorant_function(model, order=ORDER, upward=True, quadratic=bool(columns)),
        drivers=enclosed_drivers(model, columns, principal=principal) if n_k else None,
        limits=exact_limits(model) if n_k else None,
    )


def _is_principal(model: OnlineModel, ranges: Ranges) -> bool:
    """Whether sin, cos and tan are taken of states only, which stay in the principal period.

    Where one does not, `ok` says so: this chooses the cheaper code and proves nothing.
    """
    box = ranges.states.reordered(model.ode.names)
    for node in model.graph.nodes:
        if node.name not in ("sin", "cos", "tan"):
            continue
        element = model.graph.nodes[node.operands[0]].element
        if element is None or element[0] != 0:
            return False
        k = element[1]
        if not max(abs(box.lower[k]), abs(box.upper[k])) < PRINCIPAL_RAD:
            return False
    return True
