"""Interval arrays contain exact results, and elimination accepts positive matrices alone."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from exact_matrices import exact, product, semidefinite
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.sensitivity.interval_arrays import (
    Interval,
    _quotient,
    add,
    matrix_product,
    multiply,
    positive_definite,
)
from workbench.sensitivity.vectorised import Array

_SEEDS = st.integers(0, 10**6)


def _inside(interval: Interval, shares: Array) -> list[list[Fraction]]:
    """The points that lie shares / 8 of the way from the lower to the upper ends."""
    low, high, eighths = (exact(np.asarray(part, dtype=float)) for part in (*interval, shares))
    return [
        [p + (q - p) * s / 8 for p, q, s in zip(*each, strict=True)]
        for each in zip(low, high, eighths, strict=True)
    ]


@given(_SEEDS)
@settings(max_examples=20, deadline=None)
def test_interval_operations_contain_the_exact_results(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ends = [np.sort(rng.normal(size=(2, 3, 3)), axis=0) for _ in range(2)]
    if seed % 2:
        ends = [np.stack([end[0], end[0]]) for end in ends]
    first, second = ((end[0], end[1]) for end in ends)
    divisor = (np.abs(second[0]) + 0.1, np.abs(second[0]) + 0.1 + (second[1] - second[0]))
    shares = rng.integers(0, 9, (2, 3, 3))
    a, b, d = (
        _inside(first, shares[0]), _inside(second, shares[1]), _inside(divisor, shares[1])
    )  # fmt: skip
    pairs = [(i, j) for i in range(3) for j in range(3)]
    total = product(a, b)
    cases = (
        (add(first, second), {(i, j): a[i][j] + b[i][j] for i, j in pairs}),
        (multiply(first, second), {(i, j): a[i][j] * b[i][j] for i, j in pairs}),
        (_quotient(first, divisor), {(i, j): a[i][j] / d[i][j] for i, j in pairs}),
        (matrix_product(first, second), {(i, j): total[i][j] for i, j in pairs}),
    )
    for (low, high), expected in cases:
        for where, value in expected.items():
            assert Fraction(low[where]) <= value <= Fraction(high[where])


@given(_SEEDS, st.integers(2, 3))
@settings(max_examples=30, deadline=None)
def test_the_widest_matrix_that_elimination_accepts_has_positive_corners(
    seed: int, size: int
) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size))
    matrix = root @ root.T + 0.3 * np.eye(size)
    matrix, shape = 0.5 * (matrix + matrix.T), rng.uniform(0.0, 1.0, (size, size))
    shape = shape + shape.T
    width, step = 0.0, 1.0
    for _ in range(25):
        trial = (width + step) * shape
        if positive_definite((matrix[None] - trial, matrix[None] + trial))[0]:
            width += step
        step *= 0.5
    free = np.argwhere(np.tril(np.ones((size, size))))
    for choice in itertools.product((-1.0, 1.0), repeat=len(free)):
        corner = matrix.copy()
        for (i, j), sign in zip(free, choice, strict=True):
            corner[i, j] = corner[j, i] = matrix[i, j] + sign * width * shape[i, j]
        assert np.linalg.eigvalsh(corner)[0] >= -1e-12


@given(_SEEDS, st.integers(1, 5))
@settings(max_examples=40, deadline=None)
def test_elimination_accepts_what_is_positive_and_nothing_else(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size))
    matrix = np.round((root + root.T + rng.uniform(-1.0, 4.0) * np.eye(size)) * 2**20) / 2**20
    accepted = bool(positive_definite((matrix[None], matrix[None]))[0])
    minimum = float(np.linalg.eigvalsh(matrix)[0])
    if accepted:
        assert semidefinite(exact(matrix))
    if minimum > 1e-9:
        assert accepted
    width = np.full_like(matrix, 0.01)
    if bool(positive_definite((matrix - width[None], matrix + width[None]))[0]):
        for _ in range(10):
            moved = matrix + 0.01 * np.sign(rng.normal(size=(size, size)))
            moved = np.tril(moved) + np.tril(moved, -1).T
            assert semidefinite(exact(moved))


@pytest.mark.parametrize(
    "matrix",
    [
        [[1.0, 2.0], [2.0, 4.0]],  # singular
        [[1.0, 2.0], [2.0, 4.0 - 2.0**-50]],  # indefinite by one rounding
        [[0.0, 0.0], [0.0, 1.0]],
        [[np.nan, 0.0], [0.0, 1.0]],
        [[1.0, np.inf], [np.inf, 1.0]],
    ],
)
def test_elimination_rejects(matrix: list[list[float]]) -> None:
    values = np.array([matrix])
    assert not positive_definite((values, values))[0]
