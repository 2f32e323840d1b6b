"""Search for the initial states that drive a trajectory, or a pair of them, to its extremes."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.models.system import System
from workbench.sensitivity.sampling import (
    Flow,
    ordered_box,
    parameter_states,
    rollout,
    step_count,
    uniform_states,
)
from workbench.sensitivity.vectorised import Array, Index
from workbench.sets.box import Box

# Lengths of the projected steps, as shares of the box's half widths; inf: to the vertex.
_STEPS = (np.inf, 1.0, 0.3, 0.05)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Rows of two initial states (N, n) each, with shared parameters (N, m)."""

    first: Array
    second: Array
    parameters: Array

    def take(self, rows: Index) -> Pairs:
        """The chosen rows."""
        return Pairs(self.first[rows], self.second[rows], self.parameters[rows])

    def differences(self, flow: Flow) -> Array:
        """second minus first along the runs: (N, K+1, n)."""
        count = len(self.first)
        runs = rollout(
            flow.system,
            np.concatenate([self.first, self.second]),
            horizon_s=flow.horizon_s,
            step_s=flow.step_s,
            parameters=np.concatenate([self.parameters, self.parameters]),
        )
        return runs[count:] - runs[:count]


def joined(parts: list[Pairs]) -> Pairs:
    """All rows of all parts."""
    return Pairs(
        np.concatenate([part.first for part in parts]),
        np.concatenate([part.second for part in parts]),
        np.concatenate([part.parameters for part in parts]),
    )


@final
@dataclass(frozen=True, slots=True, eq=False)
class Goals:
    """One per row: maximise sign (second - first)[coordinate] at the step instant `instant`."""

    coordinate: Index
    instant: Index
    sign: Array

    def values(self, differences: Array) -> Array:
        """Values for differences (N, K+1, n); -inf where a run left the finite numbers."""
        rows = np.arange(len(self.sign))
        values = self.sign * differences[rows, self.instant, self.coordinate]
        return np.where(np.isfinite(values), values, -np.inf)


def ascend(
    flow: Flow, box: Box, *, goals: Goals, start: Pairs, rounds: int, move_first: bool
) -> Pairs:
    """Projected gradient ascent of all goals at once, from `start`, one row per goal.

    Each round tries, along the gradient of the Runge-Kutta map, the vertex that the gradient's
    signs name and steps of several lengths, and keeps the best. `second` stays in `box` and within
    the box's half widths of `first`; `first` stays where it is unless `move_first`. Never returns
    a worse pair.
    """
    best, values = start, goals.values(start.differences(flow))
    for _ in range(rounds):
        together, first, second = _gradients(flow, goals, best, np.array(box.radius))
        base = best
        leads = (None, together, first) if move_first else (None,)
        for slope, step in itertools.product(leads, _STEPS):
            candidate = _moved(box, base, (slope, second), step)
            reached = goals.values(candidate.differences(flow))
            better = reached > values
            best = Pairs(
                np.where(better[:, None], candidate.first, best.first),
                np.where(better[:, None], candidate.second, best.second),
                best.parameters,
            )
            values = np.where(better, reached, values)
    return best


def gradient_states(
    system: System, box: Box, *, horizon_s: float, step_s: float, every: int, seed: int
) -> Array:
    """Initial states (N, n) that gradient ascent drives to the extremes of every coordinate.

    One state per coordinate, per direction (up, down) and per `every`-th step instant, from a
    random start in `box`, at random parameters in their ranges. Extremal for the float Runge-Kutta
    map: good samples, no proof.
    """
    ode = system.ode
    box = ordered_box(ode, box, "initial set")
    rng = np.random.default_rng(seed)
    flow = Flow(system, horizon_s, step_s)
    steps = step_count(horizon_s, step_s)
    grid = np.meshgrid(
        np.arange(len(ode.states)), _chosen_instants(steps, every), [-1.0, 1.0], indexing="ij"
    )
    goals = Goals(grid[0].ravel(), grid[1].ravel(), grid[2].ravel())
    count = len(goals.sign)
    start = Pairs(
        np.tile(np.array(box.center), (count, 1)),
        uniform_states(box, count, rng),
        parameter_states(ode.parameters, count, rng),
    )
    return ascend(flow, box, goals=goals, start=start, rounds=4, move_first=False).second


def _chosen_instants(steps: int, every: int) -> Index:
    return np.unique(np.append(np.arange(every, steps + 1, every), steps))


def _gradients(
    flow: Flow, goals: Goals, pairs: Pairs, half_widths: Array
) -> tuple[Array, Array, Array]:
    """Gradients of the goals for moving both ends together, `first` alone and `second` alone.

    In units of the half widths, each scaled so that its largest entry is 1.
    """
    count = len(pairs.first)
    _, slopes = flow.with_sensitivity(
        np.concatenate([pairs.first, pairs.second]),
        np.concatenate([pairs.parameters, pairs.parameters]),
    )
    rows = np.arange(count)
    scale = goals.sign[:, None] * half_widths
    at_first = scale * np.nan_to_num(slopes[rows, goals.instant, goals.coordinate])
    at_second = scale * np.nan_to_num(slopes[rows + count, goals.instant, goals.coordinate])
    return _unit(at_second - at_first), _unit(-at_first), _unit(at_second)


def _unit(gradients: Array) -> Array:
    largest = np.max(np.abs(gradients), axis=1, keepdims=True)
    return np.asarray(gradients / np.where(largest > 0.0, largest, 1.0))


def _moved(box: Box, pairs: Pairs, slopes: tuple[Array | None, Array], step: float) -> Pairs:
    """Steps along the slopes of first and second, projected; an infinite one goes to the vertex."""
    lower, upper, half = np.array(box.lower), np.array(box.upper), np.array(box.radius)
    shift = (pairs.second - pairs.first) / np.where(half > 0.0, half, 1.0)
    shift = np.clip(shift + _stride(slopes[1], step), -1.0, 1.0)
    first = pairs.first
    if slopes[0] is not None:
        first = np.clip(first + 2.0 * _stride(slopes[0], step) * half, lower, upper)
    return Pairs(first, np.clip(first + shift * half, lower, upper), pairs.parameters)


def _stride(slope: Array, step: float) -> Array:
    # Two half widths reach any vertex from anywhere in the box.
    return 2.0 * np.sign(slope) if np.isinf(step) else step * slope
