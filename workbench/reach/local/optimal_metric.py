"""One quadratic norm along a trajectory, its metric proposed by semidefinite programming."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from workbench.models.system import System
from workbench.reach.local.along import LocalRun, require_step, run_along, tube_along
from workbench.reach.local.quadratic import Forecast, LocalEffort
from workbench.reach.local.reference import Reference
from workbench.reach.tube import ReachTube
from workbench.sensitivity.block_choice import core_and_translations
from workbench.sets import Box


@final
@dataclass(frozen=True, slots=True)
class LocalMetric:
    """||e||_P' <= r ||e||_P + ||d||_P with M^T P + P M <= 2 r P, M and d as in `Step`.

    P trades the rate against the width of the ellipsoid up to the horizon, for the matrices that a
    few runs about the reference are likely to need; r is proved for all matrices of every step by
    outward-rounded elimination, nothing of the solver is trusted. At `effort.proposals` steps a new
    metric is proposed, and taken when it is worth its price: ||e|| then grows by the root of
    lambda_max(P_old^-1/2 P_new P_old^-1/2). States that nothing depends on (translations) would
    force r >= 0; each is a scalar of its own. step_s: length of a step in s. Rigor ENCLOSED; ends
    early as `run_along` says.
    Source: Fan, Kapinski, Jin and Mitra, EMSOFT 2016 (locally optimal metrics).
    """

    effort: LocalEffort
    step_s: float

    def __post_init__(self) -> None:
        require_step(self.step_s)

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """A tube from `initial_set` (axes = state names) over [0, horizon_s]."""
        return tube_along(self, system, initial_set=initial_set, horizon_s=horizon_s)

    def along(self, reference: Reference) -> LocalRun:
        """The tube about a trajectory that is known."""
        forecast = Forecast.of(reference)
        blocks = core_and_translations(forecast.hulls)
        return run_along(reference, forecast.bound(blocks, self.effort))
