"""How much wider a tube is than the trajectories that were sampled, and how many leave it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.bench.containment import bounds_at, escaping
from workbench.reach.tube import Array, ReachTube

SCORE_STEP_S = 0.05
# Narrower sampled sets than this (in the state's unit) have no meaningful width ratio.
_LEAST_WIDTH = 1e-9


@final
@dataclass(frozen=True, slots=True)
class HorizonScore:
    """Scores of one method over [0, horizon_s]; mappings are state name -> number.

    covered: the proof reaches horizon_s (else every other number stops where the proof stops).
    escapes: trajectories outside at any sampled time, of `trajectories`, at `times_checked` times.
    width_ratio: mean over the instants 0.05 k s, k >= 1, of tube width / sampled width there; None
    where no sampled set is wider than 1e-9.
    excess_mean, excess_worst: how far an enclosure of a 0.05 s segment reaches beyond the sampled
    hull of the same segment, in the state's unit: mean over segments and sides, and largest.
    final_radius, final_sampled_radius: half widths of tube and samples at the last instant reached.
    """

    horizon_s: float
    covered: bool
    escapes: int
    trajectories: int
    times_checked: int
    width_ratio: dict[str, float | None]
    excess_mean: dict[str, float]
    excess_worst: dict[str, float]
    final_radius: dict[str, float]
    final_sampled_radius: dict[str, float]


@final
@dataclass(frozen=True, slots=True)
class MethodScore:
    """One method on one loop: its step, Rigor, how it ended, and its scores per horizon."""

    method: str
    step_s: float
    rigor: str
    status: str
    proved_until_s: float
    elapsed_s: float
    horizons: tuple[HorizonScore, ...]


@final
class Samples:
    """Running hull of trajectories at fixed times, and first escapes from several tubes.

    times: sampled times, multiples of a step that divides 0.05 s; tubes: those to watch.
    """

    def __init__(self, times: Array, tubes: Sequence[ReachTube]) -> None:
        self.times = times
        self.tubes = tuple(tubes)
        n = len(tubes[0].names)
        self.lower = np.full((len(times), n), np.inf)
        self.upper = np.full((len(times), n), -np.inf)
        self.count = 0
        self._first_escapes: list[list[Array]] = [[] for _ in tubes]

    def add(self, runs: Array) -> None:
        """Take in one block of trajectories (N, K+1, n)."""
        self.count += len(runs)
        self.lower = np.minimum(self.lower, runs.min(axis=0))
        self.upper = np.maximum(self.upper, runs.max(axis=0))
        for found, tube in zip(self._first_escapes, self.tubes, strict=True):
            outside = escaping(tube, self.times, runs, allowance=0.0)
            leaving = outside[outside.any(axis=1)]
            found.append(self.times[leaving.argmax(axis=1)])

    def escapes(self, which: int, horizon_s: float) -> int:
        """Trajectories that leave tube number `which` no later than `horizon_s`."""
        first = np.concatenate([np.zeros(0), *self._first_escapes[which]])
        return int(np.sum(first <= horizon_s + 1e-9))

    def score(self, which: int, horizon_s: float) -> HorizonScore:
        """Scores of tube number `which` over [0, horizon_s]."""
        tube = self.tubes[which]
        end = min(horizon_s, float(tube.times[-1]))
        lower, upper = bounds_at(tube, self.times)
        per_step = round(SCORE_STEP_S / (self.times[1] - self.times[0]))
        last = int(np.floor(end / SCORE_STEP_S + 1e-9)) * per_step
        at = np.arange(per_step, last + 1, per_step)
        width, sampled = (upper - lower)[at], (self.upper - self.lower)[at]
        excess = self._excess(tube, at, per_step)
        wide = sampled > _LEAST_WIDTH
        names = tube.names

        def per_state(values: Array) -> dict[str, float]:
            return {name: float(value) for name, value in zip(names, values, strict=True)}

        return HorizonScore(
            horizon_s=horizon_s,
            covered=end >= horizon_s - 1e-9,
            escapes=self.escapes(which, horizon_s),
            trajectories=self.count,
            times_checked=int(np.sum((self.times > 0.0) & (self.times <= end + 1e-9))),
            width_ratio={
                name: float(np.mean(width[wide[:, i], i] / sampled[wide[:, i], i]))
                if wide[:, i].any()
                else None
                for i, name in enumerate(names)
            },
            excess_mean=per_state(excess.mean(axis=(0, 1)) if len(at) else np.zeros(len(names))),
            excess_worst=per_state(excess.max(axis=(0, 1)) if len(at) else np.zeros(len(names))),
            final_radius=per_state((upper - lower)[last] / 2),
            final_sampled_radius=per_state((self.upper - self.lower)[last] / 2),
        )

    def _excess(self, tube: ReachTube, at: Array, per_step: int) -> Array:
        """Excess over each 0.05 s segment's hull, lower and upper side: (2, segments, n)."""
        rows: list[tuple[Array, Array]] = []
        for stop in at.astype(int):
            span = slice(stop - per_step, stop + 1)
            begin, end = self.times[stop - per_step], self.times[stop]
            parts = (tube.times[:-1] < end - 1e-9) & (tube.times[1:] > begin + 1e-9)
            low, high = tube.lower[parts].min(axis=0), tube.upper[parts].max(axis=0)
            rows.append((self.lower[span].min(axis=0) - low, high - self.upper[span].max(axis=0)))
        return np.array(rows).reshape(len(at), 2, -1).transpose(1, 0, 2)
