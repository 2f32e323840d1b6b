"""Proved scalar discrepancy in a weighted Euclidean norm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import System
from workbench.sensitivity.blockwise import BlockwiseGrowth
from workbench.sensitivity.discrepancy import Discrepancy, Proof
from workbench.sensitivity.inputs import Inputs, mismatch
from workbench.sensitivity.jacobian import Cells, IntervalJacobian, refined, require_enclosed
from workbench.sensitivity.metric_bounds import Form, diagonal_rates
from workbench.sensitivity.metric_proposal import Aim, propose_metric
from workbench.sensitivity.vectorised import Array
from workbench.sensitivity.weighted_norm import half_widths, require_weights, squared_weights
from workbench.sets.box import Box

_CELLS_TO_PROPOSE = 16
_CONDITION_MAX = 1e8


@final
@dataclass(frozen=True, slots=True)
class EuclideanNorm:
    """||W e(t)|| <= e^(c t) ||W e(0)|| with c >= sup over the region of mu_2(W J W^-1).

    mu_2(B) is the largest eigenvalue of (B + B^T) / 2; over an interval Jacobian it is attained at
    sign vertices of a symmetric interval matrix, and each is bounded by outward-rounded
    elimination. weights: state -> weight > 0; None chooses them by semidefinite programs that
    minimise the promised growth of the region's half widths over the horizon (a proposal, c is
    proved afterwards). cells: the region is split into about this many, where mu is largest.
    inputs: what the trajectories share; what they do not enters as `BlockwiseGrowth.mismatch`.
    Needs both trajectories in the (convex) region. Rigor ENCLOSED. Raises InputError where the
    Jacobian cannot be enclosed. Source: Maidens and Arcak, IEEE TAC 60(1), 2015; Rohn, SIAM J.
    Matrix Anal. Appl. 15(1), 1994.
    """

    weights: Mapping[str, float] | None
    cells: int
    inputs: Inputs

    def __post_init__(self) -> None:
        if self.cells < 1:
            raise InputError(f"expected at least 1 cell, got {self.cells}")
        require_weights(self.weights)

    def derive(self, system: System, *, region: Box, horizon_s: float) -> Discrepancy:
        """The bound as one block with a diagonal metric, its entries the squared weights."""
        names = system.ode.names
        jacobian = IntervalJacobian(system)
        cells, scale = jacobian.start(region), half_widths(names, region)
        if self.weights is not None:
            squared = squared_weights(names, self.weights)
        else:
            budget = min(_CELLS_TO_PROPOSE, self.cells)
            cells = _split(jacobian, cells, 1.0 / scale**2, budget)
            aim = Aim(horizon_s, _CONDITION_MAX, diagonal=True, form=Form.CENTRE_RADIUS)
            squared = np.diag(
                propose_metric(cells.jacobian_lower, cells.jacobian_upper, scale=scale, aim=aim)
            )
        cells = _split(jacobian, cells, squared, self.cells)
        require_enclosed(cells, names)
        rate = float(_rates(cells, squared).max())
        metric = tuple(tuple(row) for row in np.diag(squared).tolist())
        felt = mismatch(system, region=region, inputs=self.inputs, cells=cells)
        return Discrepancy(
            names=names,
            region=region,
            horizon_s=horizon_s,
            rigor=Rigor.ENCLOSED,
            norm="Euclidean: ||e(t)|| <= exp(c t) ||e(0)||, ||e|| = sqrt(sum_i w_i^2 e_i^2)",
            condition=self.inputs.condition,
            growth=BlockwiseGrowth((tuple(range(len(names))),), (metric,), ((rate,),), felt),
            proof=Proof(self.inputs, cells),
        )


def _split(jacobian: IntervalJacobian, cells: Cells, squared: Array, budget: int) -> Cells:
    def score(candidates: Cells) -> Array:
        return _rates(candidates, squared)

    return refined(jacobian, cells, budget=budget, score=score)


def _rates(cells: Cells, squared: Array) -> Array:
    return diagonal_rates(cells.jacobian_lower, cells.jacobian_upper, squared_weights=squared)
