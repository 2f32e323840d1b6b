"""First and second derivatives of a relaxed field, with every tangent differentiated to itself.

CasADi writes tan' as 1/cos^2, which brings a cosine and a sine of its own into every bound. Here
each tan(a) becomes a symbol T with dT = (1 + T^2) da, so derivatives are polynomials in T and one
tangent serves the field and all of them: cheaper, and tighter as a range.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.models.graph import graph_of
from workbench.sensitivity.kinks import RelaxedForm, SmoothForm


@final
@dataclass(frozen=True, slots=True)
class Derivatives:
    """Of g(x, v) with v = (w, kink errors): dg/dx (n x n), dg/dv (n x n_v), and for each i the
    upper triangle of D^2 g_i over (x, v)."""

    jacobian: ca.SX
    by_exogenous: ca.SX
    hessians: tuple[ca.SX, ...]

    def all(self) -> list[ca.SX]:
        """Every matrix, in the order in which their sizes are passed on."""
        return [self.jacobian, self.by_exogenous, *self.hessians]


def derivatives(form: SmoothForm, relaxed: RelaxedForm) -> Derivatives:
    """Symbolic derivatives of the relaxed field."""
    x, v = form.ode.x, ca.vertcat(form.ode.w, relaxed.error)
    inputs = [x, form.p, form.ode.w, relaxed.slope, relaxed.offset, relaxed.error]
    field, tangents, arguments = _without_tangents(relaxed.field, inputs)
    z = ca.vertcat(x, v)
    n = x.numel()
    chain = _chain(tangents, arguments, z)
    gradient = _total(field, z, tangents, chain)
    hessians = [_total(gradient[i, :].T, z, tangents, chain) for i in range(n)]
    values: list[ca.SX] = []
    for argument in arguments:
        values.append(ca.tan(_substituted(argument, tangents[: len(values)], values)))
    matrices = [gradient[:, :n], gradient[:, n:], *(ca.triu(h) for h in hessians)]
    back = [ca.sparsify(_substituted(m, tangents, values)) for m in matrices]
    return Derivatives(back[0], back[1], tuple(back[2:]))


def _substituted(expression: ca.SX, symbols: list[ca.SX], values: list[ca.SX]) -> ca.SX:
    if not symbols:
        return expression
    return ca.substitute(expression, ca.vertcat(*symbols), ca.vertcat(*values))


def _total(expression: ca.SX, z: ca.SX, tangents: list[ca.SX], chain: list[ca.SX]) -> ca.SX:
    """d expression / dz with dT_k = chain_k dz."""
    result = ca.jacobian(expression, z)
    for tangent, row in zip(tangents, chain, strict=True):
        result = result + ca.jacobian(expression, tangent) @ row
    return ca.sparsify(result)


def _chain(tangents: list[ca.SX], arguments: list[ca.SX], z: ca.SX) -> list[ca.SX]:
    """dT_k / dz = (1 + T_k^2) d a_k / dz; an argument may hold earlier tangents."""
    rows: list[ca.SX] = []
    for tangent, argument in zip(tangents, arguments, strict=True):
        inner = _total(argument, z, tangents[: len(rows)], rows)
        rows.append((1 + tangent**2) * inner)
    return rows


def _without_tangents(
    expression: ca.SX, inputs: list[ca.SX]
) -> tuple[ca.SX, list[ca.SX], list[ca.SX]]:
    """The expression with a symbol for each tan, these symbols, and what they are tangents of."""
    function = ca.Function("field", inputs, [ca.densify(expression)])
    graph = graph_of(function)
    values: list[ca.SX] = []
    tangents: list[ca.SX] = []
    arguments: list[ca.SX] = []
    for node in graph.nodes:
        operands = [values[index] for index in node.operands]
        if node.element is not None:
            values.append(ca.vec(inputs[node.element[0]])[node.element[1]])
        elif node.constant is not None:
            values.append(ca.SX(node.constant))
        elif node.name == "tan":
            tangents.append(ca.SX.sym(f"tangent_{len(tangents)}"))
            arguments.append(operands[0])
            values.append(tangents[-1])
        elif len(operands) == 1:
            values.append(ca.SX.unary(node.operation, operands[0]))
        else:
            values.append(ca.SX.binary(node.operation, operands[0], operands[1]))
    return ca.vertcat(*[values[index] for index in graph.outputs[0]]), tangents, arguments
