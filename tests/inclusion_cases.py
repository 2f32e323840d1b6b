"""Random SX graphs, boxes for them, and their exact values in 200-bit arithmetic."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from typing import Any

import casadi as ca
import flint
import numpy as np

from workbench.sensitivity.graph import graph_of

INPUTS = 3
LITERALS = (0.1, -0.7, 1.0 / 3.0, 2.5, -3.0, 0.5, 1e-3)


def random_function(seed: int, operations: int = 12) -> ca.Function:
    """A graph of random operations on three inputs, with two outputs."""
    rng = random.Random(seed)
    x = ca.SX.sym("x", INPUTS)
    pool: list[ca.SX] = ca.vertsplit(x)
    for _ in range(operations):
        a, b, c = (rng.choice(pool[-6:]) for _ in range(3))
        pool.append(_random_operation(rng, a, b, c))
    return ca.Function("f", [x], [pool[-1], ca.vertcat(pool[-2], pool[-3])], ["x"], ["y", "z"])


def _random_operation(rng: random.Random, a: ca.SX, b: ca.SX, c: ca.SX) -> ca.SX:
    literal = rng.choice(LITERALS)
    choices = (
        lambda: a + b,
        lambda: a - b,
        lambda: a * b,
        lambda: a * literal + b,
        lambda: literal - a,
        lambda: a / (ca.fabs(b) + 0.3),
        lambda: literal / (b * b + 0.1),
        lambda: a / literal,
        lambda: a * a,
        lambda: a**3,
        lambda: a**-2,
        lambda: ca.sqrt(ca.fabs(a)),
        lambda: ca.sin(a),
        lambda: ca.cos(a),
        lambda: ca.tan(0.2 * a),
        lambda: ca.atan(a),
        lambda: ca.exp(ca.fmin(a, 2.0)),
        lambda: ca.log(ca.fabs(a) + 0.01),
        lambda: ca.tanh(a),
        lambda: ca.fmin(a, b),
        lambda: ca.fmax(a, literal),
        lambda: ca.fmin(ca.fmax(a, -0.4), 0.4),
        lambda: ca.if_else(a < b, c, b),
        lambda: ca.if_else(ca.logic_and(a <= b, ca.logic_not(c > literal)), a, c),
        lambda: -ca.fabs(a),
    )
    return rng.choice(choices)()


def random_boxes(seed: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lower and upper end points (INPUTS x count) and one point in each; half are point sets."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(INPUTS, count)) * 10.0 ** rng.uniform(-2, 0.5, size=count)
    radii = 10.0 ** rng.uniform(-12, 0, size=count) * rng.uniform(size=(INPUTS, count))
    radii[:, ::2] = 0.0
    lower, upper = points - radii, points + radii
    ends = rng.integers(0, 3, size=points.shape)
    return lower, upper, np.choose(ends, (points, lower, upper))


def exact_values(function: ca.Function, point: Sequence[float]) -> list[Any] | None:
    """All outputs at `point` in ball arithmetic; None where a ball cannot decide a comparison."""
    graph = graph_of(function)
    values: list[Any] = []
    for node in graph.nodes:
        if node.element is not None:
            values.append(flint.arb(float(point[node.element[1]])))
        elif node.constant is not None:
            values.append(flint.arb(node.constant))
        else:
            value = _exact(node.name, [values[index] for index in node.operands])
            if value is None:
                return None
            values.append(value)
    return [values[index] for row in graph.outputs for index in row]


def _truth(true: bool, false: bool) -> Any:
    return flint.arb(int(true)) if true or false else None


def _exact(name: str, operands: list[Any]) -> Any:
    a, b = operands[0], operands[-1]
    simple = {
        "add": lambda: a + b,
        "sub": lambda: a - b,
        "mul": lambda: a * b,
        "div": lambda: a / b,
        "inv": lambda: 1 / a,
        "neg": lambda: -a,
        "sq": lambda: a * a,
        "twice": lambda: 2 * a,
        "fabs": lambda: abs(a),
        "fmin": lambda: a.min(b),
        "fmax": lambda: a.max(b),
        "lt": lambda: _truth(a < b, a >= b),
        "le": lambda: _truth(a <= b, a > b),
        "not": lambda: 1 - a,
        "and": lambda: a * b,
        "or": lambda: a.max(b),
        "if_else_zero": lambda: b if a != 0 else flint.arb(0),
    }
    return simple[name]() if name in simple else getattr(a, name)()


def violations(
    function: ca.Function, lifted: ca.Function, boxes: tuple[np.ndarray, ...]
) -> tuple[int, int]:
    """(number of exact values certainly outside their valid bounds, number of those examined)."""
    lower, upper, points = boxes
    *ends, valid = (np.array(part) for part in lifted.map(lower.shape[1])(lower, upper))
    lows, highs = np.vstack(ends[0::2]), np.vstack(ends[1::2])
    wrong = examined = 0
    for k in range(lower.shape[1]):
        exact = exact_values(function, points[:, k]) if valid[0, k] else None
        for index, value in enumerate(exact or []):
            examined += 1
            low, high = flint.arb(lows[index, k]), flint.arb(highs[index, k])
            finite = math.isfinite(lows[index, k]) and math.isfinite(highs[index, k])
            wrong += not finite or bool(value < low) or bool(value > high)
    return wrong, examined
