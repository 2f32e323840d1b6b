"""The local methods, and runs of a system with inputs that switch at random."""

from __future__ import annotations

import numpy as np
from tube_cases import Array, dense_times, march

from workbench.models import System
from workbench.reach import ReachTube
from workbench.reach.local import (
    LocalBlocks,
    LocalEffort,
    LocalEuclidean,
    LocalGrowth,
    LocalLagrangian,
    LocalMethod,
    LocalMetric,
    LocalNorm,
)
from workbench.sensitivity import Norm
from workbench.sensitivity.sampling import sample_initial_states
from workbench.sets import Box


def local_methods(step_s: float) -> dict[str, LocalMethod]:
    """Every local method, by name; weights and metrics are proposed."""
    effort = LocalEffort(6, 1e4, 1)
    return {
        "max": LocalNorm(Norm.MAX, None, step_s),
        "sum": LocalNorm(Norm.SUM, None, step_s),
        "euclidean": LocalEuclidean(None, step_s),
        "growth": LocalGrowth(step_s),
        "metric": LocalMetric(effort, step_s),
        "blocks": LocalBlocks(None, effort, step_s),
        "lagrangian": LocalLagrangian(step_s),
    }


def switching_runs(
    system: System, initial_set: Box, tube: ReachTube, *, count: int, per_step: int = 5
) -> tuple[Array, Array]:
    """Times and runs from vertices, faces and inside; disturbances jump between their ends."""
    ode, times = system.ode, dense_times(tube, per_step)
    rng = np.random.default_rng(11)
    states = sample_initial_states(initial_set.reordered(ode.names), count=count, seed=11)
    parameters, disturbances = (
        [(q.lower, q.upper) for q in group] for group in (ode.parameters, ode.disturbances)
    )
    p = np.array([[ends[i] for ends in parameters] for i in (0, 1)])
    w = np.array([[ends[i] for ends in disturbances] for i in (0, 1)])
    chosen = rng.integers(0, 2, (count, len(parameters)))
    held = np.repeat(
        rng.integers(0, 2, (count, len(times) // 10 + 1, len(disturbances))), 10, axis=1
    )
    # A third of the runs keeps its disturbances at one corner.
    held[::3] = held[::3, :1]
    runs = march(
        system,
        states,
        times,
        parameters=np.where(chosen, p[1], p[0]),
        disturbances=np.where(held, w[1], w[0])[:, : len(times) - 1],
    )
    return times, runs
