"""Random SX graphs and boxes for them."""

from __future__ import annotations

import random
from collections.abc import Callable

import casadi as ca
import numpy as np

INPUTS = 3
LITERALS = (0.1, -0.7, 1.0 / 3.0, 2.5, -3.0, 0.5, 1e-3)
EXPONENTS = (0.5, 1.5, -0.5, 2.25, 0.3, 1.7, -0.4, 7.1)


def random_function(seed: int) -> ca.Function:
    """A graph of 5 to 25 random operations on three inputs, with two outputs.

    A third of the graphs are chains: each operation takes the one before as its first operand.
    """
    rng = random.Random(seed)
    x = ca.SX.sym("x", INPUTS)
    pool: list[ca.SX] = ca.vertsplit(x)
    chain = seed % 3 == 0
    for _ in range(rng.randrange(5, 26)):
        a, b, c = (rng.choice(pool[-6:]) for _ in range(3))
        pool.append(random_operation(rng, pool[-1] if chain else a, b, c))
    return ca.Function("f", [x], [pool[-1], ca.vertcat(pool[-2], pool[-3])], ["x"], ["y", "z"])


def random_operation(rng: random.Random, a: ca.SX, b: ca.SX, c: ca.SX) -> ca.SX:
    """One of the operations with an interval rule, on operands mostly inside its domain."""
    choices = (_arithmetic, _powers, _elementary, _choices)
    family = rng.choices(choices, weights=(3, 2, 4, 3))[0]
    return rng.choice(family(rng.choice(LITERALS), rng.choice(EXPONENTS), a, b, c))()


_Family = tuple[Callable[[], ca.SX], ...]


def _arithmetic(literal: float, exponent: float, a: ca.SX, b: ca.SX, c: ca.SX) -> _Family:
    return (
        lambda: a + b,
        lambda: a - b,
        lambda: a * b,
        lambda: a * literal + b,
        lambda: literal - a,
        lambda: a / (ca.fabs(b) + 0.3),
        lambda: literal / (b * b + 0.1),
        lambda: a / literal,
        lambda: a / b,
    )


def _powers(literal: float, exponent: float, a: ca.SX, b: ca.SX, c: ca.SX) -> _Family:
    return (
        lambda: a * a,
        lambda: a**3,
        lambda: a**-2,
        lambda: ca.SX.binary(ca.OP_CONSTPOW, a, 6),
        lambda: ca.sqrt(ca.fabs(a)),
        lambda: (ca.fabs(a) + 0.05) ** exponent,
        lambda: ca.fabs(a) ** abs(exponent),
        lambda: (ca.fabs(a) + 0.1) ** ca.fmin(b, 3.0),
        lambda: (1.0 + a * a) ** ca.sin(b),
        lambda: abs(literal) ** ca.tanh(a),
    )


def _elementary(literal: float, exponent: float, a: ca.SX, b: ca.SX, c: ca.SX) -> _Family:
    return (
        lambda: ca.sin(a),
        lambda: ca.cos(a),
        lambda: ca.tan(0.2 * a),
        lambda: ca.asin(ca.fmax(-1.0, ca.fmin(a, 1.0))),
        lambda: ca.acos(ca.sin(a)),
        lambda: ca.acos(0.9 * ca.tanh(a)),
        lambda: ca.atan(a),
        lambda: ca.atan2(a, b),
        lambda: ca.atan2(a, ca.fabs(b) + 0.01),
        lambda: ca.atan2(ca.fabs(a) + 0.01, b),
        lambda: ca.sinh(ca.fmin(a, 2.0)),
        lambda: ca.cosh(ca.fmax(-2.0, ca.fmin(a, 2.0))),
        lambda: ca.tanh(a),
        lambda: ca.exp(ca.fmin(a, 2.0)),
        lambda: ca.log(ca.fabs(a) + 0.01),
    )


def _choices(literal: float, exponent: float, a: ca.SX, b: ca.SX, c: ca.SX) -> _Family:
    return (
        lambda: ca.fmin(a, b),
        lambda: ca.fmax(a, literal),
        lambda: ca.fmin(ca.fmax(a, -0.4), 0.4),
        lambda: ca.fabs(a),
        lambda: -ca.fabs(a - b),
        lambda: ca.if_else(a < b, c, b),
        lambda: ca.if_else(a > literal, b, 0.5 * b),
        lambda: ca.if_else(ca.logic_and(a <= b, ca.logic_not(c > literal)), a, c),
        lambda: ca.if_else(ca.logic_or(a < literal, b < c), a, c),
    )


def random_boxes(seed: int, count: int) -> tuple[np.ndarray, ...]:
    """Lower and upper end points (INPUTS x count) and two points in each, one with random ends.

    Half are points, a fifth of the entries have extreme sizes: denormal, tiny, large or 0.
    """
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(INPUTS, count)) * 10.0 ** rng.uniform(-2, 0.5, size=count)
    extreme = rng.choice([5e-324, 3e-310, 1e-160, 1e-20, 1e4, 1e20, 1e160, 0.0], size=points.shape)
    points = np.where(rng.uniform(size=points.shape) < 0.05, extreme * np.sign(points), points)
    radii = 10.0 ** rng.uniform(-12, 0, size=count) * rng.uniform(size=(INPUTS, count))
    radii = np.where(np.abs(points) < 1e-15, np.abs(points), radii)
    radii[:, ::2] = 0.0
    lower, upper = points - radii, points + radii
    ends = rng.integers(0, 3, size=points.shape)
    inside = np.clip(lower + rng.uniform(size=points.shape) * (upper - lower), lower, upper)
    return lower, upper, np.choose(ends, (points, lower, upper)), inside
