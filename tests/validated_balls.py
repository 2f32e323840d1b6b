"""Taylor coefficients of SX expressions for one deviation at a time, over 200-bit balls.

Power series of the library python-flint: no recurrence, remainder or rounding of ours is in them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import casadi as ca
import flint
import numpy as np
import numpy.typing as npt

from workbench.models.graph import Graph
from workbench.reach.validated.algebra import Algebra
from workbench.reach.validated.series import Series
from workbench.reach.validated.tape import Tape

Ball = Any
BallSeries = Any
Array = npt.NDArray[np.float64]


@contextmanager
def precise(orders: int = 10, bits: int = 200) -> Iterator[None]:
    """Ball arithmetic with that many bits, and power series with that many terms."""
    before = flint.ctx.prec, flint.ctx.cap
    flint.ctx.prec, flint.ctx.cap = bits, orders
    try:
        yield
    finally:
        flint.ctx.prec, flint.ctx.cap = before


def _sinh(a: BallSeries) -> BallSeries:
    return (a.exp() - (-a).exp()) / 2


def _cosh(a: BallSeries) -> BallSeries:
    return (a.exp() + (-a).exp()) / 2


def _atan2(y: BallSeries, x: BallSeries) -> BallSeries:
    """The angle at the start plus the arc tangent of the turn since then."""
    y0, x0 = y[0], x[0]
    turned = ((y * x0 - x * y0) / (x * x0 + y * y0)).atan()
    return turned + flint.arb.atan2(y0, x0)


def _power(a: BallSeries, b: BallSeries) -> BallSeries:
    exponent = b[0].unique_fmpz() if b[0].is_exact() and b.length() <= 1 else None
    if exponent is None:
        return (b * a.log()).exp()
    result = flint.arb_series([1])
    for _ in range(abs(int(exponent))):
        result = result * a
    return 1 / result if exponent < 0 else result


_RULES: dict[str, Callable[..., BallSeries]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "inv": lambda a: 1 / a,
    "neg": lambda a: -a,
    "sq": lambda a: a * a,
    "twice": lambda a: 2 * a,
    "pow": _power,
    "constpow": _power,
    "atan2": _atan2,
    "sinh": _sinh,
    "cosh": _cosh,
    "tanh": lambda a: _sinh(a) / _cosh(a),
    **{
        name: getattr(flint.arb_series, name)
        for name in ("sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sqrt")
    },
}


def coefficients(graph: Graph, inputs: Sequence[Sequence[Sequence[Ball]]]) -> list[list[Ball]]:
    """Taylor coefficients of every output; inputs[j][i] are those of entry i of input j."""
    count = len(inputs[0][0])
    values: list[BallSeries] = []
    for node in graph.nodes:
        if node.element is not None:
            j, i = node.element
            values.append(flint.arb_series(list(inputs[j][i])))
        elif node.constant is not None:
            values.append(flint.arb_series([flint.arb(node.constant)]))
        else:
            values.append(_RULES[node.name](*[values[k] for k in node.operands]))
    return [[values[i][k] for k in range(count)] for row in graph.outputs for i in row]


@dataclass(frozen=True)
class Inputs:
    """Random series with full mantissas: member b deviates by about sizes[b], radii alike.

    radius_share: of the size; 0 leaves only the deviation, and a size of 0 a point, so that nothing
    but rounding is left in the radii.
    """

    algebra: Algebra
    series: list[Series]

    @classmethod
    def random(
        cls,
        algebra: Algebra,
        centers: Sequence[float],
        sizes: Sequence[float],
        *,
        orders: int,
        seed: int,
        radius_share: float = 0.05,
    ) -> Inputs:
        rng = np.random.default_rng(seed)
        scale = np.array(sizes)
        made = []
        for center in centers:
            series = Series(algebra, orders, len(sizes))
            for k in range(orders):
                # Clipped, so that the sizes say for certain what stays within a domain.
                shape = len(sizes), algebra.size
                coef = np.clip(rng.normal(size=shape), -1.5, 1.5) * scale[:, None]
                coef /= 0.5 * algebra.size
                coef[:, 0] = center * rng.uniform(0.97, 1.03) if k == 0 else rng.normal() * 0.7**k
                radius = radius_share * scale * rng.uniform(0, 1, len(sizes))
                series.fill(k, coef, radius)
            made.append(series)
        return cls(algebra, made)

    def outputs(self, function: ca.Function) -> tuple[Graph, list[Series]]:
        """The graph of a function of one vector, and the series of its outputs."""
        tape = Tape.of(function)
        running = tape.start([self.series])
        for k in range(len(self.series[0].coef)):
            running.extend(k)
        return tape.graph, [series for row in running.outputs for series in row]


def escapes(function: ca.Function, inputs: Inputs, *, deviations: int = 3, seed: int = 1) -> int:
    """How many exact coefficients lie outside: over members, deviations and admissible errors."""
    orders = len(inputs.series[0].coef)
    rng = np.random.default_rng(seed)
    found = 0
    with precise(orders):
        graph, outputs = inputs.outputs(function)
        for b in range(inputs.series[0].coef.shape[1]):
            for trial in range(deviations):
                drawn = rng.uniform(-1.0, 1.0, (1, inputs.algebra.exponents.shape[1]))
                d = np.sign(drawn) if trial % 2 else drawn
                monomials = monomial_values(inputs.algebra, d[0])
                arguments = [
                    [
                        value(s, k, b, monomials)
                        + flint.arb(float(s.radius[k, b])) * rng.choice([-1, 1])
                        for k in range(orders)
                    ]
                    for s in inputs.series
                ]
                exact = coefficients(graph, [arguments])
                found += sum(
                    outside(series, k, b, monomials, row[k])
                    for series, row in zip(outputs, exact, strict=True)
                    for k in range(orders)
                )
    return found


def monomial_values(algebra: Algebra, deviation: Array) -> list[Ball]:
    """Every monomial at one deviation."""
    balls = [flint.arb(float(v)) for v in deviation]
    result = []
    for row in algebra.exponents:
        product = flint.arb(1)
        for ball, exponent in zip(balls, row, strict=True):
            product *= ball ** int(exponent)
        result.append(product)
    return result


def value(series: Series, k: int, b: int, monomials: Sequence[Ball]) -> Ball:
    """The polynomial of order k of member b."""
    coef = series.coef[k, b]
    terms = [flint.arb(float(c)) * m for c, m in zip(coef, monomials, strict=True) if c]
    return sum(terms, flint.arb(0))


def outside(series: Series, k: int, b: int, monomials: Sequence[Ball], exact: Ball) -> bool:
    """Whether `exact` is certainly farther from the polynomial than the radius, or that is NaN."""
    assert exact.is_finite(), "the reference has no value here: choose other inputs"
    if not series.has(k):
        return bool(abs(exact) > 0)
    radius = float(series.radius[k, b])
    if not (np.isfinite(radius) and np.isfinite(series.coef[k, b]).all()):
        return True
    return bool(abs(exact - value(series, k, b, monomials)) > flint.arb(radius))
