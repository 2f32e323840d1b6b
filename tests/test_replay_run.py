"""Replay shows the monitor only the past, judges the samples that count, and measures truly."""

from __future__ import annotations

import dataclasses
import math

import pytest

from tests.replay_fixture import LIMITS, Scripted, drive, standing
from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.models.vehicle import gem_e2
from workbench.runtime import Decision, Observation
from workbench.simulation.clock import SetClock
from workbench.simulation.measures import percentile
from workbench.simulation.recorded_path import PathSmoothing, recorded_path
from workbench.simulation.replay import (
    CHECK_S,
    ReplaySettings,
    replay,
    replay_path,
    replay_timing,
    replay_vehicle,
)

SETTINGS = ReplaySettings.instrumented_car(LIMITS)


def test_every_slow_forward_sample_is_judged_once_in_time_order() -> None:
    monitor = Scripted()
    calls: list[tuple[int, int]] = []
    result = replay(
        drive(),
        monitor,
        clock=SetClock(),
        settings=SETTINGS,
        progress=lambda done, total: calls.append((done, total)),
    )
    times = [entry.frame.t_s for entry in result.entries]
    assert times == [sample.t_s for sample in drive().vehicle]
    assert [seen.reference_speed_mps for seen in monitor.seen] == [4.0] * 41
    assert calls == [(k, 41) for k in range(1, 42)]
    assert result.measures.closest is None
    assert "no people" in result.notes[3]
    assert "open-loop" in result.notes[0]
    assert "FailSafe is followed in the log only" in result.notes[2]


def test_the_clock_starts_with_the_recording_and_each_check_ends_after_its_sample() -> None:
    """Whatever the recording calls its first instant, also one that a clock cannot count from."""
    clock, ends = SetClock(), []

    class Watching(Scripted):
        def step(self, observation: Observation) -> Decision:
            ends.append(clock())
            return super().step(observation)

    late = tuple(dataclasses.replace(s, t_s=s.t_s + 1.7e9) for s in drive().vehicle)
    monitor = Watching(lambda seen: seen.stamp_s > 1.95)
    result = replay(
        dataclasses.replace(drive(), vehicle=late), monitor, clock=clock, settings=SETTINGS
    )
    stamps = [seen.stamp_s for seen in monitor.seen]
    assert stamps == pytest.approx([0.1 * k for k in range(41)], abs=1e-6)
    assert monitor.turns == pytest.approx([k / 30.0 for k in range(121)], abs=1e-6)
    assert ends == pytest.approx([stamp + CHECK_S for stamp in stamps])
    sent = [entry.frame.sent for entry in result.entries]
    assert sent == ["TRACK"] * 21 + ["BRAKE"] * 20
    assert dict(result.measures.violations) == {"PEOPLE": 21}
    assert result.measures.alerts == 21
    assert dict(result.measures.safe_shares) == {"LookAhead": 20 / 41, "FailSafe": 1.0}
    assert "21 PEOPLE, alerts 21" in result.summary_line()


def test_the_period_is_that_of_rarer_samples() -> None:
    assert replay_timing(drive()).period_s == pytest.approx(0.1)
    assert replay_timing(dataclasses.replace(drive(), vehicle=drive().vehicle[::5])).period_s == (
        pytest.approx(0.5)
    )
    assert replay_timing(dataclasses.replace(drive(), vehicle=drive().vehicle[:1])).period_s == 0.1


def test_fast_and_reversing_samples_are_not_judged() -> None:
    slow = drive().vehicle
    changed = (
        *(dataclasses.replace(s, speed_mps=8.1) for s in slow[:3]),
        *slow[3:39],
        *(dataclasses.replace(s, speed_mps=-0.5) for s in slow[39:]),
    )
    result = replay(
        dataclasses.replace(drive(), vehicle=changed),
        Scripted(),
        clock=SetClock(),
        settings=SETTINGS,
    )
    assert (result.measures.queries, result.too_fast, result.reversing) == (36, 3, 2)
    assert any("3 samples above 8 m/s" in note for note in result.notes)


def test_observations_do_not_depend_on_the_future() -> None:
    people = (standing("late", 9.0, 1.0, first_s=2.0), standing("early", 3.0, 8.0))
    whole, cut = Scripted(), Scripted()
    recording = drive(people=people)
    replay(recording, whole, clock=SetClock(), settings=SETTINGS)
    shorter = dataclasses.replace(
        recording,
        vehicle=recording.vehicle[:15],
        people=(dataclasses.replace(people[1], samples=people[1].samples[:15]),),
    )
    replay(shorter, cut, clock=SetClock(), settings=SETTINGS)
    assert whole.seen[:15] == cut.seen
    assert {person.name for person in whole.seen[25].people} == {"late", "early"}


def test_measures_are_those_of_the_scene() -> None:
    monitor = Scripted(lambda seen: seen.x[0] > 6.0)
    result = replay(
        drive(people=(standing("p", 8.0, -3.0),)), monitor, clock=SetClock(), settings=SETTINGS
    )
    measures = result.measures
    braked = sum(20.0 * math.sin(0.02 * k) - 0.1 > 6.0 for k in range(41))
    assert measures.braked_share == pytest.approx(braked / 41)
    assert dict(measures.verdicts)[Verdict.UNPROVED] == braked
    assert dict(measures.verdicts)[Verdict.INVALID] == 0
    assert measures.smallest_clearance_m == 0.25
    assert measures.people_seen == 1
    assert measures.decision_median_s == pytest.approx(0.021)
    assert measures.decision_p99_s == pytest.approx(0.041)
    line = result.summary_line()
    assert "\n" not in line
    for part in ("made: 41 queries", "smallest separation", "median 21.00 ms, p99 41.00 ms"):
        assert part in line


def test_smallest_separation_is_the_distance_to_the_body() -> None:
    """On a very wide circle the car passes a standing person at a known lateral distance."""
    recording = drive(radius_m=1e6, people=(standing("p", 8.0, -3.0), standing("far", 8.0, 9.0)))
    closest = replay(recording, Scripted(), clock=SetClock(), settings=SETTINGS).measures.closest
    assert closest is not None
    assert closest.person == "p"
    assert closest.separation_m == pytest.approx(3.0 - 0.91 - 0.3, abs=1e-3)
    # The front bumper is 3.8 m ahead of the rear axle, so the body is beside them from 4.2 m on.
    assert closest.t_s == pytest.approx(4.2 / 4.0, abs=0.11)


def test_separation_looks_at_people_who_are_sampled_now() -> None:
    recording = drive(people=(standing("p", 8.0, -3.0, first_s=2.0),))
    result = replay(recording, Scripted(), clock=SetClock(), settings=SETTINGS)
    first = next(e.frame.t_s for e in result.entries if e.separation_m is not None)
    assert first == pytest.approx(2.0, abs=0.06)


def test_the_path_is_the_rear_axle_way_and_goes_on_straight() -> None:
    table = replay_path(drive(), SETTINGS)
    on_path = [
        (x, y)
        for j, (x, y) in enumerate(zip(table.x, table.y, strict=True))
        if 0.0 <= table.station_m(j) <= 15.5
    ]
    assert max(abs(math.hypot(x, y - 20.0) - 20.0) for x, y in on_path) < 0.01
    assert table.start_m == -10.0
    assert table.end_m == pytest.approx(16.0 + 40.0, abs=0.1)


def test_noise_in_position_does_not_bend_the_path() -> None:
    noisy = tuple(
        dataclasses.replace(s, y_m=s.y_m + 0.04 * (-1) ** k)
        for k, s in enumerate(drive(radius_m=1e6).vehicle)
    )
    path = recorded_path(
        dataclasses.replace(drive(), vehicle=noisy), PathSmoothing.usual(), reference_ahead_m=0.3
    )
    assert abs(path.curvature([0.1 * k for k in range(int(10 * path.length_m))])).max() < 0.02


def test_the_vehicle_gets_the_recorded_shape_about_its_rear_axle() -> None:
    vehicle = replay_vehicle(drive(), gem_e2(), SETTINGS)
    shape = vehicle.geometry
    assert (shape.wheelbase_m, shape.half_width_m) == (2.71, 0.91)
    assert (shape.front_m, shape.rear_m) == pytest.approx((3.8, 1.0))
    assert vehicle.operation.region.interval("speed") == (-0.5, 10.0)
    assert vehicle.limits.steering_rate_radps == SETTINGS.errors.steering_rate_limit_radps
    assert vehicle.limits.accel_max_mps2 == gem_e2().limits.accel_max_mps2


def test_standing_and_fast_recordings_are_refused_with_the_reason() -> None:
    standing_still = drive(speed_mps=0.01)
    with pytest.raises(InputError, match=r"drives 0\.04 m in 4\.0 s, replay needs at least 3 m"):
        replay(standing_still, Scripted(), clock=SetClock(), settings=SETTINGS)
    with pytest.raises(InputError, match=r"no sample .* up to 8 m/s \(slowest 12\.00 m/s\)"):
        replay(drive(speed_mps=12.0), Scripted(), clock=SetClock(), settings=SETTINGS)


@pytest.mark.parametrize("wrong", [0.0, math.nan])
def test_impossible_settings_are_refused(wrong: float) -> None:
    with pytest.raises(InputError, match="speed_limit_mps"):
        dataclasses.replace(SETTINGS, speed_limit_mps=wrong)
    with pytest.raises(InputError, match="knot_spacing_m"):
        dataclasses.replace(PathSmoothing.usual(), knot_spacing_m=wrong)


def test_percentile_is_the_nearest_rank() -> None:
    values = [float(k) for k in range(1, 101)]
    assert (percentile(values, 0.5), percentile(values, 0.99)) == (50.0, 99.0)
    assert percentile([7.0], 0.99) == 7.0
