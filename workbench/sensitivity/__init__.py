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
from workbench.sensitivity.learning.between import between_instants
from workbench.sensitivity.learning.evidence import APriori, HoldOut, WaitAndJudge
from workbench.sensitivity.learning.exponential import GlobalExponential, SetExponential
from workbench.sensitivity.learning.learn import discrepancy_of, learn_from_pairs
from workbench.sensitivity.learning.matrix_form import MatrixForm
from workbench.sensitivity.learning.piecewise import PiecewiseExponential
from workbench.sensitivity.learning.published import PublishedTool
from workbench.sensitivity.learning.statement import Argument, Statement
from workbench.sensitivity.metric_bounds import Form
from workbench.sensitivity.optimal_metric import OptimalMetric
from workbench.sensitivity.weighted_norm import Norm, WeightedNorm

__all__ = [
    "APriori",
    "Argument",
    "BlockGrowth",
    "Discrepancy",
    "Effort",
    "EuclideanNorm",
    "Examination",
    "ExaminationVerdict",
    "Examiner",
    "Form",
    "GlobalExponential",
    "GrowthMatrix",
    "HoldOut",
    "Inputs",
    "LearnedExponential",
    "MatrixForm",
    "Norm",
    "OptimalMetric",
    "PiecewiseExponential",
    "Proof",
    "ProvedEnvelope",
    "PublishedTool",
    "SetExponential",
    "Statement",
    "WaitAndJudge",
    "WeightedNorm",
    "between_instants",
    "cross_examine",
    "derive_discrepancy",
    "discrepancy_of",
    "learn_discrepancy",
    "learn_from_pairs",
]
