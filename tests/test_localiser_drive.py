"""Ranges and reports on a bus become sets that hold the car, or silence: the whole localiser runs.

Virtual time, the monitor's own loop, a generated hall with 30 % of ranges dropped and 10 % stray.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Sequence

import numpy as np
import pytest
from can_cases import plain_values
from localisation_cases import hall
from localiser_cases import (
    CLOCKS,
    OWN,
    Bend,
    Road,
    core,
    drives,
    files,
    holds,
    spec,
    steps,
    truth_at,
)
from onboard_world_plant import PACMOD2, framed
from scipy import stats

from workbench.estimation.localisation_world import Leg
from workbench.runtime.localiser.car import Status
from workbench.runtime.localiser.core import REPORT_AGE_US, LocaliserCore, Silence
from workbench.runtime.localiser.numbers import NUMBERS_FILE, numbers_from_json
from workbench.runtime.localiser.sets import initial_set, possible_set
from workbench.runtime.localiser.states import HYPOTHESES
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.loop import LONGEST_WAIT_US
from workbench.runtime.onboard.readings import localised_pose
from workbench.runtime.onboard.report_names import REPORT_NAMES
from workbench.runtime.onboard.times import TURN_US
from workbench.runtime.protocols import NoSet, encode, load_protocol
from workbench.runtime.protocols.ranges import SentRange

CARS = 8
SETTLED_US = CLOCKS.range_delay_us[1] + LONGEST_WAIT_US


@functools.cache
def usual(car: int = 0, level: float = 0.99) -> Road:
    return Road(core(level), drives(CARS, 41), car).run(30.0)


def test_sets_hold_the_truth_at_the_share_of_their_level() -> None:
    """Five instants a car, far enough apart to be nearly independent."""
    drive = drives(CARS, 41)
    for level in (0.9, 0.999):
        inside = []
        for car in range(CARS):
            heard = usual(car, level).heard
            for at_s in (9.0, 14.0, 19.0, 23.5, 29.0):
                found = min((each for _, each in heard), key=lambda f: abs(f.stamp_s - at_s))
                assert abs(found.stamp_s - at_s) < 0.1
                inside.append(holds(found, truth_at(drive, car, found.stamp_s)))
        assert stats.binom.cdf(sum(inside), len(inside), level) > 1e-3, (level, np.mean(inside))


def test_a_set_in_another_place_does_not_hold_the_truth() -> None:
    drive, heard = drives(CARS, 41), usual(0).heard
    beside = [truth_at(drive, 0, found.stamp_s) for _, found in heard]
    for state in beside:
        state[0] += 0.5
    assert not any(holds(found, state) for (_, found), state in zip(heard, beside, strict=True))


def test_sets_come_at_the_rate_and_tell_their_instant() -> None:
    road = usual(0)
    sent = sorted([*(at_us for at_us, _ in road.heard), *road.unobserved])
    gaps = [b - a for a, b in itertools.pairwise(sent)]
    assert max(gaps) <= 100_000 + TURN_US // 2
    assert min(gaps) >= 100_000 - TURN_US
    for at_us, found in road.heard:
        assert SETTLED_US <= at_us - found.stamp_s * 1e6 + 100 <= SETTLED_US + 5_000
    # The last one may still be on the bus.
    assert len(road.heard) <= road.core.tally.sets <= len(road.heard) + 1
    assert road.sets.frames.lost == len(road.unobserved) == road.core.tally.unobserved
    stamps = [data for _, identifier, data in road.port.handed if identifier == 0x6C0]
    assert [data[0] for data in stamps] == [k % 256 for k in range(len(stamps))]
    assert len(stamps) > 256


def test_the_heading_is_not_observed_before_the_car_has_driven() -> None:
    road = usual(0)
    moves_us = 5.0e6
    assert len(road.unobserved) > 25
    assert min(road.unobserved) < moves_us < max(road.unobserved) < road.heard[0][0]
    said = [event.partition(":")[0] for turn in road.notes.turns for event in turn.events]
    assert said == ["UNPLACED", "HEADING_INVALID", "VALID"]


def test_a_car_that_never_drives_sends_no_set_with_a_heading() -> None:
    still = (Leg(12.0, 0.0, 0.0),)
    road = Road(core(), drives(1, 43, still), 0).run(12.0)
    assert road.heard == []
    assert len(road.unobserved) > 60
    assert road.core.said is Status.HEADING_INVALID


def test_what_is_possible_before_the_heading_is_known_holds_every_heading() -> None:
    """Also once it is: then place and speed are the estimate's own, and the heading any."""
    drive = drives(1, 43, (Leg(12.0, 0.0, 0.0),))
    car = Road(core(), drive, 0).run(8.0).core.car
    assert car is not None
    found = possible_set(car, now_s=8.0, level=0.99, deviations=3.9)
    assert found is not None
    assert found.heading == (-math.pi, math.pi)
    x, y, _, speed = truth_at(drive, 0, 8.0)
    assert found.x[0] < x < found.x[1]
    assert found.y[0] < y < found.y[1]
    assert found.speed[0] < speed < found.speed[1]
    for k in range(HYPOTHESES):
        assert found.x[0] < car.each_mean[7 * k] < found.x[1]
        assert found.y[0] < car.each_mean[7 * k + 1] < found.y[1]
    # Not wider than the lever on either side, and what is unsure anyway.
    assert 1.8 < found.x[1] - found.x[0] < 3.5
    driven = usual(0).core.car
    assert driven is not None
    known, any_heading = (
        each(driven, now_s=40.0, level=0.99, deviations=3.9) for each in (initial_set, possible_set)
    )
    assert known is not None
    assert any_heading == dataclasses.replace(known, heading=(-math.pi, math.pi))


def test_the_monitor_takes_the_sets_and_refuses_those_without_a_heading() -> None:
    road, seen = usual(0), Intake(PACMOD2, OWN, stamps=CLOCKS.stamps(LONGEST_WAIT_US))
    first_us = road.heard[0][0]
    for at_us, identifier, data in road.port.handed:
        seen.receive(identifier, data, at_us + 300)
        assert isinstance(seen.localisation, NoSet) is (at_us + 300 < first_us)
    found = seen.localisation
    assert not isinstance(found, NoSet)
    pose, truth = localised_pose(found.value), truth_at(road.drive, 0, found.value.stamp_s)
    assert pose.x[0] <= truth[0] <= pose.x[1]
    assert seen.localisation_counts.whole == road.core.tally.sets
    assert seen.localisation_counts.strikes.against == {}


def test_radii_grow_while_a_car_stands() -> None:
    """The heading's, for nothing shows it then; those of the place stay above their floor."""
    legs = (*((Leg(5.0, 0.0, 0.0), Leg(12.0, 2.0, 0.1))), Leg(32.0, 0.0, 0.1))
    heard = Road(core(), drives(1, 44, legs), 0).run(32.0).heard
    standing = [found for _, found in heard if found.stamp_s > 17.0]
    assert len(standing) > 100
    radii = [found.heading_radius_rad for found in standing]
    # To the frames' rounding.
    assert all(b >= a - 1.01e-4 for a, b in itertools.pairwise(radii))
    assert radii[-1] > radii[0]
    assert min(found.x_radius_m for found in standing) > 2 * hall().limits.still_m


def without_ranges(from_us: int) -> Bend:
    return lambda now_us, sent: [] if now_us >= from_us else [(0, sent)]


@pytest.mark.parametrize("from_s", [15.0, 22.0], ids=["moving", "standing"])
def test_silent_beacons_are_silence_within_the_stated_time(from_s: float) -> None:
    road = Road(core(), drives(1, 45), 0, bend=without_ranges(round(from_s * 1e6))).run(30.0)
    last_us, age_us = road.heard[-1][0], hall().limits.range_age_s * 1e6
    assert from_s * 1e6 + 0.5 * age_us < last_us <= from_s * 1e6 + age_us
    assert road.core.tally.begun == {Silence.LOST: 1}


def test_who_was_lost_is_found_again_after_standing_and_driving() -> None:
    def gap(now_us: int, sent: SentRange) -> Sequence[tuple[int, SentRange]]:
        return [] if 12e6 <= now_us < 16e6 else [(0, sent)]

    drive = drives(1, 46)
    road = Road(core(), drive, 0, bend=gap).run(30.0)
    pauses = [(a, b) for (a, _), (b, _) in itertools.pairwise(road.heard) if b - a > 1_000_000]
    assert len(pauses) == 1
    assert pauses[0][0] < 14.1e6
    assert pauses[0][1] > 24e6, "no heading before it drives again"
    assert all(
        holds(found, truth_at(drive, 0, found.stamp_s)) for at, found in road.heard if at > 26e6
    )


BOTH = ("VEHICLE_SPEED_RPT", "STEERING_RPT_1")


@pytest.mark.parametrize("mute", [BOTH, BOTH[:1], BOTH[1:]])
def test_reports_that_stop_are_silence_and_a_new_beginning(mute: tuple[str, ...]) -> None:
    road = Road(core(), drives(1, 45), 0, silent=(15.0, 15.3), mute=mute).run(17.0)
    last_us = road.heard[-1][0]
    assert 15e6 <= last_us <= 15e6 + REPORT_AGE_US + SETTLED_US + TURN_US
    assert road.core.tally.begun == {Silence.UNREPORTED: 1}
    assert road.core.said is Silence.UNPLACED


def test_reports_are_corrected_by_what_commissioning_found() -> None:
    """Of a car whose scale and zero are off: uncorrected, the filter finds them itself."""
    drive, off = drives(1, 47), (0.05, 0.02)
    biased = dataclasses.replace(
        drive, speed_mps=drive.speed_mps * (1 + off[0]), steering_rad=drive.steering_rad + off[1]
    )
    vehicle = dataclasses.replace(spec().vehicle, speed_scale=off[0], steering_zero_rad=off[1])
    said = numbers_from_json(files()[NUMBERS_FILE])
    for numbers, left in ((dataclasses.replace(said, vehicle=vehicle), (0.0, 0.0)), (said, off)):
        mine = LocaliserCore(numbers, steps(), level=0.99, period_us=100_000)
        Road(mine, biased, 0).run(16.0)
        assert mine.car is not None
        found = mine.car.mean[5] - drive.truth[0, 0, 5], mine.car.mean[6] - drive.truth[0, 0, 6]
        assert found[0] == pytest.approx(left[0], abs=0.02)
        assert found[1] == pytest.approx(left[1], abs=0.006)


@pytest.mark.parametrize("name", REPORT_NAMES)
def test_every_vehicle_s_reports_are_understood(name: str) -> None:
    said = numbers_from_json(files()[NUMBERS_FILE])
    numbers = dataclasses.replace(said, vehicle=dataclasses.replace(said.vehicle, protocol=name))
    mine = LocaliserCore(numbers, steps(), level=0.99, period_us=100_000)
    protocol, names = load_protocol(name), REPORT_NAMES[name]
    for place, value in ((names.speed, 2.5), (names.steering.output, 1.0)):
        message = protocol.by_name[place.message]
        data = encode(protocol, message.name, plain_values(message, {place.signal: value}))
        assert isinstance(data, bytes)
        mine.receive(message.frame_id, data, 1_000_000)
    assert (mine.tally.reports, mine.tally.refused_reports) == (2, 0)
    assert sorted(message.value for message in mine._waiting) == pytest.approx(
        sorted((2.5, said.vehicle.road_wheel.middle(1.0)))
    )


def test_reports_are_about_the_instant_before_their_delay() -> None:
    said = numbers_from_json(files()[NUMBERS_FILE])
    clocks = dataclasses.replace(said.clocks, report_delay_us=200_000)
    for numbers, stamp_s in ((said, 1.0), (dataclasses.replace(said, clocks=clocks), 0.8)):
        mine = LocaliserCore(numbers, steps(), level=0.99, period_us=100_000)
        data = framed("VEHICLE_SPEED_RPT", {"VEHICLE_SPEED": 1.0, "VEHICLE_SPEED_VALID": 1})
        mine.receive(PACMOD2.by_name["VEHICLE_SPEED_RPT"].frame_id, data, 1_000_000)
        settled_us = round(stamp_s * 1e6) + max(SETTLED_US, numbers.clocks.report_delay_us)
        mine.turn(settled_us - 1, lambda: 0)
        assert mine.car is None
        mine.turn(settled_us, lambda: 0)
        assert mine.car is not None
        assert mine.car.stamp_s == stamp_s
