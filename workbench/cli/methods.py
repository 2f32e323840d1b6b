"""The methods that `workbench derive` compares, by the names it gives them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from workbench.reach import TubeMethod, ValidatedTube
from workbench.reach.local import (
    LocalBlocks,
    LocalEffort,
    LocalEuclidean,
    LocalGrowth,
    LocalLagrangian,
    LocalMethod,
    LocalMetric,
    LocalNorm,
)
from workbench.sensitivity import GrowthMatrix, Norm, WeightedNorm
from workbench.sensitivity.block_growth import BlockGrowth, Effort
from workbench.sensitivity.discrepancy import DerivationMethod
from workbench.sensitivity.euclidean_norm import EuclideanNorm
from workbench.sensitivity.inputs import Inputs
from workbench.sensitivity.metric_bounds import Form
from workbench.sensitivity.optimal_metric import OptimalMetric

CONDITION_MAX: Final = 1e4
# Metrics are offered this often along a trajectory: at the start and half way.
_PROPOSALS: Final = 2
# Up to 2^8 extreme matrices are cheap to check.
_VERTICES: Final = 8

RegionMethod = Callable[[int, Inputs, bool], DerivationMethod]


def _over_region(cells: int, kinked: bool) -> Effort:
    form = Form.CENTRE_RADIUS if kinked else Form.VERTICES
    return Effort(form, CONDITION_MAX, cells)


def _along() -> LocalEffort:
    return LocalEffort(_VERTICES, CONDITION_MAX, _PROPOSALS)


# From the number of cells, what the trajectories share, and whether the field has kinks: undecided
# ones make so many entries of the Jacobian uncertain that its extreme matrices are too many.
REGION: Final[dict[str, RegionMethod]] = {
    "norm-max": lambda cells, inputs, _: WeightedNorm(Norm.MAX, None, cells, inputs),
    "norm-sum": lambda cells, inputs, _: WeightedNorm(Norm.SUM, None, cells, inputs),
    "norm-euclidean": lambda cells, inputs, _: EuclideanNorm(None, cells, inputs),
    "growth-matrix": lambda cells, inputs, _: GrowthMatrix(cells, inputs),
    "metric": lambda cells, inputs, kinked: OptimalMetric(_over_region(cells, kinked), inputs),
    "blocks": lambda cells, inputs, kinked: BlockGrowth(None, _over_region(cells, kinked), inputs),
}
# From the step in s.
LOCAL: Final[dict[str, Callable[[float], LocalMethod]]] = {
    "local-norm-max": lambda step_s: LocalNorm(Norm.MAX, None, step_s),
    "local-norm-sum": lambda step_s: LocalNorm(Norm.SUM, None, step_s),
    "local-norm-euclidean": lambda step_s: LocalEuclidean(None, step_s),
    "local-growth": LocalGrowth,
    "local-metric": lambda step_s: LocalMetric(_along(), step_s),
    "local-blocks": lambda step_s: LocalBlocks(None, _along(), step_s),
    "local-lagrangian": LocalLagrangian,
}
TUBES: Final[dict[str, Callable[[float], TubeMethod]]] = {
    "sensitivity-linear": lambda step_s: ValidatedTube(step_s, degree=1),
    "sensitivity-quadratic": lambda step_s: ValidatedTube(step_s, degree=2),
}
