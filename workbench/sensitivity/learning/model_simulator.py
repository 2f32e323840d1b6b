"""A model as a black box: many runs at once by classical Runge-Kutta steps of order 4."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self, final

import casadi as ca
import numpy as np

from workbench.models.signals import Ranged
from workbench.models.system import System
from workbench.sensitivity.learning.draws import Words, uniforms
from workbench.sensitivity.sampling import instants, march
from workbench.sensitivity.vectorised import Array, Vectorised

# Runs are marched in whole groups of this many, so that the bits of a run do not depend on how
# many others are asked for: numpy may treat the rest of an array unlike its whole vectors.
_LANES = 64


@final
@dataclass(frozen=True, slots=True, eq=False)
class ModelSimulator:
    """Runs of x' = field(x, p, w), one step between instants; disturbances stay nominal.

    Parameters are uniform on their ranges, drawn from a row's seed. Can be sent to other processes.
    """

    field: ca.Function
    names: tuple[str, ...]
    parameters: tuple[Ranged, ...]
    disturbances: tuple[Ranged, ...]
    times: Array

    @classmethod
    def of(cls, system: System, *, horizon_s: float, step_s: float) -> Self:
        """Of a system. Raises InputError unless the horizon is a whole number of steps."""
        ode = system.ode
        times = instants(horizon_s, step_s)
        return cls(ode.function(), ode.names, ode.parameters, ode.disturbances, times)

    @property
    def what(self) -> str:
        """How its runs come about."""
        steps = f"runs of the model by Runge-Kutta steps of {self.times[1]:g} s"
        return steps + inputs_said(self.parameters, self.disturbances)

    def runs(self, initial_states: Array, seeds: Words) -> Array:
        """As `Simulator` says; a run that leaves the finite numbers holds inf or NaN from there."""
        count = len(initial_states)
        rows = np.minimum(np.arange(-(-count // _LANES) * _LANES), count - 1)
        w = np.array([each.nominal for each in self.disturbances])
        runs = march(
            Vectorised(self.field),
            np.ascontiguousarray(initial_states[rows].T),
            (drawn_parameters(self.parameters, seeds)[rows].T, w[:, None]),
            self.times,
        )
        return runs[:count]


def drawn_parameters(ranges: tuple[Ranged, ...], seeds: Words) -> Array:
    """Values (N, n_p), uniform on the ranges, from the seeds (N,); known constants stay exact."""
    lower = np.array([each.lower for each in ranges])
    upper = np.array([each.upper for each in ranges])
    share = uniforms(seeds, len(ranges))
    return np.asarray(np.clip(lower + share * (upper - lower), lower, upper))


def inputs_said(parameters: tuple[Ranged, ...], disturbances: tuple[Ranged, ...]) -> str:
    """What a model's inputs are during its runs, in words that continue a sentence."""
    text = ""
    if any(ranged.lower < ranged.upper for ranged in parameters):
        text += ", shared parameters uniform on their ranges"
    if disturbances:
        text += ", disturbances at their nominal values"
    return text
