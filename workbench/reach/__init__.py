"""Reach tubes of closed loops and their separation from people."""

from workbench.reach.certified.certificate import (
    certificate_text,
    spread_certificate,
    tube_certificate,
)
from workbench.reach.certified.frame_tube import FrameTube
from workbench.reach.compute import Partitioned, TubeMethod, compute_tube
from workbench.reach.findings.encounter import Encounter
from workbench.reach.findings.finding import Finding, FindingEffort, Outcome, explain_separation
from workbench.reach.inner.extremes import SearchEffort
from workbench.reach.inner.hull import InnerHull, inner_hull, proved_ratio
from workbench.reach.learned.tube import LearnedTube
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
from workbench.reach.person_clearance import Nearest, nearest_people
from workbench.reach.sampled_data.tube import SampledTube
from workbench.reach.separation import (
    Comparison,
    PathGround,
    PlaneGround,
    Separation,
    check_separation,
)
from workbench.reach.switching.tube import Switched
from workbench.reach.tube import KinkRecord, ReachTube, TubeStatus
from workbench.reach.validated.tube import ValidatedTube

__all__ = [
    "Comparison",
    "Encounter",
    "Finding",
    "FindingEffort",
    "FrameTube",
    "InnerHull",
    "KinkRecord",
    "LearnedTube",
    "LocalBlocks",
    "LocalEffort",
    "LocalEuclidean",
    "LocalGrowth",
    "LocalLagrangian",
    "LocalMethod",
    "LocalMetric",
    "LocalNorm",
    "Nearest",
    "Outcome",
    "Partitioned",
    "PathGround",
    "PlaneGround",
    "ReachTube",
    "SampledTube",
    "SearchEffort",
    "Separation",
    "Switched",
    "TubeMethod",
    "TubeStatus",
    "ValidatedTube",
    "certificate_text",
    "check_separation",
    "compute_tube",
    "explain_separation",
    "inner_hull",
    "nearest_people",
    "proved_ratio",
    "spread_certificate",
    "tube_certificate",
]
