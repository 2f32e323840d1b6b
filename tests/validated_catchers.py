"""Counts of what a validated computation misses; 0 where it is sound.

The tests demand 0; planted faults must make at least one of these positive.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from fractions import Fraction

import casadi as ca
import numpy as np
import numpy.typing as npt
from validated_balls import Inputs, escapes

from workbench.reach.validated.algebra import Algebra
from workbench.reach.validated.composition import Operation
from workbench.reach.validated.lines import chebyshev_line
from workbench.reach.validated.operations import Linear, Product
from workbench.reach.validated.series import Series

Array = npt.NDArray[np.float64]

OPERATIONS: dict[str, tuple[Callable[[ca.SX, ca.SX], ca.SX], tuple[float, float]]] = {
    "sum": (lambda x, y: x + y, (0.7, -0.3)),
    "difference": (lambda x, y: x - y, (0.7, 0.9)),
    "product": (lambda x, y: x * y, (0.7, -0.3)),
    "square": (lambda x, y: x * x, (0.7, 0.9)),
    "quotient": (lambda x, y: x / y, (0.7, -1.3)),
    "inverse": (lambda x, y: 1 / x, (1.7, 0.9)),
    "constants": (lambda x, y: 2 * x - 0.1 * y + 0.3, (0.7, 0.9)),
    "sqrt": (lambda x, y: ca.sqrt(x), (1.7, 0.9)),
    "exp": (lambda x, y: ca.exp(x), (0.7, 0.9)),
    "log": (lambda x, y: ca.log(x), (1.4, 0.9)),
    "sin": (lambda x, y: ca.sin(x), (0.7, 0.9)),
    "cos and sin": (lambda x, y: ca.cos(x) + ca.sin(x), (2.7, 0.9)),
    "tan": (lambda x, y: ca.tan(x), (0.6, 0.9)),
    "asin": (lambda x, y: ca.asin(x), (0.3, 0.9)),
    "acos": (lambda x, y: ca.acos(x), (-0.2, 0.9)),
    "atan": (lambda x, y: ca.atan(x), (-2.0, 0.9)),
    "sinh": (lambda x, y: ca.sinh(x), (0.7, 0.9)),
    "cosh": (lambda x, y: ca.cosh(x), (0.7, 0.9)),
    "tanh": (lambda x, y: ca.tanh(x), (0.7, 0.9)),
    "fifth power": (lambda x, y: x**5, (0.7, 0.9)),
    "inverse cube": (lambda x, y: x**-3, (1.5, 0.9)),
    "real power": (lambda x, y: x**1.7, (1.5, 0.9)),
    "negative real power": (lambda x, y: x**-0.3, (1.5, 0.9)),
    "power of a series": (lambda x, y: x**y, (1.5, 0.9)),
    "atan2, first quadrant": (ca.atan2, (1.0, 0.9)),
    "atan2, second quadrant": (ca.atan2, (1.0, -0.9)),
    "atan2, third quadrant": (ca.atan2, (-1.5, -0.9)),
    "atan2, fourth quadrant": (ca.atan2, (-0.5, 1.9)),
    "nested": (
        lambda x, y: ca.sin(x * y) / (2 + ca.cos(x)) + ca.exp(-y) * ca.sqrt(1 + x * x),
        (0.5, 0.9),
    ),
}


def operation(name: str) -> ca.Function:
    """An entry of `OPERATIONS` as a function of one vector."""
    x = ca.SX.sym("x", 2)
    return ca.Function("operation", [x], [OPERATIONS[name][0](x[0], x[1])])


def points_escape(name: str, *, orders: int = 14, seeds: int = 3) -> int:
    """Exact coefficients outside for point sets, where nothing but rounding is in the radii."""
    algebra = Algebra.of(deep=0, degree=0, shallow=2)
    found = 0
    for seed in range(seeds):
        inputs = Inputs.random(
            algebra, OPERATIONS[name][1], (0.0, 0.0), orders=orders, seed=100 + seed
        )
        found += escapes(operation(name), inputs, deviations=1)
    return found


def _pure(algebra: Algebra, radius: float) -> Series:
    made = Series(algebra, 1, 1)
    made.give(0, np.zeros((1, algebra.size)), np.array([radius]))
    return made


def rounded_radii(count: int = 300) -> int:
    """How often the radius of a sum or product of radii is below the exact one."""
    algebra = Algebra.of(deep=1, degree=1, shallow=0)
    rng = np.random.default_rng(11)
    below = 0
    for first, second in rng.uniform(0.1, 1.0, (count, 2)):
        a, b = _pure(algebra, first), _pure(algebra, second)
        exact = Fraction(first) + Fraction(second), Fraction(first) * Fraction(second)
        operations: tuple[Operation, ...] = Linear((1.0, a), (1.0, b)), Product(a, b)
        for made, least in zip(operations, exact, strict=True):
            made.extend(0)
            below += Fraction(float(made.series.radius[0, 0])) < least
    return below


def underflowing(count: int = 50) -> int:
    """How many products far below the normal numbers are lost."""
    algebra = Algebra.of(deep=0, degree=0, shallow=0)
    rng = np.random.default_rng(12)
    lost = 0
    for first, second in 1e-165 * rng.uniform(0.1, 1.0, (count, 2)):
        a, b = Series(algebra, 1, 1), Series(algebra, 1, 1)
        a.give(0, np.array([[first]]), np.zeros(1))
        b.give(0, np.array([[second]]), np.zeros(1))
        product = Product(a, b)
        product.extend(0)
        error = abs(Fraction(first) * Fraction(second) - Fraction(product.series.coef[0, 0, 0]))
        lost += error > Fraction(float(product.series.radius[0, 0]))
    return lost


def unbounded_values(algebra: Algebra, coefficients: Array, radius: float) -> int:
    """Values of a polynomial beyond its bounds: vertices, turning points, zero; exact rationals."""
    ends = [float(end[0]) for end in algebra.bounds(coefficients[None, :], np.array([radius]))]
    if not np.isfinite(ends).all():
        return 0
    low, high = map(Fraction, ends)
    exact = [Fraction(float(c)) for c in coefficients]
    choices = [[Fraction(-1), Fraction(0), Fraction(1)] for _ in range(algebra.exponents.shape[1])]
    if algebra.degree >= 2:
        for v, k in enumerate(algebra.squares):
            if exact[k]:
                turn = -exact[1 + v] / (2 * exact[k])
                choices[v].append(max(Fraction(-1), min(Fraction(1), turn)))
    beyond = 0
    for point in itertools.product(*choices):
        total = Fraction(0)
        for c, row in zip(exact, algebra.exponents, strict=True):
            term = c
            for x, power in zip(point, row, strict=True):
                term *= x ** int(power)
            total += term
        beyond += total - Fraction(radius) < low or total + Fraction(radius) > high
    return beyond


def line_violations(seed: int, scale: float, count: int = 300) -> int:
    """Lines through random clips that miss the clip somewhere by more than their gap."""
    rng = np.random.default_rng(seed)
    low, floor = rng.normal(size=(2, count)) * scale
    widths = np.abs(rng.normal(size=(2, count))) * scale * 10 ** rng.uniform(-18, 1, (2, count))
    high, ceiling = low + widths[0], floor + widths[1]
    low[:20], high[20:40] = floor[:20], floor[20:40]
    high[40:60], low[60:80] = ceiling[40:60], ceiling[60:80]
    low, high = np.minimum(low, high), np.maximum(low, high)
    missed = 0
    lines = chebyshev_line(low, high, floor, ceiling)
    for row in zip(*lines, low, high, floor, ceiling, strict=True):
        slope, offset, gap, start, end, least, most = (Fraction(float(v)) for v in row)
        for d in (start, end, min(max(least, start), end), min(max(most, start), end)):
            missed += abs(min(max(d, least), most) - slope * d - offset) > gap
    return missed


def bounds_missed() -> int:
    """Values beyond the bounds of random polynomials of one deep and one shallow variable."""
    algebra = Algebra.of(deep=1, degree=2, shallow=1)
    rng = np.random.default_rng(6)
    return sum(unbounded_values(algebra, rng.normal(size=algebra.size), 0.0) for _ in range(100))


def tiny_bounds_missed() -> int:
    """The same of d + d^2 far below and far above the numbers whose squares are normal."""
    algebra = Algebra.of(deep=1, degree=2, shallow=0)
    sizes = (1e-170, 1e-250, 1e-305, 1e160, 4e307)
    return sum(unbounded_values(algebra, s * np.array([0.0, 1.0, 1.0]), 0.0) for s in sizes)
