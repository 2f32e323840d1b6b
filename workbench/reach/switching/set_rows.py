"""Exact operations on the rows of polynomial sets: joining batches, replacing states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from workbench.reach.validated.algebra import UNIT, upward
from workbench.reach.validated.sets import PolynomialSet


def joined(sets: Sequence[PolynomialSet]) -> PolynomialSet:
    """Sets of one algebra as one batch."""
    most = max(each.generators.shape[2] for each in sets)
    generators = [
        np.pad(each.generators, ((0, 0), (0, 0), (0, most - each.generators.shape[2])))
        for each in sets
    ]
    return PolynomialSet(
        sets[0].algebra, np.concatenate([each.coef for each in sets]), np.concatenate(generators)
    )


def with_values(source: PolynomialSet, values: Mapping[int, tuple[float, float]]) -> PolynomialSet:
    """State i replaced by any number in values[i] = (lower, upper), each independent of all else.

    Every other state keeps its row as it is, so that nothing is rounded but the radii of the
    intervals, outward.
    """
    coef, generators = source.coef.copy(), source.generators.copy()
    more = np.zeros((*coef.shape[:2], len(values)))
    for column, (state, (lower, upper)) in enumerate(values.items()):
        middle = min(max(0.5 * lower + 0.5 * upper, lower), upper)
        coef[:, state], generators[:, state] = 0.0, 0.0
        coef[:, state, 0] = middle
        if lower < upper:
            more[:, state, column] = np.nextafter(max(upper - middle, middle - lower), np.inf)
    used = more.any(axis=(0, 1))
    return PolynomialSet(
        source.algebra, coef, np.concatenate([generators, more[:, :, used]], axis=2)
    )


def with_copies(source: PolynomialSet, sources: Mapping[int, int]) -> PolynomialSet:
    """State i replaced by what state sources[i] was; exact, all correlations kept."""
    order = np.arange(source.coef.shape[1])
    for target, origin in sources.items():
        order[target] = origin
    return PolynomialSet(source.algebra, source.coef[:, order], source.generators[:, order])


def with_sums(
    source: PolynomialSet, sums: Mapping[int, tuple[int, int]], *, sign: float
) -> PolynomialSet:
    """State i replaced by a + sign b for sums[i] = (a, b), sign = +-1; rounding is one generator.

    Correlations are kept: a difference is as narrow as the two states move together.
    """
    coef, generators = source.coef.copy(), source.generators.copy()
    more = np.zeros((*coef.shape[:2], len(sums)))
    for column, (target, (a, b)) in enumerate(sums.items()):
        coef[:, target] = source.coef[:, a] + sign * source.coef[:, b]
        generators[:, target] = source.generators[:, a] + sign * source.generators[:, b]
        size = np.abs(coef[:, target]).sum(axis=1) + np.abs(generators[:, target]).sum(axis=1)
        more[:, target, column] = upward(2.0 * UNIT * size)
    return PolynomialSet(source.algebra, coef, np.concatenate([generators, more], axis=2))
