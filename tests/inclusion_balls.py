"""Values and ranges of SX graphs in ball arithmetic, to hold inclusion functions against."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import flint
import numpy as np

from workbench.models.graph import Graph, graph_of

Ball = Any


def _truth(true: bool, false: bool) -> Ball:
    """1, 0, or the ball [0, 1] of an undecided comparison."""
    if true or false:
        return flint.arb(int(true))
    return flint.arb(0).union(flint.arb(1))


def _chosen(condition: Ball, value: Ball) -> Ball:
    if condition == 0:
        return flint.arb(0)
    return value if condition != 0 else value.union(flint.arb(0))


def _power(base: Ball, exponent: Ball) -> Ball:
    whole = exponent.unique_fmpz() if exponent.is_exact() else None
    return base ** int(whole) if whole is not None else base**exponent


_OPERATIONS: dict[str, Callable[..., Ball]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "inv": lambda a: 1 / a,
    "neg": lambda a: -a,
    "sq": lambda a: a**2,
    "twice": lambda a: 2 * a,
    "fabs": abs,
    "fmin": lambda a, b: a.min(b),
    "fmax": lambda a, b: a.max(b),
    "lt": lambda a, b: _truth(a < b, a >= b),
    "le": lambda a, b: _truth(a <= b, a > b),
    "not": lambda a: 1 - a,
    "and": lambda a, b: a * b,
    "or": lambda a, b: a.max(b),
    "if_else_zero": _chosen,
    "pow": _power,
    "constpow": _power,
    "atan2": lambda a, b: flint.arb.atan2(a, b),
    **{
        name: getattr(flint.arb, name)
        for name in (
            "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log",
            "sqrt",
        )
    },
}  # fmt: skip


def _outside_power(base: Ball, exponent: Ball) -> bool:
    whole = exponent.is_exact() and exponent.unique_fmpz() is not None
    return (base < 0 and not whole) or (base == 0 and exponent <= 0)


# Operands that are certainly outside the domain.
_OUTSIDE: dict[str, Callable[..., bool]] = {
    "sqrt": lambda a: a < 0,
    "log": lambda a: a <= 0,
    "asin": lambda a: abs(a) > 1,
    "acos": lambda a: abs(a) > 1,
    "inv": lambda a: a == 0,
    "div": lambda a, b: b == 0,
    "atan2": lambda y, x: y == 0 and x <= 0,
    "pow": _outside_power,
    "constpow": _outside_power,
}


def node_values(graph: Graph, point: Sequence[Ball]) -> list[Ball]:
    """All nodes of the graph where its one input is `point`."""
    values: list[Ball] = []
    for node in graph.nodes:
        if node.element is not None:
            values.append(point[node.element[1]])
        elif node.constant is not None:
            values.append(flint.arb(node.constant))
        else:
            values.append(_OPERATIONS[node.name](*[values[k] for k in node.operands]))
    return values


def evaluated(graph: Graph, point: Sequence[Ball]) -> list[Ball]:
    """All outputs of the graph where its one input is `point`."""
    values = node_values(graph, point)
    return [values[index] for row in graph.outputs for index in row]


def evaluated_at(graph: Graph, point: np.ndarray) -> list[Ball] | None:
    """All outputs at one point, with many more bits where a domain is undecided.

    None where some operation is certainly outside its domain.
    """
    exact = [flint.arb(float(value)) for value in point]
    found = evaluated(graph, exact)
    if all(value.is_finite() for value in found):
        return found
    with flint.ctx.workprec(4000):
        values = node_values(graph, exact)
        for node in graph.nodes:
            outside = _OUTSIDE.get(node.name)
            if outside is not None and outside(*[values[k] for k in node.operands]):
                return None
        return [values[index] for row in graph.outputs for index in row]


@dataclass
class Tally:
    """What was found over many boxes."""

    boxes: int = 0
    valid: int = 0
    examined: int = 0
    undecided: int = 0
    wrong: int = 0
    missed: int = 0
    ratios: list[float] = field(default_factory=list)

    def add(
        self, function: ca.Function, lifted: ca.Function, boxes: tuple[np.ndarray, ...]
    ) -> None:
        """Hold bounds on boxes (lower, upper) against the values at the points in them.

        wrong: values certainly outside valid bounds, bounds that are not finite, points certainly
        outside a domain; undecided: values that 4000 bits do not give, because balls cannot show
        that equal numbers are equal; missed: boxes with bounds of the balls, but not of ours.
        """
        lower, upper, *points = boxes
        graph = graph_of(function)
        *ends, valid = (np.array(part) for part in lifted(lower, upper))
        lows, highs = np.vstack(ends[0::2]), np.vstack(ends[1::2])
        for k in range(lower.shape[1]):
            self.boxes += 1
            if not valid[0, k]:
                self.missed += self._has_range(graph, lower[:, k], upper[:, k])
                continue
            self.valid += 1
            for point in points:
                exact = evaluated_at(graph, point[:, k])
                if exact is None:
                    self.wrong += 1
                else:
                    self._compare(exact, lows[:, k], highs[:, k])

    def _compare(self, exact: list[Ball], lows: np.ndarray, highs: np.ndarray) -> None:
        for value, low, high in zip(exact, lows, highs, strict=True):
            self.examined += 1
            if not (math.isfinite(low) and math.isfinite(high)):
                self.wrong += 1
            elif not value.is_finite():
                self.undecided += 1
            else:
                self.wrong += bool(value < flint.arb(low)) or bool(value > flint.arb(high))

    def _has_range(self, graph: Graph, lower: np.ndarray, upper: np.ndarray) -> bool:
        return all(ball.is_finite() for ball in evaluated(graph, balls(lower, upper)))

    def compare_widths(
        self, function: ca.Function, lifted: ca.Function, boxes: tuple[np.ndarray, ...]
    ) -> None:
        """Collect (our width) / (width of the balls) where the box and the range have a width."""
        lower, upper = boxes[0][:, 1::2], boxes[1][:, 1::2]
        graph = graph_of(function)
        *ends, valid = (np.array(part) for part in lifted(lower, upper))
        lows, highs = np.vstack(ends[0::2]), np.vstack(ends[1::2])
        for k in np.flatnonzero(valid[0]):
            for index, ball in enumerate(evaluated(graph, balls(lower[:, k], upper[:, k]))):
                width, size = 2.0 * float(ball.rad()), abs(float(ball.mid()))
                if math.isfinite(width) and width > 1e-9 * size and width > 1e-150:
                    self.ratios.append((highs[index, k] - lows[index, k]) / width)


def balls(lower: np.ndarray, upper: np.ndarray) -> list[Ball]:
    """The smallest balls around the intervals."""
    return [
        flint.arb(float(a)).union(flint.arb(float(b))) for a, b in zip(lower, upper, strict=True)
    ]


def tally_of(function: ca.Function, lifted: ca.Function, boxes: tuple[np.ndarray, ...]) -> Tally:
    """The tally of one function."""
    tally = Tally()
    tally.add(function, lifted, boxes)
    return tally
