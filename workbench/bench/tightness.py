"""How much wider a tube is than the trajectories that were sampled, and how many leave it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
import numpy.typing as npt

from workbench.bench.containment import bounds_at
from workbench.reach.inner.hull import InnerHull, proved_ratio
from workbench.reach.tube import Array, ReachTube

SCORE_STEP_S = 0.05
# Narrower sampled sets than this (in the state's unit) have no meaningful width ratio.
_LEAST_WIDTH = 1e-9
# Error of the sampled runs, in the states' units: a run that is outside by less shows nothing. The
# soundness campaign settles such runs with validated arithmetic.
RUN_ERROR = 1e-9


@final
@dataclass(frozen=True, slots=True)
class HorizonScore:
    """Scores of one method over [0, horizon_s]; mappings are state name -> number.

    covered: the proof reaches horizon_s (else every other number stops where the proof stops).
    escapes: trajectories outside by more than 1e-9, the runs' own error, at any sampled time, of
    `trajectories`, at `times_checked` times; touching: outside by less, which floats cannot settle.
    width_ratio: mean over the instants 0.05 k s, k >= 1, of tube width / sampled width there; None
    where no sampled set is wider than 1e-9. proved_ratio: the same with the width that validated
    trajectories prove in place of the sampled one, so an upper bound on tube width / true width (to
    the Rigor of the tube); None without an inner hull, or where it is a point.
    excess_mean, excess_worst: how far an enclosure of a 0.05 s segment reaches beyond the sampled
    hull of the same segment, in the state's unit: mean over segments and sides, and largest.
    final_radius, final_sampled_radius: half widths of tube and samples at the last instant reached.
    """

    horizon_s: float
    covered: bool
    escapes: int
    touching: int
    trajectories: int
    times_checked: int
    width_ratio: dict[str, float | None]
    proved_ratio: dict[str, float | None]
    excess_mean: dict[str, float]
    excess_worst: dict[str, float]
    final_radius: dict[str, float]
    final_sampled_radius: dict[str, float]


@final
@dataclass(frozen=True, slots=True)
class MethodScore:
    """One method on one loop: its step, Rigor, how it ended, and its scores per horizon.

    kinks_decided: share of steps, cells and limits, over the first horizon, in which the limit was
    decided to be reached or not, where the method says so. elapsed_s: time of the tube over that
    horizon alone.
    """

    method: str
    step_s: float
    rigor: str
    status: str
    proved_until_s: float
    elapsed_s: float
    kinks_decided: float | None
    horizons: tuple[HorizonScore, ...]


@final
class Samples:
    """Running hull of trajectories at fixed times, and first escapes from several tubes.

    times: sampled times, multiples of a step that divides 0.05 s; tubes: those to watch; inner:
    what is proved to be reached, at the instants 0.05 k.
    """

    def __init__(
        self, times: Array, tubes: Sequence[ReachTube], *, inner: InnerHull | None = None
    ) -> None:
        self.times = times
        self.tubes = tuple(tubes)
        self.inner = inner
        n = len(tubes[0].names)
        self.lower = np.full((len(times), n), np.inf)
        self.upper = np.full((len(times), n), -np.inf)
        self.count = 0
        self._bounds = [bounds_at(tube, times) for tube in tubes]
        # First times outside, of all runs: by more than an allowance of 0, and of the runs' error.
        self._first: list[dict[float, list[Array]]] = [{0.0: [], RUN_ERROR: []} for _ in tubes]

    def add(self, runs: Array) -> None:
        """Take in one block of trajectories (N, K+1, n)."""
        self.count += len(runs)
        low, high = runs.min(axis=0), runs.max(axis=0)
        self.lower = np.minimum(self.lower, low)
        self.upper = np.maximum(self.upper, high)
        for first, (lower, upper) in zip(self._first, self._bounds, strict=True):
            # Most tubes hold the whole block; a NaN run makes this false.
            if np.all((lower <= low) & (high <= upper)):
                continue
            beyond = np.maximum(lower - runs, runs - upper).max(axis=2)
            for allowance, found in first.items():
                # Written so that a NaN is outside.
                outside = ~(beyond <= allowance)
                leaving = outside[outside.any(axis=1)]
                found.append(self.times[leaving.argmax(axis=1)])

    def escapes(self, which: int, horizon_s: float, *, allowance: float = RUN_ERROR) -> int:
        """Runs that leave tube number `which` by more than `allowance` (0 or 1e-9) to horizon_s."""
        first = np.concatenate([np.zeros(0), *self._first[which][allowance]])
        return int(np.sum(first <= horizon_s + 1e-9))

    def score(self, which: int, horizon_s: float, *, grid_s: float = SCORE_STEP_S) -> HorizonScore:
        """Scores of tube number `which` over [0, horizon_s].

        grid_s: distance of the instants and length of the segments that are scored, a multiple of
        0.05 s: for tubes in longer steps, which say nothing sharp about instants between them.
        """
        tube = self.tubes[which]
        end = min(horizon_s, float(tube.times[-1]))
        lower, upper = self._bounds[which]
        per_step = round(grid_s / (self.times[1] - self.times[0]))
        last = int(np.floor(end / grid_s + 1e-9)) * per_step
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
            touching=self.escapes(which, horizon_s, allowance=0.0) - self.escapes(which, horizon_s),
            trajectories=self.count,
            times_checked=int(np.sum((self.times > 0.0) & (self.times <= end + 1e-9))),
            width_ratio=_means(names, width / np.where(wide, sampled, 1.0), wide),
            proved_ratio=self._proved(tube, end),
            excess_mean=per_state(excess.mean(axis=(0, 1)) if len(at) else np.zeros(len(names))),
            excess_worst=per_state(excess.max(axis=(0, 1)) if len(at) else np.zeros(len(names))),
            final_radius=per_state((upper - lower)[last] / 2),
            final_sampled_radius=per_state((self.upper - self.lower)[last] / 2),
        )

    def _proved(self, tube: ReachTube, end: float) -> dict[str, float | None]:
        """Mean ratio to the inner hull per state, over its instants in (0, end]."""
        if self.inner is None:
            return dict.fromkeys(tube.names)
        ratio = proved_ratio(tube, self.inner)
        rows = (self.inner.times > 0.0) & (self.inner.times <= end + 1e-9)
        return _means(tube.names, ratio, rows[:, None] & np.isfinite(ratio))

    def _excess(self, tube: ReachTube, at: Array, per_step: int) -> Array:
        """Excess over each 0.05 s segment's hull, lower and upper side: (2, segments, n)."""
        rows: list[tuple[Array, Array]] = []
        for stop in at.astype(int):
            span = slice(stop - per_step, stop + 1)
            begin, end = self.times[stop - per_step], self.times[stop]
            parts = (tube.times[:-1] < end - 1e-9) & (tube.times[1:] > begin + 1e-9)
            low, high = tube.lower[parts].min(axis=0), tube.upper[parts].max(axis=0)
            rows.append((self.lower[span].min(axis=0) - low, high - self.upper[span].max(axis=0)))
        return np.array(rows).reshape(len(at), 2, len(tube.names)).transpose(1, 0, 2)


def _means(
    names: tuple[str, ...], values: Array, chosen: npt.NDArray[np.bool_]
) -> dict[str, float | None]:
    """Mean of the chosen values (M, n) per column; None where none is chosen."""
    return {
        name: float(np.mean(values[chosen[:, i], i])) if chosen[:, i].any() else None
        for i, name in enumerate(names)
    }
