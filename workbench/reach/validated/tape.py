"""From an SX Function to the operations that carry its Taylor series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from workbench.errors import InputError
from workbench.models.graph import Graph, Node, graph_of
from workbench.reach.validated.algebra import Algebra
from workbench.reach.validated.angle import Angle
from workbench.reach.validated.composition import Operation
from workbench.reach.validated.operations import (
    Even,
    Exponential,
    Inverse,
    Linear,
    Pair,
    Power,
    Product,
    Root,
    Tangent,
)
from workbench.reach.validated.primitive import primitive
from workbench.reach.validated.series import Series
from workbench.sensitivity.intervals import HIGHEST_POWER

_PRIMITIVES = frozenset({"log", "atan", "asin", "acos"})
_PAIRS = {"sin": (False, False), "cos": (False, True), "sinh": (True, False), "cosh": (True, True)}


@final
@dataclass(frozen=True, slots=True, eq=False)
class Tape:
    """A smooth SX function; `start` gives its operations on given input series."""

    graph: Graph

    @classmethod
    def of(cls, function: ca.Function) -> Tape:
        """Read the function's instructions."""
        return cls(graph_of(function))

    def start(self, inputs: Sequence[Sequence[Series]]) -> Running:
        """Operations on the series inputs[j][k] of entry k of input j."""
        builder = _Builder(inputs)
        values = [builder.value(node) for node in self.graph.nodes]
        outputs = [[values[index] for index in row] for row in self.graph.outputs]
        return Running(builder.operations, outputs)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Running:
    """Operations in the order of evaluation, and the series of each output entry."""

    operations: list[Operation]
    outputs: list[list[Series]]

    def extend(self, k: int) -> None:
        """Fill order k of every value; the inputs' orders 0 .. k are there."""
        for operation in self.operations:
            if operation.series.has(k):
                operation.extend(k)


class _Builder:
    """Appends operations while it walks the graph."""

    def __init__(self, inputs: Sequence[Sequence[Series]]) -> None:
        self._inputs = inputs
        first = next(series for row in inputs for series in row)
        self._algebra: Algebra = first.algebra
        self._batch = first.coef.shape[1]
        self._values: list[Series] = []
        self._pairs: dict[tuple[int, bool], Pair] = {}
        # Exact numbers that are there before order 0 is computed: constants and number inputs.
        self._given = {id(s) for row in inputs for s in row if s.number}
        self.operations: list[Operation] = []

    def value(self, node: Node) -> Series:
        series = self._of(node)
        self._values.append(series)
        return series

    def _of(self, node: Node) -> Series:
        if node.element is not None:
            return self._inputs[node.element[0]][node.element[1]]
        if node.constant is not None:
            return self._constant(node.constant)
        operands = [self._values[index] for index in node.operands]
        name = node.name
        if name in _PAIRS:
            return self._paired(node.operands[0], operands[0], *_PAIRS[name])
        if name in _PRIMITIVES:
            return self._add(*primitive(name, operands[0]))
        if len(operands) == 1:
            return self._unary(name, operands[0])
        return self._binary(name, operands[0], operands[1])

    def _unary(self, name: str, a: Series) -> Series:
        simple: dict[str, Operation] = {}
        match name:
            case "neg":
                simple[name] = Linear((-1.0, a))
            case "twice":
                simple[name] = Linear((2.0, a))
            case "sq":
                simple[name] = Product(a, a)
            case "inv":
                simple[name] = Inverse(a)
            case "sqrt":
                simple[name] = Root(a)
            case "exp":
                simple[name] = Exponential(a)
            case "tan" | "tanh":
                simple[name] = Tangent(a, hyperbolic=name == "tanh")
            case _:
                raise InputError(f"no Taylor recurrence for the operation {name!r}")
        return self._add(simple[name])

    def _binary(self, name: str, a: Series, b: Series) -> Series:
        match name:
            case "add":
                return self._add(Linear((1.0, a), (1.0, b)))
            case "sub":
                return self._add(Linear((1.0, a), (-1.0, b)))
            case "mul":
                return self._add(Product(a, b))
            case "div":
                inverse = Inverse(b)
                return self._add(inverse, Product(a, inverse.series))
            case "pow" | "constpow":
                return self._power(a, b)
            case "atan2":
                return self._angle(a, b)
            case _:
                raise InputError(f"no Taylor recurrence for the operation {name!r}")

    def _angle(self, y: Series, x: Series) -> Series:
        squares = Product(y, y), Product(x, x)
        total = Linear(*((1.0, square.series) for square in squares))
        return self._add(*squares, total, Angle(y, x, total.series))

    def _power(self, base: Series, exponent: Series) -> Series:
        known = exponent.coef[0][0, 0]
        if id(exponent) not in self._given or np.any(exponent.coef[0][:, 0] != known):
            logarithm = primitive("log", base)
            product = Product(exponent, logarithm[-1].series)
            return self._add(*logarithm, product, Exponential(product.series))
        whole = float(known).is_integer() and abs(known) <= HIGHEST_POWER
        if not whole:
            return self._add(Power(base, float(known)))
        result = self._repeated(base, abs(int(known)))
        return self._add(Inverse(result)) if known < 0 else result

    def _repeated(self, base: Series, exponent: int) -> Series:
        if exponent == 0:
            return self._constant(1.0)
        if exponent == 1:
            return base
        half = self._repeated(base, exponent // 2)
        square = self._add(Product(half, half))
        return self._add(Product(square, base)) if exponent % 2 else square

    def _paired(self, operand: int, a: Series, hyperbolic: bool, even: bool) -> Series:
        key = (operand, hyperbolic)
        if key not in self._pairs:
            self._pairs[key] = Pair(a, hyperbolic=hyperbolic)
            self._add(self._pairs[key])
        return Even(self._pairs[key]).series if even else self._pairs[key].series

    def _constant(self, value: float) -> Series:
        made = Series.constant(self._algebra, np.full(self._batch, value), np.zeros(self._batch))
        self._given.add(id(made))
        return made

    def _add(self, *operations: Operation) -> Series:
        self.operations.extend(operations)
        return operations[-1].series
