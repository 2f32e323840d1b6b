"""The core's rarer ways: a vehicle that does not enable, what freezes, what heals, misuse."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from onboard_core_bench import (
    OWN,
    PACMOD2,
    Bench,
    bench,
    brakes,
    commander,
    commands,
    driven,
    faults,
    framed,
    said,
)
from onboard_core_cases import SENSORS, SETTINGS

from workbench.errors import InputError
from workbench.runtime.onboard.actuation import Wanted
from workbench.runtime.onboard.core import Mode, Request, State
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.found_in_car import found_in_mode
from workbench.runtime.onboard.intake import BusError, Intake
from workbench.runtime.onboard.onboard_settings import ReadingErrors
from workbench.runtime.onboard.states import Standing
from workbench.runtime.onboard.times import TURN_US


def raises(*args: object, **named: object) -> None:
    raise ZeroDivisionError("planted")


def test_a_vehicle_that_does_not_enable_is_given_up() -> None:
    b = bench()
    b.run(12)
    b.changes["GLOBAL_RPT", "PACMOD_STATUS"] = 0
    b.request(Request.ARM)
    assert b.step().state is State.ARMED
    result = b.until(State.YIELDED)
    assert Fault.NOT_ENABLED in faults(result)
    assert said(result)["GLOBAL_CMD"]["PACMOD_ENABLE"] == 0
    assert 1_000_000 < result.at_us - 12 * TURN_US < 1_100_000


def test_a_pedal_ends_arming_at_once_and_a_fault_too() -> None:
    for fault in (False, True):
        b = bench()
        b.run(12)
        b.request(Request.ARM)
        b.step()
        if fault:
            b.core.bus_error(BusError.BUS_OFF, b.at_us - 1)
        else:
            b.changes["ACCEL_RPT", "MANUAL_INPUT"] = 0.3
        result = b.step()
        assert result.state is (State.DISARMED if fault else State.YIELDED)
        # The vehicle was never enabled, so there is nothing to give up.
        assert "ACCEL_CMD" not in commands(result)
        assert said(result).get("GLOBAL_CMD", {"PACMOD_ENABLE": 0})["PACMOD_ENABLE"] == 0


def test_what_raises_while_arming_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    b = bench()
    b.run(12)
    b.request(Request.ARM)
    b.step()
    monkeypatch.setattr(b.core._watch, "look", raises)
    result = b.step()
    assert result.state is State.DISARMED
    assert said(result)["GLOBAL_CMD"]["PACMOD_ENABLE"] == 0
    assert commands(b.step()) == set()


def test_every_way_in_survives_what_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    class UnsayableError(Exception):
        def __str__(self) -> str:
            raise RuntimeError("no words")

    def unsayable(*args: object) -> None:
        raise UnsayableError

    for mode, way in ((Mode.DRIVE, "bus_error"), (Mode.GATE, "receive_upstream")):
        b = bench(mode)
        if mode is Mode.DRIVE:
            monkeypatch.setattr(b.core._watch.intake, "bus_error", unsayable)
            b.core.bus_error(BusError.SEND, 0)
        else:
            monkeypatch.setattr(b.core._watch.upstream, "receive", unsayable)
            b.core.receive_upstream(0x69, bytes(8), 0)
        found = next(each for each in b.step().faults if each.fault is Fault.INTERNAL)
        assert found.detail == f"{way}: UnsayableError"


def test_even_a_heartbeat_that_cannot_be_made_does_not_stop_the_brake(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    b = driven()
    monkeypatch.setattr(b.core._announcer, "heartbeat", raises)
    result = b.step()
    assert (result.state, brakes(result)) == (State.FAULT, True)
    assert "HEARTBEAT" not in said(result)


def test_frames_that_are_not_made_are_replaced_by_the_last_resort() -> None:
    b = driven()
    commander(b).silent()
    result = b.step()
    assert Fault.NOT_COVERED in faults(result)
    assert (result.state, brakes(result)) == (State.BRAKING, True)


def test_a_law_without_a_reading_gives_way_to_brake(monkeypatch: pytest.MonkeyPatch) -> None:
    b = driven()
    look = b.core._watch.look

    def blind(*args: Any) -> Any:
        return replace(look(*args), reading=None)

    monkeypatch.setattr(b.core._watch, "look", blind)
    result = b.step()
    assert Fault.NOT_COVERED in faults(result)
    assert (result.state, brakes(result)) == (State.BRAKING, True)


def test_a_speed_that_freezes_while_the_car_is_pushed_is_noticed() -> None:
    b = driven()
    b.raw["VEHICLE_SPEED_RPT"] = framed("VEHICLE_SPEED_RPT", b.reports()["VEHICLE_SPEED_RPT"])[1]
    seen: set[Fault] = set()
    for _ in range(40):
        result = b.step()
        seen |= faults(result)
    assert Fault.FROZEN in seen
    assert brakes(result)


def test_a_steering_wheel_that_freezes_is_noticed() -> None:
    b = driven()
    b.changes["STEERING_RPT_1", "OUTPUT_VALUE"] = 1.0
    b.changes["STEERING_RPT_1", "COMMANDED_VALUE"] = 0.0
    seen: set[Fault] = set()
    for _ in range(40):
        seen |= faults(b.step())
    assert {Fault.FROZEN, Fault.NOT_FOLLOWING} <= seen


def test_a_report_beyond_the_vehicles_range_goes_no_further() -> None:
    b = driven()
    impossible = framed("VEHICLE_SPEED_RPT", {"VEHICLE_SPEED": 60.0, "VEHICLE_SPEED_VALID": 1})
    before = b.core._watch.intake.reports["VEHICLE_SPEED_RPT"]
    b.receive(*impossible, b.at_us - 2_000)
    assert b.core._watch.intake.reports["VEHICLE_SPEED_RPT"] is before
    for _ in range(3):
        b.step(lambda b, at_us: b.receive(*impossible, at_us))
    assert b.step().state is State.TRACKING, "a good frame ends the row"


def test_what_happened_once_is_no_reason_for_ever() -> None:
    b = bench()
    b.run(12)
    b.receive(0x10, bytes(8), b.at_us - 1_000)
    b.core.bus_error(BusError.ERROR_FRAME, b.at_us - 1_000)
    assert {Fault.WRONG_PROTOCOL, Fault.ERROR_FRAME} <= faults(b.step())
    last = b.run(4)
    assert Fault.ERROR_FRAME not in faults(last)
    assert Fault.WRONG_PROTOCOL in faults(last)
    assert faults(b.run(30)) == set()


def test_an_alert_does_not_speak_against_arming() -> None:
    b = bench()
    b.run(12)
    radii = {"SET": 0, "X_RADIUS": 0.0, "Y_RADIUS": 0.0, "HEADING_OBSERVED": 1}
    b.request(Request.ARM)
    result = b.step(lambda b, at_us: b.receive(*framed("LOC_RADII", radii), at_us))
    assert Fault.OUT_OF_ORDER in faults(result)
    assert result.state is State.ARMED


def test_a_wrong_unit_is_forgiven_after_metres_of_agreement() -> None:
    b = bench()
    b.run(12)
    b.speed_mps, b.gain = 0.0, 1.0
    for k in range(60):
        b.speed_mps = min(0.05 * k, 2.0)
        b.gain = min(b.gain + 0.02, 2.0)
        result = b.step()
    assert Fault.WRONG_SPEED in faults(result)
    while b.gain > 1.0:
        b.gain = max(b.gain - 0.02, 1.0)
        b.step()
    assert Fault.WRONG_SPEED in faults(b.run(12))
    assert Fault.WRONG_SPEED not in faults(b.run(150))


def test_without_a_status_a_commanded_car_counts_as_disabled() -> None:
    intake = Intake(PACMOD2, OWN, stamps=SENSORS.stamps)
    tracking = Standing(State.TRACKING, 0)
    found = list(found_in_mode(intake, SETTINGS.limits, 1, tracking))
    assert [each.fault for each in found] == [Fault.NOT_ENABLED]
    assert found[0].detail == "GLOBAL_RPT has not come"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"reference_speed_mps": -1.0}, "reference_speed_mps"),
        ({"gate": Wanted(-0.1, 0.0)}, "margins >= 0"),
        ({"bundle_tag": 256}, "one byte"),
        ({"maker": 1 << 24}, "three bytes"),
        ({"limits": replace(SETTINGS.limits, people_age_us=1)}, "ages of sets"),
    ],
)
def test_settings_that_make_no_sense_are_refused(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(SETTINGS, **changed)


def test_limits_and_errors_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InputError, match="pedal: expected a number > 0"):
        replace(SETTINGS.limits, pedal=0.0)
    with pytest.raises(InputError, match="speed_mps"):
        replace(SETTINGS.limits, speed_mps=(1.0, 1.0))
    with pytest.raises(InputError, match="heading_rad"):
        ReadingErrors(offset_m=0.1, heading_rad=float("nan"), speed_mps=0.1)


def test_a_new_bench_drives_like_another() -> None:
    one, two = driven(), driven()
    for _ in range(6):
        assert one.step().frames == two.step().frames
    assert isinstance(one, Bench)
