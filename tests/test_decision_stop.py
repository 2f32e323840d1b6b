"""No car that is told to brake at any instant of the window leaves its tube, until it stands."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from decision_answers import TubeAnswer
from decision_fixture import COMPLETE, STARTS, STEP_S, UNFINISHED, kernel
from decision_paths import paths
from decision_stops import AT_ONCE, SPEED, SPEED_INTEGRAL, Scene, excess, runs_of

# What rounding of the simulation changes.
_ROUNDING = 1e-13
_HELD = (0.05, 0.0834)


def _check_stands(tube: TubeAnswer) -> None:
    """Only a tube that ends with a standstill is complete."""
    speeds = tube.rows("upper", 7)[:, SPEED]
    assert (tube.status == COMPLETE) == (speeds[-1] == 0.0)
    assert (speeds[:-1] > 0.0).all() or tube.steps == 1


_SCENES = [
    Scene("S", "initial set", 1 / 3), Scene("S", "standing"), Scene("S", "rate limit", 0.4),
    Scene("S", "point"), Scene("unsure", "accelerating", 2 / 3), Scene("unsure", "braking", 0.2),
    Scene("left", "initial set", 0.4), Scene("right", "rate limit"), Scene("left", "point"),
    Scene("right", "initial set", 0.4), Scene("straight", "initial set"),
    Scene("straight", "accelerating"),
]  # fmt: skip


@pytest.mark.parametrize("tube", ["stop", "brake"])
@pytest.mark.parametrize("scene", _SCENES, ids=lambda s: f"{s.where}-{s.start}")
def test_no_run_leaves_the_rows_before_and_after_it_stands(scene: Scene, tube: str) -> None:
    answer: TubeAnswer = getattr(scene.answer(kernel()), tube)
    assert answer.steps >= 9
    _check_stands(answer)
    assert excess(answer, runs_of(scene, tube)).max() < _ROUNDING


def test_most_of_these_tubes_reach_a_standstill() -> None:
    """What is refused would be inside of anything."""
    answers = [scene.answer(kernel()) for scene in _SCENES]
    assert sum(answer.stop.status == COMPLETE for answer in answers) >= len(answers) - 2
    assert sum(answer.brake.status == COMPLETE for answer in answers) >= len(answers) - 3


_HELD_SCENES = [
    Scene("straight", "standing", 1.0, (0.25, 0.2834), _HELD),
    Scene("S", "standing", 1.0, (0.25, 0.2834), _HELD),
    Scene("unsure", "standing", 1.0, (0.25, 0.2834), (0.0, 0.07)),
    Scene("left", "standing", 0.5, (0.3, 0.45), (0.02, 0.21)),
    Scene("right", "charged", 0.5, (0.25, 0.3), (0.02, 0.14)),
    # A command that may come before TRACK does, and a start known to a whole number of steps.
    Scene("left", "standing", 1.0, (0.02, 0.1), (0.05, 0.0834)),
    Scene("right", "standing", 1.0, (0.2, 0.25), (0.05, 0.1)),
    Scene("right", "accelerating", 0.5, (0.25, 0.25), (0.1, 0.1)),
]


@pytest.mark.parametrize("scene", _HELD_SCENES, ids=lambda s: f"{s.where}-{s.start}-{s.start_s}")
def test_a_car_that_waits_for_track_stays_in_rows_of_the_stamps_time(scene: Scene) -> None:
    answer = scene.answer(kernel()).stop
    assert answer.status == COMPLETE
    _check_stands(answer)
    assert excess(answer, runs_of(scene, "stop")).max() < _ROUNDING


@pytest.mark.parametrize("scene", _HELD_SCENES[:5], ids=lambda s: f"{s.where}-{s.start}")
def test_a_car_that_waits_and_then_tracks_to_the_end_stays_in_its_rows(scene: Scene) -> None:
    answer = scene.answer(kernel()).track
    assert answer.steps > 20
    to_the_end = dataclasses.replace(scene, switch_s=(3.01, 3.01))
    assert excess(answer, runs_of(to_the_end, "track", 8, 32)).max() < _ROUNDING


def test_a_car_that_is_told_to_brake_before_it_starts_stays_where_it_stands() -> None:
    scene = _HELD_SCENES[5]
    answer = scene.answer(kernel()).stop
    states = scene.box.states(100, np.random.default_rng(1))
    states[SPEED] = states[SPEED_INTEGRAL] = 0.0
    lower, upper = answer.rows("lower", 7)[..., None], answer.rows("upper", 7)[..., None]
    assert (lower <= states).all()
    assert (states <= upper).all()


def test_any_window_any_start_any_path() -> None:
    """Windows from an instant to half a second, wherever they begin, also before a row ends."""
    chance = np.random.default_rng(19)
    complete = 0
    for _ in range(20):
        start = list(STARTS)[chance.integers(len(STARTS))]
        first = chance.choice([0.0, 0.05, 0.1, *chance.uniform(0.0, 0.6, 3)])
        window = (first, first + chance.choice([0.0, 0.05, *chance.uniform(0.0, 0.5, 2)]))
        held = (0.0, float(chance.uniform(0.0, 0.2))) if start == "standing" else AT_ONCE
        where = list(paths())[chance.integers(len(paths()))]
        share = float(chance.uniform(0.05, 0.7))
        scene = Scene(where, start, share, window, held, window)
        answer = scene.answer(kernel())
        for tube in ("stop", "brake") if held == AT_ONCE else ("stop",):
            rows: TubeAnswer = getattr(answer, tube)
            if rows.steps:
                _check_stands(rows)
                assert excess(rows, runs_of(scene, tube, 8, 32)).max() < _ROUNDING, scene
            complete += rows.status == COMPLETE
    assert complete >= 20


def test_a_command_too_late_to_stop_within_the_rows_is_unfinished() -> None:
    answer = Scene("straight", "point", 1.0, (2.5, 2.6)).answer(kernel()).stop
    assert (answer.status, answer.steps) == (UNFINISHED, 60)
    assert (answer.rows("upper", 7)[:, SPEED] > 0.0).all()


def test_a_known_start_costs_a_step_of_speed_and_a_share_of_the_build_up() -> None:
    """A bound of everything would contain all runs."""
    scene = Scene("straight", "point", 1.0, (0.2, 0.2))
    answer, runs = scene.answer(kernel()).stop, runs_of(scene, "stop")
    reached = float(np.ptp(runs.states[-1, 0]))
    width = answer.rows("upper", 7)[-1, 0] - answer.rows("lower", 7)[-1, 0]
    # Speeds are those of the worst end of a step, from 2.8 m/s to 0 on either side.
    assert reached < width < reached + 2 * STEP_S * 2.8 + 0.08
