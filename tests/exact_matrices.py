"""Matrices of fractions, for tests that repeat a proof without rounding."""

from __future__ import annotations

from fractions import Fraction

from workbench.sensitivity.vectorised import Array

Exact = list[list[Fraction]]


def exact(matrix: Array) -> Exact:
    return [[Fraction(value) for value in row] for row in matrix.tolist()]


def product(a: Exact, b: Exact) -> Exact:
    columns = list(zip(*b, strict=True))
    return [
        [sum((x * y for x, y in zip(row, c, strict=True)), Fraction(0)) for c in columns]
        for row in a
    ]


def semidefinite(matrix: Exact) -> bool:
    """Exact elimination: a zero pivot needs a zero row."""
    work = [list(row) for row in matrix]
    for k in range(len(work)):
        if work[k][k] < 0 or (work[k][k] == 0 and any(work[k][j] for j in range(k, len(work)))):
            return False
        for i in range(k + 1, len(work)):
            if work[k][k]:
                factor = work[i][k] / work[k][k]
                work[i] = [a - factor * b for a, b in zip(work[i], work[k], strict=True)]
    return True
