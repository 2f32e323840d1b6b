"""Growth of several quadratic norms that feed each other, and its evaluation rounded up."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import numpy as np

from workbench.sensitivity.growth_matrix import MetzlerGrowth
from workbench.sensitivity.interval_arrays import matrix_product, multiply, point
from workbench.sensitivity.metric_bounds import Form, coupling_bounds, metric_rates, sign_vectors
from workbench.sensitivity.rounding import mul_up, sqrt_up, up
from workbench.sensitivity.vectorised import Array

Metric = tuple[tuple[float, ...], ...]
Blocks = tuple[tuple[int, ...], ...]
_SIGNED_MOST = 12


@final
@dataclass(frozen=True, slots=True)
class BlockwiseGrowth:
    """V(t) <= exp(M t) V(0) + int_0^t exp(M s) ds |mismatch|, V_k = sqrt(e_k^T P_k e_k).

    blocks: the states of each block, every state in one; metrics: P_k, symmetric positive definite,
    doubles that stand for themselves; comparison: M, M_kk the rate of block k in its metric, M_kl
    >= 0 what block l feeds into it; mismatch: one bound >= 0 per state on what different inputs add
    to its rate, in its unit per second.
    """

    blocks: Blocks
    metrics: tuple[Metric, ...]
    comparison: tuple[tuple[float, ...], ...]
    mismatch: tuple[float, ...]

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """sqrt((P_k^-1)_ii) V_k(t), rounded up; inf where it leaves the doubles."""
        felt = MetzlerGrowth(self.comparison, self._norms(self.mismatch))
        reached = felt.half_widths(self._norms(initial), t_s)
        result = [0.0] * len(initial)
        for block, metric, radius in zip(self.blocks, self.metrics, reached, strict=True):
            for i, extent in zip(block, _extents(metric), strict=True):
                result[i] = mul_up(extent, radius)
        return tuple(result)

    def condition(self, units: Sequence[float]) -> float:
        """Largest condition number of a metric, with one unit per state; in floating point."""
        scale = np.array(units)
        found = []
        for block, metric in zip(self.blocks, self.metrics, strict=True):
            unit = scale[list(block)]
            found.append(float(np.linalg.cond(np.array(metric) * unit[:, None] * unit[None, :])))
        return max(found)

    def _norms(self, half_widths: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(
            box_norm(metric, tuple(half_widths[i] for i in block))
            for block, metric in zip(self.blocks, self.metrics, strict=True)
        )


@functools.lru_cache(maxsize=4096)
def box_norm(metric: Metric, half_widths: tuple[float, ...]) -> float:
    """max sqrt(v^T P v) over |v_i| <= half_widths_i, at the vertices, rounded up.

    Beyond 12 states, the root of sum_ij |P_ij| half_widths_i half_widths_j.
    """
    if not any(half_widths):
        return 0.0
    radius = np.array(half_widths)
    outer = multiply(point(radius[:, None]), point(radius[None, :]))
    with np.errstate(all="ignore"):
        if len(radius) > _SIGNED_MOST:
            terms = multiply(point(np.abs(np.array(metric))), outer)
            signs = np.ones((1, len(radius)))
        else:
            terms = multiply(point(np.array(metric)), outer)
            signs = sign_vectors(len(radius))
        half = matrix_product(point(signs), terms)
        both = matrix_product((half[0][:, None, :], half[1][:, None, :]), point(signs[:, :, None]))
        largest = float(both[1].max())
    return sqrt_up(max(largest, 0.0)) if math.isfinite(largest) else math.inf


def comparison_bounds(
    lower: Array, upper: Array, *, blocks: Blocks, metrics: tuple[Metric, ...], form: Form
) -> Array:
    """M (C, b, b) for the matrices in each hull [lower, upper] (C, n, n), proved.

    M_kk: rates of the diagonal blocks, M_kl: couplings, as in `metric_bounds`; inf where nothing is
    proved.
    """
    arrays = [np.array(metric) for metric in metrics]
    result = np.zeros((len(lower), len(blocks), len(blocks)))
    for (k, targets), (j, sources) in itertools.product(enumerate(blocks), repeat=2):
        low, high = (part_of(ends, targets, sources) for ends in (lower, upper))
        if k == j:
            result[:, k, k] = metric_rates(low, high, metric=arrays[k], form=form)
        else:
            result[:, k, j] = coupling_bounds(low, high, row=arrays[k], column=arrays[j], form=form)
    return result


def part_of(matrices: Array, targets: Sequence[int], sources: Sequence[int]) -> Array:
    """The entries (C, targets, sources) of a stack of matrices."""
    return np.asarray(matrices[:, list(targets)][:, :, list(sources)])


@functools.lru_cache(maxsize=256)
def _extents(metric: Metric) -> tuple[float, ...]:
    """Upper bounds on sqrt((P^-1)_ii), from exact elimination; inf unless P > 0."""
    size = len(metric)
    rows = [
        [*map(Fraction, row), *(Fraction(i == j) for j in range(size))]
        for i, row in enumerate(metric)
    ]
    for k in range(size):
        pivot = rows[k][k]
        if pivot <= 0:
            return (math.inf,) * size
        rows[k] = [value / pivot for value in rows[k]]
        for i in range(size):
            if i != k and rows[i][k]:
                factor = rows[i][k]
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
    return tuple(sqrt_up(up(float(rows[i][size + i]))) for i in range(size))


def rows(matrix: Array) -> Metric:
    """A matrix as tuples of its rows."""
    return tuple(tuple(row) for row in matrix.tolist())
