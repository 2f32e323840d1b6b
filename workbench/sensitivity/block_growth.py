"""Proved block-wise discrepancy: a quadratic norm for each group of states, and their exchange."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import System
from workbench.sensitivity.block_choice import (
    Proposals,
    feedback_groups,
    named_blocks,
    separated,
)
from workbench.sensitivity.blockwise import (
    Blocks,
    BlockwiseGrowth,
    Metric,
    comparison_bounds,
    rows,
)
from workbench.sensitivity.discrepancy import Discrepancy, Proof
from workbench.sensitivity.growth_matrix import excess
from workbench.sensitivity.inputs import Inputs, mismatch
from workbench.sensitivity.jacobian import Cells, IntervalJacobian, refined, require_enclosed
from workbench.sensitivity.metric_bounds import Form
from workbench.sensitivity.metric_proposal import Aim
from workbench.sensitivity.vectorised import Array
from workbench.sensitivity.weighted_norm import half_widths
from workbench.sets.box import Box

# Metrics are proposed for a coarser cover than the one they are proved on.
_CELLS_TO_PROPOSE = 16


@final
@dataclass(frozen=True, slots=True)
class Effort:
    """How metrics are chosen and proved.

    form: how the matrices of a cell's Jacobian hull are covered; condition_max: largest ratio of a
    metric's eigenvalues in units of the region's half widths; cells: the region is split into about
    this many, where growth is largest.
    """

    form: Form
    condition_max: float
    cells: int

    def __post_init__(self) -> None:
        if self.cells < 1:
            raise InputError(f"expected at least 1 cell, got {self.cells}")
        if not self.condition_max >= 1.0:
            raise InputError(f"expected condition_max >= 1, got {self.condition_max!r}")

    def aim(self, horizon_s: float) -> Aim:
        """What metrics are chosen for."""
        return Aim(horizon_s, self.condition_max, diagonal=False, form=self.form)


@final
@dataclass(frozen=True, slots=True)
class BlockGrowth:
    """V' <= M V for the norms V_k = sqrt(e_k^T P_k e_k) of groups of states.

    M_kk is the rate of A_kk in P_k, M_kl the norm of A_kl from P_l to P_k, over all matrices A of
    the interval Jacobian. blocks: names of the states of each group, every state in one; None
    takes the strongly connected groups (states that feed back into each other) and takes states
    out of them as long as the promised growth falls. The metrics come
    from semidefinite programs and are rounded; M is proved afterwards by outward-rounded
    elimination for every matrix of every cell, nothing of the solver is trusted. inputs: what the
    trajectories share; what they do not enters as `BlockwiseGrowth.mismatch`. Needs both
    trajectories in the (convex) region. Rigor ENCLOSED. Raises InputError where the Jacobian cannot
    be enclosed or the groups are no partition. Source: Russo, di Bernardo and Sontag, IEEE TAC
    58(5), 2013.
    """

    blocks: tuple[tuple[str, ...], ...] | None
    effort: Effort
    inputs: Inputs

    def derive(self, system: System, *, region: Box, horizon_s: float) -> Discrepancy:
        """The bound with its metrics and comparison matrix."""
        names = system.ode.names
        jacobian = IntervalJacobian(system)
        cells, scale = jacobian.start(region), half_widths(names, region)
        given = self.blocks is not None
        blocks = feedback_groups(cells) if self.blocks is None else named_blocks(names, self.blocks)
        cells = cells_to_propose(jacobian, cells, blocks=blocks, scale=scale, effort=self.effort)
        proposals = Proposals(cells, scale=scale, aim=self.effort.aim(horizon_s))
        blocks = blocks if given else separated(blocks, proposals.promise)
        comparison, cells = proved_comparison(
            jacobian, cells, blocks=blocks, metrics=proposals.metrics(blocks), effort=self.effort
        )
        require_enclosed(cells, names)
        groups = " | ".join(", ".join(names[i] for i in block) for block in blocks)
        felt = mismatch(system, region=region, inputs=self.inputs, cells=cells)
        return Discrepancy(
            names=names,
            region=region,
            horizon_s=horizon_s,
            rigor=Rigor.ENCLOSED,
            norm=f"block-wise: V(t) <= exp(M t) V(0), V_k = sqrt(e_k^T P_k e_k) over {groups}",
            condition=self.inputs.condition,
            growth=BlockwiseGrowth(blocks, proposals.metrics(blocks), comparison, felt),
            proof=Proof(self.inputs, cells),
        )


def cells_to_propose(
    jacobian: IntervalJacobian, start: Cells, *, blocks: Blocks, scale: Array, effort: Effort
) -> Cells:
    """A cover that is coarse enough for programs over its Jacobian hulls."""
    plain = tuple(rows(np.diag(1.0 / scale[list(block)] ** 2)) for block in blocks)
    return _split(jacobian, start, blocks, plain, min(_CELLS_TO_PROPOSE, effort.cells))


def proved_comparison(
    jacobian: IntervalJacobian,
    cells: Cells,
    *,
    blocks: Blocks,
    metrics: tuple[Metric, ...],
    effort: Effort,
) -> tuple[Metric, Cells]:
    """The comparison matrix of the metrics, and the finer cells on which it is proved."""
    cells = _split(jacobian, cells, blocks, metrics, effort.cells)
    bounds = _comparisons(cells, blocks, metrics, effort.form)
    return rows(bounds.max(axis=0)), cells


def _split(
    jacobian: IntervalJacobian,
    cells: Cells,
    blocks: Blocks,
    metrics: tuple[Metric, ...],
    budget: int,
) -> Cells:
    def score(candidates: Cells) -> Array:
        return excess(_comparisons(candidates, blocks, metrics, Form.CENTRE_RADIUS))

    return refined(jacobian, cells, budget=budget, score=score)


def _comparisons(cells: Cells, blocks: Blocks, metrics: tuple[Metric, ...], form: Form) -> Array:
    hulls = (cells.jacobian_lower, cells.jacobian_upper)
    return comparison_bounds(*hulls, blocks=blocks, metrics=metrics, form=form)
