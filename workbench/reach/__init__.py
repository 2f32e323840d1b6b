"""Reach tubes of closed loops and their separation from people."""

from workbench.reach.compute import Partitioned, TubeMethod, compute_tube
from workbench.reach.sensitivity_tube import SensitivityTube
from workbench.reach.tube import ReachTube, TubeStatus

__all__ = [
    "Partitioned", "ReachTube", "SensitivityTube", "TubeMethod", "TubeStatus", "compute_tube",
]  # fmt: skip
