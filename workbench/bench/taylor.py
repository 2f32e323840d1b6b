"""Taylor coefficients of a solution by recurrences over the instructions of the field.

With x(t + s) = sum_k x_k s^k every node of the graph is such a series too, and
(k + 1) x_{k+1} = f_k gives the next coefficient of the state from those of the field. Nothing is
differentiated symbolically, and no code is shared with the tubes.
Source: E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential Equations I, section I.8;
A. Griewank, A. Walther, Evaluating Derivatives, chapter 13.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, final

import casadi as ca

from workbench.errors import InputError
from workbench.models.graph import Node, graph_of


class Algebra(Protocol):
    """Numbers that the recurrences run in, beside their operators + - * / and * and / by an int."""

    def number(self, value: float) -> Any:
        """The constant `value`."""

    def sine_cosine(self, angle: Any) -> tuple[Any, Any]:
        """Both of one number."""

    def convolve(self, left: Sequence[Any], right: Sequence[Any]) -> Any:
        """sum_j left[j] right[n-1-j] for two sequences of length n >= 1."""

    def least(self, sides: tuple[Any, Any], branch: tuple[Any, Any], order: int) -> Any:
        """Coefficient `order` of a minimum: branch[0] where sides[0] < sides[1], else branch[1]."""


@final
@dataclass(frozen=True, slots=True)
class Expansion:
    """state[k][i]: coefficient k of state i; kinks: series of both sides of each minimum that
    depends on the state."""

    state: list[list[Any]]
    kinks: list[tuple[list[Any], list[Any]]]


@final
@dataclass(frozen=True, slots=True)
class TaylorField:
    """The recurrences of one field (x, p, w) -> dx.

    nodes: its instructions, in an order of evaluation; outputs[i]: the node of dx_i; kinks: the
    nodes that take a minimum, maximum or absolute value of something that depends on the state, in
    the order in which expansions report them. Parameters and disturbances are constant over an
    expansion.
    """

    nodes: tuple[Node, ...]
    outputs: tuple[int, ...]
    kinks: tuple[int, ...] = field(init=False)
    _varying: list[bool] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        varying: list[bool] = []
        for node in self.nodes:
            of_state = node.element is not None and node.element[0] == 0
            varying.append(of_state or any(varying[k] for k in node.operands))
        kinks = (k for k, node in enumerate(self.nodes) if node.name in _KINKS and varying[k])
        object.__setattr__(self, "_varying", varying)
        object.__setattr__(self, "kinks", tuple(kinks))

    def expand(self, algebra: Algebra, inputs: tuple[Sequence[Any], ...], order: int) -> Expansion:
        """Coefficients 0..order of the solution that starts at x, with inputs = (x, p, w)."""
        run = _Run(algebra, self._varying)
        state = [list(inputs[0])]
        for k in range(order):
            for index, node in enumerate(self.nodes):
                if k == 0 or self._varying[index]:
                    run.series[index].append(_coefficient(run, node, index, (k, state, inputs)))
            state.append([run.at(node, k) / (k + 1) for node in self.outputs])
        return Expansion(state, list(run.kinks.values()))


def taylor_field(function: ca.Function) -> TaylorField:
    """The recurrences of an SX Function (x, p, w) -> dx.

    Operations: + - * / neg, sq, twice, inv, sin, cos, tan, fmin, fmax, fabs; others raise
    InputError.
    """
    graph = graph_of(function)
    unknown = sorted({node.name for node in graph.nodes} - {"const", "input", *_RULES})
    if unknown:
        raise InputError(
            f"expected a field of {', '.join(sorted(_RULES))}, got {', '.join(unknown)}; "
            "write it with these operations"
        )
    return TaylorField(graph.nodes, graph.outputs[0])


@final
class _Run:
    """The series of all nodes of one expansion; nodes that do not vary have one coefficient."""

    __slots__ = ("algebra", "angles", "kinks", "series", "squares", "varying")

    def __init__(self, algebra: Algebra, varying: list[bool]) -> None:
        self.algebra, self.varying = algebra, varying
        self.series: list[list[Any]] = [[] for _ in varying]
        self.angles: dict[int, tuple[list[Any], list[Any], list[Any]]] = {}
        self.squares: dict[int, list[Any]] = {}
        self.kinks: dict[int, tuple[list[Any], list[Any]]] = {}

    def at(self, node: int, k: int) -> Any:
        """Coefficient k of a node."""
        series = self.series[node]
        return series[k] if k == 0 or self.varying[node] else series[0] * 0

    def product(self, a: int, b: int, k: int) -> Any:
        """Coefficient k of the product of two nodes."""
        left, right = self.series[a], self.series[b]
        if k == 0:
            return left[0] * right[0]
        if not self.varying[a]:
            return right[k] * left[0]
        if not self.varying[b]:
            return left[k] * right[0]
        return self.algebra.convolve(left, right)

    def angle(self, node: int, k: int) -> tuple[list[Any], list[Any], list[Any]]:
        """Series of sine, cosine and derivative of the angle, up to k, k and k - 1."""
        sine, cosine, slope = self.angles.setdefault(node, ([], [], []))
        if len(sine) > k:
            return sine, cosine, slope
        angle = self.series[node]
        if k == 0:
            first = self.algebra.sine_cosine(angle[0])
        else:
            slope.append(angle[k] * k)
            convolve = self.algebra.convolve
            first = convolve(slope, cosine) / k, convolve(slope, sine) / -k
        sine.append(first[0])
        cosine.append(first[1])
        return sine, cosine, slope


def _coefficient(
    run: _Run, node: Node, index: int, now: tuple[int, list[list[Any]], tuple[Sequence[Any], ...]]
) -> Any:
    k, state, inputs = now
    if node.constant is not None:
        return run.algebra.number(node.constant)
    if node.element is not None:
        which, position = node.element
        return inputs[which][position] if which else state[k][position]
    return _RULES[node.name](run, k, index, node.operands)


def _add(run: _Run, k: int, _index: int, operands: tuple[int, ...]) -> Any:
    a, b = operands
    if k and not run.varying[a]:
        return run.series[b][k]
    return run.series[a][k] + run.series[b][k] if not k or run.varying[b] else run.series[a][k]


def _sub(run: _Run, k: int, _index: int, operands: tuple[int, ...]) -> Any:
    a, b = operands
    if k and not run.varying[a]:
        return -run.series[b][k]
    return run.series[a][k] - run.series[b][k] if not k or run.varying[b] else run.series[a][k]


def _div(run: _Run, k: int, index: int, operands: tuple[int, ...]) -> Any:
    a, b = operands
    numerator, divisor = run.at(a, k), run.series[b]
    if k and run.varying[b]:
        numerator = numerator - run.algebra.convolve(divisor[1:], run.series[index])
    return numerator / divisor[0]


def _inv(run: _Run, k: int, index: int, operands: tuple[int, ...]) -> Any:
    divisor = run.series[operands[0]]
    if k == 0:
        return run.algebra.number(1.0) / divisor[0]
    return -run.algebra.convolve(divisor[1:], run.series[index]) / divisor[0]


def _tan(run: _Run, k: int, index: int, operands: tuple[int, ...]) -> Any:
    """From t' = (1 + t^2) a'."""
    if k == 0:
        sine, cosine, _ = run.angle(operands[0], 0)
        return sine[0] / cosine[0]
    tangent, square = run.series[index], run.squares.setdefault(index, [])
    square.append(run.algebra.convolve(tangent, tangent))
    slope = run.angle(operands[0], k)[2]
    return (slope[k - 1] + run.algebra.convolve(slope, square)) / k


def _extreme(sign: int) -> Callable[[_Run, int, int, tuple[int, ...]], Any]:
    """The minimum (sign 1), or the maximum as the minimum of the opposites (sign -1)."""

    def rule(run: _Run, k: int, index: int, operands: tuple[int, ...]) -> Any:
        values = [run.at(operand, k) * sign for operand in operands]
        return _least(run, k, index, (values[0], values[1])) * sign

    return rule


def _fabs(run: _Run, k: int, index: int, operands: tuple[int, ...]) -> Any:
    value = run.series[operands[0]][k]
    return -_least(run, k, index, (value, -value))


def _least(run: _Run, k: int, index: int, values: tuple[Any, Any]) -> Any:
    sides = run.kinks.setdefault(index, ([], [])) if run.varying[index] else ([], [])
    for side, value in zip(sides, values, strict=True):
        side.append(value)
    return run.algebra.least((sides[0][0], sides[1][0]), values, k)


_KINKS = frozenset({"fmin", "fmax", "fabs"})
_RULES: dict[str, Callable[[_Run, int, int, tuple[int, ...]], Any]] = {
    "add": _add,
    "sub": _sub,
    "mul": lambda run, k, _index, operands: run.product(operands[0], operands[1], k),
    "sq": lambda run, k, _index, operands: run.product(operands[0], operands[0], k),
    "neg": lambda run, k, _index, operands: -run.series[operands[0]][k],
    "twice": lambda run, k, _index, operands: run.series[operands[0]][k] * 2,
    "div": _div,
    "inv": _inv,
    "sin": lambda run, k, _index, operands: run.angle(operands[0], k)[0][k],
    "cos": lambda run, k, _index, operands: run.angle(operands[0], k)[1][k],
    "tan": _tan,
    "same": lambda run, k, _index, operands: run.series[operands[0]][k],
    "fmin": _extreme(1),
    "fmax": _extreme(-1),
    "fabs": _fabs,
}
