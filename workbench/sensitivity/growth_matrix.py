"""Proved componentwise discrepancy: a Metzler matrix bounds how every state moves every other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import System
from workbench.sensitivity.discrepancy import Discrepancy, Proof
from workbench.sensitivity.inputs import Inputs, mismatch
from workbench.sensitivity.jacobian import Cells, IntervalJacobian, refined, require_enclosed
from workbench.sensitivity.rounding import exp_up, mul_up, sum_up, up
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box


@final
@dataclass(frozen=True, slots=True)
class MetzlerGrowth:
    """|e(t)| <= exp(M t) |e(0)| + int_0^t exp(M s) ds mismatch, componentwise.

    matrix: M, its entries off the diagonal non-negative (1/s and the states' units); mismatch: one
    bound >= 0 per state on what different inputs add to its rate, in its unit per second.
    """

    matrix: tuple[tuple[float, ...], ...]
    mismatch: tuple[float, ...]

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """The bound, rounded up; inf where it leaves the doubles.

        With a mismatch, one more state that stays 1 feeds it: ((M, mismatch), (0, 0)).
        """
        if t_s == 0.0:
            return initial
        if not any(self.mismatch):
            return _exponential(self.matrix, initial, t_s)
        rows = [(*row, felt) for row, felt in zip(self.matrix, self.mismatch, strict=True)]
        rows.append((0.0,) * (len(initial) + 1))
        return _exponential(tuple(rows), (*initial, 1.0), t_s)[:-1]


@final
@dataclass(frozen=True, slots=True)
class GrowthMatrix:
    """M_ii = sup J_ii, M_ij = sup |J_ij| over the region: |e(t)| <= exp(M t) |e(0)|.

    cells: the region is split into about this many before the suprema are taken. inputs: what the
    trajectories share; what they do not enters as `MetzlerGrowth.mismatch`. Needs both
    trajectories in the (convex) region. Exact for cascades; sign loss makes it grow for
    oscillating loops. Rigor ENCLOSED. Raises InputError where the Jacobian cannot be enclosed.
    Source: Maidens and Arcak, IEEE TAC 60(1), 2015; Kapela and Zgliczynski, DCDS-B 11(2), 2009.
    """

    cells: int
    inputs: Inputs

    def __post_init__(self) -> None:
        if self.cells < 1:
            raise InputError(f"expected at least 1 cell, got {self.cells}")

    def derive(self, system: System, *, region: Box, horizon_s: float) -> Discrepancy:
        """The bound with its matrix."""
        jacobian = IntervalJacobian(system)
        cells = jacobian.start(region)
        cells = refined(jacobian, cells, budget=self.cells, score=_score)
        require_enclosed(cells, system.ode.names)
        matrix = cells.magnitude.max(axis=0)
        felt = mismatch(system, region=region, inputs=self.inputs, cells=cells)
        return Discrepancy(
            names=system.ode.names,
            region=region,
            horizon_s=horizon_s,
            rigor=Rigor.ENCLOSED,
            norm="componentwise: |e(t)| <= exp(M t) |e(0)|, M the Metzler bound on the Jacobian",
            condition=self.inputs.condition,
            growth=MetzlerGrowth(tuple(tuple(row) for row in matrix.tolist()), felt),
            proof=Proof(self.inputs, cells),
        )


def _score(cells: Cells) -> Array:
    return excess(cells.magnitude)


def excess(bound: Array) -> Array:
    """How much each matrix (C, k, k) contributes to the suprema: its summed shares of them."""
    finite = np.where(np.isfinite(bound), bound, np.nan)
    top = (
        np.nanmax(np.abs(finite), axis=0) if np.isfinite(bound).any() else np.ones(bound.shape[1:])
    )
    return np.asarray((bound / np.where(top > 0.0, top, 1.0)).sum(axis=(1, 2)))


def _down_product(first: float, second: float) -> float:
    return max(0.0, float(np.nextafter(first * second, 0.0)))


def _exponential(
    matrix: tuple[tuple[float, ...], ...], initial: tuple[float, ...], t_s: float
) -> tuple[float, ...]:
    """exp(M t) initial >= 0, rounded up; inf where it leaves the doubles.

    exp(M t) = e^(-a t) exp((M + a I) t) with a >= 0 so large that M + a I >= 0: the series has no
    cancellation, and its tail after q = |(M + a I) t| / (N + 1) <= 1/2 is at most q / (1 - q) <= 1
    times its last term's largest entry.
    """
    size = len(matrix)
    shift = max(0.0, -min(matrix[i][i] for i in range(size)))
    rows = [
        [up(value + shift) if i == j and shift else value for j, value in enumerate(row)]
        for i, row in enumerate(matrix)
    ]
    norm = max(mul_up(sum_up(row), t_s) for row in rows)
    if not norm < 700.0:
        return tuple(float("inf") for _ in initial)
    term, total = list(initial), list(initial)
    for k in range(1, 2 * (int(norm) + 1) + 40):
        scaled = up(t_s / k)
        term = [mul_up(sum_up(map(mul_up, row, term)), scaled) for row in rows]
        total = [sum_up(pair) for pair in zip(total, term, strict=True)]
    total = [sum_up((value, max(term))) if max(term) else value for value in total]
    decay = exp_up(-_down_product(shift, t_s)) if shift else 1.0
    return tuple(mul_up(decay, value) for value in total)
