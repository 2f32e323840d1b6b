"""Truncated power series in time t and a direction epsilon, through a graph.

For a field f the coefficients along its own flow follow from x_(i+1) = f_i / (i + 1) (Taylor's
method); with a direction epsilon carried along they are those of the variational equations.
Source: E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential Equations I, section I.8.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Generic, TypeVar, final

from workbench.errors import InputError
from workbench.models.graph import Graph, Node
from workbench.reach.online.algebras import Algebra

T = TypeVar("T")
# Operations that are evaluated at points and never differentiated.
_VALUE_ONLY = ("fabs",)
Monomial = tuple[int, int]
"""Powers of t and of epsilon."""
Terms = dict[Monomial, T]
"""Coefficients by monomial; a missing one is 0."""


@final
class GraphSeries(Generic[T]):
    """The series of every node of a graph; `advance` adds one monomial to all of them.

    Monomials must come in an order in which every one follows all that divide it.
    inputs: series by graph input element, to be completed by the caller before each `advance`.
    lower_bound: for the nodes that something is divided by (index, value -> bound of |node| from
    below).
    """

    def __init__(
        self,
        graph: Graph,
        algebra: Algebra[T],
        inputs: Mapping[tuple[int, int], Terms[T]],
        *,
        lower_bound: Callable[[int, T], T] | None = None,
    ) -> None:
        self._graph, self._algebra, self._inputs = graph, algebra, inputs
        self._values: list[Terms[T]] = [{} for _ in graph.nodes]
        # The cosine beside a sine, the derivative 1 + tan^2 beside a tangent, the inverse of a
        # denominator.
        self._beside: list[Terms[T]] = [{} for _ in graph.nodes]
        self._lower_bound = lower_bound

    def output(self, j: int, k: int) -> Terms[T]:
        """Series of nonzero k of output j, as far as it was advanced."""
        return self._values[self._graph.outputs[j][k]]

    def advance(self, monomial: Monomial) -> None:
        """Compute the coefficient of `monomial` of every node."""
        for index, node in enumerate(self._graph.nodes):
            value = self._coefficient(index, node, monomial)
            if value is not None:
                self._values[index][monomial] = value

    def _coefficient(self, index: int, node: Node, m: Monomial) -> T | None:
        a = self._algebra
        if node.element is not None:
            return self._inputs[node.element].get(m)
        if node.constant is not None:
            return a.constant(node.constant) if m == (0, 0) and node.constant != 0.0 else None
        operands = [self._values[k] for k in node.operands]
        if node.name in ("add", "sub"):
            return self._sum(operands[0].get(m), operands[1].get(m), minus=node.name == "sub")
        if node.name == "neg":
            value = operands[0].get(m)
            return None if value is None else a.neg(value)
        if node.name == "twice":
            value = operands[0].get(m)
            return None if value is None else a.times(value, 2)
        if node.name == "mul":
            return self._product(operands[0], operands[1], m)
        if node.name == "sq":
            return self._product(operands[0], operands[0], m)
        if node.name in ("div", "inv"):
            numerator: Terms[T] = operands[0] if node.name == "div" else {(0, 0): a.constant(1.0)}
            return self._quotient(index, node.operands[-1], numerator, m)
        if node.name in ("sin", "cos", "tan"):
            return self._trigonometric(index, node.name, operands[0], m)
        if node.name in _VALUE_ONLY and m == (0, 0):
            return a.function(node.name, operands[0][m])
        raise InputError(
            f"the online kernel has no rule for {node.name}; it takes + - * /, squares, sin, cos, "
            "tan and limits (fmin, fmax, fabs)"
        )

    def _sum(self, left: T | None, right: T | None, *, minus: bool = False) -> T | None:
        if right is None:
            return left
        if left is None:
            return self._algebra.neg(right) if minus else right
        return self._algebra.sub(left, right) if minus else self._algebra.add(left, right)

    def _product(self, left: Terms[T], right: Terms[T], m: Monomial) -> T | None:
        """Coefficient m of left * right."""
        total: T | None = None
        square = left is right
        for one in _divisors(m):
            other = (m[0] - one[0], m[1] - one[1])
            if square and one > other:
                continue
            factors = left.get(one), right.get(other)
            if factors[0] is None or factors[1] is None:
                continue
            term = self._algebra.mul(factors[0], factors[1])
            if square and one != other:
                term = self._algebra.times(term, 2)
            total = self._sum(total, term)
        return total

    def _quotient(self, index: int, divisor: int, numerator: Terms[T], m: Monomial) -> T | None:
        """c_m = (n_m - sum_(0 < k <= m) d_k c_(m-k)) / d_0."""
        a, below = self._algebra, self._values[divisor]
        beside = self._beside[index]
        if m == (0, 0):
            bound = self._lower_bound
            beside[m] = a.inverse(below[m] if bound is None else bound(divisor, below[m]))
        rest = numerator.get(m)
        for one in _divisors(m):
            other = (m[0] - one[0], m[1] - one[1])
            known = self._values[index].get(other)
            if one == (0, 0) or one not in below or known is None:
                continue
            rest = self._sum(rest, a.mul(below[one], known), minus=True)
        return None if rest is None else a.mul(rest, beside[0, 0])

    def _trigonometric(self, index: int, name: str, inner: Terms[T], m: Monomial) -> T | None:
        a, own, beside = self._algebra, self._values[index], self._beside[index]
        if m == (0, 0):
            argument = inner.get(m, a.constant(0.0))
            value = a.function(name, argument)
            if name == "tan":
                beside[m] = a.add(a.constant(1.0), a.mul(value, value))
            else:
                beside[m] = a.function("cos" if name == "sin" else "sin", argument)
            return value
        value_or_none = self._chain(inner, beside, m, minus=name == "cos")
        if name == "tan":
            if value_or_none is not None:
                own[m] = value_or_none
            square = self._product(own, own, m)
            if square is not None:
                beside[m] = square
        else:
            partner = self._chain(inner, own, m, minus=name == "sin")
            if partner is not None:
                beside[m] = partner
        return value_or_none

    def _chain(
        self, inner: Terms[T], derivative: Terms[T], m: Monomial, *, minus: bool
    ) -> T | None:
        """(1/m_i) sum k_i inner_k derivative_(m-k), from y' = derivative inner' in variable i."""
        a = self._algebra
        i = 0 if m[0] else 1
        total: T | None = None
        for one in _divisors(m):
            other = (m[0] - one[0], m[1] - one[1])
            if not one[i] or one not in inner or other not in derivative:
                continue
            term = a.times(a.mul(inner[one], derivative[other]), one[i])
            total = self._sum(total, term)
        if total is None:
            return None
        return a.over(a.neg(total) if minus else total, m[i])


def _divisors(m: Monomial) -> list[Monomial]:
    return [(i, j) for i in range(m[0] + 1) for j in range(m[1] + 1)]
