"""A localiser in the loop of a simulated drive, from ranges alone, tells sets that hold the truth.

Where they end the monitor brakes, and a wrong sign anywhere in a range is seen.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
import random
import tomllib
from typing import Any

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from hypothesis import given
from hypothesis import strategies as st
from simulated_worlds import scenario

from workbench.errors import InputError
from workbench.runtime import Deciding, Observation
from workbench.runtime.localiser.folder import Built
from workbench.runtime.onboard.states import State
from workbench.runtime.protocols import Refusal, decode
from workbench.runtime.protocols.ranges import ranges_protocol, received_range
from workbench.simulation import range_beacons
from workbench.simulation.bus_drive import BusDrive, Recorded
from workbench.simulation.bus_world import BusSetting, BusWorld
from workbench.simulation.onboard_car import Sent
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.plants.make import PLANTS
from workbench.simulation.range_beacons import RANGED_US, Beacons, RangeErrors, true_range_m
from workbench.simulation.ranged_place import RangedPlace, Ranging, require_heard
from workbench.simulation.rig import Rig, Trial, outcome_on_bus
from workbench.simulation.run_up import AWAY_M, BEGUN_US, RunUp
from workbench.simulation.scenarios.scenario import Dropout, Sensing
from workbench.simulation.simulated import (
    build_localiser,
    build_rig,
    ranged_sensors,
    simulated_sensors,
)
from workbench.simulation.told_scores import ToldScores, holds

CROSSES = (14.0, -6.0, 0.0, 1.5, 3.0)
"""In the way of a car that nobody stops."""


@functools.cache
def rig() -> Rig:
    return build_rig(sensors=ranged_sensors())


@functools.cache
def built() -> Built:
    return build_localiser()


def errors(dropped: float = 0.3) -> RangeErrors:
    return RangeErrors.stated(built().numbers.site, dropped=dropped)


def driven(
    *walkers: tuple[float, ...], plant: str = "bicycle", seed: int = 1, duration_s: float = 6.0,
    sensing: Sensing | None = None,
) -> tuple[BusDrive, Trial]:  # fmt: skip
    trial = Trial(scenario(*walkers, duration_s=duration_s, sensing=sensing), plant, seed)
    setting = BusSetting(rig().settings.maker, ranging=Ranging(built(), errors()))
    kept = Recorded(pages=False)
    return rig().on_bus(trial, deciding=Deciding.BOTH, setting=setting, recorded=kept), trial


def seen_rightly(motion: Motion, seen: Observation) -> bool:
    """Whether what the monitor takes for possible holds the truth."""
    sides = (
        (motion.x_m, seen.x), (motion.y_m, seen.y), (motion.speed_mps, seen.speed),
        (motion.road_wheel_rad, seen.steering), (motion.heading, seen.heading),
    )  # fmt: skip
    return all(low <= value <= high for value, (low, high) in sides)


@pytest.mark.parametrize("plant", PLANTS)
def test_the_truth_lies_in_what_is_told_and_in_what_the_monitor_makes_of_it(plant: str) -> None:
    """Over the run-up, setting off, driving and braking, with three ranges in ten lost."""
    pytest.importorskip("vehiclemodels", reason="needs the extra commonroad")
    found, trial = driven(CROSSES, plant=plant, duration_s=9.0)
    assert len(found.told) > 120
    assert [told for told in found.told if not holds(told)] == []
    checked = [i for i in found.instants if i.observation is not None]
    assert len(checked) > 80
    assert all(seen_rightly(i.motion, i.observation) for i in checked if i.observation)
    assert max(i.motion.speed_mps for i in found.instants) > 1.5
    outcome = outcome_on_bus(found, trial.scenario)
    assert outcome.brakes
    assert outcome.contact is None
    # Not by saying little: half a metre would hold anything.
    scores = ToldScores.of(found.told)
    assert scores is not None
    assert scores.holding == 1.0
    assert scores.error_m.worst < scores.radius_m.worst < 0.25
    assert scores.heading_radius_rad.worst < 0.05


def run_up(seed: int) -> tuple[list[Sent], RangedPlace]:
    """All frames until the car has come to the path's beginning; no monitor is there yet."""
    scene = rig().scene(Trial(scenario(), "bicycle", seed), away_m=AWAY_M)
    world = BusWorld(scene, BusSetting(ranging=Ranging(built(), errors())), seed=seed)
    frames = list(world.until(BEGUN_US))
    assert world.ranged is not None
    return frames, world.ranged


def test_the_same_seed_gives_the_same_frames_and_another_one_others() -> None:
    one, again, other = (run_up(seed)[0] for seed in (3, 3, 4))
    assert one == again
    assert one != other


def test_the_heading_is_observed_only_once_the_car_has_driven() -> None:
    told = run_up(3)[1].told
    stands_until_s = 4.0 - BEGUN_US / 1e6
    assert stands_until_s + 0.5 < told[0].t_s < stands_until_s + 6.0
    assert all(map(holds, told))
    assert told[-1].place.heading_radius_rad < 0.5 * told[0].place.heading_radius_rad


@pytest.mark.parametrize(
    ("forward", "x"), [(-1.0, 1.0), (1.0, -1.0)], ids=["antenna behind", "x mirrored"]
)
def test_a_wrong_sign_in_a_range_is_seen(
    forward: float, x: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrong(site: Any, beacon: Any, motion: Motion) -> float:
        antenna = dataclasses.replace(site.antenna, forward_m=forward * site.antenna.forward_m)
        mirrored = dataclasses.replace(beacon, x_m=x * beacon.x_m)
        return true_range_m(dataclasses.replace(site, antenna=antenna), mirrored, motion)

    monkeypatch.setattr(range_beacons, "true_range_m", wrong)
    told = run_up(1)[1].told
    assert told
    assert not any(holds(each) for each in told)


def test_a_car_that_seems_to_drive_away_from_its_path_is_not_armed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def mirrored(site: Any, beacon: Any, motion: Motion) -> float:
        return true_range_m(site, dataclasses.replace(beacon, x_m=-beacon.x_m), motion)

    monkeypatch.setattr(range_beacons, "true_range_m", mirrored)
    found, _ = driven(duration_s=1.0)
    assert found.told
    assert all(i.state is State.DISARMED for i in found.instants)


def test_ranges_that_stop_brake_the_car_and_it_stays() -> None:
    """Two seconds after the last range the localiser is silent, then its last set is too old; to
    begin anew it would have to be driven by hand."""
    silent = Sensing(dropouts=(Dropout("localisation", 3.0, 5.5),))
    found, _ = driven(duration_s=9.0, sensing=silent)
    assert any(i.state is State.TRACKING for i in found.instants if 2.0 < i.t_s < 3.0)
    last_s = max(told.t_s for told in found.told)
    assert 4.0 < last_s <= 5.1
    faults = {name for i in found.instants if i.t_s >= 3.0 for name in i.faults}
    assert "LOCALISATION_LOST" in faults
    begun = next(i.t_s for i in found.instants if i.state is State.BRAKING and i.t_s > 3.0)
    assert begun < 6.0
    assert not any(i.state is State.TRACKING for i in found.instants if i.t_s > begun)
    assert found.instants[-1].motion.speed_mps == pytest.approx(0.0, abs=0.01)
    widths = [told.place.x_radius_m for told in found.told if told.t_s > 3.2]
    assert all(b >= a - 0.002 for a, b in itertools.pairwise(widths))
    assert widths[-1] > 1.2 * widths[0]


@pytest.mark.parametrize("seed", range(6))
def test_the_run_up_ends_at_standstill_where_the_path_begins(seed: int) -> None:
    """Whatever the actuators are."""
    scene = rig().scene(Trial(scenario(), "bicycle", seed), away_m=AWAY_M)
    driver = RunUp(scene.car, rig().settings.drive_by_wire)
    fastest_mps = 0.0
    for at_us in range(0, BEGUN_US, 5_000):
        driver.press(at_us)
        scene.car.advance(5_000)
        fastest_mps = max(fastest_mps, scene.car.motion.speed_mps)
        if at_us > BEGUN_US - 1_500_000:
            assert scene.car.motion.speed_mps < 0.01
    assert 1.2 < fastest_mps < 1.8
    assert abs(scene.place().station_m) < 0.3
    assert abs(scene.place().offset_m) < 0.1


poses = st.builds(
    Motion, *(st.floats(-40.0, 60.0),) * 2, st.floats(-10.0, 10.0),
    *(st.just(0.0),) * 5,
)  # fmt: skip


@given(poses, st.integers(0, 1000))
def test_a_range_without_an_error_is_the_distance_of_antenna_and_beacon(
    motion: Motion, seed: int
) -> None:
    site, exact = built().numbers.site, RangeErrors(0.0, 0.0, 0.0, 0.0)
    beacons = Beacons(site, exact, random.Random(seed), period_us=RANGED_US)
    sent = [each for k in range(1, 68) for each in beacons.due(motion, 10_000 * k, silent=False)]
    assert 16 <= len(sent) <= 33
    assert [at for at, _ in sent] == sorted(at for at, _ in sent)
    for at_us, (identifier, data) in sent:
        frame = decode(ranges_protocol(), identifier, data)
        assert not isinstance(frame, Refusal)
        found = received_range(frame)
        beacon, antenna = site.beacons[found.beacon], site.antenna
        # In the car's own axes, the other way round than in the code.
        dx, dy = beacon.x_m - motion.x_m, beacon.y_m - motion.y_m
        c, s = math.cos(motion.heading), math.sin(motion.heading)
        ahead, left = c * dx + s * dy - antenna.forward_m, c * dy - s * dx - antenna.left_m
        expected = math.hypot(ahead, left, beacon.height_m - antenna.height_m)
        assert found.range_m == pytest.approx(expected, abs=0.001)
        assert at_us <= 10_000 * 68


def ranges(given: RangeErrors, seed: int, *, silent_until: int = 0) -> dict[int, float]:
    """Ranges of a minute by the number of their step."""
    motion = Motion(20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    beacons = Beacons(built().numbers.site, given, random.Random(seed), period_us=RANGED_US)
    found = {}
    for k in range(3000):
        silent = k < silent_until
        for _, (identifier, data) in beacons.due(motion, 20_000 * k, silent=silent):
            frame = decode(ranges_protocol(), identifier, data)
            assert not isinstance(frame, Refusal)
            sent = received_range(frame)
            beacon = built().numbers.site.beacons[sent.beacon]
            assert sent.range_m is not None
            found[k] = sent.range_m - true_range_m(built().numbers.site, beacon, motion)
    return found


def test_ranges_err_stray_and_are_lost_as_stated() -> None:
    stated = RangeErrors(0.2, 0.1, 1.0, 0.3)
    found = list(ranges(stated, 5).values())
    assert len(found) == pytest.approx(16 * 180 * 0.7, rel=0.05)
    ordered = sorted(found)
    assert ordered[len(found) // 2] == pytest.approx(0.03, abs=0.03)
    assert ordered[len(found) // 10] == pytest.approx(-0.25, abs=0.05)
    assert sum(error > 1.0 for error in found) / len(found) == pytest.approx(0.037, abs=0.015)
    assert min(found) > -1.0


def test_a_silence_changes_no_range_after_it() -> None:
    whole = ranges(RangeErrors(0.2, 0.1, 1.0, 0.3), 6)
    cut = ranges(RangeErrors(0.2, 0.1, 1.0, 0.3), 6, silent_until=1000)
    assert cut == {k: error for k, error in whole.items() if k >= 1000}


@pytest.mark.parametrize(
    "wrong", [(math.nan, 0.0, 1.0, 0.0), (0.2, 1.0, 1.0, 0.0), (0.2, 0.0, -1.0, 0.0),
              (0.2, 0.0, 1.0, 1.0)],
)  # fmt: skip
def test_errors_that_make_no_sense_are_refused(wrong: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="expected a"):
        RangeErrors(*wrong)


def test_a_bundle_that_does_not_allow_for_the_delay_is_refused() -> None:
    ranging, settings = Ranging(built(), errors()), rig().settings
    require_heard(ranging, settings)
    sensors = settings.sensors
    for least_us, most_us in ((48_000, 100_000), (1_000, 88_000)):
        stamps = dataclasses.replace(sensors.stamps, delay_us=(least_us, most_us))
        less = dataclasses.replace(settings, sensors=dataclasses.replace(sensors, stamps=stamps))
        with pytest.raises(InputError, match="delay_us"):
            require_heard(ranging, less)


def test_the_sensors_file_differs_from_the_other_one_by_the_delay_alone() -> None:
    one, other = (tomllib.loads(text) for text in (simulated_sensors(), ranged_sensors()))
    assert one["clocks"].pop("delay_us") != other["clocks"].pop("delay_us")
    assert one == other


def test_a_car_that_is_taken_to_stand_creeps_no_faster_than_its_sets_say() -> None:
    """A report counts 0.01 m/s, and the last one before the next is a thirtieth of a second old."""
    numbers = built().numbers
    said_mps = numbers.deviations(numbers.level) * numbers.site.motion.standing_mps
    assert said_mps > numbers.site.reports.standing_mps + 0.005 + 0.3 / 30.0
