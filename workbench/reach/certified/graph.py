"""A model in the few operations that certificates are written in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.errors import InputError
from workbench.models.graph import Graph, Node, graph_of
from workbench.models.system import Ode, System
from workbench.sensitivity.kink_ranges import decimal_hull

JsonNode = list[str | int | float]
_HIGHEST_POWER = 32
_KEPT = frozenset({
    "add", "sub", "mul", "div", "fmin", "fmax", "sin", "cos", "tan", "atan", "exp", "log", "sqrt",
})  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class CertifiedModel:
    """x' = field(x, u): parameters, disturbances and inexact constants are the inputs u.

    nodes: [operation, operands]; node numbers count the states, then the inputs, then `nodes`.
    ranges: one interval per input; a parameter's holds its double and the decimal number that it
    prints as.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    ranges: tuple[tuple[float, float], ...]
    nodes: list[JsonNode]
    field: list[int]

    def document(self) -> dict[str, object]:
        """The part "model" of a certificate."""
        return {
            "states": list(self.states),
            "inputs": list(self.inputs),
            "nodes": self.nodes,
            "field": self.field,
        }


def certified_model(system: System) -> CertifiedModel:
    """The field of `system`, rewritten by identities into the operations of certificates.

    Rigor: the rewritten field equals the given one for every state and input where both are
    defined. Raises InputError naming an operation that cannot be rewritten.
    """
    ode = system.ode
    function, literals = _function(ode)
    graph = graph_of(function)
    constants = {node.constant for node in graph.nodes if node.constant is not None} | set(literals)
    inexact = [value for value in sorted(constants) if decimal_hull(value) != (value, value)]
    hulls = [(decimal_hull(p.lower)[0], decimal_hull(p.upper)[1]) for p in ode.parameters]
    hulls += [(w.lower, w.upper) for w in ode.disturbances]
    names = [signal.name for signal in (*ode.parameters, *ode.disturbances)]
    writer = _Writer(ode, inexact, literals)
    field = writer.field(graph, function.sparsity_out(0).row())
    return CertifiedModel(
        ode.names,
        (*names, *(f"constant {value!r}" for value in inexact)),
        (*hulls, *map(decimal_hull, inexact)),
        writer.nodes,
        field,
    )


def _function(ode: Ode) -> tuple[ca.Function, list[float]]:
    branchless = ode.branchless_field()
    if branchless is None:
        return ode.function(), []
    literals = branchless.literals
    symbols = ca.vertcat(*literals.symbols) if literals.symbols else ca.SX(0, 1)
    field = ca.vertcat(*branchless.outputs[0])
    return ca.Function("field", [ode.x, ode.p, ode.w, symbols], [field]), literals.values


@final
class _Writer:
    """Makes each node once."""

    def __init__(self, ode: Ode, inexact: list[float], literals: list[float]) -> None:
        states, inputs = len(ode.states), len(ode.parameters) + len(ode.disturbances)
        self._offsets = (0, states, states + len(ode.parameters))
        self._inexact = {value: states + inputs + k for k, value in enumerate(inexact)}
        self._first = states + inputs + len(inexact)
        self._states, self._literals = states, literals
        self._numbers: dict[tuple[str | int | float, ...], int] = {}
        self.nodes: list[JsonNode] = []

    def field(self, graph: Graph, rows: list[int]) -> list[int]:
        """The node of each state's rate."""
        made: list[int] = []
        for node in graph.nodes:
            exponent = graph.nodes[node.operands[1]].constant if "pow" in node.name else None
            made.append(self._node(node, [made[k] for k in node.operands], exponent))
        field = [-1] * self._states
        for row, k in zip(rows, graph.outputs[0], strict=True):
            field[row] = made[k]
        return [self.constant(0.0) if k < 0 else k for k in field]

    def _node(self, node: Node, a: list[int], exponent: float | None) -> int:
        if node.element is not None:
            group, k = node.element
            return self.constant(self._literals[k]) if group == 3 else self._offsets[group] + k
        if node.constant is not None:
            return self.constant(node.constant)
        if node.name in _KEPT:
            return self.put(node.name, *a)
        if exponent is not None:
            return self._power(a[0], exponent)
        if node.name not in _REWRITTEN:
            raise InputError(
                f"certificates have no form of the operation {node.name!r}; write the model with "
                "sums, products, constant powers and the usual functions"
            )
        return _REWRITTEN[node.name](self, *a)

    def put(self, name: str, *operands: int | float) -> int:
        """The number of a node."""
        key = (name, *operands)
        if key not in self._numbers:
            self._numbers[key] = self._first + len(self.nodes)
            self.nodes.append([*key])
        return self._numbers[key]

    def constant(self, value: float) -> int:
        """The input or the node of a constant."""
        return self._inexact[value] if value in self._inexact else self.put("constant", value)

    def _power(self, a: int, exponent: float) -> int:
        size = abs(exponent)
        if size == 0.5:
            root = self.put("sqrt", a)
        elif not exponent.is_integer() or size > _HIGHEST_POWER:
            scaled = self.put("mul", self.constant(exponent), self.put("log", a))
            return self.put("exp", scaled)
        elif size == 0.0:
            return self.constant(1.0)
        else:
            root = a if size == 1.0 else self.put("pow", a, int(size))
        return root if exponent > 0.0 else self.put("div", self.constant(1.0), root)


def _negated(w: _Writer, a: int) -> int:
    return w.put("sub", w.constant(0.0), a)


def _absolute(w: _Writer, a: int) -> int:
    return w.put("fmax", w.put("fmax", a, _negated(w, a)), w.constant(0.0))


def _twice_atan(w: _Writer, numerator: int, denominator: int) -> int:
    half = w.put("atan", w.put("div", numerator, denominator))
    return w.put("add", half, half)


def _cofactor(w: _Writer, a: int) -> int:
    """sqrt(1 - a^2)."""
    one = w.constant(1.0)
    return w.put("sqrt", w.put("mul", w.put("sub", one, a), w.put("add", one, a)))


def _arcsine(w: _Writer, a: int) -> int:
    """asin a = 2 atan(a / (1 + sqrt(1 - a^2)))."""
    return _twice_atan(w, a, w.put("add", w.constant(1.0), _cofactor(w, a)))


def _arccosine(w: _Writer, a: int) -> int:
    """acos a = 2 atan(sqrt(1 - a^2) / (1 + a))."""
    return _twice_atan(w, _cofactor(w, a), w.put("add", w.constant(1.0), a))


def _angle(w: _Writer, y: int, x: int) -> int:
    """atan2(y, x) = 2 atan(y / (sqrt(x^2 + y^2) + x)), off the negative x axis."""
    radius = w.put("sqrt", w.put("add", w.put("pow", x, 2), w.put("pow", y, 2)))
    return _twice_atan(w, y, w.put("add", radius, x))


def _exponentials(w: _Writer, a: int, operation: str) -> int:
    pair = w.put(operation, w.put("exp", a), w.put("exp", _negated(w, a)))
    return w.put("mul", w.constant(0.5), pair)


def _tanh(w: _Writer, a: int) -> int:
    """tanh a = 1 - 2 / (exp(2 a) + 1)."""
    below = w.put("add", w.put("exp", w.put("add", a, a)), w.constant(1.0))
    return w.put("sub", w.constant(1.0), w.put("div", w.constant(2.0), below))


_REWRITTEN: dict[str, Callable[..., int]] = {
    "neg": _negated,
    "twice": lambda w, a: w.put("add", a, a),
    "sq": lambda w, a: w.put("pow", a, 2),
    "inv": lambda w, a: w.put("div", w.constant(1.0), a),
    "fabs": _absolute,
    "asin": _arcsine,
    "acos": _arccosine,
    "atan2": _angle,
    "sinh": lambda w, a: _exponentials(w, a, "sub"),
    "cosh": lambda w, a: _exponentials(w, a, "add"),
    "tanh": _tanh,
}
