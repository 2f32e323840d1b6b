"""A query chooses horizon and step: all time is covered, whether the step divides it or not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from decision_answers import Array, TubeAnswer
from decision_fixture import (
    BAD_INPUT,
    COMPLETE,
    HORIZON_S,
    INVALID,
    NOT_PREDICTED,
    SAFE,
    STARTS,
    STEP_S,
    UNFINISHED,
    UNPROVED,
    DecisionKernel,
    compiled,
    kernel,
    query,
    real_text,
)
from decision_paths import FINE, paths, simulate
from decision_stops import Scene, excess, runs_of

from workbench.runtime.person_tubes import DiscPiece, PersonTube, TrackedPerson, TubeKind

_ROUNDING = 1e-12
_FINE_S = STEP_S / FINE
# Horizons of whole fine times: steps that divide them, that do not, and that leave a sliver.
_GRIDS = [(3.0, 0.05), (1.5, 0.025), (2.365, 0.04), (1.83, 0.031), (0.735, 0.05), (0.04, 0.05)]
_FAULTS = {
    "rows are rounded down": (r"ceil\(horizon / step - 1e-9\)", "floor(horizon / step)"),
    "rows are as long as the longest": (
        r"h = wb_row_length\(d->order, k\) / substeps;",
        "h = WB_STEP_MAX / substeps;",
    ),
    "time passes as if they were": (r"return k \* order->step; \}", "return k * WB_STEP_MAX; }"),
}


def _track(
    made: DecisionKernel, where: str, start: str, grid: tuple[float, float]
) -> tuple[TubeAnswer, float]:
    """The tube of TRACK, and how far runs along the very path leave it."""
    horizon_s, step_s = grid
    path, box = paths()[where], STARTS[start]
    asked = query(path.table, box, horizon_s=[horizon_s], step_s=[step_s])
    tube = made(asked).track
    fine = simulate(
        box, box.states(30, np.random.default_rng(3)), path.curvature,
        steps=math.ceil(horizon_s / STEP_S - 1e-9),
    )  # fmt: skip
    instants: Array = _FINE_S * np.arange(len(fine))
    lower, upper = tube.rows("lower", 7), tube.rows("upper", 7)
    worst = -math.inf
    for t, states in zip(instants, fine, strict=True):
        if t > horizon_s + 1e-9:
            break
        # An instant between two rows is in both.
        for side in (-1e-9, 1e-9):
            row = min(max(int(t / step_s + side), 0), math.ceil(horizon_s / step_s - 1e-9) - 1)
            if row >= tube.steps:
                return tube, math.inf
            outside = np.maximum(lower[row][:, None] - states, states - upper[row][:, None])
            worst = max(worst, float(outside.max()))
    return tube, worst


@pytest.mark.parametrize("grid", _GRIDS, ids=str)
@pytest.mark.parametrize(("where", "start"), [("right", "initial set"), ("left", "rate limit")])
def test_track_is_covered_up_to_the_horizon(
    where: str, start: str, grid: tuple[float, float]
) -> None:
    tube, outside = _track(kernel(), where, start, grid)
    assert tube.status == COMPLETE
    assert tube.steps == math.ceil(grid[0] / grid[1] - 1e-9)
    assert outside < _ROUNDING


@pytest.mark.parametrize("grid", [(2.4, 0.05), (2.37, 0.04), (1.83, 0.031), (1.5, 0.025)], ids=str)
@pytest.mark.parametrize(
    "scene",
    [
        Scene("S", "initial set", share=0.5),
        Scene("left", "accelerating"),
        Scene("straight", "standing", start_s=(0.03, 0.11), switch_s=(0.2, 0.25)),
    ],
    ids=lambda scene: scene.start,
)
def test_stops_are_covered_to_the_standstill(scene: Scene, grid: tuple[float, float]) -> None:
    answer = scene.answer(kernel(), horizon_s=[grid[0]], step_s=[grid[1]])
    for name in ("stop", "brake"):
        tube = answer.stop if name == "stop" else answer.brake
        if tube.status == COMPLETE:
            assert excess(tube, runs_of(scene, name), step_s=grid[1]).max() < _ROUNDING
    # From 2.7 m/s a standstill takes up to 1.64 s.
    expected = {COMPLETE} if grid[0] > 1.8 else {COMPLETE, UNFINISHED}
    assert {answer.stop.status, answer.brake.status} <= expected


@pytest.mark.parametrize("name", _FAULTS)
def test_a_planted_fault_is_caught(name: str) -> None:
    faulty = compiled(real_text().edited(_FAULTS[name]))
    caught = False
    scene = Scene("left", "accelerating")
    for grid in [(2.365, 0.04), (1.83, 0.031)]:
        tube, outside = _track(faulty, "right", "initial set", grid)
        stop = scene.answer(faulty, horizon_s=[grid[0]], step_s=[grid[1]]).stop
        assert tube.status == stop.status == COMPLETE
        stopped = excess(stop, runs_of(scene, "stop"), step_s=grid[1]).max()
        caught = caught or not max(outside, stopped) < _ROUNDING
    assert caught


def _intending(until_s: float) -> TrackedPerson:
    """Somebody far away whose intent is known until then."""
    piece = DiscPiece(-1.0, 50.0, 50.0, 0.0, 0.0, 0.3, 0.0, 0.0)
    return TrackedPerson("", (PersonTube(TubeKind.INTENT, ((piece,),), until_s),))


@pytest.mark.parametrize("grid", _GRIDS, ids=str)
def test_people_are_asked_for_until_the_horizon_and_no_further(grid: tuple[float, float]) -> None:
    path, box = paths()["S"].table, STARTS["point"]
    chosen = {"horizon_s": [grid[0]], "step_s": [grid[1]]}
    known = kernel()(query(path, box, [_intending(grid[0] * (1 + 1e-12))], **chosen)).track
    assert known.verdict == SAFE
    short = kernel()(query(path, box, [_intending(grid[0] * (1 - 1e-6))], **chosen)).track
    assert (short.verdict, short.intent.cause) == (UNPROVED, NOT_PREDICTED)


def test_a_longer_horizon_finds_who_stands_further_along() -> None:
    path, box = paths()["straight"].table, STARTS["point"]
    ahead = (6.5, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0)
    verdicts = [
        kernel()(query(path, box, [ahead], horizon_s=[t], step_s=[0.04])).track.verdict
        for t in (0.9, 1.1, 1.3, 1.5, 1.7, 1.9, 2.1, 2.3)
    ]
    assert verdicts == sorted(verdicts)
    assert verdicts[0] == SAFE
    assert verdicts[-1] == UNPROVED
    # At 2.8 m/s the bumper, 2.26 m ahead, is 0.2 m from the disc after 1.34 s.
    assert verdicts[:3] == [SAFE] * 3


def test_what_the_bundle_has_stands_where_nothing_is_chosen() -> None:
    path, box = paths()["S"].table, STARTS["initial set"]
    same = query(path, box, horizon_s=[HORIZON_S], step_s=[STEP_S])
    assert np.array_equal(query(path, box), same)


@pytest.mark.parametrize(
    "chosen",
    [
        {"step_s": [STEP_S * (1 + 1e-15)]},
        {"step_s": [STEP_S / 2]},
        {"horizon_s": [HORIZON_S + 0.01]},
        *({name: [bad]} for name in ("step_s", "horizon_s") for bad in (0.0, -1.0)),
        *({name: [bad]} for name in ("step_s", "horizon_s") for bad in (math.nan, math.inf)),
        {"step_s": [5e-324], "horizon_s": [5e-324 * 100]},
    ],
    ids=str,
)
def test_a_grid_that_the_kernel_has_no_room_or_proof_for_is_refused(
    chosen: dict[str, list[float]],
) -> None:
    answer = kernel()(query(paths()["S"].table, STARTS["point"], **chosen))
    assert [tube.verdict for tube in answer.tubes] == [INVALID] * 3
    assert [tube.status for tube in answer.tubes] == [BAD_INPUT] * 3


def test_a_horizon_much_shorter_than_a_step_is_one_row() -> None:
    answer = kernel()(query(paths()["S"].table, STARTS["point"], horizon_s=[1e-6]))
    assert (answer.track.verdict, answer.track.steps) == (SAFE, 1)
