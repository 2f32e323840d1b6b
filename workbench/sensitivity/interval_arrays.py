"""Interval arithmetic on numpy arrays, rounded outward, and a proof of positive definiteness."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from workbench.sensitivity.vectorised import Array

Interval = tuple[Array, Array]
Flags = npt.NDArray[np.bool_]


def point(values: Array) -> Interval:
    """The interval of exactly these doubles."""
    return values, values


def negate(a: Interval) -> Interval:
    """{-a}, exact."""
    return -a[1], -a[0]


def add(a: Interval, b: Interval) -> Interval:
    """{a + b}."""
    return _outward(a[0] + b[0], a[1] + b[1])


def multiply(a: Interval, b: Interval) -> Interval:
    """{a b}, entry by entry."""
    products = (a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1])
    low, high = products[0], products[0]
    for product in products[1:]:
        low, high = np.minimum(low, product), np.maximum(high, product)
    return _outward(low, high)


def matrix_product(a: Interval, b: Interval) -> Interval:
    """{a b} of stacks of matrices (..., i, k) and (..., k, j)."""
    total: Interval | None = None
    for k in range(a[0].shape[-1]):
        left = (a[0][..., :, k, None], a[1][..., :, k, None])
        right = (b[0][..., None, k, :], b[1][..., None, k, :])
        term = multiply(left, right)
        total = term if total is None else add(total, term)
    if total is None:
        raise ValueError("expected matrices with a common dimension of at least 1")
    return total


def transpose(a: Interval) -> Interval:
    """The matrices transposed."""
    return np.swapaxes(a[0], -1, -2), np.swapaxes(a[1], -1, -2)


def positive_definite(matrices: Interval) -> Flags:
    """Whether every symmetric matrix within [lower, upper] is proved positive definite: (N,).

    matrices: two (N, m, m), of which the parts on and below the diagonal count. Eliminates one
    pivot after the other; with a positive pivot a symmetric matrix is positive definite if and only
    if its Schur complement is. NaN and infinity prove nothing.
    """
    low, high = (np.array(end) for end in matrices)
    size = low.shape[-1]
    good = np.ones(len(low), dtype=np.bool_)
    with np.errstate(all="ignore"):
        for k in range(size):
            good &= low[:, k, k] > 0.0
            pivot = np.where(good, low[:, k, k], 1.0), np.where(good, high[:, k, k], 1.0)
            column = (low[:, k + 1 :, k], high[:, k + 1 :, k])
            outer = multiply(
                (column[0][:, :, None], column[1][:, :, None]),
                (column[0][:, None, :], column[1][:, None, :]),
            )
            removed = _quotient(outer, (pivot[0][:, None, None], pivot[1][:, None, None]))
            rest = add((low[:, k + 1 :, k + 1 :], high[:, k + 1 :, k + 1 :]), negate(removed))
            low[:, k + 1 :, k + 1 :], high[:, k + 1 :, k + 1 :] = rest
    return good


def _quotient(a: Interval, divisor: Interval) -> Interval:
    """{a / d} for d > 0."""
    return _outward(
        np.minimum(a[0] / divisor[0], a[0] / divisor[1]),
        np.maximum(a[1] / divisor[0], a[1] / divisor[1]),
    )


def _outward(low: Array, high: Array) -> Interval:
    # A rounded result has the exact one between its two neighbours.
    return np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
