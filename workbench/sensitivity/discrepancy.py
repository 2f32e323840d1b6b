"""Discrepancy functions (the beta): how far two trajectories can be apart after a given time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, final

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import System
from workbench.sensitivity.inputs import Inputs
from workbench.sensitivity.jacobian import Cells
from workbench.sensitivity.learning.statement import Statement
from workbench.sets.box import Box


class Growth(Protocol):
    """The formula of a discrepancy: from initial distances to later ones."""

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """Bound on |e_i(t)| for every i, given |e_j(0)| <= initial_j."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """What a proved growth was derived from: the inputs assumed, and the cells of the region.

    Every inequality behind the growth holds for every matrix of every cell's Jacobian hull.
    """

    inputs: Inputs
    cells: Cells


@final
@dataclass(frozen=True, slots=True)
class Discrepancy:
    """|x_i(t) - x'_i(t)| <= radius(initial_radius, t)_i for two trajectories of one system.

    names: the states, in order. region: where the claim holds (`condition` says for which
    trajectories); axes that it leaves out are unrestricted. horizon_s: the claim ends there. norm:
    in words and formula. rigor: as its method says. growth: the function behind `radius`. proof:
    what can be re-checked; None for learned bounds. statements: what the runs behind a learned
    bound support; empty for proved ones.
    """

    names: tuple[str, ...]
    region: Box | None
    horizon_s: float
    norm: str
    rigor: Rigor
    condition: str
    growth: Growth
    proof: Proof | None = None
    statements: tuple[Statement, ...] = ()

    def radius(
        self, initial_radius: Mapping[str, float] | Sequence[float], t_s: float
    ) -> tuple[float, ...]:
        """Half widths at `t_s`, one per state in its own unit.

        initial_radius: bound on each |x_j(0) - x'_j(0)|, by name (missing means 0) or one per
        state. Raises InputError outside [0, horizon_s] or on a radius that is negative or not
        finite.
        """
        if not 0.0 <= t_s <= self.horizon_s:
            raise InputError(
                f"expected a time in [0, {self.horizon_s!r}] s, got {t_s!r}; "
                "derive with a longer horizon"
            )
        return self.growth.half_widths(self._checked(initial_radius), float(t_s))

    def _checked(self, radius: Mapping[str, float] | Sequence[float]) -> tuple[float, ...]:
        if isinstance(radius, Mapping):
            unknown = sorted(set(radius) - set(self.names))
            if unknown:
                raise InputError(
                    f"unknown states {unknown} in the radius; the states are {self.names}"
                )
            values = tuple(float(radius.get(name, 0.0)) for name in self.names)
        else:
            values = tuple(float(value) for value in radius)
        if len(values) != len(self.names):
            raise InputError(
                f"expected {len(self.names)} radii for {self.names}, got {len(values)}"
            )
        for name, value in zip(self.names, values, strict=True):
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"expected a finite radius >= 0 for {name!r}, got {value!r}")
        return values


class DerivationMethod(Protocol):
    """A way to prove a discrepancy."""

    def derive(self, system: System, *, region: Box, horizon_s: float) -> Discrepancy:
        """Bound valid for trajectories of `system` that stay in `region` up to `horizon_s`."""


class LearningMethod(Protocol):
    """A way to learn a discrepancy from runs."""

    def learn(self, system: System, *, initial_set: Box, horizon_s: float) -> Discrepancy:
        """Bound that the runs from `initial_set` up to `horizon_s` obeyed."""


def derive_discrepancy(
    system: System, *, region: Box, horizon_s: float, method: DerivationMethod
) -> Discrepancy:
    """Prove how far two trajectories in `region` can spread.

    region: a box over the states in their units; an axis may be left out where the Jacobian does
    not depend on it. horizon_s: end of the claim. method: for example
    `GrowthMatrix(cells=256, inputs=Inputs.SHARED)`.
    Both trajectories must stay in `region`, as a reach tube shows; the method's `inputs` say which
    parameters and disturbances they have. Rigor as the method states it. Raises InputError where
    the field has no derivative or its Jacobian cannot be enclosed on the region.
    """
    _check_horizon(horizon_s)
    unknown = sorted(set(region.names) - set(system.ode.names))
    if unknown:
        raise InputError(
            f"the region names {unknown}, which are no states; they are {system.ode.names}"
        )
    return method.derive(system, region=region, horizon_s=horizon_s)


def learn_discrepancy(
    system: System, *, initial_set: Box, horizon_s: float, method: LearningMethod
) -> Discrepancy:
    """Learn from runs how far two trajectories from `initial_set` spread. Rigor SAMPLED.

    initial_set: a box that names every state. method: for example `LearnedExponential(...)`.
    Raises InputError on a set without spread or a run that leaves the finite numbers.
    """
    _check_horizon(horizon_s)
    return method.learn(system, initial_set=initial_set, horizon_s=horizon_s)


def _check_horizon(horizon_s: float) -> None:
    if not (math.isfinite(horizon_s) and horizon_s > 0.0):
        raise InputError(f"expected a finite horizon_s > 0, got {horizon_s!r}")
