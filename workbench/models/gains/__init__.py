"""Studies of a vehicle's gains: margins over speed, exact stability maps, the loop at samples.

>>> from workbench.models.gains import LateralLoop, Reason, conditions
>>> conditions(LateralLoop(1.75, 2.8, 2.0, 0.6, 0.05, 1.0)).reason() is Reason.STABLE
True
>>> conditions(LateralLoop(1.75, 2.8, 0.0, 0.6, 0.05, 1.0)).reason().short
'no damping'
"""

from workbench.models.gains.held import HeldLoop, Timing, schur_stable
from workbench.models.gains.jitter import Answer, judge, prove_contraction
from workbench.models.gains.lateral import AXES, LateralLoop, Schedule
from workbench.models.gains.over_speed import over_speed
from workbench.models.gains.responses import responses, step_response
from workbench.models.gains.routh import Reason, conditions, stability_pieces, stable_between
from workbench.models.gains.schedules import worst_pattern
from workbench.models.gains.spectral import critical_delay, sampled_map
from workbench.models.gains.stability_map import stability_map
from workbench.models.gains.study import (
    Effort,
    GainStudy,
    default_ranges,
    default_sampling,
    study_gains,
)

__all__ = [
    "AXES",
    "Answer",
    "Effort",
    "GainStudy",
    "HeldLoop",
    "LateralLoop",
    "Reason",
    "Schedule",
    "Timing",
    "conditions",
    "critical_delay",
    "default_ranges",
    "default_sampling",
    "judge",
    "over_speed",
    "prove_contraction",
    "responses",
    "sampled_map",
    "schur_stable",
    "stability_map",
    "stability_pieces",
    "stable_between",
    "step_response",
    "study_gains",
    "worst_pattern",
]
