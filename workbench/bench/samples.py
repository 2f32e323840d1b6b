"""Trajectories that press on a tube: all corners, faces, interior and gradient ascent."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark
from workbench.models.system import System
from workbench.sensitivity.ascent import gradient_states
from workbench.sensitivity.sampling import rollout, sample_initial_states, step_count
from workbench.sensitivity.vectorised import Array

_BLOCK = 2048
# Disturbances are held this long; at the end of a hold a run switches or keeps them.
_HOLD_S = 0.25
_SHARE_THAT_SWITCHES = 0.4
# Gradient ascent aims at every coordinate's extremes at multiples of this many of its own steps.
_ASCENT_STEP_S = 0.05
_ASCENT_EVERY = 5


@final
@dataclass(frozen=True, slots=True)
class SamplePlan:
    """count: trajectories; horizon_s: their length; step_s: Runge-Kutta step and sampling interval;
    seed: of all random choices."""

    count: int
    horizon_s: float
    step_s: float
    seed: int

    def __post_init__(self) -> None:
        if self.count < 1000:
            raise InputError(f"expected at least 1000 trajectories, got {self.count}")
        step_count(self.horizon_s, self.step_s)

    @property
    def times(self) -> Array:
        """The sampled times, 0 and horizon_s included."""
        return np.linspace(0.0, self.horizon_s, step_count(self.horizon_s, self.step_s) + 1)

    @property
    def blocks(self) -> int:
        """Number of blocks that `sampled_runs` yields."""
        return math.ceil(self.count / _BLOCK)


def initial_states(benchmark: Benchmark, plan: SamplePlan) -> Array:
    """All vertices, gradient-chosen states, then faces and interior in equal shares: (count, n)."""
    box = benchmark.initial_set.reordered(benchmark.system.ode.names)
    chosen = gradient_states(
        benchmark.system,
        box,
        horizon_s=plan.horizon_s,
        step_s=_ASCENT_STEP_S,
        every=_ASCENT_EVERY,
        seed=plan.seed,
    )
    others = sample_initial_states(box, count=plan.count - len(chosen), seed=plan.seed)
    return np.concatenate([chosen, others])


def sampled_runs(benchmark: Benchmark, plan: SamplePlan) -> Iterator[Array]:
    """Blocks of trajectories (N, K+1, n) at `plan.times`, `plan.count` in all.

    Disturbances jump between the corners of their range at random times, a multiple of 0.25 s.
    Rigor SAMPLED; the Runge-Kutta error at 0.0125 s is below 1e-10 on smooth loops.
    """
    rng = np.random.default_rng(plan.seed + 1)
    states = initial_states(benchmark, plan)
    for start in range(0, plan.count, _BLOCK):
        yield _block(benchmark.system, states[start : start + _BLOCK], plan, rng)


def _block(system: System, states: Array, plan: SamplePlan, rng: np.random.Generator) -> Array:
    ranges = system.ode.disturbances
    if not ranges:
        return rollout(system, states, horizon_s=plan.horizon_s, step_s=plan.step_s)
    corners = np.array([(r.lower, r.upper) for r in ranges])
    steps, hold = len(plan.times) - 1, max(1, round(_HOLD_S / plan.step_s))
    parts: list[Array] = [states[:, None, :]]
    values = _random_corners(corners, len(states), rng)
    for done in range(0, steps, hold):
        length = min(hold, steps - done)
        part = rollout(
            system,
            parts[-1][:, -1, :],
            horizon_s=length * plan.step_s,
            step_s=plan.step_s,
            disturbances=values,
        )
        parts.append(part[:, 1:, :])
        switches = rng.random(len(states)) < _SHARE_THAT_SWITCHES
        values = np.where(switches[:, None], _random_corners(corners, len(states), rng), values)
    return np.concatenate(parts, axis=1)


def _random_corners(corners: Array, count: int, rng: np.random.Generator) -> Array:
    upper = rng.random((count, len(corners))) < 0.5
    return np.asarray(np.where(upper, corners[:, 1], corners[:, 0]))
