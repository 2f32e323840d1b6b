"""if_else replaced by fmin and fmax, after a proof that the two branches meet.

For if_else(g < 0, a, b) let D = a - b. All proofs are about exact polynomials in canonical atoms
(`atoms`, `signs`); literals are the rational numbers that their doubles are. `branches` tries

    D <= 0 where g <= 0, D >= 0 where g >= 0:      min(a, b); max(a, b) for the mirror image
    g = c v + g0, c a number, v* = -g0 / c,        a(v kept where g <= 0) + b(v kept where g >= 0)
        D = 0 at v = v*:                               - a(v*)
    D = q g where g <= 0:                          b + q min(g, 0)
    D = q g where g >= 0:                          a - q max(g, 0)

Each equals the if_else at every state and for all parameters and disturbances in their ranges, if
both branches are defined there: all but the second also evaluate a branch where it is not taken,
so that bounds are invalid where it leaves its domain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.errors import InputError
from workbench.models.atoms import Range
from workbench.models.branches import Branch, Value, gap, joined
from workbench.models.exact_values import ExactValues
from workbench.models.graph import Graph, Node
from workbench.models.literals import Literals
from workbench.models.operations import BRANCHES
from workbench.models.polynomials import Polynomial, TooLargeError

_SHOWN = 80


@final
@dataclass(frozen=True, slots=True)
class Branchless:
    """The outputs of a graph without if_else, in the inputs and the symbols of `literals`."""

    outputs: tuple[tuple[ca.SX, ...], ...]
    literals: Literals


def has_branches(graph: Graph) -> bool:
    """Whether the graph holds an if_else or a comparison."""
    return any(node.name in BRANCHES for node in graph.nodes)


def without_branches(
    graph: Graph, inputs: Sequence[ca.SX], ranges: Sequence[Sequence[Range]], *, where: str
) -> Branchless:
    """Rewrite every if_else of the graph, see the module's text.

    inputs: one SX column for each input of the graph, the second the parameters; ranges: for each,
    the ranges of its elements; where: what the graph is, for messages. Raises InputError for an
    if_else whose continuity is not proved, and for comparisons outside an if_else.
    """
    rewriter = _Rewriter(graph, inputs, ranges, where)
    return Branchless(rewriter.run(), rewriter.literals)


@final
class _Rewriter:
    def __init__(
        self,
        graph: Graph,
        inputs: Sequence[ca.SX],
        ranges: Sequence[Sequence[Range]],
        where: str,
    ) -> None:
        self._graph, self._inputs, self._where = graph, inputs, where
        self.literals = Literals()
        self._exact = ExactValues(inputs, ranges, self.literals)
        self._values: dict[int, Value] = {}
        self._gap = ""

    def run(self) -> tuple[tuple[ca.SX, ...], ...]:
        needed, compared = self._needed()
        for index in needed:
            node = self._graph.nodes[index]
            branch = self._branch(node)
            if branch is not None:
                self._values[index] = self._joined(*branch)
                continue
            value = self._expression(node)
            exact = Polynomial()
            if index in compared:
                operands = [self._values[k].exact for k in node.operands]
                exact = self._exact.of(index, node, operands, value)
            self._values[index] = Value(value, exact)
        return tuple(
            tuple(self._values[index].expression for index in row) for row in self._graph.outputs
        )

    def _needed(self) -> tuple[list[int], set[int]]:
        """Nodes to evaluate, rising, and those among them that some if_else is computed from."""
        needed = {index for row in self._graph.outputs for index in row}
        compared: set[int] = set()
        for index in range(len(self._graph.nodes) - 1, -1, -1):
            if index not in needed:
                continue
            node = self._graph.nodes[index]
            branch = self._branch(node)
            used = node.operands if branch is None else self._used(*branch)
            needed.update(used)
            if branch is not None or index in compared:
                compared.update(used)
        return sorted(needed), compared

    def _branch(self, node: Node) -> tuple[int, int | None, int | None] | None:
        """(condition, value, other) when `node` is CasADi's if_else; None stands for 0."""
        branches = branches_of_sum(node, self._graph)
        if branches is not None:
            return branches
        return (node.operands[0], node.operands[1], None) if node.name == "if_else_zero" else None

    def _used(self, condition: int, value: int | None, other: int | None) -> list[int]:
        """The numbers that an if_else is computed from."""
        found = [index for index in (value, other) if index is not None]
        conditions = [condition]
        while conditions:
            node = self._graph.nodes[conditions.pop()]
            if node.name in ("not", "and", "or"):
                conditions.extend(node.operands)
            elif node.name in ("lt", "le"):
                found.extend(node.operands)
        return found

    def _joined(self, condition: int, value: int | None, other: int | None) -> Value:
        zero = Value(ca.SX(0.0), Polynomial())
        taken, left = (zero if k is None else self._values[k] for k in (value, other))
        result = self._on(condition, taken, left)
        if result is not None:
            return result
        shown = ", ".join(self._shown(part) for part in (taken.expression, left.expression))
        raise InputError(
            f"{self._where}: if_else({self._text(condition)}, {shown}) could not be proved "
            f"continuous. Its branches have to meet where the condition changes{self._gap}, "
            "exactly, with literals taken as doubles and parameters anywhere in their ranges: "
            "tried the minimum and maximum of the branches, their values at the switching point "
            "and exact division of their difference; write it with fmin, fmax or fabs, or mend "
            "the branches"
        )

    def _on(self, condition: int, taken: Value, left: Value) -> Value | None:
        """if_else(condition, taken, left)."""
        node = self._graph.nodes[condition]
        if node.name in ("lt", "le"):
            low, high = (self._values[k] for k in node.operands)
            try:
                guard = Value(low.expression - high.expression, low.exact - high.exact)
                branch = Branch(guard, taken, left, taken.exact - left.exact)
            except TooLargeError:
                return None
            result = joined(self._exact, branch)
            if result is None:
                size = gap(self._exact, branch)
                self._gap = "" if size is None else f" (they differ by {size:.6g} there)"
            return result
        if node.name == "not":
            return self._on(node.operands[0], left, taken)
        if node.name not in ("and", "or"):
            return None
        for first, second in (node.operands, node.operands[::-1]):
            inner = self._on(second, taken, left)
            if inner is not None:
                pair = (inner, left) if node.name == "and" else (taken, inner)
                result = self._on(first, *pair)
                if result is not None:
                    return result
        return None

    def _expression(self, node: Node) -> ca.SX:
        if node.element is not None:
            return ca.vec(self._inputs[node.element[0]])[node.element[1]]
        if node.constant is not None:
            return self.literals.of(node.constant)
        if node.name in ("lt", "le", "not", "and", "or"):
            raise InputError(
                f"{self._where}: the comparison {node.name!r} is used as a number, which jumps; "
                "use it as the condition of an if_else with branches that meet, or write the law "
                "with fmin, fmax or fabs"
            )
        operands = [self._values[index].expression for index in node.operands]
        if len(operands) == 1:
            return ca.SX.unary(node.operation, operands[0])
        exponent = self._graph.nodes[node.operands[1]].constant
        if node.name in ("pow", "constpow") and exponent is not None:
            # As a symbol it would lose the rules for powers of bases that reach 0.
            operands[1] = ca.SX(exponent)
        return ca.SX.binary(node.operation, operands[0], operands[1])

    def _text(self, condition: int) -> str:
        node = self._graph.nodes[condition]
        if node.name in ("lt", "le"):
            low, high = (self._shown(self._values[k].expression) for k in node.operands)
            return f"{low} {'<' if node.name == 'lt' else '<='} {high}"
        if node.name in ("not", "and", "or"):
            return f"{node.name}({', '.join(map(self._text, node.operands))})"
        return f"a {node.name!r} as the condition"

    def _shown(self, expression: ca.SX) -> str:
        if self.literals.symbols:
            symbols, values = ca.vertcat(*self.literals.symbols), ca.DM(self.literals.values)
            expression = ca.substitute(expression, symbols, values)
        text = str(expression)
        return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def branches_of_sum(node: Node, graph: Graph) -> tuple[int, int, int] | None:
    """(condition, value, other) when `node` is CasADi's sum form of if_else."""
    if node.name != "add":
        return None
    first, second = (graph.nodes[index] for index in node.operands)
    if first.name != "if_else_zero" or second.name != "if_else_zero":
        return None
    for taken, left in ((first, second), (second, first)):
        condition = graph.nodes[left.operands[0]]
        if condition.name == "not" and condition.operands[0] == taken.operands[0]:
            return taken.operands[0], taken.operands[1], left.operands[1]
    return None
