"""Arming clears, then enables, and is refused with one sentence wherever something is wrong."""

from __future__ import annotations

import pytest
from onboard_core_bench import answer, bench, brakes, commands, driven, refusal, said

from workbench.runtime.onboard.core import Request, State
from workbench.runtime.onboard.states import CLEARING_TURNS

OTHERS = {"GLOBAL_CMD", "ACCEL_CMD", "BRAKE_CMD", "STEERING_CMD"}


def test_arming_clears_and_enables_in_separate_frames_with_both_pedals_free() -> None:
    b = bench()
    b.run(12)
    b.request(Request.ARM)
    for _ in range(CLEARING_TURNS):
        result = b.step()
        assert commands(result) == {"GLOBAL_CMD"}
        flags = said(result)["GLOBAL_CMD"]
        assert flags == {"PACMOD_ENABLE": 0, "CLEAR_OVERRIDE": 1, "IGNORE_OVERRIDE": 0}
    result = b.step()
    heard = said(result)
    assert commands(result) == OTHERS
    assert heard["GLOBAL_CMD"] == {
        "PACMOD_ENABLE": 1, "CLEAR_OVERRIDE": 0, "IGNORE_OVERRIDE": 0,
    }  # fmt: skip
    assert (heard["ACCEL_CMD"]["ACCEL_CMD"], heard["BRAKE_CMD"]["BRAKE_CMD"]) == (0.0, 0.0)
    result = b.step()
    assert (result.state, brakes(result)) == (State.BRAKING, True)


@pytest.mark.parametrize(
    ("message", "signal", "value", "reason"),
    [
        ("SHIFT_RPT", "OUTPUT_VALUE", 2, "NOT_FORWARD"),
        ("BRAKE_RPT", "MANUAL_INPUT", 0.3, "DRIVER_OVERRIDE"),
        ("GLOBAL_RPT", "PACMOD_STATUS", 1, "somebody else has enabled it"),
        ("GLOBAL_RPT", "VEH_CAN_TIMEOUT", 1, "NOT_ENABLED"),
        ("VEHICLE_SPEED_RPT", "VEHICLE_SPEED", 0.1, "does not stand"),
        ("VIN_RPT", "MFG_CODE", 1, "WRONG_VEHICLE"),
    ],
)
def test_what_the_vehicle_reports_refuses_arming(
    message: str, signal: str, value: float, reason: str
) -> None:
    b = bench()
    b.changes[message, signal] = value
    b.run(12)
    assert reason in refusal(b)


def test_what_is_missing_refuses_arming() -> None:
    assert "STALE_REPORT: VEHICLE_SPEED_RPT: none yet" in refusal(bench())
    for name in ("LOC_RADII", "PEOPLE", "STEERING_RPT_1"):
        b = bench()
        b.silent.add(name)
        b.run(12)
        assert "not armed" in refusal(b)
    b = bench()
    b.run(12)
    b.step(lambda b, at_us: b.receive(0x10, bytes(8), at_us))
    assert "WRONG_PROTOCOL" in refusal(b)


def test_a_request_must_fit_the_state_and_be_fresh() -> None:
    b = driven()
    assert "it is TRACKING" in answer(b, Request.ARM)
    b = bench()
    b.run(12)
    assert "rearm needs the state YIELDED" in answer(b, Request.REARM)
    b.core.request(Request.ARM, b.at_us - 200_000)
    result = b.step()
    assert result.state is State.DISARMED
    assert "ask again" in result.events[0]
    b.core.request(Request.DISARM, b.at_us)
    b.core.request(Request.ARM, b.at_us)
    assert b.step().state is State.DISARMED
