"""The crossing's car obeys: it tracks its path, stops when told, goes on, and repeats exactly."""

from __future__ import annotations

import dataclasses
import itertools
import math

import pytest

from tests.replay_fixture import Scripted
from workbench.errors import InputError
from workbench.models.vehicle import gem_e2
from workbench.runtime import Action, Observation
from workbench.simulation.crossing import Crossing, CrossingResult, simulate
from workbench.simulation.driving import Driver
from workbench.simulation.people import discs

SCENE = Crossing.standard(gem_e2(), seed=None)


def conflict(seen: Observation) -> bool:
    """A crude judge: will a predicted disc come near where the car would be in 3 s or less?"""
    cos, sin = (f(sum(seen.heading) / 2) for f in (math.cos, math.sin))
    x, y = sum(seen.x) / 2, sum(seen.y) / 2
    for person in seen.people:
        for k, (px, py, radius) in enumerate(discs(person, horizon_s=3.0, step_s=0.1)):
            dx, dy = px - x - cos * 0.28 * k, py - y - sin * 0.28 * k
            along, across = cos * dx + sin * dy, cos * dy - sin * dx
            if -0.5 - radius < along < 2.3 + radius and abs(across) < radius + 0.9:
                return True
    return False


@pytest.fixture(scope="module")
def guarded() -> CrossingResult:
    return simulate(SCENE, Scripted(conflict))


def test_undisturbed_the_car_meets_the_crossing_person() -> None:
    closest = simulate(SCENE, Scripted()).measures.closest
    assert closest is not None
    assert closest.person == "crossing"
    assert closest.separation_m < 0.0


def test_the_car_stops_for_the_crossing_person_and_goes_on(guarded: CrossingResult) -> None:
    assert guarded.braked_s is not None
    assert guarded.resumed_s is not None
    assert guarded.braked_s < guarded.resumed_s
    assert guarded.slowest_mps < 1.5
    braked = {e.frame.t_s for e in guarded.entries if e.frame.action == "BRAKE"}
    assert min(braked) == guarded.braked_s
    assert max(braked) < guarded.resumed_s
    assert guarded.measures.closest is not None
    assert guarded.measures.closest.separation_m > 0.5
    last = guarded.entries[-1].frame
    assert last.speed_mps > 2.0
    assert last.x_m > 30.0
    assert "braked from" in guarded.summary_line()
    assert "closed-loop" in guarded.summary_line()


def test_the_person_alongside_is_passed_at_three_metres() -> None:
    alone = dataclasses.replace(
        SCENE, walkers=tuple(w for w in SCENE.walkers if w.name == "alongside")
    )
    result = simulate(alone, Scripted(conflict))
    assert result.measures.braked_share == 0.0
    assert result.measures.closest is not None
    width = gem_e2().geometry.half_width_m
    assert result.measures.closest.separation_m == pytest.approx(3.0 - width - 0.3, abs=0.1)
    assert "did not brake" in result.summary_line()


def test_the_same_seed_gives_the_same_run() -> None:
    short = dataclasses.replace(SCENE, duration_s=3.0, seed=7)
    runs = [Scripted(conflict) for _ in range(2)]
    frames = [[e.frame for e in simulate(short, run).entries] for run in runs]
    assert frames[0] == frames[1]
    assert runs[0].seen == runs[1].seen
    other = Scripted(conflict)
    simulate(dataclasses.replace(short, seed=8), other)
    assert other.seen != runs[0].seen


def test_observations_contain_the_truth() -> None:
    monitor = Scripted()
    result = simulate(dataclasses.replace(SCENE, duration_s=6.0, seed=3), monitor)
    for entry, seen in zip(result.entries, monitor.seen, strict=True):
        frame = entry.frame
        for interval, value in (
            (seen.x, frame.x_m),
            (seen.y, frame.y_m),
            (seen.heading, frame.heading),
            (seen.speed, frame.speed_mps),
        ):
            assert interval[0] <= value <= interval[1]


def test_braking_takes_the_time_of_the_closed_form() -> None:
    vehicle = gem_e2()
    driver = Driver(vehicle, SCENE.path)
    state = driver.start(2.8)
    mode = vehicle.brake.mode()
    deceleration = 0.5 * (mode.deceleration_min_mps2 + mode.deceleration_max_mps2)
    stands_s = mode.standstill_time_s(2.8, deceleration)
    before = driver.drive(state, Action.BRAKE, math.floor(stands_s * 100) / 100 - 0.02)
    assert before.speed_mps > 0.0
    # The clock of the brake runs on over several decisions of the same kind.
    for _ in range(math.ceil(stands_s * 10)):
        state = driver.drive(state, Action.BRAKE, 0.1)
    assert state.speed_mps == 0.0
    resting = driver.drive(state, Action.BRAKE, 1.0)
    assert (resting.x_m, resting.y_m, resting.heading) == (state.x_m, state.y_m, state.heading)
    assert driver.drive(resting, Action.TRACK, 1.0).speed_mps > 0.5


def test_a_switch_resets_the_speed_integral() -> None:
    driver = Driver(gem_e2(), SCENE.path)
    state = driver.drive(driver.start(2.0), Action.TRACK, 1.0)
    assert state.speed_integral_m != 0.0
    assert driver.drive(state, Action.BRAKE, 0.1).speed_integral_m == 0.0


def test_the_car_stays_on_its_path_and_moves_as_fast_as_it_says() -> None:
    result = simulate(dataclasses.replace(SCENE, duration_s=12.0), Scripted())
    table = SCENE.path_table()
    nodes = list(zip(table.x, table.y, strict=True))
    frames = [entry.frame for entry in result.entries]
    for frame in frames:
        assert min(math.dist((frame.x_m, frame.y_m), node) for node in nodes) < 0.25
    for before, after in itertools.pairwise(frames):
        moved = math.dist((before.x_m, before.y_m), (after.x_m, after.y_m))
        assert moved == pytest.approx(0.05 * (before.speed_mps + after.speed_mps), abs=1e-3)


def test_a_run_needs_a_duration() -> None:
    with pytest.raises(InputError, match="duration_s"):
        dataclasses.replace(SCENE, duration_s=math.nan)
