"""The core arms only when all is well, drives, yields, and repeats itself to the last bit."""

from __future__ import annotations

import random

import pytest
from onboard_core_bench import (
    Bench,
    answer,
    bench,
    brakes,
    commander,
    commands,
    driven,
    faults,
    framed,
    identifier,
    person,
    refusal,
    said,
)
from onboard_core_cases import DRIVE_BY_WIRE, core
from runtime_world import arc_table

from workbench.claims import Verdict
from workbench.runtime import Action
from workbench.runtime.onboard.core import Core, Mode, Request, State, TurnResult
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.recorder_entries import digest, turn_record
from workbench.runtime.onboard.times import DECIDE_EVERY, SEND_US, TURN_US


def test_in_shadow_everything_is_decided_and_no_command_is_made() -> None:
    b = bench(Mode.SHADOW)
    decided = []
    for k in range(30):
        result = b.step(lambda b, at_us: b.receive(*framed("ACCEL_CMD", {"ACCEL_CMD": 0.4}), at_us))
        assert commands(result) == set()
        assert (result.state, said(result)["HEARTBEAT"]["MODE"]) == (State.DISARMED, Mode.SHADOW)
        # Somebody else drives this car: their commands are no intrusion.
        assert Fault.SPOOFED not in faults(result)
        decided += [k] if result.decision is not None else []
    # From the first turn on which sets have come, every third.
    assert decided == list(range(9, 30, DECIDE_EVERY))
    assert "in mode shadow" in refusal(b)
    result = b.step(lambda b, at_us: b.receive(identifier("DECISION"), bytes(8), at_us))
    assert Fault.SPOOFED in faults(result)


def test_shadow_needs_no_vehicle_that_can_be_commanded() -> None:
    from dataclasses import replace

    three = replace(DRIVE_BY_WIRE, protocol="pacmod3")
    result = core(Mode.SHADOW, drive_by_wire=three).turn(0, lambda: 0)
    assert result.state is State.DISARMED


def test_heartbeats_count_and_decisions_name_people() -> None:
    b = driven()
    before = said(b.step())["HEARTBEAT"]
    b.people = [person(7, b.x_m + 3.5, 0.0), person(9, 40.0, 30.0)]
    after = before
    for _ in range(9):
        result = b.step()
        counter, after = after["COUNTER"], said(result)["HEARTBEAT"]
        assert after["COUNTER"] == (counter + 1) % 256
        assert after["BUNDLE_TAG"] == 0xA5
        assert after["STAMP"] == pytest.approx(result.at_us / 1e6, abs=1e-4)
    heard = said(_until_decided(b))
    assert heard["DECISION"]["ACTION"] == 1
    assert heard["DECISION"]["VERDICT"] == 2
    assert heard["DECISION"]["ALERT"] == 2
    assert (heard["ALERT"]["TRACK"], heard["ALERT"]["COUNT"]) == (7, 1)
    assert heard["ALERT"]["PEOPLE_SET"] == heard["DECISION"]["PEOPLE_SET"]


def _until_decided(b: Bench) -> TurnResult:
    for _ in range(DECIDE_EVERY + 1):
        result = b.step()
        if result.decision is not None:
            return result
    raise AssertionError("no decision")


def test_where_nothing_can_be_judged_everybody_is_warned() -> None:
    b = driven()
    b.silent.add("PEOPLE")
    results = [b.step() for _ in range(40)]
    last = next(r for r in reversed(results) if "DECISION" in said(r))
    assert last.decision is None
    assert said(last)["DECISION"]["VERDICT"] == 1
    assert (said(last)["DECISION"]["ACTION"], said(last)["DECISION"]["ALERT"]) == (1, 3)


def test_a_person_ahead_brakes_and_the_car_goes_on_when_they_are_gone() -> None:
    b = driven()
    b.people = [person(7, b.x_m + 5.0, 0.0)]
    result = b.until(State.BRAKING)
    assert brakes(result)
    assert result.faults == ()
    b.run(40)
    assert b.speed_mps == 0.0
    b.people = []
    assert b.until(State.TRACKING).decision is not None


def test_a_fault_that_brakes_holds_until_it_is_over_and_the_car_stands() -> None:
    b = driven()
    b.silent.add("SHIFT_RPT")
    b.until(State.BRAKING)
    b.silent.clear()
    released = 0
    while b.step().state is State.BRAKING:
        released += 1
        assert released < 90
    assert b.speed_mps < 0.05
    assert (released + 1) * TURN_US >= 1_000_000


def test_the_driver_gets_the_car_and_rearm_gives_it_back() -> None:
    b = driven()
    b.changes["GLOBAL_RPT", "OVERRIDE_STATUS"] = 1
    result = b.until(State.YIELDED)
    assert said(result)["GLOBAL_CMD"]["PACMOD_ENABLE"] == 0
    for _ in range(20):
        result = b.step()
        assert commands(result) == set()
        assert result.state is State.YIELDED
    assert "does not stand" in refusal(b, Request.REARM)
    while b.speed_mps > 0.0:
        b.speed_mps = max(b.speed_mps - 0.05, 0.0)
        b.step()
    b.run(12)
    b.request(Request.REARM)
    result = b.step()
    assert said(result)["GLOBAL_CMD"]["CLEAR_OVERRIDE"] == 1
    # The vehicle keeps the bit until it has been cleared.
    b.changes.clear()
    b.until(State.TRACKING)


def test_a_latched_fault_needs_disarm_then_arm() -> None:
    b = driven()
    b.core.bus_error(BusError.BUS_OFF, b.at_us - 1)
    assert b.step().state is State.FAULT
    assert "it is FAULT" in answer(b, Request.REARM)
    b.run(60)
    assert (b.step().state, b.speed_mps) == (State.FAULT, 0.0)
    b.request(Request.DISARM)
    result = b.step()
    assert result.state is State.DISARMED
    assert said(result)["GLOBAL_CMD"]["PACMOD_ENABLE"] == 0
    assert commands(b.step()) == set()
    b.request(Request.ARM)
    b.until(State.TRACKING)


def test_disarming_brakes_to_standstill_first() -> None:
    b = driven()
    b.request(Request.DISARM)
    result = b.step()
    assert (result.state, brakes(result)) == (State.BRAKING, True)
    b.until(State.DISARMED)
    assert b.speed_mps <= 0.05


@pytest.mark.parametrize("takes_us", [51_000, 1_000_000])
def test_a_decision_that_is_late_is_an_overrun_and_does_not_track_on(takes_us: int) -> None:
    b = driven()
    b.takes_us = takes_us
    result = _until_decided(b)
    assert Fault.OVERRUN in faults(result)
    assert result.decision is not None
    assert result.decision.verdict is Verdict.INVALID
    assert result.decision.action is Action.BRAKE
    assert (result.state, brakes(result)) == (State.BRAKING, True)


LEFT_US = 58_000 - TURN_US - SEND_US
"""Of turn_s: what a turn and the sending of its frames leave for the decision."""


@pytest.mark.parametrize(("takes_us", "covered"), [(LEFT_US, True), (LEFT_US + 100, False)])
def test_a_decision_that_makes_commands_late_brakes_and_does_not_latch(
    takes_us: int, covered: bool
) -> None:
    b = driven()
    b.takes_us = takes_us
    result = _until_decided(b)
    assert (Fault.NOT_COVERED in faults(result)) is not covered
    assert result.state is (State.TRACKING if covered else State.BRAKING)
    assert brakes(result) is not covered


def test_a_clock_that_raises_or_runs_backwards_brakes() -> None:
    b = driven()
    while b.turns % DECIDE_EVERY:
        b.step()

    def broken() -> int:
        raise OSError("no clock")

    result = b.core.turn(b.at_us, broken)
    assert (result.state, brakes(result)) == (State.FAULT, True)
    b = driven()
    b.takes_us = -1_000_000
    result = _until_decided(b)
    assert (result.state, brakes(result)) == (State.BRAKING, True)
    b = driven()
    result = b.core.turn(0, lambda: 0)
    assert Fault.CLOCK_BACKWARDS in faults(result)
    assert (result.state, brakes(result)) == (State.FAULT, True)


def bits(result: TurnResult) -> tuple[object, ...]:
    return result.frames, digest(turn_record(result))


def replayed(other: Core, log: list[tuple[object, ...]]) -> list[tuple[object, ...]]:
    """What another core makes of the calls that were recorded."""
    found = []
    for kind, *values in log:
        if kind == "receive":
            other.receive(*values)  # type: ignore[arg-type]
        elif kind == "request":
            other.request(*values)  # type: ignore[arg-type]
        else:
            at_us, ended_us = values
            found.append(bits(other.turn(at_us, lambda ended_us=ended_us: ended_us)))  # type: ignore[arg-type,misc]
    return found


def test_the_same_calls_give_the_same_bits() -> None:
    b = bench()
    b.dice = random.Random(9)
    results = []
    for k in range(90):
        if k == 12:
            b.request(Request.ARM)
        if k == 60:
            b.people = [person(7, b.x_m + 6.0, 0.0)]
        if k == 80:
            b.silent.add("VEHICLE_SPEED_RPT")
        results.append(bits(b.step()))
    assert replayed(core(), b.log) == results
    speed = identifier("VEHICLE_SPEED_RPT")
    last = max(k for k, call in enumerate(b.log) if call[:2] == ("receive", speed))
    assert replayed(core(), b.log[:last] + b.log[last + 1 :]) != results


def test_without_a_path_the_steering_stays_where_the_path_had_it() -> None:
    b = Bench(core(path=arc_table(0.02, nodes=500)))
    b.run(12)
    b.request(Request.ARM)
    b.until(State.TRACKING)
    b.run(12)
    b.silent.add("VEHICLE_SPEED_RPT")
    b.until(State.BRAKING)
    last = commander(b).last
    assert last is not None
    hold = last.sent.hold_rad
    assert abs(hold) > 0.05
    for _ in range(20):
        result = b.step()
        assert brakes(result)
        position = said(result)["STEERING_CMD"]["POSITION_VALUE"]
        assert position == pytest.approx(hold, abs=0.0006)
