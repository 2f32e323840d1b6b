"""How far trajectories spread: proved and learned bounds, and their cross-examination."""

from workbench.sensitivity.block_growth import BlockGrowth, Effort
from workbench.sensitivity.discrepancy import (
    Discrepancy,
    Proof,
    derive_discrepancy,
    learn_discrepancy,
)
from workbench.sensitivity.euclidean_norm import EuclideanNorm
from workbench.sensitivity.examination import (
    Examination,
    ExaminationVerdict,
    Examiner,
    ProvedEnvelope,
)
from workbench.sensitivity.examine import cross_examine
from workbench.sensitivity.growth_matrix import GrowthMatrix
from workbench.sensitivity.inputs import Inputs
from workbench.sensitivity.learned import LearnedExponential
from workbench.sensitivity.metric_bounds import Form
from workbench.sensitivity.optimal_metric import OptimalMetric
from workbench.sensitivity.weighted_norm import Norm, WeightedNorm

__all__ = [
    "BlockGrowth",
    "Discrepancy",
    "Effort",
    "EuclideanNorm",
    "Examination",
    "ExaminationVerdict",
    "Examiner",
    "Form",
    "GrowthMatrix",
    "Inputs",
    "LearnedExponential",
    "Norm",
    "OptimalMetric",
    "Proof",
    "ProvedEnvelope",
    "WeightedNorm",
    "cross_examine",
    "derive_discrepancy",
    "learn_discrepancy",
]
