"""Tubes along one enclosed trajectory x*: bounds on e = x - x*, advanced step by step.

In the methods' formulas e' = M(t) e + d(t): M is the mean Jacobian between x* and the other
trajectory, d what other parameters and disturbances than those of x* add (`along.Step`). All
methods end early as `along.run_along` says, and raise InputError on a step_s that is not positive.
"""

from workbench.reach.local.along import LocalMethod, LocalRun
from workbench.reach.local.blocks import LocalBlocks
from workbench.reach.local.fixed_norm import LocalEuclidean, LocalNorm
from workbench.reach.local.growth import LocalGrowth
from workbench.reach.local.lagrangian import LocalLagrangian
from workbench.reach.local.optimal_metric import LocalMetric
from workbench.reach.local.quadratic import LocalEffort
from workbench.reach.local.reference import Reference

__all__ = [
    "LocalBlocks",
    "LocalEffort",
    "LocalEuclidean",
    "LocalGrowth",
    "LocalLagrangian",
    "LocalMethod",
    "LocalMetric",
    "LocalNorm",
    "LocalRun",
    "Reference",
]
