"""Replayed, late, invented and broken frames, floods, and numbers gone wrong end in silence."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localisation_cases import hall
from localiser_cases import (
    CLOCKS,
    OWN,
    Road,
    core,
    drives,
    steps,
)
from onboard_world_plant import PACMOD2, framed

from workbench.runtime.localiser.car import Car
from workbench.runtime.localiser.core import Silence
from workbench.runtime.localiser.range_stream import RangeFault
from workbench.runtime.localiser.sets import initial_set, possible_set
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.loop import LONGEST_WAIT_US
from workbench.runtime.onboard.states import Request
from workbench.runtime.protocols import Refusal, decode
from workbench.runtime.protocols.ranges import SentRange, range_frame

CARS = 8
SETTLED_US = CLOCKS.range_delay_us[1] + LONGEST_WAIT_US


def test_replayed_ranges_are_refused_counted_and_change_nothing() -> None:
    kept: list[tuple[int, SentRange]] = []

    def replay(now_us: int, sent: SentRange) -> Sequence[tuple[int, SentRange]]:
        """Every range of 1 s before comes once more, right after the new one."""
        kept.append((now_us, sent))
        old = [each for then, each in kept if then == now_us - 1_000_000]
        return [(0, sent), *((100, each) for each in old if each.beacon == sent.beacon)]

    replayed = Road(core(), drives(CARS, 41), 0, bend=replay).run(30.0)
    counts = replayed.core.ranges.counts
    there = [each for then, each in kept if each.range_m is not None and then < 29e6]
    assert 0.6 * len(there) < counts[RangeFault.REGRESSED] <= len(there)
    plain = Road(core(), drives(CARS, 41), 0).run(30.0)
    assert [found for _, found in replayed.heard] == [found for _, found in plain.heard]


@pytest.mark.parametrize(
    ("change", "faults"),
    [
        (lambda sent, old: old, {RangeFault.REGRESSED, RangeFault.REPEATED}),
        # With counters as they ought to be, and stamps that are old.
        (lambda sent, old: SentRange(sent.number, old.beacon, old.range_m, old.stamp),
         {RangeFault.REGRESSED, RangeFault.LATE}),
        # And with stamps that go on, 0.3 s late.
        (lambda sent, old: SentRange(sent.number, old.beacon, old.range_m, sent.stamp - 3000),
         {RangeFault.REGRESSED, RangeFault.LATE}),
        (lambda sent, old: SentRange(sent.number, old.beacon, old.range_m,
                                     (sent.stamp + 600_000) % 2**24), {RangeFault.JUMPED}),
    ],
    ids=["as they were", "new counters", "late by 0.3 s", "a minute ahead"],
)  # fmt: skip
def test_old_ranges_instead_of_new_ones_end_in_silence(change: object, faults: set[object]) -> None:
    assert callable(change)
    kept: list[SentRange] = []

    def instead(now_us: int, sent: SentRange) -> Sequence[tuple[int, SentRange]]:
        if sent.range_m is not None:
            kept.append(sent)
        if now_us < 15e6 or sent.range_m is None:
            return [(0, sent)]
        changed = change(sent, kept[len(kept) // 2])
        return [(0, SentRange(changed.number, changed.beacon, changed.range_m,
                              changed.stamp % 2**24))]  # fmt: skip

    road = Road(core(), drives(1, 45), 0, bend=instead).run(20.0)
    assert road.heard[-1][0] <= 15e6 + hall().limits.range_age_s * 1e6
    found = {fault for fault, count in road.core.ranges.counts.items() if count}
    assert found - {RangeFault.NO_RANGE} <= faults
    assert found & faults


@given(delays=st.lists(st.integers(0, SETTLED_US + 500), min_size=2, max_size=12))
def test_no_used_range_is_about_an_instant_that_was_settled(delays: list[int]) -> None:
    """However late they come: what is taken at a turn is never older than what was taken before."""
    mine, at_us = core(), 0
    for number, late_us in enumerate(delays):
        at_us = max(at_us + 1, 100 * 1_000 * (number + 1) + late_us)
        mine.turn(at_us, lambda: 0)
        sent = range_frame(SentRange(number, 1, 8.0, 1_000 * (number + 1)))
        assert not isinstance(sent, Refusal)
        mine.receive(*sent, at_us)
        assert all(message.at_us >= at_us - SETTLED_US for message in mine._waiting)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_no_frame_makes_it_raise_or_send_what_is_no_set(data: st.DataObject) -> None:
    """Well-formed frames with any values, and frames of any bytes, in any order of instants."""
    mine, at_us = core(), 0
    speed, steering = (PACMOD2.by_name[n].frame_id for n in ("VEHICLE_SPEED_RPT", "STEERING_RPT_1"))
    for number in range(data.draw(st.integers(1, 60))):
        at_us += data.draw(st.integers(-1_000, 400_000))
        kind = data.draw(st.integers(0, 4))
        if kind == 0:
            beacon, stamp = data.draw(st.integers(0, 63)), data.draw(st.integers(0, 2**24 - 1))
            sent = SentRange(number, beacon, data.draw(st.floats(0.0, 131.0)), stamp)
            frame = range_frame(sent)
            assert not isinstance(frame, Refusal)
            mine.receive(*frame, at_us)
        elif kind == 1:
            identifier = data.draw(st.sampled_from([speed, steering, 0x6B8, 0x6C0]))
            mine.receive(identifier, data.draw(st.binary(max_size=8)), at_us)
        elif kind == 2:
            value = data.draw(st.floats(-327.0, 327.0))
            mine.receive(speed, framed("VEHICLE_SPEED_RPT", {
                "VEHICLE_SPEED": value, "VEHICLE_SPEED_VALID": 1}), at_us)  # fmt: skip
        elif kind == 3:
            said = dict.fromkeys(("MANUAL_INPUT", "COMMANDED_VALUE"), 0.0)
            value = data.draw(st.floats(-32.0, 32.0))
            said["OUTPUT_VALUE"] = value
            mine.receive(steering, framed("STEERING_RPT_1", said), at_us)
        else:
            for made in mine.turn(max(at_us, 0), lambda: 0).frames:
                found = decode(OWN, made.identifier, made.data)
                assert not isinstance(found, Refusal) or found.signal == "HEADING_OBSERVED"


def test_numbers_that_are_not_finite_are_silence_and_a_new_beginning() -> None:
    for place, wrong in ((0, math.nan), (1, math.inf)):
        road = Road(core(), drives(1, 45), 0).run(12.0)
        car = road.core.car
        assert car is not None
        assert car.aligned
        (car.mean, car.covariance)[place][0] = wrong
        heard = len(road.heard)
        road.run(12.3)
        assert len(road.heard) == heard
        assert road.core.tally.begun == {Silence.NOT_FINITE: 1}


@pytest.mark.parametrize("variance", [-1e-300, math.nan, math.inf])
def test_a_variance_that_cannot_be_makes_no_set(variance: float) -> None:
    car = Car(hall(), steps(), at_s=0.0)
    assert initial_set(car, now_s=0.0, level=0.9, deviations=3.0) is not None
    car.covariance[8] = variance
    assert initial_set(car, now_s=0.0, level=0.9, deviations=3.0) is None
    car.aligned = True
    assert possible_set(car, now_s=0.0, level=0.9, deviations=3.0) is None


def test_one_hypothesis_that_is_not_finite_makes_no_set() -> None:
    car = Road(core(), drives(1, 45), 0).run(4.9).core.car
    assert car is not None
    assert car.logs
    assert possible_set(car, now_s=5.0, level=0.9, deviations=3.0) is not None
    car.each_mean[7 * 5] = math.nan
    assert possible_set(car, now_s=5.0, level=0.9, deviations=3.0) is None


def test_a_set_that_its_frames_cannot_hold_is_not_sent() -> None:
    road = Road(core(), drives(1, 45), 0).run(12.0)
    car = road.core.car
    assert car is not None
    car.mean[0] = 9e3
    heard = len(road.heard)
    for _ in range(3):
        road.loop.once()
    assert len(road.heard) == heard
    assert road.core.said is Silence.UNSENDABLE


def test_a_flood_is_counted_and_held_in_bounds() -> None:
    mine = core()
    speed = PACMOD2.by_name["VEHICLE_SPEED_RPT"].frame_id
    data = framed("VEHICLE_SPEED_RPT", {"VEHICLE_SPEED": 1.0, "VEHICLE_SPEED_VALID": 1})
    for k in range(1000):
        mine.receive(speed, data, 1000 * k)
    assert (mine.tally.reports, mine.tally.early) == (100, 900)
    for k in range(1000):
        mine.receive(speed, data, 1_000_000 + 10_000 * k)
    assert mine.tally.dropped == 1000 + 100 - 512
    mine.receive(speed, data, 0)
    assert mine.tally.backwards == 1
    mine.bus_error(BusError.ERROR_FRAME, 0)
    mine.request(Request.DISARM, 0)
    assert mine.tally.bus_errors == 1


def test_a_steering_wheel_beyond_its_map_is_refused() -> None:
    mine = core()
    said = {"MANUAL_INPUT": 0.0, "COMMANDED_VALUE": 0.0, "OUTPUT_VALUE": 30.0}
    mine.receive(PACMOD2.by_name["STEERING_RPT_1"].frame_id, framed("STEERING_RPT_1", said), 5)
    assert (mine.tally.refused_reports, mine.tally.reports) == (1, 0)
