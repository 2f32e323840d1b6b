"""The trajectory that a local bound is measured from, enclosed, and the system seen from it."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.models.system import Ode, System
from workbench.reach.ranged_parameters import (
    initial_box,
    with_inputs_as_states,
    with_ranged_parameters_as_states,
)
from workbench.reach.tube import Array, ReachTube
from workbench.reach.validated.bounds import BatchInclusion, Range
from workbench.reach.validated.tube import ValidatedTube
from workbench.sensitivity.jacobian import IntervalJacobian
from workbench.sets import Box


@final
@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """A trajectory z* = (x*, q*) of the system and the box that all others start in.

    z = (x, q): the n states, then the ranged parameters and disturbances, q constant or arbitrary
    in time within `lower`, `upper`; q* is the middle. lower, upper, radius (n + m): the box at the
    start and its largest distance from z*. tube: encloses z* for all times, Rigor ENCLOSED.
    """

    system: System
    seen: Seen
    lower: Array
    upper: Array
    radius: Array
    tube: ReachTube

    @classmethod
    def of(cls, system: System, *, initial_set: Box, horizon_s: float, step_s: float) -> Reference:
        """The trajectory from the middle of `initial_set` (axes = state names)."""
        original, seen = system.ode, seen_of(system.ode)
        held = with_ranged_parameters_as_states(original)
        states = initial_box(original, held, initial_set)
        felt = {w.name: (w.lower, w.upper) for w in original.disturbances}
        box = Box.from_intervals({name: states.interval(name) for name in held.names} | felt)
        lower, upper = np.array(box.lower), np.array(box.upper)
        middle = np.clip(0.5 * lower + 0.5 * upper, lower, upper)
        point = Box.from_intervals(
            {name: (x, x) for name, x in zip(box.names, middle.tolist(), strict=True)}
        )
        tube = ValidatedTube(step_s).tube(seen.ode, initial_set=point, horizon_s=horizon_s)
        radius = np.nextafter(np.maximum(upper - middle, middle - lower), np.inf)
        return cls(system, seen, lower, upper, np.where(lower == upper, 0.0, radius), tube)

    @property
    def size(self) -> int:
        """Number n of the system's states."""
        return len(self.system.ode.states)

    def with_inputs(self, states: Range) -> Range:
        """The box (1, n + m) of these states (n,) and all admissible inputs."""
        low, high = states
        n = self.size
        return np.append(low, self.lower[n:])[None], np.append(high, self.upper[n:])[None]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """The system with parameters and disturbances as states, its range and its derivative."""

    ode: Ode
    field: BatchInclusion
    jacobian: IntervalJacobian

    def field_range(self, box: Range) -> tuple[Range, Array]:
        """Ranges of z' over boxes (B, n + m), and which of them are valid."""
        p = np.array([self.ode.parameter_values()]).reshape(1, -1)
        found, valid = self.field([box, (p, p)])
        return found[0], valid


@functools.lru_cache(maxsize=16)
def seen_of(original: Ode) -> Seen:
    """What depends on the system alone."""
    # At every instant the field sees values of the disturbances in their ranges, and the bounds use
    # nothing else of them.
    ode = with_inputs_as_states(original)
    return Seen(ode, BatchInclusion.of([ode.x, ode.p], [ode.field]), IntervalJacobian(ode))
