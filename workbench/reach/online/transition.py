"""The transition of one Taylor step, in one fixed order of operations for all who compute it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar, final

import casadi as ca

from workbench.sensitivity.validity import verbatim

T = TypeVar("T")
# The identity's entry; a product with it is the other factor.
_ONE = ca.SX(1)


class Arithmetic(Protocol[T]):
    """Operations on a row of the transition, restricted to some of its columns."""

    def times(self, order: int, place: int, row: T) -> T:
        """Nonzero `place` of h^order A_order, times a row."""

    def add(self, left: T, right: T) -> T:
        """left + right."""

    def shared(self, divisor: int, row: T) -> T:
        """h / divisor, times a row."""


def transition_rows(
    structure: Sequence[ca.Sparsity], units: list[T | None], arithmetic: Arithmetic[T]
) -> list[T | None]:
    """Rows of sum_i T_i, T_0 = 1, T_(i+1) = h / (i + 1) sum_j h^j A_j T_(i-j); None: all zeros.

    structure: of A_0, A_1, ..., the Jacobian's coefficients along the flow, as many as the order.
    units: rows of T_0 in the columns meant.
    """
    n, order = structure[0].size1(), len(structure)
    entries = [_by_row(sparsity) for sparsity in structure]
    powers = [units]
    for i in range(order):
        rows: list[T | None] = []
        for row in range(n):
            total: T | None = None
            for j in range(i + 1):
                part: T | None = None
                for place, column in entries[j][row]:
                    factor = powers[i - j][column]
                    if factor is not None:
                        term = arithmetic.times(j, place, factor)
                        part = term if part is None else arithmetic.add(part, term)
                if part is not None:
                    total = part if total is None else arithmetic.add(total, part)
            rows.append(None if total is None else arithmetic.shared(i + 1, total))
        powers.append(rows)
    return [_sum([power[row] for power in powers], arithmetic) for row in range(n)]


def _by_row(sparsity: ca.Sparsity) -> list[list[tuple[int, int]]]:
    """For each row its nonzeros as (place among the nonzeros, column)."""
    rows: list[list[tuple[int, int]]] = [[] for _ in range(sparsity.size1())]
    for place, (row, column) in enumerate(zip(*sparsity.get_triplet(), strict=True)):
        rows[row].append((place, column))
    return rows


def _sum(terms: list[T | None], arithmetic: Arithmetic[T]) -> T | None:
    """The smallest first."""
    total: T | None = None
    for term in reversed(terms):
        if term is not None:
            total = term if total is None else arithmetic.add(total, term)
    return total


@final
class _Symbols:
    """SX numbers, exactly as written."""

    def __init__(self, scaled: Sequence[ca.SX], shares: Sequence[ca.SX]) -> None:
        self._nonzeros, self._shares = [a.nonzeros() for a in scaled], shares

    def times(self, order: int, place: int, row: ca.SX) -> ca.SX:
        factor = self._nonzeros[order][place]
        return factor if row is _ONE else factor * row

    def add(self, left: ca.SX, right: ca.SX) -> ca.SX:
        return left + right

    def shared(self, divisor: int, row: ca.SX) -> ca.SX:
        return self._shares[divisor - 1] * row


def transition_of(scaled: Sequence[ca.SX], shares: Sequence[ca.SX]) -> ca.SX:
    """The transition as an expression, n x n and sparse, from h^j A_j and h, h / 2, h / 3, ..."""
    n = scaled[0].size1()
    structure = [a.sparsity() for a in scaled]
    found = ca.SX(n, n)
    with verbatim():
        arithmetic = _Symbols(scaled, shares)
        for column in range(n):
            units = [_ONE if row == column else None for row in range(n)]
            for row, value in enumerate(transition_rows(structure, units, arithmetic)):
                if value is not None:
                    found[row, column] = value
    return found
