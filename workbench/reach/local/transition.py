"""Interval enclosures of the solution matrices of e' = M(t) e."""

from __future__ import annotations

import math

import numpy as np

from workbench.reach.tube import Array
from workbench.sensitivity.interval_arrays import (
    Flags,
    Interval,
    add,
    matrix_product,
    multiply,
    point,
)
from workbench.sensitivity.rounding import mul_up, sum_up, up

_ORDER = 12


def transition(lower: Array, upper: Array, length_s: float) -> Interval:
    """Phi(h) of Phi' = M(t) Phi, Phi(0) = I, for every measurable M(t) in [lower, upper] (n, n).

    sum_j of the j-fold integrals of M(t_1) .. M(t_j) over h > t_1 > .. > t_j > 0 (Peano-Baker):
    each is a mean of products times h^j / j!, and lies in the interval product (h M)^j / j!. What
    follows order N is below a^(N+1) / (N+1)! / (1 - a / (N+2)), a = h max row sum of |M|. Entries
    that no product reaches stay 0. Infinite where a >= (N + 2) / 2.
    """
    size = len(lower)
    feeds = (lower != 0.0) | (upper != 0.0)
    scaled = multiply(point(np.array(length_s)), (lower, upper))
    reached = np.eye(size, dtype=np.bool_)
    term: Interval = point(np.eye(size))
    total, ever = term, reached
    for j in range(1, _ORDER + 1):
        term = matrix_product(scaled, term)
        reached = (feeds.astype(int) @ reached.astype(int)) > 0
        low, high = np.nextafter(term[0] / j, -np.inf), np.nextafter(term[1] / j, np.inf)
        term = np.where(reached, low, 0.0), np.where(reached, high, 0.0)
        total, ever = add(total, term), ever | reached
    tail = np.where(_closure(feeds), _tail(np.maximum(np.abs(lower), np.abs(upper)), length_s), 0.0)
    ends = add(total, (-tail, tail))
    some = ever | (tail > 0.0)
    return np.where(some, ends[0], 0.0), np.where(some, ends[1], 0.0)


def inverse_product(frame: Array, matrix: Interval) -> tuple[Interval, Array]:
    """Encloses C^-1 X for a frame C (n, n): (R X, slack (1, m)), |C^-1 X - R X| <= slack.

    R is an approximate inverse; with d = max row sum of |R C - I| < 1, C^-1 X = (R C)^-1 R X
    differs from R X by at most d / (1 - d) times the largest entry of its column. Infinite where C
    is singular to rounding.
    """
    size = len(frame)
    try:
        near = np.asarray(np.linalg.inv(frame), dtype=np.float64)
    except np.linalg.LinAlgError:
        near = np.full((size, size), np.nan)
    rest = add(matrix_product(point(near), point(frame)), point(-np.eye(size)))
    error = max(sum_up(row) for row in np.maximum(np.abs(rest[0]), np.abs(rest[1])).tolist())
    product = matrix_product(point(near), matrix)
    largest = np.maximum(np.abs(product[0]), np.abs(product[1])).max(axis=0)
    usable = error < 0.5 and bool(np.isfinite(near).all())
    share = up(error / math.nextafter(1.0 - error, 0.0)) if usable else math.inf
    return product, np.nextafter(share * largest, np.inf)[None]


def _tail(size: Array, length_s: float) -> float:
    rate = max(sum_up(row) for row in size.tolist())
    a = mul_up(rate, length_s)
    if not a < 0.5 * (_ORDER + 2):
        return math.inf
    # a / (N + 2) < 1/2: the geometric rest is at most twice the first term.
    return mul_up(2.0, *(up(a / j) for j in range(1, _ORDER + 2)))


def _closure(feeds: Flags) -> Flags:
    """Which entries some power of the matrix reaches."""
    result = np.eye(len(feeds), dtype=np.bool_) | feeds
    for _ in range(len(feeds)):
        result = (result.astype(int) @ result.astype(int)) > 0
    return np.asarray(result)
