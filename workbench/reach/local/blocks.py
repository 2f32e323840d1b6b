"""Several quadratic norms along a trajectory that feed each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from workbench.models.system import System
from workbench.reach.local.along import LocalRun, require_step, run_along, tube_along
from workbench.reach.local.quadratic import Forecast, LocalEffort
from workbench.reach.local.reference import Reference
from workbench.reach.tube import ReachTube
from workbench.sensitivity.block_choice import feedback_groups, named_blocks, separated
from workbench.sets import Box


@final
@dataclass(frozen=True, slots=True)
class LocalBlocks:
    """V' <= C V + D for the norms V_k = sqrt(e_k^T P_k e_k) of groups of states.

    C_kk is the rate of M_kk in P_k, C_kl the norm of M_kl from P_l to P_k, D_k that of d; M and d
    as in `Step`. blocks: names of the states of each group, every state in one; None takes the
    states that feed back into each other, and takes states out of them as long as the promised
    growth falls. effort, step_s, metrics and their changes as in `LocalMetric`. Rigor ENCLOSED;
    ends early as `run_along` says. Raises InputError where the groups are no partition. Source:
    Russo, di Bernardo and Sontag, IEEE TAC 58(5), 2013.
    """

    blocks: tuple[tuple[str, ...], ...] | None
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
        if self.blocks is None:
            groups = feedback_groups(forecast.hulls)
        else:
            groups = named_blocks(reference.system.ode.names, self.blocks)
        first = forecast.proposals(0, groups, self.effort)
        blocks = groups if self.blocks is not None else separated(groups, first.promise)
        return run_along(reference, forecast.bound(blocks, self.effort, first))
