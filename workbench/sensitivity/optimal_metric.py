"""Proved discrepancy in one optimal quadratic norm, proposed by semidefinite programming."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from workbench.claims import Rigor
from workbench.models.system import System
from workbench.sensitivity.block_choice import Proposals, core_and_translations
from workbench.sensitivity.block_growth import Effort, cells_to_propose, proved_comparison
from workbench.sensitivity.blockwise import BlockwiseGrowth
from workbench.sensitivity.discrepancy import Discrepancy, Proof
from workbench.sensitivity.inputs import Inputs, mismatch
from workbench.sensitivity.jacobian import IntervalJacobian, require_enclosed
from workbench.sensitivity.weighted_norm import half_widths
from workbench.sets.box import Box


@final
@dataclass(frozen=True, slots=True)
class OptimalMetric:
    """||e(t)||_P <= e^(r t) ||e(0)||_P with A^T P + P A <= 2 r P for all A of the Jacobian hulls.

    P and r trade the rate against the width of the ellipsoid over the horizon: in units of the
    region's half widths, r T + log max_i sqrt((P^-1)_ii) is least among the metrics that bisection
    over semidefinite programs finds. P is rounded, and r is proved afterwards by outward-rounded
    elimination for every matrix of every cell; nothing of the solver is trusted. States that
    nothing depends on (translations) would force r >= 0: they are left out of the metric and
    integrated, each a block of its own in `BlockwiseGrowth`. inputs: what the trajectories share;
    what they do not enters as its mismatch. Needs both trajectories in the (convex) region. Rigor
    ENCLOSED. Raises InputError where the Jacobian cannot be enclosed or has too many extreme
    matrices. Source: Aylward, Parrilo and Slotine, Automatica 44(8), 2008.
    """

    effort: Effort
    inputs: Inputs

    def derive(self, system: System, *, region: Box, horizon_s: float) -> Discrepancy:
        """The bound with its metric."""
        names = system.ode.names
        jacobian = IntervalJacobian(system)
        cells, scale = jacobian.start(region), half_widths(names, region)
        blocks = core_and_translations(cells)
        cells = cells_to_propose(jacobian, cells, blocks=blocks, scale=scale, effort=self.effort)
        proposals = Proposals(cells, scale=scale, aim=self.effort.aim(horizon_s))
        metrics = proposals.metrics(blocks)
        comparison, cells = proved_comparison(
            jacobian, cells, blocks=blocks, metrics=metrics, effort=self.effort
        )
        require_enclosed(cells, names)
        core = ", ".join(names[i] for i in blocks[0])
        felt = mismatch(system, region=region, inputs=self.inputs, cells=cells)
        return Discrepancy(
            names=names,
            region=region,
            horizon_s=horizon_s,
            rigor=Rigor.ENCLOSED,
            norm=f"metric: ||e(t)|| <= exp(r t) ||e(0)||, ||e|| = sqrt(e^T P e) over {core}",
            condition=self.inputs.condition,
            growth=BlockwiseGrowth(blocks, metrics, comparison, felt),
            proof=Proof(self.inputs, cells),
        )
