"""Tubes along one enclosed trajectory: bounds on the distance to it, advanced step by step."""

from workbench.reach.local.along import LocalMethod, LocalRun
from workbench.reach.local.blocks import LocalBlocks
from workbench.reach.local.fixed_norm import LocalEuclidean, LocalNorm
from workbench.reach.local.growth import LocalGrowth
from workbench.reach.local.lagrangian import LocalLagrangian
from workbench.reach.local.optimal_metric import LocalMetric
from workbench.reach.local.quadratic import Effort
from workbench.reach.local.reference import Reference

__all__ = [
    "Effort",
    "LocalBlocks",
    "LocalEuclidean",
    "LocalGrowth",
    "LocalLagrangian",
    "LocalMethod",
    "LocalMetric",
    "LocalNorm",
    "LocalRun",
    "Reference",
]
