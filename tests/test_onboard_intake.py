"""Everything that came is held as it came, and everything wrong is counted by name."""

from __future__ import annotations

import dataclasses

import pytest
from can_cases import plain_frame, plain_values
from onboard_intakes import (
    PACMOD3,
    give,
    intake,
)
from onboard_sensors import BOUNDS, OWN, PACMOD2, pacmod2_reports

from workbench.errors import InputError
from workbench.runtime.onboard.counting import FrameRate
from workbench.runtime.onboard.intake import MOST_SAMPLES, BusError, Intake
from workbench.runtime.onboard.report_names import REPORT_NAMES, Place, SystemPlaces, report_names
from workbench.runtime.onboard.times import seconds
from workbench.runtime.protocols import (
    Reason,
    encode,
    load_protocol,
)


def test_instants_are_the_nearest_doubles() -> None:
    assert seconds(33_333) == 0.033333
    assert seconds(-(10**15)) == -1e9


@pytest.mark.parametrize("name", REPORT_NAMES)
def test_every_place_exists(name: str) -> None:
    protocol, names = load_protocol(name), REPORT_NAMES[name]
    places: list[Place] = []
    for field in dataclasses.fields(names):
        value = getattr(names, field.name)
        for each in value if isinstance(value, tuple) else (value,):
            if isinstance(each, SystemPlaces):
                places += [each.manual, each.commanded, each.output]
            elif isinstance(each, Place):
                places.append(each)
    for place in places:
        protocol.by_name[place.message].signal(place.signal)
        assert protocol.by_name[place.message].sender != "WORKBENCH"
    gear = protocol.by_name[names.gear.output.message].signal(names.gear.output.signal)
    assert gear.choices[names.forward] == "FORWARD"
    assert set(names.needed) <= set(protocol.by_name)
    assert len(set(names.needed)) == len(names.needed) >= 5


def test_only_vehicles_report() -> None:
    with pytest.raises(InputError, match="vehicle's protocol"):
        report_names(OWN)
    with pytest.raises(InputError, match="common identifier"):
        Intake(PACMOD2, PACMOD2, stamps=BOUNDS.stamps)


def test_reports_are_held_with_their_times() -> None:
    found = intake()
    for at_us, speed in ((10, 1.0), (20_000, 1.0), (40_000, 1.5), (60_000, 1.5)):
        give(found, pacmod2_reports(speed_mps=speed, wheel_rad=0.1), at_us)
    report = found.reports["VEHICLE_SPEED_RPT"]
    assert (report.values["VEHICLE_SPEED"], report.at_us, report.same_since_us) == (
        1.5, 60_000, 40_000,
    )  # fmt: skip
    assert found.reports["STEERING_RPT_1"].same_since_us == 10
    kept = [(sample.value, sample.at_us) for sample in found.samples["VEHICLE_SPEED_RPT"]]
    assert kept == [(1.0, 10), (1.0, 20_000), (1.5, 40_000), (1.5, 60_000)]


def test_a_flood_does_not_push_samples_out() -> None:
    found = intake()
    for at_us in range(0, 1_000_000, 500):
        give(found, pacmod2_reports(speed_mps=1.0, wheel_rad=0.1), at_us)
    kept = found.samples["VEHICLE_SPEED_RPT"]
    assert kept[0].at_us == 0
    assert len(kept) <= MOST_SAMPLES
    assert found.frames.within_us(1_000_000, back_us=1_000_000) == 4_000
    assert found.frames.within_us(1_000_000, back_us=100_000) == 400
    assert found.arrivals["STEERING_RPT_1"].within_us(1_000_000, back_us=100_000) == 200


def test_refusals_count_in_a_row_until_a_frame_is_accepted() -> None:
    found = intake()
    good = pacmod2_reports(speed_mps=1.0, wheel_rad=0.0)[0]
    for at_us in (5, 6, 7):
        found.receive(good[0], good[1][:-1], at_us)
    count = found.refusals["VEHICLE_SPEED_RPT"]
    assert (count.total, count.in_a_row, count.row_since_us, count.last_us) == (3, 3, 5, 7)
    assert found.last_refusal["VEHICLE_SPEED_RPT"].reason is Reason.WRONG_LENGTH
    assert "VEHICLE_SPEED_RPT" not in found.reports
    found.receive(*good, 8)
    count = found.refusals["VEHICLE_SPEED_RPT"]
    assert (count.total, count.in_a_row, count.row_since_us) == (3, 0, None)


def test_a_report_whose_counter_stands_is_dropped() -> None:
    found = intake("pacmod3")
    message = PACMOD3.by_name["COMPONENT_RPT_00"]
    for at_us, counter in ((1, 3), (2, 4), (3, 4), (4, 2), (5, 5)):
        data = encode(PACMOD3, message.name, plain_values(message, {"COUNTER": counter}))
        assert isinstance(data, bytes)
        found.receive(message.frame_id, data, at_us)
    assert found.counter_faults["COMPONENT_RPT_00"].total == 2
    assert found.reports["COMPONENT_RPT_00"].at_us == 5


def test_identifiers_that_only_we_send_are_noticed() -> None:
    found = intake()
    for protocol, name in ((PACMOD2, "BRAKE_CMD"), (OWN, "HEARTBEAT")):
        message = protocol.by_name[name]
        found.receive(message.frame_id, plain_frame(protocol, message), 7)
        found.receive(message.frame_id, b"", 7)
    assert {name: count.total for name, count in found.spoofed.items()} == {
        "BRAKE_CMD": 2, "HEARTBEAT": 2,
    }  # fmt: skip
    assert found.commands["BRAKE_CMD"].at_us == 7
    assert not found.reports


def test_reports_of_another_protocol_and_strangers_are_noticed() -> None:
    found = intake()
    found.receive(0x10, bytes(8), 1)
    found.receive(0x400, bytes(2), 2)
    found.receive(0x123, bytes(8), 3)
    found.receive(-1, b"", 3)
    assert sum(count.total for count in found.foreign.values()) == 2
    assert set(found.foreign) <= {"pacmod3", "pacmod3_3_4"}
    assert found.unknown.total == 2
    # 0x80 is a command of the one and a report of the other.
    found.receive(0x80, plain_frame(PACMOD2, PACMOD2.by_id[0x80]), 4)
    assert "PARKING_BRAKE_STATUS_RPT" in found.reports


def test_bus_errors_are_counted_by_kind() -> None:
    found = intake()
    for at_us in (3, 9):
        found.bus_error(BusError.BUS_OFF, at_us)
    count = found.bus_errors[BusError.BUS_OFF]
    assert (count.total, count.row_since_us, count.last_us) == (2, 3, 9)


def test_frames_of_the_past_are_dropped_and_counted() -> None:
    found = intake()
    give(found, pacmod2_reports(speed_mps=1.0, wheel_rad=0.0), 100)
    give(found, pacmod2_reports(speed_mps=2.0, wheel_rad=0.0), 99)
    assert found.backwards.total == 2
    assert found.reports["VEHICLE_SPEED_RPT"].values["VEHICLE_SPEED"] == 1.0


def test_rates_forget() -> None:
    rate = FrameRate()
    for at_us in range(0, 5_000_000, 1_000):
        rate.take(at_us)
    assert rate.within_us(5_000_000, back_us=1_000_000) == 1_000
    assert rate.within_us(9_000_000, back_us=1_000_000) == 0
