"""Sets of states: a polynomial of the initial deviation plus a zonotope of what was bounded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.reach.validated.algebra import UNIT, Algebra, Array, upward
from workbench.reach.validated.bounds import Range

# Orders of the longest series in time that is used.
LONGEST_SERIES = 20
# Beyond this many generators per state the smallest are merged into a box.
_MOST_GENERATORS = 400


@final
@dataclass(frozen=True, slots=True, eq=False)
class PolynomialSet:
    """{P(d) + G xi : |d_i| <= 1, |xi_j| <= 1} for each of a batch of B.

    coef (B, n, C): coefficients of P over the deep monomials of `algebra` (those of its n shallow
    variables are 0); generators (B, n, g).
    """

    algebra: Algebra
    coef: Array
    generators: Array

    @classmethod
    def of_boxes(cls, lower: Array, upper: Array, *, degree: int) -> PolynomialSet:
        """The boxes [lower, upper] (B, n); one deep variable per axis that is wide in any."""
        batch, n = lower.shape
        center = np.clip(0.5 * lower + 0.5 * upper, lower, upper)
        radius = np.where(
            lower == upper, 0.0, np.nextafter(np.maximum(upper - center, center - lower), np.inf)
        )
        wide = np.flatnonzero(radius.max(axis=0) > 0.0)
        degree = degree if len(wide) else 1
        size = Algebra.size_of(deep=len(wide), degree=degree, shallow=n)
        if not Algebra.operations_fit(size, LONGEST_SERIES):
            raise InputError(
                f"expected fewer terms than {size}: {len(wide)} uncertain axes with degree "
                f"{degree}; use a lower degree"
            )
        algebra = Algebra.of(deep=len(wide), degree=degree, shallow=n)
        coef = np.zeros((batch, n, algebra.size))
        coef[:, :, 0] = center
        for v, axis in enumerate(wide):
            coef[:, axis, 1 + v] = radius[:, axis]
        return cls(algebra, coef, np.zeros((batch, n, 0)))

    @property
    def batch(self) -> int:
        """Number B of sets."""
        return len(self.coef)

    def spread(self) -> Array:
        """Radius (B, n) of the zonotope."""
        return (
            upward(np.abs(self.generators).sum(axis=2))
            if self.generators.shape[2]
            else (np.zeros(self.coef.shape[:2]))
        )

    def hull(self) -> Range:
        """Smallest boxes found around the sets, (B, n) each."""
        return self.algebra.bounds(self.coef, self.spread())

    def with_spread_as_variables(self) -> Array:
        """Coefficients with the zonotope's radius on the shallow variables, one per state."""
        n = self.coef.shape[1]
        result = self.coef.copy()
        diagonal = np.arange(n)
        result[:, diagonal, self.algebra.size - n + diagonal] = self.spread()
        return result

    def image_range(self, coef: Array, radius: Array) -> Range:
        """Range (B, k) of k functions coef +- radius in the variables of
        `with_spread_as_variables`, keeping what the generators have in common."""
        moved, slack = self._moved(coef)
        deep = coef.copy()
        deep[:, :, self.algebra.size - self.coef.shape[1] :] = 0.0
        return self.algebra.bounds(deep, upward(radius + np.abs(moved).sum(axis=2) + slack))

    def _moved(self, coef: Array) -> tuple[Array, Array]:
        """The generators under the shallow part of coef (B, k, C), and its rounding (B, k)."""
        n, count = self.generators.shape[1:]
        spread = self.spread()
        linear = coef[:, :, -n:] / np.where(spread > 0.0, spread, 1.0)[:, None, :]
        slack = (n + count + 4) * UNIT * (np.abs(linear) @ spread[:, :, None])[:, :, 0]
        return linear @ self.generators, upward(2.0 * slack)

    def mapped(self, coef: Array, radius: Array, more: Array) -> PolynomialSet:
        """The set after a step that takes state i to coef_i(d, eta) +- radius_i.

        coef (B, n, C) in the variables of `with_spread_as_variables`; radius (B, n); more (B, n, g)
        are further generators. The shallow part is L eta with eta_j = z_j / spread_j, so that every
        generator moves by L / spread.
        """
        n = self.coef.shape[1]
        moved, slack = self._moved(coef)
        box = upward(radius + slack)
        diagonal = np.zeros((len(coef), n, n))
        diagonal[:, np.arange(n), np.arange(n)] = box
        polynomial = coef.copy()
        polynomial[:, :, -n:] = 0.0
        generators = np.concatenate([moved, more, diagonal], axis=2)
        return PolynomialSet(self.algebra, polynomial, _reduced(generators))


def _reduced(generators: Array) -> Array:
    """At most `_MOST_GENERATORS` n columns; the smallest become one box."""
    batch, n, count = generators.shape
    most = _MOST_GENERATORS * n
    if count <= most:
        return generators
    size = np.abs(generators)
    scale = np.maximum(size.sum(axis=2, keepdims=True), 1e-300)
    weight = (size / scale).max(axis=1)
    order = np.argsort(weight, axis=1)
    sorted_columns = np.take_along_axis(generators, order[:, None, :], axis=2)
    merged = count - most // 2
    box = np.zeros((batch, n, n))
    box[:, np.arange(n), np.arange(n)] = upward(np.abs(sorted_columns[:, :, :merged]).sum(axis=2))
    return np.concatenate([sorted_columns[:, :, merged:], box], axis=2)
