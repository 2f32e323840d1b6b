"""How far trajectories spread: proved and learned bounds, and their cross-examination."""

from workbench.sensitivity.discrepancy import Discrepancy, derive_discrepancy, learn_discrepancy
from workbench.sensitivity.examination import (
    Examination,
    ExaminationVerdict,
    Examiner,
    ProvedEnvelope,
)
from workbench.sensitivity.examine import cross_examine
from workbench.sensitivity.growth_matrix import GrowthMatrix
from workbench.sensitivity.learned import LearnedExponential
from workbench.sensitivity.weighted_norm import Norm, WeightedNorm

__all__ = [
    "Discrepancy",
    "Examination",
    "ExaminationVerdict",
    "Examiner",
    "GrowthMatrix",
    "LearnedExponential",
    "Norm",
    "ProvedEnvelope",
    "WeightedNorm",
    "cross_examine",
    "derive_discrepancy",
    "learn_discrepancy",
]
