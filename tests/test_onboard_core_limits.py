"""Every fault begins exactly where its limit says: in microseconds, counts, metres a second."""

from __future__ import annotations

from dataclasses import replace

import pytest
from onboard_core_bench import OWN, PACMOD2, Bench, commander, driven, framed, person, said
from onboard_core_cases import PATH, SENSORS, SETTINGS, bundle, core
from runtime_world import arc_table

from workbench.runtime.onboard.actuation import Outputs
from workbench.runtime.onboard.core import Mode, Request, State
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.following import Following
from workbench.runtime.onboard.found_on_bus import found_in_reports, found_on_bus
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.turns import overrun, untimely
from workbench.runtime.onboard.watching import Watch

LIMITS = SETTINGS.limits
BRAKE = bundle(0).manifest.brake


def intake(**speeds_mps: float) -> Intake:
    """Every needed report at 1 s, and speeds at other instants: us1200000=1.5."""
    made = Intake(PACMOD2, OWN, stamps=SENSORS.stamps)
    reports = Bench(core(Mode.SHADOW)).reports()
    for name in made.names.needed:
        made.receive(*framed(name, reports[name]), 1_000_000)
    for key, value in speeds_mps.items():
        told = {"VEHICLE_SPEED": value, "VEHICLE_SPEED_VALID": 1}
        made.receive(*framed("VEHICLE_SPEED_RPT", told), int(key.removeprefix("us")))
    return made


def test_a_report_is_stale_after_three_periods_and_says_since_when() -> None:
    made = intake()
    assert not list(found_in_reports(made, LIMITS, 1_100_000))
    found = list(found_in_reports(made, LIMITS, 1_100_001))
    assert len(found) == len(made.names.needed)
    assert {(each.fault, each.since_us) for each in found} == {(Fault.STALE_REPORT, 1_100_000)}
    assert found[0].detail == "VEHICLE_SPEED_RPT: 100001 us old"


def test_a_bus_is_silent_after_as_long() -> None:
    made = intake()
    assert not list(found_on_bus(made, LIMITS, 1_100_000, commands_pass=False))
    found = list(found_on_bus(made, LIMITS, 1_100_001, commands_pass=False))
    assert [(each.fault, each.since_us) for each in found] == [(Fault.BUS_SILENT, 1_100_000)]


@pytest.mark.parametrize(("count", "too_many"), [(27, False), (28, True)])
def test_a_report_may_come_half_as_often_again(count: int, too_many: bool) -> None:
    made = Intake(PACMOD2, OWN, stamps=SENSORS.stamps)
    gear = framed("SHIFT_RPT", {"MANUAL_INPUT": 3, "COMMANDED_VALUE": 3, "OUTPUT_VALUE": 3})
    for k in range(count):
        made.receive(*gear, 1_000_000 + k)
    found = {each.fault for each in found_in_reports(made, LIMITS, 1_050_000)}
    assert (Fault.REPLAYED in found) is too_many


@pytest.mark.parametrize(("frames", "busy"), [(500, False), (501, True)])
def test_a_bus_is_busy_from_so_many_frames_on(frames: int, busy: bool) -> None:
    made = intake()
    for k in range(frames - 6):
        made.receive(0, bytes(8), 1_000_001 + k)
    found = {each.fault for each in found_on_bus(made, LIMITS, 1_020_000, commands_pass=False)}
    assert (Fault.BUS_BUSY in found) is busy
    assert Fault.BUS_FLOOD not in found
    later = list(found_on_bus(made, LIMITS, 1_066_667, commands_pass=False))
    flooded = [each for each in later if each.fault is Fault.BUS_FLOOD]
    assert len(flooded) == (len(made.names.needed) if busy else 0)
    assert {each.since_us for each in flooded} <= {1_066_666}


@pytest.mark.parametrize(("speed_mps", "accepted"), [(0.69, True), (0.71, False)])
def test_a_speed_may_change_by_a_step_and_what_the_car_can_do(
    speed_mps: float, accepted: bool
) -> None:
    watch = Watch(bundle(0).manifest, PATH, SETTINGS, mode=Mode.DRIVE)
    for value, at_us in ((0.0, 1_000_000), (speed_mps, 1_033_333)):
        told = {"VEHICLE_SPEED": value, "VEHICLE_SPEED_VALID": 1}
        watch.receive(*framed("VEHICLE_SPEED_RPT", told), at_us)
    # 0.3 m/s and 12 m/s^2 for 33.333 ms are 0.7 m/s.
    last = watch.intake.reports["VEHICLE_SPEED_RPT"].values["VEHICLE_SPEED"]
    assert (last == speed_mps) is accepted


def _braking(from_mps: float) -> Following:
    held = Outputs(0.0, 0.45, 0.0, 0.5)
    following = Following()
    for at_us in range(1_000_000, 2_000_000, 50_000):
        following = following.commanding(
            at_us, held, acceleration_mps2=-2.0, brakes_from_mps=from_mps
        )
    return following


@pytest.mark.parametrize(("speed_mps", "weak"), [(1.09, False), (1.11, True)])
def test_a_brake_is_weak_where_its_bounds_are_missed(speed_mps: float, weak: bool) -> None:
    # From 2 m/s at 1 s: 0.35 s until it has built up, a period for the report, then 2 m/s^2.
    made = intake(us1848333=speed_mps)
    following = _braking(2.0)
    found = following.found(made, LIMITS, 1_850_000, brake=BRAKE, error_mps=0.03)
    told = {each.fault for each in found} & {Fault.WEAK_BRAKE}
    assert told == ({Fault.WEAK_BRAKE} if weak else set())


def test_a_standing_car_is_not_weakly_braked() -> None:
    made = intake(us1900000=0.05)
    found = _braking(0.0).found(made, LIMITS, 1_950_000, brake=BRAKE, error_mps=0.0)
    assert Fault.WEAK_BRAKE not in {each.fault for each in found}


def test_a_command_may_be_repeated_as_late_as_stated() -> None:
    made = intake()
    told = {"MANUAL_INPUT": 0.0, "COMMANDED_VALUE": 0.45, "OUTPUT_VALUE": 0.45}
    made.receive(*framed("BRAKE_RPT", told | {"BRAKE_ON_OFF": 1}), 1_050_000)
    free = Outputs(0.0, 0.0, 0.0, 0.5)
    following = _braking(0.0)
    for at_us in (2_000_000, 2_050_000, 2_100_000):
        following = following.commanding(at_us, free, acceleration_mps2=0.0, brakes_from_mps=None)
    # The last turn with 0.45 was at 1.95 s.
    for now_us, late in ((2_150_000, False), (2_150_001, True)):
        found = following.found(made, LIMITS, now_us, brake=BRAKE, error_mps=0.0)
        assert any(each.fault is Fault.NOT_FOLLOWING for each in found) is late


def test_turns_and_decisions_are_late_beyond_what_the_proof_allows() -> None:
    timing = SETTINGS.timing
    assert untimely(None, 10**6, timing) == ()
    assert untimely(10**6, 1_050_000, timing) == ()
    late = Found(Fault.LATE_TURN, "50001 us after the last turn, 50000 us are allowed", 1_050_000)
    assert untimely(10**6, 1_050_001, timing) == (late,)
    assert untimely(10**6, 10**6, timing) == ()
    assert untimely(10**6, 10**6 - 1, timing)[0].fault is Fault.CLOCK_BACKWARDS
    assert overrun(10**6, None, timing) == overrun(10**6, 1_050_000, timing) == ()
    assert overrun(10**6, 1_050_001, timing)[0].since_us == 1_050_000


def test_while_the_path_is_known_a_braking_car_steers_along_it() -> None:
    b = Bench(core(path=arc_table(0.02, nodes=500)))
    b.run(12)
    b.request(Request.ARM)
    b.until(State.TRACKING)
    while b.speed_mps < 1.0:
        b.step()
    b.people = [person(7, b.x_m + 4.0, 0.0)]
    b.until(State.BRAKING)
    positions = []
    while b.speed_mps > 0.5:
        positions.append(said(b.step())["STEERING_CMD"]["POSITION_VALUE"])
        assert commander(b).last is not None
    assert len(set(positions)) > len(positions) // 2


def test_a_fault_that_is_over_is_told_once() -> None:
    b = driven()
    b.silent.add("SHIFT_RPT")
    b.until(State.BRAKING)
    b.silent.clear()
    events = [event for _ in range(6) for event in b.step().events]
    assert events == ["STALE_REPORT is over"]


def test_limits_are_values_that_can_be_changed() -> None:
    longer = replace(LIMITS, report_age_us=200_000)
    assert not list(found_in_reports(intake(), longer, 1_200_000))
