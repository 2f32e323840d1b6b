"""Polynomials with a radius: functions of the initial deviation that are known up to a bound.

An element (c, r) stands for every function d -> sum_k c_k m_k(d) + e(d) with |e| <= r on [-1, 1]^m.
All are held in batches: coefficients (B, C), radii (B,). Every operation bounds what it drops and
its own rounding in the radius, so containment holds for exact reals (ENCLOSED); sums may be taken
in any order and fused, since only the standard bound n u sum |terms| is used.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

UNIT = 2.0**-53
# Radii are sums and products of non-negative floats; with fewer than 2^16 operations each their
# relative error is below 2^-36. The absolute term covers underflow.
_UP = 1.0 + 2.0**-36
_TINY = 1e-290
_MOST_OPERATIONS = 2**16


def upward(radius: Array) -> Array:
    """A radius that was computed in floats, so enlarged that it bounds the exact one."""
    return np.asarray(radius * _UP + _TINY)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Algebra:
    """Monomials of degree <= `degree` in `deep` variables, and `shallow` variables to degree one.

    Products of a shallow variable with any other are dropped into the radius. exponents: (C, deep +
    shallow), row 0 is the constant, the last `shallow` rows are the shallow variables.
    """

    deep: int
    degree: int
    shallow: int
    exponents: npt.NDArray[np.int64]
    left: npt.NDArray[np.int64]
    right: npt.NDArray[np.int64]
    scatter: Array
    classes: Array
    dropped: Array
    squares: npt.NDArray[np.int64]

    @classmethod
    def of(cls, *, deep: int, degree: int, shallow: int) -> Algebra:
        """Build the tables of the products that are kept; see `size_of` for their size."""
        rows = [
            tuple(combination.count(v) for v in range(deep)) + (0,) * shallow
            for d in range(degree + 1)
            for combination in itertools.combinations_with_replacement(range(deep), d)
        ]
        rows += [tuple(int(v == deep + s) for v in range(deep + shallow)) for s in range(shallow)]
        index = {row: k for k, row in enumerate(rows)}
        pairs = []
        for (i, a), (j, b) in itertools.product(enumerate(rows), repeat=2):
            target = index.get(tuple(p + q for p, q in zip(a, b, strict=True)))
            if target is not None:
                pairs.append((i, j, target))
        left, right, kept = (np.array(column) for column in zip(*pairs, strict=True))
        scatter = np.zeros((len(pairs), len(rows)))
        scatter[np.arange(len(pairs)), kept] = 1.0
        # Classes of monomials: their degree, and one more class for all shallow ones.
        kind = [degree + 1 if any(row[deep:]) else sum(row) for row in rows]
        classes = np.zeros((len(rows), degree + 3))
        classes[np.arange(len(rows)), kind] = 1.0
        classes[:, -1] = 1.0
        dropped = np.zeros((degree + 3, degree + 3))
        for p, q in itertools.product(range(degree + 2), repeat=2):
            shallow_too = max(p, q) > degree
            dropped[p, q] = float(p > 0 and q > 0 if shallow_too else p + q > degree)
        squares = [k for k, row in enumerate(rows) if degree >= 2 and 2 in row and sum(row) == 2]
        return cls(
            deep, degree, shallow, np.array(rows), left, right, scatter, classes, dropped,
            np.array(squares, dtype=np.int64),
        )  # fmt: skip

    @staticmethod
    def size_of(*, deep: int, degree: int, shallow: int) -> int:
        """Number of monomials, without building anything."""
        return math.comb(deep + degree, degree) + shallow

    @property
    def size(self) -> int:
        """Number C of monomials."""
        return len(self.exponents)

    @staticmethod
    def operations_fit(size: int, orders: int) -> bool:
        """Whether the standard bounds above hold for that many monomials and orders in time."""
        return (size + 8) * (orders + 2) < _MOST_OPERATIONS

    def class_norms(self, coefficients: Array) -> Array:
        """Sums of |c| by class, (..., degree + 3), up to 2^-36 of their value.

        The classes are the degrees, all shallow monomials together, and all monomials.
        """
        return np.asarray(np.abs(coefficients) @ self.classes)

    def bounds(self, coefficients: Array, radius: Array) -> tuple[Array, Array]:
        """Lower and upper bound (...,) over all deviations; squares are one-sided.

        Per deep variable the terms a d + b d^2 are ranged together: extreme at d = +-1 or, where
        |a| < 2 |b|, at -a^2 / (4 b). All other terms count with their absolute values.
        """
        total = np.abs(coefficients).sum(axis=-1)
        spread = total - np.abs(coefficients[..., 0])
        low, high = coefficients[..., 0] - 0.0, coefficients[..., 0] + 0.0
        if self.degree >= 2:
            first = coefficients[..., 1 : 1 + self.deep]
            square = coefficients[..., self.squares]
            spread = spread - np.abs(first).sum(axis=-1) - np.abs(square).sum(axis=-1)
            with np.errstate(all="ignore"):
                inside = np.abs(first) < 2.0 * np.abs(square)
                turn = np.where(inside, -0.25 * (first * (first / square)), 0.0)
            ends = square + np.abs(first), square - np.abs(first)
            high = high + np.maximum(ends[0], turn).sum(axis=-1)
            low = low + np.minimum(ends[1], turn).sum(axis=-1)
        slack = upward(radius + 8 * (self.size + 8) * UNIT * total)
        return low - np.maximum(spread, 0.0) - slack, high + np.maximum(spread, 0.0) + slack
