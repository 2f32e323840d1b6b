"""Requests age exactly, every third turn decides, and what was sent is what the car is held to."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import pytest
from onboard_core_bench import bench, brakes, commands, driven, faults
from onboard_core_cases import SETTINGS, bundle, core

from workbench.runtime.onboard.core import Request, State
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.times import DECIDE_EVERY
from workbench.runtime.onboard.watching import Sight


@pytest.mark.parametrize(
    ("age_us", "armed"), [(0, True), (100_000, True), (100_001, False), (-1, False)]
)
def test_an_arm_is_carried_out_for_a_tenth_of_a_second(age_us: int, armed: bool) -> None:
    b = bench()
    b.run(12)
    b.core.request(Request.ARM, b.at_us - age_us)
    result = b.step()
    assert result.state is (State.ARMED if armed else State.DISARMED)
    if not armed:
        assert result.events == (f"not armed: asked {age_us} us ago; ask again",)


def test_a_disarm_is_never_too_old_and_nothing_overwrites_it() -> None:
    b = driven()
    b.core.request(Request.ARM, b.at_us)
    b.core.request(Request.DISARM, b.at_us - 10_000_000)
    b.core.request(Request.REARM, b.at_us)
    result = b.step()
    assert result.events[0] == "disarming, as asked"
    assert brakes(result)


def test_a_request_is_answered_once() -> None:
    b = bench()
    b.run(12)
    b.core.request(Request.REARM, b.at_us)
    assert b.step().events != ()
    assert b.step().events == ()


def test_every_third_turn_decides_and_a_fault_s_answer_goes_first() -> None:
    b = driven()
    while b.turns % DECIDE_EVERY:
        b.step()
    decided = [b.step().decision is not None for _ in range(2 * DECIDE_EVERY)]
    assert decided == [True, False, False] * 2
    b.core.bus_error(BusError.BUS_OFF, b.at_us - 1)
    first, second = b.step(), b.step()
    assert Fault.BUS_ERROR in faults(first)
    assert (first.state, first.decision, first.decided_us) == (State.FAULT, None, None)
    assert brakes(first)
    # The next turn makes up for it, and the one after is not due.
    assert second.decision is not None
    assert b.step().decision is None


def test_a_driver_s_hand_is_answered_before_the_turn_decides() -> None:
    b = driven()
    while b.turns % DECIDE_EVERY:
        b.step()
    b.changes["GLOBAL_RPT", "OVERRIDE_STATUS"] = 1
    first, second = b.step(), b.step()
    assert (first.state, first.decision) == (State.YIELDED, None)
    assert commands(first) == {"GLOBAL_CMD"}
    assert second.decision is not None


def test_a_braking_car_is_held_to_what_its_brake_must_do_from_the_measured_speed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    b = driven()
    b.core.bus_error(BusError.BUS_OFF, b.at_us - 1)
    look, seen = b.core._watch.look, []

    def looked(*args: Any) -> Sight:
        seen.append(look(*args))
        return seen[-1]

    monkeypatch.setattr(b.core._watch, "look", looked)
    result = b.step()
    assert brakes(result)
    observation, following = seen[-1].observation, b.core._watch.following
    assert observation is not None
    assert following.braking == (result.at_us, observation.speed[1])
    assert following.acceleration_mps2 == -bundle(0).manifest.brake.deceleration_min_mps2


def test_a_braking_car_whose_speed_is_unknown_may_be_as_fast_as_any(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    b = driven()
    b.core.bus_error(BusError.BUS_OFF, b.at_us - 1)
    look = b.core._watch.look

    def blind(*args: Any) -> Sight:
        return dataclasses.replace(look(*args), observation=None)

    monkeypatch.setattr(b.core._watch, "look", blind)
    result = b.step()
    assert brakes(result)
    assert b.core._watch.following.braking == (result.at_us, SETTINGS.limits.speed_mps[1])


def test_a_tracking_car_is_held_to_what_was_asked_of_its_pedals() -> None:
    b = driven()
    result = b.step()
    asked_mps2 = b.core._helm.acceleration_mps2
    assert (result.state, asked_mps2 != 0.0) == (State.TRACKING, True)
    following = b.core._watch.following
    assert (following.braking, following.acceleration_mps2) == (None, asked_mps2)


def test_no_time_has_passed_before_the_first_turn_or_by_a_clock_that_runs_backwards(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = core()
    passed: list[float] = []
    monkeypatch.setattr(made._helm, "elapse", passed.append)
    for at_us in (5_000_000, 5_033_333, 5_000_000, 5_000_000, 5_000_001):
        made.turn(at_us, itertools.repeat(at_us).__next__)
    assert passed == [0.0, 0.033333, 0.0, 0.0, 1e-6]


def test_what_broke_is_told_once() -> None:
    b = bench()
    b.run(12)
    with pytest.MonkeyPatch.context() as broken:
        broken.setattr(b.core._watch, "receive", None)
        b.core.receive(1, b"", b.at_us - 1)
    assert Fault.INTERNAL in faults(b.step())
    assert Fault.INTERNAL not in faults(b.step())
