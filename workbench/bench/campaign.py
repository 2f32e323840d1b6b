"""The soundness campaign: many trajectories of many random loops against the tubes of a method."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.bench.containment import bounds_at
from workbench.bench.lanes import Accuracy, Inputs, trajectories
from workbench.bench.pressing import pressing_inputs
from workbench.bench.random_loops import RandomLoop, random_loops
from workbench.bench.suspects import Containment, Seen, gathered, settle, unsettled
from workbench.bench.taylor import taylor_field
from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.reach import ReachTube, TubeMethod, compute_tube
from workbench.sensitivity.vectorised import Array

LEAST_PER_LOOP = 100
_BLOCK = 2500
# Checked times per tube: its instants and at least one time in each segment, about this many.
_TIMES = 240
_MOST_PER_SEGMENT = 8
_ACCURACY = Accuracy(16, 1e-14)
# Every 20th run is repeated more accurately; ten times the largest difference is the margin.
_REFERENCE = Accuracy(20, 1e-17)
_REFERENCE_EVERY = 20
_MARGIN_FACTOR = 10.0
_ROUNDING = 4e-15
# A tube below ENCLOSED does not claim to cover its own rounding: it is widened by this share of
# 1 + |bound| before anything counts as outside. An ENCLOSED one is taken at its word.
_ROUNDING_ALLOWANCE = 1e-12
# Effort for single validated runs per loop, in (number of states)^3 (time in s + 0.2), about 1 ms
# each; a loop with this many proved escapes needs no more of them.
_EFFORT = 10_000.0
_ENOUGH_ESCAPES = 2
# Distances are compared with half widths only where these exceed this (in the state's unit).
_LEAST_HALF_WIDTH = 1e-9


@final
@dataclass(frozen=True, slots=True)
class Approach:
    """Least distance from a trajectory to the tube's boundary over all checked times after 0.

    absolute: in the state's unit; relative: as a share of the half width there, over the times
    where that exceeds 1e-9, None where there are none. Negative: outside. Distances from runs that
    were re-integrated are proved lower bounds.
    """

    absolute: float
    relative: float | None


@final
@dataclass(frozen=True, slots=True)
class LoopResult:
    """One loop: the tube's status and reach, and what became of its trajectories.

    trajectories: followed up to proved_until_s (none where the proof never began); escapes: proved
    to leave the tube; undecided: near the boundary, with neither proved; reintegrated: settled by
    validated arithmetic, these two included. closest: state -> approach. tube_s, runs_s: cost in s.
    """

    name: str
    status: str
    rigor: str
    horizon_s: float
    proved_until_s: float
    trajectories: int
    escapes: int
    undecided: int
    reintegrated: int
    closest: dict[str, Approach]
    tube_s: float
    runs_s: float

    @property
    def complete(self) -> bool:
        """Whether the proof reaches the horizon."""
        return self.status == "COMPLETE"


@final
@dataclass(frozen=True, slots=True)
class CampaignResult:
    """All loops of one campaign, in order."""

    seed: int
    loops: tuple[LoopResult, ...]

    @property
    def trajectories(self) -> int:
        """Trajectories followed in all."""
        return sum(loop.trajectories for loop in self.loops)

    @property
    def escapes(self) -> int:
        """Trajectories proved to leave their tube."""
        return sum(loop.escapes for loop in self.loops)

    @property
    def undecided(self) -> int:
        """Trajectories of which neither inside nor escape was proved."""
        return sum(loop.undecided for loop in self.loops)

    @property
    def completed(self) -> int:
        """Loops whose proof reaches the horizon."""
        return sum(loop.complete for loop in self.loops)


def run_campaign(
    method: TubeMethod,
    *,
    loops: int = 200,
    trajectories: int = 1_000_000,
    seed: int = 1,
    progress: Callable[[int], None] | None = None,
) -> CampaignResult:
    """Hold the tubes of `method` on random loops against trajectories that press on them.

    loops: from `random_loops`; trajectories: in all, in equal shares, at least 100 per loop;
    progress: called with 1 after each loop. A trajectory counts as inside when it clears the
    boundary by ten times its estimated error at every checked time (instants and times between
    them), or when validated arithmetic proves it at the times where it does not; it counts as an
    escape only when validated arithmetic proves that. Rigor SAMPLED: no escape is no proof.
    Raises InputError on numbers too small.
    """
    if loops < 1 or trajectories < LEAST_PER_LOOP * loops:
        raise InputError(
            f"expected at least 1 loop and {LEAST_PER_LOOP} trajectories for each, got {loops} "
            f"loops and {trajectories} trajectories; give fewer loops or more trajectories"
        )
    results = []
    for index, loop in enumerate(random_loops(loops, seed=seed)):
        count = trajectories // loops + (index < trajectories % loops)
        results.append(check_loop(loop, method, count=count, seed=seed + index))
        if progress is not None:
            progress(1)
    return CampaignResult(seed, tuple(results))


def check_loop(loop: RandomLoop, method: TubeMethod, *, count: int, seed: int) -> LoopResult:
    """One loop of a campaign; `run_campaign` says what is checked."""
    start = time.perf_counter()
    tube = compute_tube(
        loop.system, initial_set=loop.initial_set, horizon_s=loop.horizon_s, method=method
    )
    between = time.perf_counter()
    until_s = float(tube.times[-1])
    check = _Check(loop, tube, seed)
    if until_s > 0.0:
        inputs = pressing_inputs(loop, count=count, horizon_s=until_s, seed=seed)
        for first in range(0, count, _BLOCK):
            check.add(inputs.take(slice(first, first + _BLOCK)))
    return LoopResult(
        name=loop.name,
        status=tube.status.name,
        rigor=tube.rigor.name,
        horizon_s=loop.horizon_s,
        proved_until_s=until_s,
        trajectories=check.count,
        escapes=check.lanes[Containment.ESCAPE],
        undecided=check.lanes[Containment.UNDECIDED],
        reintegrated=sum(check.lanes.values()),
        closest=check.closest(),
        tube_s=between - start,
        runs_s=time.perf_counter() - between,
    )


@final
class _Check:
    """Takes blocks of trajectories in and keeps what a `LoopResult` reports."""

    def __init__(self, loop: RandomLoop, tube: ReachTube, seed: int) -> None:
        ode = loop.system.ode
        order = [tube.names.index(name) for name in ode.names]
        self.names, self.field = ode.names, taylor_field(ode.function())
        self.times = _checked_times(tube, np.random.default_rng(seed))
        lower, upper = (bound[:, order] for bound in bounds_at(tube, self.times))
        allowance = 0.0 if tube.rigor is Rigor.ENCLOSED else _ROUNDING_ALLOWANCE
        later = self.times[:, None] > 0.0
        self.bounds = (
            lower - allowance * later * (1.0 + np.abs(lower)),
            upper + allowance * later * (1.0 + np.abs(upper)),
        )
        self.gaps = np.full((len(self.times), len(ode.names)), np.inf)
        self.lanes = dict.fromkeys(Containment, 0)
        self.count = self.proved_escapes = 0
        self.effort_left = _EFFORT

    def add(self, inputs: Inputs) -> None:
        """Follow one block of trajectories."""
        self.count += len(inputs.states)
        runs = trajectories(self.field, inputs, self.times, _ACCURACY)
        margin, states = self._margin(inputs, runs.states), runs.states
        near = np.zeros(states.shape, dtype=np.bool_)
        for k, (lower, upper) in enumerate(zip(*self.bounds, strict=True)):
            gaps = np.minimum(states[k] - lower[:, None], upper[:, None] - states[k])
            # NaN compares false and is near.
            near[k] = ~(gaps >= margin[k, :, None])
            clear = np.where(near[k], np.inf, gaps).min(axis=1)
            self.gaps[k] = np.minimum(self.gaps[k], clear)
            # The states are not needed any more, and twice as much memory would be.
            states[k] = gaps
        if near.any():
            self._settle(Seen(self.field, inputs, runs, self.times, near, states))

    def _margin(self, inputs: Inputs, states: Array) -> Array:
        """Ten times the estimated error of the runs at each time (m, n); 0 at the start."""
        rows = slice(0, None, _REFERENCE_EVERY)
        reference = trajectories(self.field, inputs.take(rows), self.times, _REFERENCE)
        difference = np.nan_to_num(np.abs(reference.states - states[:, :, rows]).max(axis=2))
        size = np.maximum(*(np.abs(bound) for bound in self.bounds))
        error = np.maximum.accumulate(difference, axis=0) + _ROUNDING * (1.0 + size)
        return np.where(self.times[:, None] > 0.0, _MARGIN_FACTOR * error, 0.0)

    def _settle(self, seen: Seen) -> None:
        worst: dict[int, Containment] = {}
        for suspects in gathered(seen):
            effort = len(suspects.part.states) ** 3 * (self.times[suspects.at[-1]] + 0.2)
            settled = unsettled(suspects)
            if effort <= self.effort_left and self.proved_escapes < _ENOUGH_ESCAPES:
                self.effort_left -= effort
                settled = settle(suspects, seen, self.bounds)
                self.proved_escapes += Containment.ESCAPE in settled.findings
            at = suspects.at, suspects.state
            self.gaps[at] = np.minimum(self.gaps[at], settled.gaps)
            for lane, finding in zip(suspects.lanes.tolist(), settled.findings, strict=True):
                worst[lane] = max(worst.get(lane, Containment.INSIDE), finding)
        for finding in worst.values():
            self.lanes[finding] += 1

    def closest(self) -> dict[str, Approach]:
        """Per state; empty where no trajectory was followed."""
        if not self.count:
            return {}
        half = 0.5 * (self.bounds[1] - self.bounds[0])
        found = {}
        for i, name in enumerate(self.names):
            later = self.times > 0.0
            wide = later & (half[:, i] > _LEAST_HALF_WIDTH)
            shares = self.gaps[wide, i] / half[wide, i]
            relative = float(shares.min()) if wide.any() else None
            found[name] = Approach(float(self.gaps[later, i].min()), relative)
        return found


def _checked_times(tube: ReachTube, rng: np.random.Generator) -> Array:
    """All instants, and in each segment the same number of random times."""
    segments = len(tube.times) - 1
    if not segments:
        return tube.times
    inner = min(max(1, _TIMES // segments - 1), _MOST_PER_SEGMENT)
    share = rng.uniform(0.02, 0.98, (segments, inner))
    between = tube.times[:-1, None] + share * np.diff(tube.times)[:, None]
    return np.union1d(tube.times, between)
