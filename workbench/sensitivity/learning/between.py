"""From the instants to all times: what a model's derivative adds to a learned bound."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import final

from workbench.errors import InputError
from workbench.models.system import System
from workbench.sensitivity.discrepancy import Discrepancy, Growth
from workbench.sensitivity.growth_matrix import GrowthMatrix
from workbench.sensitivity.inputs import Inputs
from workbench.sensitivity.rounding import up
from workbench.sets.box import Box


@final
@dataclass(frozen=True, slots=True)
class FilledGrowth:
    """|e(t)| <= exp(M (t - t_k)) |e(t_k)| after each instant t_k = k step_s.

    at_instants: the bound there. step: the growth from an instant on.
    """

    at_instants: Growth
    step: Growth
    step_s: float

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """Bound on |e_i(t)|; the growth over the step is rounded up."""
        nearest = round(t_s / self.step_s)
        if abs(t_s - nearest * self.step_s) <= 1e-12 * t_s:
            return self.at_instants.half_widths(initial, t_s)
        last = math.floor(t_s / self.step_s) * self.step_s
        return self.step.half_widths(self.at_instants.half_widths(initial, last), up(t_s - last))


def between_instants(
    learned: Discrepancy, *, system: System, region: Box, step_s: float, cells: int
) -> Discrepancy:
    """`learned`, extended to all times by D+|e| <= M |e| with the Metzler bound M over `region`.

    region: convex, so that the Jacobian between two runs inside is one of it; cells: as in
    `GrowthMatrix`. Holds between instants for a pair of exact solutions with the same inputs that
    stays in the region and keeps the learned bound at the instants; nothing is added to the
    probability of the latter. Rigor SAMPLED. Source: as `GrowthMatrix`. Raises InputError where the
    names differ or the Jacobian cannot be enclosed on the region.
    """
    if learned.names != system.ode.names:
        raise InputError(f"expected a bound over {system.ode.names}, got one over {learned.names}")
    if not 0.0 < step_s <= learned.horizon_s:
        raise InputError(
            f"expected 0 < step_s <= {learned.horizon_s!r}, got {step_s!r}; give the spacing of "
            "the instants the bound was learned on"
        )
    growth = GrowthMatrix(cells=cells, inputs=Inputs.SHARED).derive(
        system, region=region, horizon_s=step_s
    )
    between = (
        "between the instants the bound grows by the Jacobian over the region, and holds for exact "
        "solutions with the same inputs that keep it at the instants and stay in the region; no "
        "probability is claimed for staying there"
    )
    return replace(
        learned,
        norm=f"{learned.norm}; from instant to instant exp(M t), M the Metzler bound",
        condition=f"{learned.condition}; {between}",
        growth=FilledGrowth(learned.growth, growth.growth, step_s),
        statements=tuple(replace(each, between=between) for each in learned.statements),
    )
