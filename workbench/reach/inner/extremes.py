"""Search for the choices that drive each state to its extremes at each instant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.models.signals import Ranged
from workbench.models.system import Ode
from workbench.reach.inner.choice_flow import ChoiceFlow
from workbench.reach.inner.choices import Choices, joined
from workbench.reach.tube import Array
from workbench.sensitivity.sampling import face_states, uniform_states, vertex_states
from workbench.sensitivity.vectorised import Index
from workbench.sets import Box

# Lengths of the projected gradient steps, as shares of the ranges' half widths; inf: to the vertex.
_STEPS = (np.inf, 0.5, 0.1, 0.02)
# Share of a range of values that may be given away on each side to need fewer trajectories.
_GIVEN_AWAY = 1e-4


@final
@dataclass(frozen=True, slots=True)
class SearchEffort:
    """How hard to search; it decides how tight the result is, never whether it is true.

    starts: random choices tried first, besides the vertices (at most `starts` of them) and the
    centre; rounds: of gradient ascent and of coordinate search; every: gradients are aimed at one
    in so many instants of the grid (each run serves all instants); seed: of the random choices.
    Raises InputError on starts < 1, rounds < 0 or every < 1.
    """

    starts: int
    rounds: int
    every: int
    seed: int

    def __post_init__(self) -> None:
        if self.starts < 1 or self.rounds < 0 or self.every < 1:
            raise InputError(
                "expected starts >= 1, rounds >= 0 and every >= 1, got "
                f"{self.starts}, {self.rounds} and {self.every}"
            )


@final
@dataclass(frozen=True, slots=True, eq=False)
class Admissible:
    """What may be chosen: initial set in the states' order, ranges of constants and signals."""

    box: Box
    constants: tuple[Ranged, ...]
    signals: tuple[Ranged, ...]
    instants: int

    @classmethod
    def of(cls, ode: Ode, box: Box, instants: int) -> Admissible:
        """All that `ode` leaves open over `instants` grid intervals."""
        ranged = tuple(p for p in ode.parameters if p.lower < p.upper)
        return cls(box, ranged, ode.disturbances, instants)

    def ends(self) -> tuple[Choices, Choices]:
        """The least and the largest choice, one row each."""
        return tuple(
            Choices(
                np.array([getattr(self.box, end)], dtype=float),
                np.array([[getattr(c, end) for c in self.constants]], dtype=float),
                np.tile(
                    np.array([getattr(s, end) for s in self.signals], dtype=float),
                    (1, self.instants, 1),
                ),
            )
            for end in ("lower", "upper")
        )  # type: ignore[return-value]

    def starts(self, effort: SearchEffort) -> Choices:
        """Vertices, faces, interior and the centre; constants and held signals at random ends."""
        rng = np.random.default_rng(effort.seed)
        states = np.concatenate(
            [
                np.array([self.box.center]),
                vertex_states(self.box, most=effort.starts, rng=rng),
                face_states(self.box, effort.starts // 2, rng),
                uniform_states(self.box, effort.starts - effort.starts // 2, rng),
            ]
        )
        low, high = self.ends()
        count = len(states)
        picked = [
            np.where(rng.random((count, *part.shape[1:-1], part.shape[-1])) < 0.5, part, other)
            for part, other in ((low.constants, high.constants), (low.signals, high.signals))
        ]
        # A signal that stays at one end for the whole run reaches farther than a trembling one.
        picked[1][:] = picked[1][:, :1]
        return Choices(states, *picked)

    def moved(self, base: Choices, slopes: Choices, step: float) -> Choices:
        """Steps along `slopes`, in shares of the half widths, kept inside; inf: to the ends."""
        low, high = self.ends()
        parts = []
        for name in ("states", "constants", "signals"):
            value, slope, least, most = (getattr(c, name) for c in (base, slopes, low, high))
            half = 0.5 * (most - least)
            # Where a coordinate already sits at its end, its slope must not set the scale.
            free = np.where(slope > 0.0, value < most, value > least) * slope * half
            stride = 2.0 * np.sign(slope) if np.isinf(step) else step * _unit(free)
            parts.append(np.clip(value + stride * half, least, most))
        return Choices(*parts)

    def flips(self, base: Choices) -> list[Choices]:
        """The base with one state, constant, or signal (throughout) at one of its ends."""
        found = []
        for end in self.ends():
            for name in ("states", "constants", "signals"):
                for i in range(getattr(base, name).shape[-1]):
                    parts = {n: getattr(base, n) for n in ("states", "constants", "signals")}
                    value = parts[name].copy()
                    value[..., i] = getattr(end, name)[..., i]
                    if not np.array_equal(value, parts[name]):
                        found.append(Choices(**{**parts, name: value}))
        return found


def _unit(slope: Array) -> Array:
    axes = tuple(range(1, slope.ndim))
    largest = np.max(np.abs(slope), axis=axes, keepdims=True, initial=0.0)
    return np.asarray(slope / np.where(largest > 0.0, largest, 1.0))


@final
class Best:
    """The best choice found so far for each of G goals."""

    def __init__(self, goals: Callable[[Array], Array], flow: ChoiceFlow, start: Choices) -> None:
        self.goals, self.flow = goals, flow
        values = self._values(start)
        rows = values.argmax(axis=0)
        self.values = values[rows, np.arange(values.shape[1])]
        self.choices = start.take(rows)

    def take_in(self, candidates: Choices) -> None:
        """Let every candidate compete for every goal."""
        values = self._values(candidates)
        rows = values.argmax(axis=0)
        reached = values[rows, np.arange(values.shape[1])]
        better = np.flatnonzero(reached > self.values)
        self.values[better] = reached[better]
        self.choices = self.choices.replaced(better, candidates.take(rows[better]))

    def _values(self, candidates: Choices) -> Array:
        values = self.goals(self.flow.runs(candidates))
        return np.where(np.isfinite(values), values, -np.inf)


def climb(
    best: Best,
    admissible: Admissible,
    effort: SearchEffort,
    *,
    aimed: Index,
    slopes: Callable[[Choices], Choices],
) -> None:
    """Improve the goals `aimed` by projected gradient ascent and coordinate search.

    slopes: gradients of these goals, one row each. Every run competes for every goal.
    """
    for _ in range(effort.rounds):
        base = best.choices.take(aimed)
        found = slopes(base)
        for step in _STEPS:
            best.take_in(admissible.moved(base, found, step))
        flips = admissible.flips(best.choices.take(aimed).without_repeats())
        if flips:
            best.take_in(joined(flips).without_repeats())


def aimed_instants(count: int, every: int) -> Index:
    """Every `every`-th of the instants 0 .. count, the last one included."""
    return np.unique(np.append(np.arange(every, count + 1, every), count))


def extreme_choices(flow: ChoiceFlow, admissible: Admissible, effort: SearchEffort) -> Choices:
    """Choices of which each state's least and largest value at each instant is nearly reached.

    Vertices, projected gradient ascent and coordinate search on float runs: good candidates, no
    proof.
    """
    instants, n = len(flow.times_s), len(flow.ode.states)

    def goals(runs: Array) -> Array:
        return np.concatenate([-runs, runs], axis=2).reshape(len(runs), -1)

    best = Best(goals, flow, admissible.starts(effort))
    rows = aimed_instants(instants - 1, effort.every)
    aimed = (rows[:, None] * 2 * n + np.arange(2 * n)).ravel()
    sign = np.concatenate([-np.eye(n), np.eye(n)])[aimed % (2 * n)]
    climb(
        best, admissible, effort, aimed=aimed,
        slopes=lambda base: flow.gradients(base, aimed // (2 * n), sign),
    )  # fmt: skip
    choices = best.choices.without_repeats()
    return choices.take(_few(goals(flow.runs(choices)), n))


def _few(values: Array, n: int) -> Index:
    """Rows of `values` (N, G) that reach nearly the best of every column, chosen greedily.

    Columns: per instant -x and x for the n states; the two best of a state add up to its width.
    """
    values = np.where(np.isfinite(values), values, -np.inf)
    best = values.max(axis=0)
    width = np.nan_to_num(best.reshape(-1, 2, n).sum(axis=1), neginf=0.0)
    enough = values >= best - _GIVEN_AWAY * np.repeat(width[:, None], 2, axis=1).ravel()
    left, chosen = np.ones(len(best), dtype=bool), []
    while left.any():
        row = int(enough[:, left].sum(axis=1).argmax())
        chosen.append(row)
        left &= ~enough[row]
    return np.array(chosen)
