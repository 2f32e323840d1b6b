"""Taylor series in time with polynomial coefficients, one order at a time."""

from __future__ import annotations

from typing import final

import numpy as np

from workbench.reach.validated.algebra import UNIT, Algebra, Array, upward


@final
class Series:
    """sum_k a_k t^k, each a_k an element of `algebra` in a batch of B; orders are filled upward.

    coef (K, B, C), radius (K, B). A series with `steady` has no terms beyond order 0; a `number` is
    steady and has no terms beyond the constant monomial.
    """

    __slots__ = ("_norms", "_ready", "algebra", "coef", "number", "radius", "steady")

    def __init__(
        self,
        algebra: Algebra,
        orders: int,
        batch: int,
        *,
        steady: bool = False,
        number: bool = False,
    ) -> None:
        count = 1 if steady else orders
        self.algebra, self.steady, self.number = algebra, steady or number, number
        self.coef = np.zeros((count, batch, algebra.size))
        self.radius = np.zeros((count, batch))
        self._norms = np.zeros((count, batch, algebra.degree + 3))
        self._ready = 0

    @classmethod
    def constant(cls, algebra: Algebra, value: Array, radius: Array) -> Series:
        """Numbers value +- radius, both (B,)."""
        made = cls(algebra, 1, len(value), steady=True, number=True)
        coef = np.zeros((len(value), algebra.size))
        coef[:, 0] = value
        made.give(0, coef, radius)
        return made

    def fill(self, k: int, coef: Array, radius: Array) -> None:
        """Set order k to what was computed; the radius is enlarged for its own rounding."""
        self.give(k, coef, upward(radius))

    def give(self, k: int, coef: Array, radius: Array) -> None:
        """Set order k to given values; a radius of 0 means exact."""
        self.coef[k] = coef
        self.radius[k] = radius
        self._ready = min(self._ready, k)

    def norms(self, first: int, last: int) -> Array:
        """Sums of |coef| by class for the orders first .. last, (orders, B, degree + 3)."""
        if last >= self._ready:
            fresh = slice(self._ready, last + 1)
            self._norms[fresh] = self.algebra.class_norms(self.coef[fresh])
            self._ready = last + 1
        return self._norms[first : last + 1]

    def size(self, k: int) -> Array:
        """Sum of |coef| of order k, (B,)."""
        return self.norms(k, k)[0, :, -1]

    def has(self, k: int) -> bool:
        """Whether order k may be other than 0."""
        return k == 0 or not self.steady


def linear(out: Series, k: int, terms: list[tuple[float, Series]]) -> None:
    """Order k of a combination sum f_i s_i with factors +-1 or powers of two (exact products)."""
    present = [(f, s) for f, s in terms if s.has(k)]
    coef = sum((f * s.coef[k] for f, s in present), np.zeros_like(out.coef[0]))
    radius = sum((abs(f) * s.radius[k] for f, s in present), np.zeros_like(out.radius[0]))
    if len(present) > 1:
        size = sum(abs(f) * s.size(k) for f, s in present)
        radius = radius + len(present) * UNIT * size
    out.fill(k, coef, radius)


def scaled(out: Series, k: int, source: Series, factor: float) -> None:
    """Order k of factor * source for one exact double."""
    out.fill(
        k,
        factor * source.coef[k],
        abs(factor) * (source.radius[k] + 2.0 * UNIT * source.size(k)),
    )


def convolution(
    a: Series, b: Series, k: int, *, first: int = 0, last: int | None = None
) -> tuple[Array, Array]:
    """sum_{j = first .. last} a_j b_{k-j} (last: k where not given): coefficients and radius."""
    last = k if last is None else last
    if a.steady:
        first, last = max(first, 0), min(last, 0)
    if b.steady:
        first, last = max(first, k), min(last, k)
    batch = max(a.coef.shape[1], b.coef.shape[1])
    if last < first:
        return np.zeros((batch, a.algebra.size)), np.zeros(batch)
    if a.number or b.number:
        return _by_number(a, b, first, k - first)
    alg = a.algebra
    left, right = slice(first, last + 1), slice(k - last, k - first + 1)
    a_coef, b_coef = a.coef[left], b.coef[right][::-1]
    products = np.einsum("jbp,jbp->bp", a_coef[:, :, alg.left], b_coef[:, :, alg.right])
    a_norms, b_norms = a.norms(first, last), b.norms(k - last, k - first)[::-1]
    b_radius = b.radius[right][::-1]
    rounding = (last - first + 2) * (alg.size + 2) * UNIT
    lost = np.einsum("jbd,jbd->b", a_norms @ alg.dropped, b_norms)
    spread = a_norms[:, :, -1] * (b_radius + rounding * b_norms[:, :, -1])
    spread = spread + a.radius[left] * (b_norms[:, :, -1] + b_radius)
    return products @ alg.scatter, lost + spread.sum(axis=0)


def _by_number(a: Series, b: Series, i: int, j: int) -> tuple[Array, Array]:
    """a_i b_j where one of them is a number, for which only order 0 is reached."""
    if a.number:
        a, b, i, j = b, a, j, i
    value = b.coef[j][:, :1]
    size = np.abs(value[:, 0])
    radius = a.radius[i] * (size + b.radius[j]) + a.size(i) * (b.radius[j] + 2.0 * UNIT * size)
    return value * a.coef[i], radius


@final
class Weighted:
    """The series of t a'(t): order k is k a_k; kept beside a while its orders arrive."""

    __slots__ = ("series", "source")

    def __init__(self, source: Series) -> None:
        self.source = source
        self.series = Series(source.algebra, len(source.coef), source.coef.shape[1])
        self.series.steady = source.steady

    def extend(self, k: int) -> None:
        """Order k, exact but for one rounding of each product."""
        if self.source.has(k):
            scaled(self.series, k, self.source, float(k))
