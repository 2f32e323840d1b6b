"""A turn sees what was received, doubts it beyond limits, and reads it as the law needs it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from onboard_core_bench import framed
from onboard_core_cases import SETTINGS
from onboard_watching_cases import (
    BINS,
    DISARMED,
    PATH,
    SPACING_M,
    START_M,
    TRACKING,
    S,
    look,
    seeing,
    told,
    watching,
    with_place,
    with_speed,
    with_wheel,
)

from workbench.runtime.observation import Observation
from workbench.runtime.onboard.actuation import Outputs
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.law_reading import LawReading, middle
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.states import Mode, Standing
from workbench.runtime.onboard.watching import Sight
from workbench.runtime.path import PathTable
from workbench.runtime.projection import PathPose


def test_before_anything_came_all_is_missing_and_each_fault_is_told_once_in_order() -> None:
    sight = look(watching(start_station_m=3.0), 200_000)
    assert (sight.observation, sight.reading, sight.people_set) == (None, None, 0)
    assert sight.station_m == 3.0
    assert math.isnan(sight.read_back_rad)
    assert [(each.fault, each.since_us) for each in sight.found] == [
        (Fault.STALE_REPORT, 0),
        (Fault.LOCALISATION_LOST, 0),
        (Fault.BUS_SILENT, 100_000),
        (Fault.PEOPLE_LOST, 0),
    ]


def test_what_came_is_seen() -> None:
    watch = seeing()
    sight = look(watch, S)
    assert isinstance(sight.observation, Observation)
    assert sight.people_set == 7
    assert sight.read_back_rad == 0.5
    assert sight.station_m == pytest.approx(1.0, abs=0.1)
    assert watch.following.wheel == (S, 0.5)
    assert not {Fault.NOT_OBSERVED, Fault.COARSE_READING} & {each.fault for each in sight.found}


@pytest.mark.parametrize("mode", list(Mode))
def test_who_may_command_besides_us_depends_on_the_mode(mode: Mode) -> None:
    watch = watching(mode)
    watch.receive(*framed("BRAKE_CMD", {"BRAKE_CMD": 0.0}), S)
    sight = look(watch, S)
    assert (told(sight, Fault.SPOOFED) is None) is (mode is Mode.SHADOW)
    assert (told(sight, Fault.UPSTREAM_LOST) is not None) is (mode is Mode.GATE)
    assert (watch.upstream is not None) is (mode is Mode.GATE)


def test_a_car_that_tracks_must_be_enabled_and_a_bundle_signed() -> None:
    assert told(look(watching(), S, TRACKING), Fault.NOT_ENABLED) is not None
    assert told(look(watching(), S), Fault.NOT_ENABLED) is None
    assert told(look(watching(), S), Fault.BUNDLE) is None
    assert told(look(watching(signed=False), S), Fault.BUNDLE) is not None


def test_a_car_that_does_not_follow_is_seen() -> None:
    watch = watching()
    says = {"MANUAL_INPUT": 0.0, "COMMANDED_VALUE": 0.5, "OUTPUT_VALUE": 0.5, "BRAKE_ON_OFF": 1}
    watch.receive(*framed("BRAKE_RPT", says), S)
    assert told(look(watch, S), Fault.NOT_FOLLOWING) is None
    watch.following = watch.following.commanding(
        0, Outputs(0.0, 0.0, 0.0, 0.5), acceleration_mps2=0.0, brakes_from_mps=None
    )
    found = told(look(watch, S), Fault.NOT_FOLLOWING)
    assert found == Found(Fault.NOT_FOLLOWING, "brake: commanded 0.000 to 0.000, reported 0.500", S)


def test_reports_and_localisation_are_compared() -> None:
    watch = seeing()
    assert told(look(watch, S), Fault.WRONG_SPEED) is None
    assert watch.agreed_m == 0.0
    at_us = S + 250_000
    with_place(watch, at_us, number=2, x_m=1.25, y_m=0.6, heading_rad=0.1, speed_mps=1.0)
    with_speed(watch, 1.0, at_us)
    with_wheel(watch, 0.5, at_us)
    look(watch, at_us)
    # 0.25 m less the radii of both, each rounded up.
    assert watch.agreed_m == pytest.approx(0.25 - 2 * 0.101, abs=1e-6)
    wrong = seeing(place={"speed_mps": 4.0})
    assert told(look(wrong, S), Fault.WRONG_SPEED) is not None
    assert wrong.agreed_m == 0.0


def test_a_turn_before_the_last_frame_sees_nothing_and_says_why() -> None:
    sight = look(seeing(start_station_m=3.0), S - 1)
    assert (sight.observation, sight.reading, sight.station_m) == (None, None, 3.0)
    found = told(sight, Fault.CLOCK_BACKWARDS)
    assert found is not None
    assert found.since_us == S - 1
    assert "the last frame at 1000000 us" in found.detail


def test_a_car_off_the_path_is_seen_and_not_read() -> None:
    for x_m in (-10.6, 30.6):
        sight = look(seeing(place={"x_m": x_m}, start_station_m=3.0), S)
        assert sight.observation is not None
        assert (sight.reading, sight.station_m) == (None, 3.0)
        found = told(sight, Fault.NOT_OBSERVED)
        assert found is not None
        assert found.since_us == S
        assert found.detail.startswith("no path coordinates: ")


def known(sight: Sight, path: PathTable = PATH) -> tuple[Observation, PathPose]:
    """What was seen, and where on the path that is."""
    seen = sight.observation
    assert seen is not None
    pose = path.project(seen.x, seen.y, seen.heading, near_station_m=None)
    assert isinstance(pose, PathPose)
    return seen, pose


@pytest.mark.parametrize("name", ["offset_m", "heading_rad", "speed_mps"])
def test_a_reading_is_coarse_beyond_what_is_granted(name: str) -> None:
    seen, pose = known(look(seeing(), S))
    ends = {"offset_m": pose.offset, "heading_rad": pose.heading_error, "speed_mps": seen.speed}
    error = 0.5 * (ends[name][1] - ends[name][0])
    word = {"offset_m": "offset", "heading_rad": "heading error", "speed_mps": "speed"}[name]
    for granted, coarse in (
        (error, None),
        (
            math.nextafter(error, 0.0),
            f"{word} is known within {error:.3f}, the proof grants {error:g}",
        ),
    ):
        sight = look(seeing(reading=replace(SETTINGS.reading, **{name: granted})), S)
        found = None if coarse is None else Found(Fault.COARSE_READING, coarse, S)
        assert told(sight, Fault.COARSE_READING) == found


@pytest.mark.parametrize("path_bin", [0, 1, 22, BINS - 2, BINS - 1])
def test_the_law_reads_the_curvature_of_the_bin_that_the_car_is_in(path_bin: int) -> None:
    x_m = START_M + (path_bin + 0.5) * SPACING_M
    still = {"x_m": x_m, "y_m": 0.0, "heading_rad": 0.0, "heading_radius_rad": 0.001}
    sharp = {"x_radius_m": 0.02, "y_radius_m": 0.02, "speed_radius_mps": 0.02}
    sight = look(seeing(0.0, place=still | sharp), S)
    assert sight.reading is not None, sight.found
    assert sight.reading.curvature_per_m == (path_bin + 1) / 32768


@pytest.mark.parametrize(("station_m", "path_bin"), [(-10.2, 0), (30.2, BINS - 1)])
def test_beyond_its_ends_a_path_goes_on_as_it_ends(
    station_m: float, path_bin: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    beyond = PathPose((station_m - 0.1, station_m + 0.1), (-0.1, 0.1), (-0.1, 0.1))
    monkeypatch.setattr(PathTable, "project", lambda *_, **__: beyond)
    sight = look(seeing(), S)
    assert sight.reading is not None
    assert sight.reading.curvature_per_m == (path_bin + 1) / 32768


def law(watch_settings: OnboardSettings = SETTINGS) -> LawReading:
    return LawReading(middle(watch_settings.sensors.wheelbase_m), watch_settings.reading)


def read(before: LawReading, sight: Sight, elapsed_s: float, *, free: bool) -> LawReading:
    """What is read next, from what was seen."""
    seen, pose = known(sight)
    curvature = (math.floor((middle(pose.station) - START_M) / SPACING_M) + 1) / 32768
    return before.seen(seen, pose, curvature, elapsed_s=elapsed_s, free=free)


@pytest.mark.parametrize("speed_mps", [0.0, 1.0])
@pytest.mark.parametrize("standing", [DISARMED, TRACKING])
def test_only_a_car_that_stands_untracked_may_be_read_anew(
    speed_mps: float, standing: Standing
) -> None:
    sight = look(seeing(speed_mps), S, standing)
    free = speed_mps == 0.0 and standing is DISARMED
    assert sight.reading == read(law(), sight, 0.0, free=free).reading
    assert sight.reading is not None
    # 0.6 m beside the path is granted to be read as 0, but is no jump for a car that stands.
    assert (sight.reading.offset_m == 0.0) is not free


@pytest.mark.parametrize("later_us", [0, 10_000, 20_000])
def test_a_reading_goes_on_by_the_time_since_the_last(later_us: int) -> None:
    watch = seeing()
    first = look(watch, S, TRACKING)
    expected = read(law(), first, 0.0, free=False)
    second = look(watch, S + later_us, TRACKING)
    expected = read(expected, second, later_us / 1e6, free=False)
    assert second.reading == expected.reading
    third = look(watch, S + 30_000, TRACKING)
    expected = read(expected, third, (30_000 - later_us) / 1e6, free=False)
    assert third.reading == expected.reading
    # A clock that runs backwards moves nothing on.
    fourth = look(watch, S + 5_000, TRACKING)
    expected = read(expected, fourth, 0.0, free=False)
    assert fourth.reading == expected.reading
