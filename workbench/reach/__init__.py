"""Reach tubes of closed loops and their separation from people."""

from workbench.reach.compute import Partitioned, TubeMethod, compute_tube
from workbench.reach.sensitivity_tube import SensitivityTube
from workbench.reach.separation import PathGround, PlaneGround, Separation, check_separation
from workbench.reach.tube import KinkRecord, ReachTube, TubeStatus
from workbench.reach.validated.tube import ValidatedTube

__all__ = [
    "KinkRecord",
    "Partitioned",
    "PathGround",
    "PlaneGround",
    "ReachTube",
    "SensitivityTube",
    "Separation",
    "TubeMethod",
    "TubeStatus",
    "ValidatedTube",
    "check_separation",
    "compute_tube",
]
