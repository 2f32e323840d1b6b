"""The crossing's car obeys: it tracks its path, stops when told, goes on, and repeats exactly."""

from __future__ import annotations

import dataclasses
import itertools
import math

import pytest

from tests.replay_fixture import Scripted
from workbench.errors import InputError
from workbench.models.vehicle import gem_e2
from workbench.runtime import Action, Decision, Observation
from workbench.runtime.policies import Hypothesis, Turn, Violation
from workbench.simulation.clock import SetClock
from workbench.simulation.crossing import Crossing
from workbench.simulation.drawn_people import discs
from workbench.simulation.driving import Driver
from workbench.simulation.obeying import TIMING, CrossingResult, simulate
from workbench.simulation.people import seen_people

SCENE = Crossing.standard(gem_e2(), start_speed_mps=2.8, seed=None)
STANDING = Crossing.standard(gem_e2(), start_speed_mps=0.0, seed=None)


def driven(scene: Crossing, monitor: Scripted) -> CrossingResult:
    return simulate(scene, monitor, clock=SetClock())


def conflict(seen: Observation) -> bool:
    """A crude judge: will a predicted disc come near where the car would be in 3 s or less?"""
    cos, sin = (f(sum(seen.heading) / 2) for f in (math.cos, math.sin))
    x, y = sum(seen.x) / 2, sum(seen.y) / 2
    for person in seen.people:
        expected = discs(person.intent[0], horizon_s=3.0, step_s=0.1)
        for k, (px, py, radius) in enumerate(expected):
            dx, dy = px - x - cos * 0.28 * k, py - y - sin * 0.28 * k
            along, across = cos * dx + sin * dy, cos * dy - sin * dx
            if -0.5 - radius < along < 2.3 + radius and abs(across) < radius + 0.9:
                return True
    return False


@pytest.fixture(scope="module")
def guarded() -> CrossingResult:
    return driven(SCENE, Scripted(conflict))


@pytest.mark.parametrize("scene", [SCENE, STANDING], ids=["moving", "standing"])
def test_undisturbed_the_car_meets_the_crossing_person(scene: Crossing) -> None:
    closest = driven(scene, Scripted()).measures.closest
    assert closest is not None
    assert closest.person == "crossing"
    assert closest.separation_m < 0.0


def test_the_car_stops_for_the_crossing_person_and_goes_on(guarded: CrossingResult) -> None:
    assert guarded.braked_s is not None
    assert guarded.resumed_s is not None
    assert guarded.braked_s < guarded.resumed_s
    assert guarded.brakes == 1
    assert guarded.slowest_mps is not None
    assert guarded.slowest_mps < 1.5
    braked = {e.frame.t_s for e in guarded.entries if e.frame.sent == "BRAKE"}
    assert min(braked) == guarded.braked_s
    assert max(braked) < guarded.resumed_s
    assert guarded.measures.closest is not None
    assert guarded.measures.closest.separation_m > 0.5
    last = guarded.entries[-1].frame
    assert last.speed_mps > 2.0
    assert last.x_m > 30.0
    # It rolls from the start.
    assert "the car tracked from 0.0 s, braked once, first at" in guarded.summary_line()
    assert "the car set off at 0.0 s and did not" in driven(STANDING, Scripted()).summary_line()
    assert "closed-loop" in guarded.summary_line()


def test_the_person_alongside_is_passed_at_six_metres() -> None:
    alone = dataclasses.replace(
        SCENE, walkers=tuple(w for w in SCENE.walkers if w.name == "alongside")
    )
    result = driven(alone, Scripted(conflict))
    assert result.measures.braked_share == 0.0
    assert result.measures.closest is not None
    width = gem_e2().geometry.half_width_m
    assert result.measures.closest.separation_m == pytest.approx(6.0 - width - 0.3, abs=0.1)
    assert "did not brake" in result.summary_line()


def test_the_same_seed_gives_the_same_run() -> None:
    short = dataclasses.replace(SCENE, duration_s=3.0, seed=7)
    runs = [Scripted(conflict) for _ in range(2)]
    frames = [[e.frame for e in driven(short, run).entries] for run in runs]
    assert frames[0] == frames[1]
    assert runs[0].seen == runs[1].seen
    other = Scripted(conflict)
    driven(dataclasses.replace(short, seed=8), other)
    assert other.seen != runs[0].seen


def test_observations_contain_the_truth() -> None:
    monitor = Scripted()
    result = driven(dataclasses.replace(STANDING, duration_s=6.0, seed=3), monitor)
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


def test_from_standstill_the_car_stands_until_track_is_sent() -> None:
    class Waiting(Scripted):
        def turn(self, now_s: float) -> Turn:
            return Turn(Action.BRAKE if now_s < 0.99 else Action.TRACK, None)

    result = driven(dataclasses.replace(STANDING, duration_s=2.0), Waiting())
    speeds = [entry.frame.speed_mps for entry in result.entries]
    assert speeds[:11] == [0.0] * 11
    assert speeds[-1] > 0.5
    assert result.started_s == pytest.approx(1.0)
    assert result.braked_s is None
    never = driven(dataclasses.replace(STANDING, duration_s=0.5), Scripted(lambda seen: True))
    assert never.measures.alerts == 5


def test_a_check_ends_before_the_next_turn_and_the_car_does_what_the_turn_says() -> None:
    clock, ends = SetClock(), []

    class Watching(Scripted):
        def step(self, observation: Observation) -> Decision:
            ends.append(clock() - observation.stamp_s)
            return super().step(observation)

    monitor = Watching(lambda seen: seen.stamp_s >= 0.5)
    scene = dataclasses.replace(SCENE, duration_s=1.0, seed=5)
    result = simulate(scene, monitor, clock=clock)
    assert monitor.turns == pytest.approx([k / 30.0 for k in range(30)])
    assert min(ends) > 0.0
    assert max(ends) < min(TIMING.send_gap_s, TIMING.latency_s)
    assert len(set(ends)) == 10
    # Sent is what is in force at the stamp; the decision of 0.5 s acts from the turn after it.
    assert [entry.frame.sent for entry in result.entries] == ["TRACK"] * 6 + ["BRAKE"] * 4
    assert result.braked_s == pytest.approx(0.6)


def test_what_a_turn_of_the_sender_refutes_is_logged_with_the_next_decision() -> None:
    missed = Violation(Hypothesis.SENDER, "BRAKE is sent too late", refutes_plan=True)

    class Late(Scripted):
        def turn(self, now_s: float) -> Turn:
            return Turn(Action.TRACK, missed if 0.22 < now_s < 0.25 else None)

    result = driven(dataclasses.replace(SCENE, duration_s=0.6), Late())
    named = [entry.frame.violations for entry in result.entries]
    assert named == [(), (), (), ("SENDER: BRAKE is sent too late",), (), ()]
    assert dict(result.measures.violations) == {"SENDER": 1}


def test_everybody_walks_within_the_limits_of_the_guard_and_is_in_it() -> None:
    """A second method: positions of the walkers themselves against the guards of their samples."""
    limits = STANDING.limits
    for walker in STANDING.walkers:
        track = walker.track(STANDING.duration_s)
        velocities = [
            ((b.x_m - a.x_m) / 0.1, (b.y_m - a.y_m) / 0.1)
            for a, b in itertools.pairwise(track.samples)
        ]
        for before, after in itertools.pairwise(velocities):
            assert math.dist(before, after) / 0.1 <= limits.acceleration_mps2
            assert math.hypot(*after) <= limits.speed_mps
        for k, sample in enumerate(track.samples[10:-20], start=10):
            (seen,) = seen_people((track,), sample.t_s, STANDING.models, limits)
            later = track.samples[k + 20]
            p, w = seen.guard.position, seen.guard.velocity
            away = math.hypot(later.x_m - p.x - 2.0 * w.x, later.y_m - p.y - 2.0 * w.y)
            grown = p.radius + 2.0 * w.radius + 2.0 * limits.acceleration_mps2
            assert away + STANDING.models.on_foot.body_radius_m <= grown


def test_the_brake_is_within_the_vehicle_and_differs_with_the_seed() -> None:
    brake = gem_e2().brake
    with pytest.raises(InputError, match="deceleration_mps2: expected 2 to 3"):
        Driver(gem_e2(), SCENE.path, deceleration_mps2=1.0)
    stops = []
    for hardness in (brake.deceleration_min_mps2, brake.deceleration_max_mps2):
        driver = Driver(gem_e2(), SCENE.path, deceleration_mps2=hardness)
        stops.append(driver.drive(driver.start(2.8), Action.BRAKE, 3.0).values[0])
    assert stops == pytest.approx([2.8 * 0.15 + 1.96, 2.8 * 0.15 + 2.8**2 / 6.0], abs=0.02)


def test_a_switch_resets_the_speed_integral() -> None:
    driver = Driver(gem_e2(), SCENE.path)
    state = driver.drive(driver.start(2.0), Action.TRACK, 1.0)
    assert state.speed_integral_m != 0.0
    assert driver.drive(state, Action.BRAKE, 0.1).speed_integral_m == 0.0


def test_the_car_stays_on_its_path_and_moves_as_fast_as_it_says() -> None:
    result = driven(dataclasses.replace(SCENE, duration_s=12.0), Scripted())
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
