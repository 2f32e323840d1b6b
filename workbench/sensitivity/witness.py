"""A pair of runs that refutes a discrepancy, and its replay."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.models.system import System
from workbench.sensitivity.ascent import Pairs
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.learning.pairs import Simulator
from workbench.sensitivity.sampling import Flow


@final
@dataclass(frozen=True, slots=True)
class Witness:
    """Two initial states whose runs are further apart at `time_s` than the bound says.

    first, second: states; parameters: shared values; distance: |second - first| of `coordinate` at
    `time_s` by Runge-Kutta steps of `step_s`; integration_error: its estimated error (from halving
    the step); bound: what the examined discrepancy promised for these initial distances.
    """

    first: tuple[float, ...]
    second: tuple[float, ...]
    parameters: tuple[float, ...]
    time_s: float
    coordinate: str
    distance: float
    integration_error: float
    bound: float
    step_s: float

    @property
    def excess(self) -> float:
        """By how much the bound fails, in the coordinate's unit."""
        return self.distance - self.bound

    def replay(self, system: System) -> float:
        """Run the pair again: the distance, equal to `distance` on the same machine."""
        return _distance(self, system, self.step_s)


@final
@dataclass(frozen=True, slots=True)
class SimulatedWitness:
    """The same of a black box: two initial states and the seed that their runs share.

    distance: |second - first| of `coordinate` at `time_s` as the simulator gives it, twice the
    same; how far the simulator itself errs is not known.
    """

    first: tuple[float, ...]
    second: tuple[float, ...]
    seed: int
    time_s: float
    coordinate: str
    distance: float
    bound: float

    @property
    def excess(self) -> float:
        """By how much the bound fails, in the coordinate's unit."""
        return self.distance - self.bound

    def replay(self, simulator: Simulator) -> float:
        """Run the pair again: the distance, equal to `distance` with the same simulator."""
        seeds = np.full(2, self.seed, dtype=np.uint64)
        runs = simulator.runs(np.array([self.first, self.second]), seeds)
        index = tuple(simulator.names).index(self.coordinate)
        instant = int(np.argmin(np.abs(simulator.times - self.time_s)))
        return abs(float(runs[1, instant, index] - runs[0, instant, index]))


AnyWitness = Witness | SimulatedWitness


def own_bound(pair: Pairs, claim: Discrepancy, time_s: float) -> tuple[float, ...]:
    """What `claim` promises at `time_s` for the initial distances of the pair's first row."""
    gaps = [
        0.0 if a == b else math.nextafter(abs(float(b) - float(a)), math.inf)
        for a, b in zip(pair.first[0], pair.second[0], strict=True)
    ]
    return claim.radius(gaps, time_s)


def confirmed(
    flow: Flow, pair: Pairs, *, coordinate: int, time_s: float, claim: Discrepancy
) -> Witness | None:
    """The first row of `pair` as a witness against `claim`, or None if it does not stand.

    Runs it again with a quarter of the flow's step; the distance must exceed the bound by more
    than the difference to half the step, and the bound is taken for the pair's own initial
    distances.
    """
    system, step_s = flow.system, flow.step_s
    first, second = pair.first[0], pair.second[0]
    trial = Witness(
        tuple(first.tolist()),
        tuple(second.tolist()),
        tuple(pair.parameters[0].tolist()),
        time_s=time_s,
        coordinate=claim.names[coordinate],
        distance=0.0,
        integration_error=0.0,
        bound=own_bound(pair, claim, time_s)[coordinate],
        step_s=step_s / 4.0,
    )
    distance = _distance(trial, system, step_s / 4.0)
    rounding = 1e-13 * (1.0 + float(np.max(np.abs(np.concatenate([first, second])))))
    error = abs(distance - _distance(trial, system, step_s / 2.0)) + rounding
    if not distance - error > trial.bound:
        return None
    return Witness(
        trial.first,
        trial.second,
        trial.parameters,
        time_s,
        trial.coordinate,
        distance,
        error,
        trial.bound,
        trial.step_s,
    )


def _distance(witness: Witness, system: System, step_s: float) -> float:
    pair = Pairs(
        np.array([witness.first]), np.array([witness.second]), np.array([witness.parameters])
    )
    index = system.ode.names.index(witness.coordinate)
    if witness.time_s == 0.0:
        return abs(witness.second[index] - witness.first[index])
    difference = pair.differences(Flow(system, witness.time_s, step_s))
    return abs(float(difference[0, -1, index]))
