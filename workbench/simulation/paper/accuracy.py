"""The paper's Table II: how often tubes contain where the car was, and what area that takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.simulation.conformance.counting import Share, clustered
from workbench.simulation.paper.replayed import TURN_S, Array, ReplayedRun
from workbench.simulation.paper.tubes import PathRows, PathTubes

HORIZONS_S: Final = (3.0, 3.5, 4.0, 4.5, 5.0)
CONFIDENCES: Final = ("High", "Med", "Low")
"""The nested sets by the paper's names, the largest first."""
PUBLISHED: Final = (
    (0.98905, 0.98338, 0.98617, 0.97825, 0.96851),
    (0.98161, 0.96629, 0.97138, 0.95917, 0.94874),
    (0.95825, 0.94078, 0.94672, 0.93416, 0.92078),
)
"""The paper's shares, by confidence and T."""
AT_SPEED_MPS: Final = 1.0
_RESAMPLES: Final = 2000
_SEED: Final = 1

Bools = NDArray[np.bool_]
Interval = tuple[float, float]


@final
@dataclass(frozen=True, slots=True)
class Starts:
    """Which decisions count: with at least this speed (m/s); held: with the car in the set."""

    name: str
    least_mps: float
    held: bool


STARTS: Final = (
    Starts("at speed", AT_SPEED_MPS, held=False),
    Starts("at speed with the car in the set", AT_SPEED_MPS, held=True),
    Starts("at any speed", 0.0, held=False),
)


@final
@dataclass(frozen=True, slots=True, eq=False)
class RunTubes:
    """What W tubes from one nested set say of one run, at J instants after each decision.

    speed_mps (W,): of the car at the decision; kept (W,): instants at which TRACK had been in force
    since; inside (W, J): contained, False where the proof had ended; reached (W, J): whether it had
    not; begins (W,): whether the set contained the car at the decision; area_m2 (W, K): of the rows
    in station and offset, NaN where the proof had ended.
    """

    run: str
    plant: str
    speed_mps: Array
    kept: NDArray[np.int_]
    begins: Bools
    inside: Bools
    reached: Bools
    area_m2: Array
    step_s: float


def run_tubes(
    run: ReplayedRun, tubes: PathTubes, level: int, *, horizon_s: float = max(HORIZONS_S),
    advance: Callable[[], None] = lambda: None,
) -> RunTubes:  # fmt: skip
    """The tube of every decision of a run under TRACK; `advance` after each."""
    windows = run.kept(horizon_s=horizon_s)
    instants = int(horizon_s / TURN_S + 1e-9)
    inside = np.zeros((len(windows), instants), dtype=bool)
    reached = np.zeros_like(inside)
    begins = np.zeros(len(windows), dtype=bool)
    areas: list[Array] = []
    step_s = 1.0
    for k, (asked, kept) in enumerate(windows):
        rows = tubes.rows(run.path, asked, level)
        step_s, box = rows.step_s, asked.sets[level]
        sides = np.array([box.interval("station"), box.interval("offset")]).T
        begins[k] = _within(sides[0], sides[1], run.lower[asked.turn], run.upper[asked.turn]).all()
        seen = slice(asked.turn + 1, asked.turn + 1 + kept)
        inside[k, :kept] = contained(rows, run.lower[seen], run.upper[seen])
        reached[k, :kept] = row_at(rows, kept) < len(rows.lower)
        areas.append(np.prod(rows.upper - rows.lower, axis=1))
        advance()
    turns = [asked.turn for asked, _ in windows]
    return RunTubes(
        run.name, run.plant, run.speed_mps[turns],
        np.array([kept for _, kept in windows], dtype=int), begins, inside,
        reached, _padded(areas, round(horizon_s / step_s)), step_s,
    )  # fmt: skip


def contained(rows: PathRows, lower: Array, upper: Array) -> Bools:
    """(J,): whether the place [lower, upper] (J, 2) at TURN_S, 2 TURN_S, ... lies in its row."""
    at = row_at(rows, len(lower))
    proved = at < len(rows.lower)
    found = np.zeros(len(lower), dtype=bool)
    at = at[proved]
    found[proved] = _within(rows.lower[at], rows.upper[at], lower[proved], upper[proved]).all(
        axis=1
    )
    return found


def row_at(rows: PathRows, count: int) -> NDArray[np.int_]:
    """(count,): number of the row of each instant after the decision, whether or not there is
    one."""
    after_s = TURN_S * np.arange(1, count + 1)
    return np.asarray(np.floor(after_s / rows.step_s + 1e-9), dtype=int)


def _within(lower: Array, upper: Array, low: Array, high: Array) -> Bools:
    """NaN is nowhere."""
    return np.asarray((low >= lower) & (high <= upper))


def _padded(areas: Sequence[Array], count: int) -> Array:
    found = np.full((len(areas), count), np.nan)
    for k, area in enumerate(areas):
        found[k, : len(area)] = area[:count]
    return found


@final
@dataclass(frozen=True, slots=True)
class Cell:
    """One cell of the table: tubes of one nested set up to T.

    steps: instants under TRACK; windows: whole trajectories, those of T under TRACK; each with an
    interval that counts runs, not steps (`Share`), and one by drawing runs anew (`..._drawn`);
    None where there is no such window. outside: instants at which the tube had not ended and did
    not contain the car; the others that it did not contain are those it did not reach. censored:
    windows that BRAKE, or the run's end, cut short of
    T, whose steps until then count and whose trajectories do not; proof_ended: windows with a proof
    that ends before T; begins: share of the sets that contained the car; mean_area_m2: over the
    rows of all windows, NaN without any; area_rows: share of all rows that it is the mean of, less
    than 1 where tubes ended early: what is missing are the last, widest rows.
    """

    horizon_s: float
    runs: int
    steps: Share
    steps_drawn: Interval
    outside: int
    windows: Share | None
    windows_drawn: Interval
    all_windows: int
    censored: int
    proof_ended: int
    begins: float
    mean_area_m2: float
    area_rows: float


def cell(runs: Sequence[RunTubes], *, horizon_s: float, starts: Starts) -> Cell | None:
    """Of the windows that count; None where there is none."""
    counts = np.array([_counts(run, horizon_s, starts) for run in runs]).reshape(len(runs), -1)
    counts = counts[counts[:, 1] > 0.0]
    if not len(counts):
        return None
    of = {name: counts[:, k] for k, name in enumerate(_COUNTED)}
    inside, steps, whole, complete = (of[name] for name in _COUNTED[:4])
    lengths = [int(count) for count in complete if count]
    rows = of["rows"].sum()
    return Cell(
        horizon_s,
        len(counts),
        clustered(int(inside.sum()), sizes=[int(count) for count in steps]),
        drawn_again(inside, steps),
        int(of["outside"].sum()),
        clustered(int(whole.sum()), sizes=lengths) if lengths else None,
        drawn_again(whole, complete),
        int(of["windows"].sum()),
        int(of["windows"].sum() - complete.sum()),
        int(of["proof_ended"].sum()),
        float(of["begins"].sum() / of["windows"].sum()),
        float(of["area"].sum() / rows) if rows else float("nan"),
        float(rows / of["all_rows"].sum()),
    )


_COUNTED: Final = (
    "inside", "steps", "whole", "complete", "windows", "proof_ended", "begins", "area", "rows",
    "all_rows", "outside",
)  # fmt: skip


def _counts(run: RunTubes, horizon_s: float, starts: Starts) -> tuple[float, ...]:
    """`_COUNTED` of one run."""
    chosen = run.speed_mps >= starts.least_mps
    if starts.held:
        chosen &= run.begins
    most, rows = int(horizon_s / TURN_S + 1e-9), round(horizon_s / run.step_s)
    kept = np.minimum(run.kept[chosen], most)
    counts = np.arange(most) < kept[:, None]
    inside = run.inside[chosen][:, :most]
    complete = kept == most
    area = run.area_m2[chosen][:, :rows]
    proved = np.isfinite(area)
    numbers = (
        (inside & counts).sum(), counts.sum(), (inside.all(axis=1) & complete).sum(),
        complete.sum(), chosen.sum(), (~proved).any(axis=1).sum(), run.begins[chosen].sum(),
        area[proved].sum(), proved.sum(), proved.size,
        (run.reached[chosen][:, :most] & ~inside & counts).sum(),
    )  # fmt: skip
    return tuple(map(float, numbers))


def drawn_again(inside: Array, of: Array) -> Interval:
    """95 % interval of sum(inside) / sum(of) by drawing runs with replacement; (0, 1) where there
    is none. Runs that agree give an interval without width, which says nothing of runs not seen."""
    if not of.sum():
        return 0.0, 1.0
    chosen = np.random.default_rng(_SEED).integers(len(of), size=(_RESAMPLES, len(of)))
    sums = of[chosen].sum(axis=1)
    shares = inside[chosen].sum(axis=1)[sums > 0.0] / sums[sums > 0.0]
    low, high = np.quantile(shares, (0.025, 0.975))
    return float(low), float(high)


@final
@dataclass(frozen=True, slots=True)
class AccuracyRow:
    """One row of the table: plant, method, confidence (an index of `CONFIDENCES`), name of
    which starts count (of `STARTS`), and a cell for each T, None where there is no such window."""

    plant: str
    method: str
    confidence: int
    starts: str
    cells: tuple[Cell | None, ...]

    @property
    def least(self) -> float | None:
        """The smallest share of contained steps over all T."""
        return min((cell.steps.value for cell in self.cells if cell is not None), default=None)


def accuracy_rows(
    runs: Sequence[ReplayedRun], methods: Sequence[PathTubes], *,
    advance: Callable[[], None] = lambda: None,
) -> tuple[AccuracyRow, ...]:  # fmt: skip
    """By plant, method, confidence and starts; `advance` after each run, method and confidence."""
    plants = tuple(dict.fromkeys(run.plant for run in runs))
    found = []
    for plant in plants:
        mine = [run for run in runs if run.plant == plant]
        for method in methods:
            for level in range(len(CONFIDENCES)):
                tubes = []
                for run in mine:
                    tubes.append(run_tubes(run, method, level))
                    advance()
                found += [
                    AccuracyRow(plant, method.title, level, starts.name, tuple(
                        cell(tubes, horizon_s=t, starts=starts) for t in HORIZONS_S
                    ))
                    for starts in STARTS
                ]  # fmt: skip
    return tuple(found)
