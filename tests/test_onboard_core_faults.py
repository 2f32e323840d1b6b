"""Every fault that can be noticed on board is answered in the very next turn, as its table says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from onboard_core_bench import Bench, bench, brakes, commands, driven, faults, framed, said
from onboard_core_cases import DRIVE_BY_WIRE, SETTINGS, core
from onboard_core_changes import CASES, RADII, Change, jump
from runtime_world import arc_table

from workbench.runtime.onboard import found_in_car
from workbench.runtime.onboard.actuation import DriveByWire
from workbench.runtime.onboard.core import Request, State, TurnResult
from workbench.runtime.onboard.faults import Fault, Latency, Reaction
from workbench.runtime.onboard.onboard_settings import ReadingErrors
from workbench.runtime.onboard.times import TURN_US


def _until_found(b: Bench, fault: Fault, change: Change) -> TurnResult:
    """The first turn with the fault; none before is anything but permitted."""
    for _ in range(60):
        result = b.step(change)
        if fault in faults(result):
            return result
    raise AssertionError(f"{fault.name} was not found; {result.faults}")


@pytest.mark.parametrize("case", CASES)
def test_a_fault_is_answered_in_the_turn_after_its_condition(case: str) -> None:
    fault, change = CASES[case]
    b = driven()
    result = _until_found(b, fault, change)
    found = next(each for each in result.faults if each.fault is fault)
    # A hang is over when the turn comes.
    assert fault is Fault.LATE_TURN or 0 <= result.at_us - found.since_us <= TURN_US
    if fault.reaction is Reaction.YIELD:
        assert result.state is State.YIELDED
        assert commands(result) == {"GLOBAL_CMD"}
        assert said(result)["GLOBAL_CMD"]["PACMOD_ENABLE"] == 0
        assert commands(b.step()) == set()
    else:
        assert brakes(result)
        latched = fault.reaction in (Reaction.LATCH, Reaction.REFUSE)
        others = {each.fault.reaction for each in result.faults}
        assert result.state is (
            State.FAULT if latched or Reaction.LATCH in others else State.BRAKING
        )
    assert said(result)["HEARTBEAT"]["STATE"] == result.state


@pytest.mark.parametrize("case", CASES)
def test_no_decision_delays_the_answer_to_a_new_fault(case: str) -> None:
    fault, change = CASES[case]
    for phase in range(3):
        b = driven()
        b.run(1 + phase)
        before = State.TRACKING
        for _ in range(60):
            result = b.step(change)
            if result.state is not before:
                break
        # Where the decision itself brakes there is no fault yet; then a fault is not new.
        new = result.faults and result.state is not State.TRACKING
        assert not new or result.decided_us is None or fault is Fault.WEAK_BRAKE


def test_milder_faults_leave_the_car_tracking() -> None:
    for fault, change in (
        (Fault.CLOCK_JUMP, jump),
        (Fault.OUT_OF_ORDER, lambda b, at_us: b.receive(*framed("LOC_RADII", RADII), at_us)),
        (Fault.BUS_BUSY, lambda b, at_us: [b.receive(0, bytes(8), at_us) for _ in range(300)]),
    ):
        b = driven()
        result = _until_found(b, fault, change)
        assert fault.reaction is Reaction.ALERT
        assert result.state is State.TRACKING
        assert any(event.startswith(fault.name) for event in result.events)


def test_a_changed_floating_point_mode_latches(monkeypatch: pytest.MonkeyPatch) -> None:
    b = driven()
    monkeypatch.setattr(found_in_car, "float_mode_fault", lambda: "flushed")
    result = b.step()
    assert faults(result) == {Fault.FLOAT_MODE}
    assert result.state is State.FAULT
    assert brakes(result)


def test_what_raises_inside_latches_and_brakes_with_the_last_steering(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    b = driven()
    before = said(b.step())["STEERING_CMD"]

    def broken(*args: object, **named: object) -> None:
        raise ZeroDivisionError("planted")

    with monkeypatch.context() as patch:
        patch.setattr(b.core._watch, "look", broken)
        result = b.step()
        assert faults(result) == {Fault.INTERNAL}
        assert (result.state, brakes(result)) == (State.FAULT, True)
        assert said(result)["STEERING_CMD"] == before
        assert "planted" in result.events[0]
        assert brakes(b.step())
    assert (b.step().state, brakes(b.step())) == (State.FAULT, True)


def test_what_raises_in_receiving_is_found_by_the_next_turn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    b = driven()

    def broken(*args: object, **named: object) -> None:
        raise ZeroDivisionError("planted")

    monkeypatch.setattr(b.core._watch.intake, "receive", broken)
    result = b.step()
    assert Fault.INTERNAL in faults(result)
    assert (result.state, brakes(result)) == (State.FAULT, True)


def test_a_law_that_cannot_be_sent_within_the_proof_brakes() -> None:
    pedals = replace(DRIVE_BY_WIRE.pedals, slew_mps3=1.0, withheld_mps2=0.15)
    slow: DriveByWire = replace(DRIVE_BY_WIRE, pedals=pedals)
    b = bench(drive_by_wire=slow)
    b.run(12)
    b.request(Request.ARM)
    b.until(State.TRACKING)
    for _ in range(40):
        assert Fault.NOT_COVERED not in faults(b.step())
    b.speed_mps -= 0.25
    result = b.step()
    assert Fault.NOT_COVERED in faults(result)
    assert (result.state, brakes(result)) == (State.BRAKING, True)


@pytest.mark.parametrize(
    ("fault", "changed"),
    [
        (Fault.BUNDLE, {"signed": False}),
        (Fault.WRONG_VEHICLE, {"maker": 0x123456}),
        (
            Fault.COARSE_READING,
            {"reading": ReadingErrors(offset_m=0.05, heading_rad=1.0, speed_mps=1.0)},
        ),
    ],
)
def test_what_is_wrong_from_the_start_refuses(fault: Fault, changed: dict[str, Any]) -> None:
    b = bench(**changed)
    b.run(12)
    b.request(Request.ARM)
    result = b.step()
    assert result.state is State.DISARMED
    assert commands(result) == set()
    refusals = [event for event in result.events if event.startswith("not armed: ")]
    assert len(refusals) == 1
    assert fault.name in refusals[0]


def test_an_expected_maker_must_have_been_reported() -> None:
    b = bench()
    b.silent.add("VIN_RPT")
    b.run(12)
    b.request(Request.ARM)
    result = b.step()
    assert result.state is State.DISARMED
    assert "WRONG_VEHICLE: no VIN_RPT yet" in result.events[0]


def test_off_the_path_nothing_is_observed() -> None:
    b = Bench(core(path=arc_table(0.0, nodes=20)))
    result = b.run(12)
    assert faults(result) == {Fault.NOT_OBSERVED}


def test_the_cases_cover_the_table() -> None:
    elsewhere = {
        Fault.CLOCK_JUMP, Fault.OUT_OF_ORDER, Fault.BUS_BUSY, Fault.FLOAT_MODE, Fault.INTERNAL,
        Fault.NOT_COVERED, Fault.BUNDLE, Fault.COARSE_READING, Fault.NOT_OBSERVED,
        # In test_onboard_core.py and test_onboard_core_gate.py.
        Fault.OVERRUN, Fault.UPSTREAM_LOST, Fault.UPSTREAM_DISABLED,
        # In test_onboard_core_intents.py.
        Fault.INTENTS_LOST,
    }  # fmt: skip
    beside = {fault for fault in Fault if fault.rule.latency is Latency.BESIDE}
    assert beside == {Fault.LOG_LOST, Fault.LEAK}
    assert {fault for fault, _ in CASES.values()} | elsewhere | beside == set(Fault)
    assert SETTINGS.signed
