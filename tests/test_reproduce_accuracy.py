"""Table II counts what it says: containment by row, censoring, areas and intervals."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.models.spline_path import SplinePath
from workbench.sets import Box
from workbench.simulation.paper.accuracy import (
    HORIZONS_S,
    PUBLISHED,
    Starts,
    accuracy_rows,
    cell,
    contained,
    drawn_again,
    run_tubes,
)
from workbench.simulation.paper.replayed import TURN_S, Array, Asked, ReplayedRun
from workbench.simulation.paper.tubes import PathRows

ALL = Starts("all", 0.0, held=False)
STEP_S = 0.05
SPEED_MPS = 2.0
HALF_M = np.array([0.5, 0.25])
PATH = SplinePath.through([(0.0, 0.0), (30.0, 0.0), (60.0, 0.0)]).table(0.5)


def run_of(tracks: list[bool], *, name: str = "run", aside_m: float = 0.0) -> ReplayedRun:
    """A car at 2 m/s on a straight path, aside_m beside it; every third turn decides."""
    turns = len(tracks)
    place = np.column_stack([SPEED_MPS * TURN_S * np.arange(turns), np.full(turns, aside_m)])
    asked = []
    for turn in range(0, turns, 3):
        sides = {"station": (place[turn, 0] - 0.1, place[turn, 0] + 0.1), "offset": (-0.1, 0.1)}
        asked.append(Asked(turn, (Box.from_intervals(sides),) * 3, SPEED_MPS))
    return ReplayedRun(
        name, "bicycle", PATH, place, place, np.full(turns, SPEED_MPS), np.array(tracks),
        tuple(asked), 0,
    )  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Moving:
    """Tubes about a car that goes on at 2 m/s from the middle of the set, for proved_s."""

    half_m: Array
    proved_s: float = 5.0
    title: str = "moving"

    def rows(self, _path: object, asked: Asked, level: int) -> PathRows:
        """Rows that hold the car on all of each step, and half_m more to either side."""
        middle = np.array(asked.sets[level].center)
        at = STEP_S * np.arange(round(self.proved_s / STEP_S))
        way = np.column_stack([SPEED_MPS * at, np.zeros_like(at)])
        step = np.array([SPEED_MPS * STEP_S, 0.0])
        return PathRows(middle + way - self.half_m, middle + way + step + self.half_m, STEP_S)


def test_a_tube_about_the_car_contains_every_step_and_has_its_area() -> None:
    found = cell([run_tubes(run_of([True] * 400), Moving(HALF_M), 0)], horizon_s=3.0, starts=ALL)
    assert found is not None
    assert found.steps.value == 1.0
    assert found.windows is not None
    assert found.windows.value == 1.0
    assert found.mean_area_m2 == pytest.approx((1.0 + SPEED_MPS * STEP_S) * 0.5)
    assert found.begins == 1.0


def test_a_tube_shrunk_by_a_fifth_contains_less() -> None:
    """The car is 0.22 m aside, inside of 0.25 m and outside of 0.2 m."""
    run = run_of([True] * 400, aside_m=0.22)
    shares = [
        cell([run_tubes(run, Moving(scale * HALF_M), 0)], horizon_s=3.0, starts=ALL)
        for scale in (1.0, 0.8)
    ]
    assert [each.steps.value for each in shares if each is not None] == [1.0, 0.0]
    assert [each.outside for each in shares if each is not None] == [0, shares[0].steps.of]


@given(st.floats(0.0, 2.0), st.floats(0.1, 2.0))
def test_containment_is_monotone_in_the_tube(aside_m: float, scale: float) -> None:
    rows = PathRows(np.array([[-1.0, -1.0]] * 3), np.array([[1.0, 1.0]] * 3), STEP_S)
    wider = PathRows(rows.lower * (1.0 + scale), rows.upper * (1.0 + scale), STEP_S)
    place = np.array([[0.0, aside_m]] * 4)
    inside = contained(rows, place, place)
    assert (inside <= contained(wider, place, place)).all()
    assert inside.all() == (aside_m <= 1.0)


def test_each_instant_is_compared_with_its_own_row() -> None:
    """Row k is of [0.05 k, 0.05 (k + 1)]: turns 1, 2, 3 at 0.0325, 0.065, 0.0975 s are in rows 0,
    1, 1, and 0.13 s has none."""
    rows = PathRows(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.5, 0.0], [1.5, 0.0]]), STEP_S)
    place = np.array([[0.2, 0.0], [1.2, 0.0], [1.2, 0.0], [1.2, 0.0]])
    assert contained(rows, place, place).tolist() == [True, True, True, False]
    assert contained(rows, place[::-1], place[::-1]).tolist() == [False, True, True, False]
    nowhere = np.full((1, 2), math.nan)
    assert not contained(rows, nowhere, nowhere).any()


def test_steps_after_a_brake_do_not_count_and_its_trajectories_are_not_whole() -> None:
    """TRACK for 100 turns (3.25 s), then BRAKE: 3 s are 92 turns, so that decisions at turns 3 and
    6 alone are whole; the one at turn 0 was not under TRACK before."""
    run = run_of([True] * 100 + [False] * 50)
    tubes = run_tubes(run, Moving(HALF_M), 0)
    found = cell([tubes], horizon_s=3.0, starts=ALL)
    assert found is not None
    kept = [min(100 - turn, 92) for turn in range(3, 100, 3)]
    assert found.steps.of == sum(kept)
    assert found.all_windows == len(kept)
    assert found.censored == len(kept) - 2
    assert found.windows is not None
    assert found.windows.of == 2


def test_what_a_proof_does_not_reach_is_not_contained() -> None:
    tubes = run_tubes(run_of([True] * 400), Moving(HALF_M, proved_s=2.0), 0)
    early, late = (cell([tubes], horizon_s=t, starts=ALL) for t in (2.0, 4.0))
    assert early is not None
    assert late is not None
    assert (early.steps.value, early.proof_ended) == (1.0, 0)
    assert late.steps.value < 0.75
    assert late.proof_ended == late.all_windows
    assert (early.outside, late.outside) == (0, 0)
    assert (early.area_rows, late.area_rows) == (1.0, 0.5)


def test_a_decision_at_another_speed_or_outside_of_its_set_is_left_out() -> None:
    outside = run_tubes(run_of([True] * 200, aside_m=0.2), Moving(HALF_M), 0)
    assert cell([outside], horizon_s=3.0, starts=Starts("", 0.0, held=True)) is None
    assert cell([outside], horizon_s=3.0, starts=Starts("", 2.5, held=False)) is None
    assert cell([outside], horizon_s=3.0, starts=ALL) is not None


def test_intervals_count_runs_not_steps() -> None:
    """All of n runs: Clopper and Pearson's lower end is 0.025^(1/n)."""
    runs = [run_tubes(run_of([True] * 200, name=str(k)), Moving(HALF_M), 0) for k in range(3)]
    found = cell(runs, horizon_s=3.0, starts=ALL)
    assert found is not None
    assert found.steps.low == pytest.approx(0.025 ** (1.0 / 3.0))
    assert found.steps.high == 1.0
    assert found.steps_drawn == (1.0, 1.0)


def test_drawing_runs_anew_agrees_with_the_binomial() -> None:
    """Of 40 runs of one step each, 30 contained: draws are binomial with 40 and 0.75."""
    low, high = drawn_again(np.array([1.0] * 30 + [0.0] * 10), np.ones(40))
    deviation = math.sqrt(0.75 * 0.25 / 40)
    assert low == pytest.approx(0.75 - 1.96 * deviation, abs=0.03)
    assert high == pytest.approx(0.75 + 1.96 * deviation, abs=0.03)
    assert drawn_again(np.zeros(3), np.zeros(3)) == (0.0, 1.0)


def test_rows_are_of_every_plant_method_confidence_and_start() -> None:
    runs = [run_of([True] * 250), dataclasses.replace(run_of([True] * 250), plant="other")]
    counted = []
    rows = accuracy_rows(
        runs, (Moving(HALF_M), Moving(0.1 * HALF_M, title="thin")),
        advance=lambda: counted.append(1),
    )  # fmt: skip
    assert len(rows) == 2 * 2 * 3 * 3
    assert len(counted) == 2 * 2 * 3
    assert {row.method for row in rows} == {"moving", "thin"}
    assert all(len(row.cells) == len(HORIZONS_S) for row in rows)
    assert all(row.least == 1.0 for row in rows)


def test_the_papers_numbers_are_in_their_order() -> None:
    """More confidence contains more, at every T."""
    assert all(high > med > low for high, med, low in zip(*PUBLISHED, strict=True))
