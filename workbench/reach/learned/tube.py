"""The paper's own method: one simulation for each region of the initial set, bloated by a beta."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import Ode, System
from workbench.reach.compute import hull
from workbench.reach.tube import Array, ReachTube, TubeStatus
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.sampling import instants, ordered_box, rollout
from workbench.sets import Box

MOST_REGIONS: Final = 64


@final
@dataclass(frozen=True, slots=True)
class LearnedTube:
    """Simulate from the middle of every region, bloat by the learned beta, and take the union.

    At t_k: union over regions i of [xi_i(t_k) - beta(r_i, t_k), xi_i(t_k) + beta(r_i, t_k)], with
    xi_i the classical Runge-Kutta solution from the middle of region i and r_i its radii.

    learned: the beta (`learn_discrepancy`); regions: how many along each state that is named, one
    along the others; step_s: spacing of the instants and of the simulation, s. Rigor SAMPLED, and
    less than `learned` states: that is about pairs of which both ends are drawn, and here one end
    is the middle of a region. A row of the tube, between two instants, is the hull of the sets at
    its ends; nothing more is claimed of it. The system's disturbances and parameters must have one
    value each, because a pair of runs has them in common. A set that is not inside `learned.region`
    gives a tube without rows (LEFT_REGION), a simulation that leaves the finite numbers one that
    ends there (ENCLOSURE_FAILED). InputError for another system's beta, and for a horizon beyond
    its own. Source: Fan, Qi, Mitra, Viswanathan, "DryVR", CAV 2017, and the paper's section on
    online reachability.
    """

    learned: Discrepancy
    regions: Mapping[str, int]
    step_s: float

    def __post_init__(self) -> None:
        unknown = sorted(set(self.regions) - set(self.learned.names))
        wrong = any(count < 1 for count in self.regions.values())
        if unknown or wrong or self.count > MOST_REGIONS:
            raise InputError(
                f"expected regions along {self.learned.names}, one or more each and at most "
                f"{MOST_REGIONS} in all, got {dict(self.regions)}; split fewer states"
            )

    @property
    def count(self) -> int:
        """Number of regions."""
        return math.prod(self.regions.values())

    def cells(self, system: System, *, initial_set: Box, horizon_s: float) -> tuple[ReachTube, ...]:
        """One tube per region; their union is the tube, of which `tube` gives the hull."""
        ode, learned = system.ode, self.learned
        self._check(ode, horizon_s)
        box = ordered_box(ode, initial_set, "initial set")
        times = instants(horizon_s, self.step_s)
        outside = outside_of(learned, box)
        if outside:
            return (_nothing(box, outside),)
        regions = box.split(self.regions)
        runs = rollout(
            system,
            np.array([region.center for region in regions]),
            horizon_s=horizon_s,
            step_s=self.step_s,
        )
        return tuple(
            _bloated(run, self._half_widths(region, times), times, ode.names)
            for run, region in zip(runs, regions, strict=True)
        )

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """The hull of all regions' tubes."""
        return hull(self.cells(system, initial_set=initial_set, horizon_s=horizon_s))

    def _half_widths(self, region: Box, times: Array) -> Array:
        return np.array([self.learned.radius(region.radius, t) for t in times.tolist()])

    def _check(self, ode: Ode, horizon_s: float) -> None:
        if ode.names != self.learned.names:
            raise InputError(
                f"expected a bound for the states {ode.names}, got one for {self.learned.names}; "
                "learn it on this system"
            )
        ranged = [q.name for q in (*ode.parameters, *ode.disturbances) if q.lower < q.upper]
        if ranged:
            raise InputError(
                f"expected parameters and disturbances with one value each, got ranges of {ranged};"
                " the two runs of a learned pair have them in common, so that a tube about one run "
                "says nothing of other values"
            )
        if not 0.0 < horizon_s <= self.learned.horizon_s:
            raise InputError(
                f"expected a horizon of at most {self.learned.horizon_s:g} s, to which the bound "
                f"was learned, got {horizon_s:g} s; learn with a longer one"
            )


def outside_of(learned: Discrepancy, box: Box) -> str:
    """Along which states a set reaches beyond where the bound was learned, in words; '' if none."""
    region = learned.region
    if region is None:
        return ""
    axes = [
        name
        for name in region.names
        if not (
            region.interval(name)[0] <= box.interval(name)[0]
            and box.interval(name)[1] <= region.interval(name)[1]
        )
    ]
    return (
        f"the initial set is not inside the set that the bound was learned on along {axes}; learn "
        "on a larger one"
        if axes
        else ""
    )


def _nothing(box: Box, message: str) -> ReachTube:
    none = np.empty((0, len(box.names)))
    return ReachTube(
        np.zeros(1), none, none, np.array([box.lower]), np.array([box.upper]), box.names,
        TubeStatus.LEFT_REGION, Rigor.SAMPLED, message,
    )  # fmt: skip


def _bloated(run: Array, half_widths: Array, times: Array, names: tuple[str, ...]) -> ReachTube:
    """Boxes (K+1, n) about a run, and the hulls of neighbours, as far as all is finite."""
    finite = np.isfinite(run).all(axis=1) & np.isfinite(half_widths).all(axis=1)
    rows = len(times) if finite.all() else int(np.argmin(finite))
    lower, upper = run[:rows] - half_widths[:rows], run[:rows] + half_widths[:rows]
    complete = rows == len(times)
    return ReachTube(
        times[:rows],
        np.minimum(lower[:-1], lower[1:]), np.maximum(upper[:-1], upper[1:]), lower, upper, names,
        TubeStatus.COMPLETE if complete else TubeStatus.ENCLOSURE_FAILED, Rigor.SAMPLED,
        "" if complete else f"the simulation left the finite numbers after {times[rows - 1]:.3f} s",
    )  # fmt: skip
