"""Search for the initial states that drive a trajectory, or a pair of them, to its extremes."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Protocol, final

import numpy as np

from workbench.models.system import System
from workbench.sensitivity.sampling import (
    Flow,
    ordered_box,
    parameter_states,
    step_count,
    uniform_states,
)
from workbench.sensitivity.vectorised import Array, Index
from workbench.sets.box import Box

# Lengths of the projected steps, as shares of the box's half widths; inf: to the vertex.
_STEPS = (np.inf, 1.0, 0.3, 0.05)


class Runs(Protocol):
    """What can be searched: runs from chosen initial states, and their slopes (a `Flow` has both).

    parameters: a row per run that the two runs of a pair share.
    """

    def runs(self, initial_states: Array, parameters: Array) -> Array:
        """States (N, K+1, n) from `initial_states` (N, n)."""

    def slopes(
        self, initial_states: Array, parameters: Array, coordinate: Index, instant: Index
    ) -> Array:
        """d state[coordinate] at the step `instant` / d initial state (N, n), row by row."""


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

    def differences(self, flow: Runs) -> Array:
        """second minus first along the runs: (N, K+1, n)."""
        count = len(self.first)
        runs = flow.runs(
            np.concatenate([self.first, self.second]),
            np.concatenate([self.parameters, self.parameters]),
        )
        # Two runs that left the finite numbers have no difference.
        with np.errstate(invalid="ignore", over="ignore"):
            return np.asarray(runs[count:] - runs[:count])


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

    def take(self, rows: Index) -> Goals:
        """The chosen rows."""
        return Goals(self.coordinate[rows], self.instant[rows], self.sign[rows])

    def values(self, differences: Array) -> Array:
        """Values for differences (N, K+1, n); -inf where a run left the finite numbers."""
        rows = np.arange(len(self.sign))
        values = self.sign * differences[rows, self.instant, self.coordinate]
        return np.where(np.isfinite(values), values, -np.inf)

    def gradients(self, flow: Runs, pairs: Pairs, *, move_first: bool) -> tuple[Array, Array]:
        """d value / d first and d value / d second, (N, n) each; 0 where there is none.

        The former is 0 as well where first may not move.
        """
        at_second = self._slopes(flow, pairs.second, pairs.parameters)
        if not move_first:
            return np.zeros_like(at_second), at_second
        return -self._slopes(flow, pairs.first, pairs.parameters), at_second

    def _slopes(self, flow: Runs, states: Array, parameters: Array) -> Array:
        slopes = flow.slopes(states, parameters, self.coordinate, self.instant)
        return self.sign[:, None] * np.nan_to_num(slopes, posinf=0.0, neginf=0.0)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Reached:
    """The best pair found for each goal, and its value (N,)."""

    pairs: Pairs
    values: Array

    def or_better(self, candidates: Pairs, values: Array) -> Reached:
        """Row by row the better one."""
        better = (values > self.values)[:, None]
        return Reached(
            Pairs(
                np.where(better, candidates.first, self.pairs.first),
                np.where(better, candidates.second, self.pairs.second),
                np.where(better, candidates.parameters, self.pairs.parameters),
            ),
            np.maximum(values, self.values),
        )


def ascend(
    flow: Runs, box: Box, *, goals: Goals, start: Pairs, rounds: int, move_first: bool
) -> Pairs:
    """Projected gradient ascent of all goals at once, from `start`, one row per goal.

    Each round tries, along the gradient of the runs, the vertex that the gradient's
    signs name and steps of several lengths, and keeps the best. `second` stays in `box` and within
    the box's half widths of `first`; `first` stays where it is unless `move_first`. Never returns
    a worse pair. A row that gained nothing in a round takes half as long steps from then on.
    """
    best = Reached(start, goals.values(start.differences(flow)))
    half_widths, pace = np.array(box.radius), np.ones((len(best.values), 1))
    for _ in range(rounds):
        base, before = best.pairs, best.values
        at_first, at_second = (
            half_widths * g for g in goals.gradients(flow, base, move_first=move_first)
        )
        together, first, second = _unit(at_first + at_second), _unit(at_first), _unit(at_second)
        leads = (None, together, first) if move_first else (None,)
        for slope, step in itertools.product(leads, _STEPS):
            candidate = _moved(box, base, (slope, second), step * pace)
            best = best.or_better(candidate, goals.values(candidate.differences(flow)))
        pace = np.where((best.values > before)[:, None], pace, 0.5 * pace)
    return best.pairs


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


def _unit(gradients: Array) -> Array:
    largest = np.max(np.abs(gradients), axis=1, keepdims=True)
    return np.asarray(gradients / np.where(largest > 0.0, largest, 1.0))


def _moved(box: Box, pairs: Pairs, slopes: tuple[Array | None, Array], step: Array) -> Pairs:
    """Steps along the slopes of first and second, projected; an infinite one goes to the vertex."""
    lower, upper, half = np.array(box.lower), np.array(box.upper), np.array(box.radius)
    shift = (pairs.second - pairs.first) / np.where(half > 0.0, half, 1.0)
    shift = np.clip(shift + _stride(slopes[1], step), -1.0, 1.0)
    first = pairs.first
    if slopes[0] is not None:
        first = np.clip(first + 2.0 * _stride(slopes[0], step) * half, lower, upper)
    return Pairs(first, np.clip(first + shift * half, lower, upper), pairs.parameters)


def _stride(slope: Array, step: Array) -> Array:
    # Two half widths reach any vertex from anywhere in the box.
    vertex = np.isinf(step)
    return np.where(vertex, 2.0 * np.sign(slope), np.where(vertex, 0.0, step) * slope)
