"""Recurrences of Taylor coefficients, one class per operation.

Each takes the series of its operands and fills its own, order by order. The recurrences are
identities between the coefficients of analytic functions, so they hold for every deviation at
once; order 0 is the composition with the function itself. Source: Griewank and Walther, Evaluating
Derivatives, 2nd ed., table 13.2.
"""

from __future__ import annotations

from typing import final

import numpy as np

from workbench.reach.validated.algebra import UNIT, Array
from workbench.reach.validated.composition import NUMBERS, compose
from workbench.reach.validated.series import Series, Weighted, convolution, linear


def like(*operands: Series) -> Series:
    """An empty series that varies where one of the operands does."""
    longest = max(operands, key=lambda s: len(s.coef))
    return Series(
        longest.algebra,
        len(longest.coef),
        longest.coef.shape[1],
        steady=all(s.steady for s in operands),
        number=all(s.number for s in operands),
    )


@final
class Linear:
    """sum f_i s_i with factors that are powers of two, up to sign."""

    def __init__(self, *terms: tuple[float, Series]) -> None:
        self._terms = list(terms)
        self.series = like(*(s for _, s in terms))

    def extend(self, k: int) -> None:
        """Termwise."""
        linear(self.series, k, self._terms)


@final
class Product:
    """a b."""

    def __init__(self, a: Series, b: Series) -> None:
        self._a, self._b = a, b
        self.series = like(a, b)

    def extend(self, k: int) -> None:
        """Cauchy product."""
        if self._a is self._b:
            self.series.fill(k, *square(self._a, k))
        else:
            self.series.fill(k, *convolution(self._a, self._b, k))


@final
class Inverse:
    """1 / b: b_0 q_k = -sum_{j >= 1} b_j q_{k-j}."""

    def __init__(self, b: Series) -> None:
        self._b = b
        self.series = like(b)

    def extend(self, k: int) -> None:
        """The recurrence above."""
        if k == 0:
            self.series.fill(0, *compose("inv", self._b, lambda x: [Inverse(x)]))
            return
        coef, radius = convolution(self._b, self.series, k, first=1)
        rest = like(self.series)
        rest.fill(k, -coef, radius)
        self.series.fill(k, *convolution(self.series, rest, k, first=0, last=0))


@final
class Root:
    """sqrt(a)."""

    def __init__(self, a: Series) -> None:
        self._a = a
        self.series = like(a)
        self._half_inverse: Series | None = None

    def extend(self, k: int) -> None:
        """s_k = (a_k - sum_{0 < j < k} s_j s_{k-j}) / (2 s_0)."""
        if k == 0:
            self.series.fill(0, *compose("sqrt", self._a, lambda x: [Root(x)]))
            return
        if self._half_inverse is None:
            self._half_inverse = reciprocal(self.series, 2.0)
        rest = convolution(self.series, self.series, k, first=1, last=k - 1)
        self.series.fill(k, *solved(self._a, rest, k, self._half_inverse))


@final
class Exponential:
    """e^a: k e_k = sum j a_j e_{k-j}."""

    def __init__(self, a: Series) -> None:
        self._a, self._rate = a, Weighted(a)
        self.series = like(a)

    def extend(self, k: int) -> None:
        """The recurrence above."""
        self._rate.extend(k)
        if k == 0:
            self.series.fill(0, *compose("exp", self._a, lambda x: [Exponential(x)]))
            return
        term = convolution(self._rate.series, self.series, k, first=1)
        self.series.fill(k, *over(term, k))


@final
class Pair:
    """sin and cos, or sinh and cosh: f' = a' g, g' = -+ a' f; `series` is the odd function."""

    def __init__(self, a: Series, *, hyperbolic: bool) -> None:
        self._a, self._rate = a, Weighted(a)
        self._hyperbolic = hyperbolic
        self._filled = 0
        self.series, self.even = like(a), like(a)

    def extend(self, k: int) -> None:
        """Both recurrences; nothing where order k is there."""
        if k < self._filled:
            return
        self._filled = k + 1
        self._rate.extend(k)
        if k == 0:
            self._start()
            return
        odd = convolution(self._rate.series, self.even, k, first=1)
        coef, radius = convolution(self._rate.series, self.series, k, first=1)
        self.series.fill(k, *over(odd, k))
        self.even.fill(k, *over((coef if self._hyperbolic else -coef, radius), k))

    def _start(self) -> None:
        odd, even = ("sinh", "cosh") if self._hyperbolic else ("sin", "cos")

        def pair(x: Series) -> Pair:
            return Pair(x, hyperbolic=self._hyperbolic)

        self.series.fill(0, *compose(odd, self._a, lambda x: [pair(x)]))
        self.even.fill(0, *compose(even, self._a, lambda x: [Even(pair(x))]))


@final
class Even:
    """The even function of a `Pair` as a value of its own."""

    def __init__(self, pair: Pair) -> None:
        self._pair = pair
        self.series = pair.even

    def extend(self, k: int) -> None:
        """The pair fills both."""
        self._pair.extend(k)


@final
class Tangent:
    """tan or tanh: f' = (1 +- f^2) a'."""

    def __init__(self, a: Series, *, hyperbolic: bool) -> None:
        self._a, self._rate = a, Weighted(a)
        self._hyperbolic = hyperbolic
        self.series, self._slope = like(a), like(a)

    def extend(self, k: int) -> None:
        """The recurrence above; the slope 1 +- f^2 follows one order behind."""
        self._rate.extend(k)
        if k == 0:
            name = "tanh" if self._hyperbolic else "tan"
            start = compose(name, self._a, lambda x: [Tangent(x, hyperbolic=self._hyperbolic)])
            self.series.fill(0, *start)
        else:
            term = convolution(self._rate.series, self._slope, k, first=1)
            self.series.fill(k, *over(term, k))
        if self.series.has(k):
            squared, radius = square(self.series, k)
            slope = -squared if self._hyperbolic else squared
            if k == 0:
                slope[:, 0] += 1.0
                radius = radius + UNIT * np.abs(slope[:, 0])
            self._slope.fill(k, slope, radius)


@final
class Power:
    """a^c for one real c and a > 0: a f' = c f a'."""

    def __init__(self, a: Series, exponent: float) -> None:
        self._a, self._exponent = a, exponent
        self.series = like(a)
        self._inverse: Series | None = None

    def extend(self, k: int) -> None:
        """k a_0 f_k = sum_{j >= 1} (c j - (k - j)) a_j f_{k-j}."""
        c = self._exponent
        if k == 0:
            start = compose("pow", self._a, lambda x: [Power(x, c)], exponent=c)
            self.series.fill(0, *start)
            return
        if self._inverse is None:
            self._inverse = reciprocal(self._a, 1.0)
        coef, radius = np.zeros_like(self.series.coef[0]), np.zeros_like(self.series.radius[0])
        for j in range(1, k + 1):
            term, spread = convolution(self._a, self.series, k, first=j, last=j)
            factor = c * j - (k - j)
            # Two roundings in the factor, one in the product, at most k in the sum.
            slack = (k + 4) * UNIT * (abs(c) * j + k)
            coef = coef + factor * term
            radius = radius + abs(factor) * spread + slack * (np.abs(term).sum(axis=-1) + spread)
        held = like(self.series)
        held.fill(k, coef, radius)
        self.series.fill(k, *over(convolution(self._inverse, held, k, first=0, last=0), k))


def square(a: Series, k: int) -> tuple[Array, Array]:
    """Order k of a^2; of a number the range of the square, which is never negative."""
    if k > 0 or a.algebra is not NUMBERS:
        return convolution(a, a, k)
    size, radius = np.abs(a.coef[0][:, 0]), a.radius[0]
    least = np.maximum(np.nextafter(size - radius, -np.inf), 0.0)
    most = np.nextafter(size + radius, np.inf)
    low, high = np.nextafter(least * least, -np.inf), np.nextafter(most * most, np.inf)
    middle = 0.5 * low + 0.5 * high
    return middle[:, None], np.maximum(high - middle, middle - low)


def over(term: tuple[Array, Array], k: int) -> tuple[Array, Array]:
    """term / k."""
    coef = term[0] / k
    return coef, term[1] / k + UNIT * np.abs(coef).sum(axis=-1)


def reciprocal(series: Series, factor: float) -> Series:
    """1 / (factor s_0) as a steady series, for a factor that is a power of two."""
    start = Series(series.algebra, 1, series.coef.shape[1], steady=True)
    start.fill(0, factor * series.coef[0], factor * series.radius[0])
    result = Inverse(start)
    result.extend(0)
    return result.series


def solved(
    source: Series, rest: tuple[Array, Array], k: int, inverse: Series
) -> tuple[Array, Array]:
    """(source_k - rest) times the steady `inverse`."""
    held = Series(source.algebra, k + 1, source.coef.shape[1])
    coef, radius = -rest[0], rest[1]
    if source.has(k):
        coef = coef + source.coef[k]
        radius = radius + source.radius[k] + UNIT * np.abs(coef).sum(axis=-1)
    held.fill(k, coef, radius)
    return convolution(inverse, held, k, first=0, last=0)
