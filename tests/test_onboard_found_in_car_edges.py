"""What the vehicle says of itself is found to its edges: in which state, from when on."""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from onboard_intakes import intake

from workbench.runtime.onboard import found_in_car
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.found_in_car import (
    enabled_since,
    found_in_mode,
    found_in_setting,
    reasons_not_to_arm,
    stands,
)
from workbench.runtime.onboard.intake import Intake, Report
from workbench.runtime.onboard.limits import pacmod2_limits
from workbench.runtime.onboard.report_names import Place
from workbench.runtime.onboard.states import COMMANDING, Standing, State

AT_US, NOW_US = 4_000_000, 5_000_000
MAKER = 0x353243
LIMITS = pacmod2_limits(localisation_age_us=900_000, people_age_us=600_000)
COMMANDED = sorted(COMMANDING - {State.ARMED})
PEDALS = (Place("ACCEL_RPT", "MANUAL_INPUT"), Place("BRAKE_RPT", "MANUAL_INPUT"))
STATUS = Place("GLOBAL_RPT", "PACMOD_STATUS")
OVERRIDE = Place("GLOBAL_RPT", "OVERRIDE_STATUS")
UNHEARD = Place("GLOBAL_RPT", "USR_CAN_TIMEOUT")
TIMEOUT = Place("GLOBAL_RPT", "STR_CAN_TIMEOUT")
GEAR = Place("SHIFT_RPT", "OUTPUT_VALUE")
SPEED = Place("VEHICLE_SPEED_RPT", "VEHICLE_SPEED")
MADE_BY = Place("VIN_RPT", "MFG_CODE")
Changes = dict[str, dict[str, float]]


def vehicle(changes: Changes | None = None, *, name: str = "pacmod2") -> Intake:
    """A vehicle that stands in FORWARD, enabled, with nothing wrong; changes: by message."""
    found = intake(name)
    names = found.names
    values: dict[str, dict[str, float]] = {}
    systems = (names.accelerator, names.brake, names.steering)
    places = (*(s.manual for s in systems), names.unheard, names.speed, names.stopped)
    for place in (*places, *names.overridden, *names.faulty):
        if place is not None:
            values.setdefault(place.message, {})[place.signal] = 0.0
    for place in names.enabled:
        values[place.message][place.signal] = 1.0
    values.setdefault(GEAR.message, {})[GEAR.signal] = names.forward
    for message, these in (changes or {}).items():
        values.setdefault(message, {}).update(these)
    found.reports.update({key: Report(each, AT_US, b"", AT_US) for key, each in values.items()})
    return found


def changed(place: Place, value: float) -> Changes:
    return {place.message: {place.signal: value}}


def told(found: Iterable[Found]) -> list[tuple[Fault, str, int]]:
    return [(each.fault, each.detail, each.since_us) for each in found]


def in_mode(found: Intake, state: State, since_us: int = NOW_US) -> list[tuple[Fault, str, int]]:
    return told(found_in_mode(found, LIMITS, NOW_US, Standing(state, since_us)))


def arming(found: Intake, maker: int | None = None) -> list[tuple[Fault, str, int]]:
    return told(reasons_not_to_arm(found, LIMITS, NOW_US, maker=maker))


def in_setting(found: Intake, **named: bool | int | None) -> list[tuple[Fault, str, int]]:
    maker, signed = named.get("maker", MAKER), bool(named.get("signed", True))
    return told(found_in_setting(found, maker=maker, signed=signed, now_us=NOW_US))


def said(fault: Fault, place: Place, value: float) -> tuple[Fault, str, int]:
    return fault, f"{place.message}.{place.signal} is {value:g}", AT_US


@pytest.mark.parametrize("state", State)
def test_nothing_is_asked_of_a_vehicle_that_is_not_commanded(state: State) -> None:
    wrong = vehicle(changed(GEAR, 1.0) | changed(PEDALS[0], 0.9))
    assert bool(in_mode(wrong, state)) is (state in COMMANDING)
    assert in_mode(vehicle(), state) == []


@pytest.mark.parametrize("state", COMMANDED)
@pytest.mark.parametrize(
    ("place", "value", "fault"),
    [(OVERRIDE, 1.0, Fault.DRIVER_OVERRIDE), (STATUS, 0.0, Fault.NOT_ENABLED),
     (UNHEARD, 1.0, Fault.NOT_ENABLED), (TIMEOUT, 1.0, Fault.NOT_ENABLED),
     (GEAR, 1.0, Fault.NOT_FORWARD)],
)  # fmt: skip
def test_what_a_commanded_vehicle_says_counts_since_it_came(
    state: State, place: Place, value: float, fault: Fault
) -> None:
    found = vehicle(changed(place, value))
    assert in_mode(found, state) == [said(fault, place, value)]
    # An override is being cleared, enabling takes its time; a fault or a gear is one at once.
    counts = place in (TIMEOUT, GEAR)
    assert in_mode(found, State.ARMED) == [said(fault, place, value)] * counts


@pytest.mark.parametrize("state", [State.DISARMED, *COMMANDED, State.ARMED])
def test_a_foot_counts_beyond_its_threshold(state: State) -> None:
    for place in PEDALS:
        for value in (LIMITS.pedal, LIMITS.pedal + 0.001):
            found = vehicle(changed(place, value))
            detail = f"{place.message}.{place.signal} is {value:.3f}"
            expected = [(Fault.DRIVER_OVERRIDE, detail, AT_US)] * (value > LIMITS.pedal)
            if state is State.DISARMED:
                found.reports[STATUS.message] = vehicle(changed(STATUS, 0.0)).reports[
                    STATUS.message
                ]
                assert arming(found) == expected
            else:
                assert in_mode(found, state) == expected


def test_a_vehicle_that_says_nothing_is_not_enabled() -> None:
    missing = (Fault.NOT_ENABLED, "GLOBAL_RPT has not come", 0)
    assert in_mode(intake(), State.TRACKING) == [missing]
    assert in_mode(intake(), State.ARMED) == []


def test_enabling_may_take_its_time_and_no_longer() -> None:
    since_us = NOW_US - LIMITS.enable_us
    assert in_mode(vehicle(), State.ARMED, since_us) == []
    late = (Fault.NOT_ENABLED, "the vehicle does not enable", NOW_US - 1)
    assert in_mode(vehicle(), State.ARMED, since_us - 1) == [late]


def test_an_emergency_stop_counts_where_there_is_one() -> None:
    pressed = vehicle({"ESTOP_RPT": {"ESTOP": 1.0}}, name="pacmod3")
    expected = [said(Fault.NOT_ENABLED, Place("ESTOP_RPT", "ESTOP"), 1.0)]
    assert in_mode(pressed, State.TRACKING) == expected
    assert in_mode(vehicle(name="pacmod3"), State.TRACKING) == []


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (changed(STATUS, 0.0), []),
        ({}, [(Fault.NOT_ENABLED,
               "somebody else has enabled it (GLOBAL_RPT.PACMOD_STATUS is 1)", AT_US)]),
        (changed(STATUS, 0.0) | changed(GEAR, 1.0), [said(Fault.NOT_FORWARD, GEAR, 1.0)]),
        (changed(STATUS, 0.0) | changed(SPEED, -0.06),
         [(Fault.NOT_OBSERVED, "the car does not stand: -0.06 m/s", NOW_US)]),
        ({"GLOBAL_RPT": {STATUS.signal: 0.0, TIMEOUT.signal: 1.0}},
         [said(Fault.NOT_ENABLED, TIMEOUT, 1.0)]),
    ],
)  # fmt: skip
def test_arming_is_refused_for_what_must_not_be(
    changes: Changes, expected: list[tuple[Fault, str, int]]
) -> None:
    assert arming(vehicle(changes)) == expected


def test_somebody_else_who_enabled_all_systems_is_named_once() -> None:
    found = vehicle(name="pacmod3")
    assert len(found.names.enabled) > 1
    detail = "somebody else has enabled it (ACCEL_RPT.ENABLED is 1)"
    assert arming(found) == [(Fault.NOT_ENABLED, detail, AT_US)]


def test_the_maker_must_have_been_reported_where_it_can_be() -> None:
    waiting, known = vehicle(changed(STATUS, 0.0)), vehicle(changed(STATUS, 0.0))
    known.reports[MADE_BY.message] = Report({MADE_BY.signal: MAKER}, AT_US, b"", AT_US)
    assert arming(waiting, MAKER) == [(Fault.WRONG_VEHICLE, "no VIN_RPT yet", 0)]
    assert arming(known, MAKER) == arming(waiting) == []
    # A protocol that names no maker cannot be asked.
    other = vehicle(name="pacmod3")
    for report in other.reports.values():
        assert isinstance(report.values, dict)
        if "ENABLED" in report.values:
            report.values["ENABLED"] = 0.0
    assert arming(other, MAKER) == arming(other) == []


@pytest.mark.parametrize(
    ("speed_mps", "expected"),
    [(0.0, True), (0.05, True), (-0.05, True), (0.0501, False), (-0.0501, False)],
)
def test_the_car_stands_up_to_its_limit_both_ways(speed_mps: float, expected: bool) -> None:
    assert stands(vehicle(changed(SPEED, speed_mps)), LIMITS) is expected


def test_a_car_that_says_nothing_does_not_stand() -> None:
    assert stands(intake(), LIMITS) is False
    detail = "the car does not stand: None m/s"
    assert arming(intake()) == [(Fault.NOT_OBSERVED, detail, NOW_US)]


@pytest.mark.parametrize("name", ["pacmod2", "pacmod3"])
def test_enabled_is_what_every_system_says_after_it_was_asked(name: str) -> None:
    found = vehicle(name=name)
    assert enabled_since(found, AT_US - 1) is True
    assert enabled_since(found, AT_US) is False
    for place in found.names.enabled:
        off = vehicle(changed(place, 0.0), name=name)
        assert enabled_since(off, AT_US - 1) is False
        del off.reports[place.message]
        assert enabled_since(off, AT_US - 1) is False


def test_another_maker_is_another_vehicle() -> None:
    found = vehicle(changed(MADE_BY, MAKER))
    assert in_setting(found) == in_setting(vehicle()) == in_setting(found, maker=None) == []
    detail = "maker 0x353243, expected 0x353244"
    assert in_setting(found, maker=MAKER + 1) == [(Fault.WRONG_VEHICLE, detail, AT_US)]
    assert in_setting(vehicle(name="pacmod3")) == []
    assert in_setting(vehicle(name="pacmod3"), maker=None) == []


def test_what_was_not_signed_counts_since_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    assert in_setting(vehicle(), signed=False) == [(Fault.BUNDLE, "no signature was verified", 0)]
    monkeypatch.setattr(found_in_car, "float_mode_fault", lambda: "flushed")
    assert in_setting(vehicle()) == [(Fault.FLOAT_MODE, "flushed", NOW_US)]
