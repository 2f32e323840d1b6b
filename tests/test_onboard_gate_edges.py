"""What upstream may is counted to its edges: ages to the microsecond, margins, limits, maps."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from onboard_core_bench import framed
from onboard_core_cases import DRIVE_BY_WIRE

from workbench.runtime.onboard.actuation import Curve, DriveByWire, Wanted
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.gate import Upstream, passed

AGE_US = 100_000
PEDALS, STEERING = DRIVE_BY_WIRE.pedals, DRIVE_BY_WIRE.steering
NAMES = ("GLOBAL_CMD", "ACCEL_CMD", "BRAKE_CMD", "STEERING_CMD")


def heard(
    at_us: int,
    *,
    enable: int = 1,
    accel: float = 0.0,
    brake: float = 0.0,
    wheel: float = 0.0,
    vehicle: DriveByWire = DRIVE_BY_WIRE,
) -> Upstream:
    upstream = Upstream(vehicle)
    flags: dict[str, float] = {"PACMOD_ENABLE": enable, "CLEAR_OVERRIDE": 0, "IGNORE_OVERRIDE": 0}
    steering = {"POSITION_VALUE": wheel, "SPEED_LIMIT": 4.0}
    for name, values in zip(
        NAMES, (flags, {"ACCEL_CMD": accel}, {"BRAKE_CMD": brake}, steering), strict=True
    ):
        upstream.receive(*framed(name, values), at_us)
    return upstream


def test_commands_are_lost_after_their_age_and_since_then() -> None:
    upstream = heard(1_000_000)
    assert not list(upstream.found(1_000_000 + AGE_US, age_us=AGE_US))
    found = list(upstream.found(1_000_001 + AGE_US, age_us=AGE_US))
    assert [(each.fault, each.since_us) for each in found] == [
        (Fault.UPSTREAM_LOST, 1_000_000 + AGE_US)
    ] * len(NAMES)
    assert found[0].detail == "GLOBAL_CMD: 100001 us old"


def test_who_was_never_heard_is_lost_from_the_first_instant_on() -> None:
    found = list(Upstream(DRIVE_BY_WIRE).found(5, age_us=AGE_US))
    assert [(each.detail, each.since_us) for each in found] == [(n, AGE_US) for n in NAMES]


@pytest.mark.parametrize("enable", [0, 1])
def test_enable_0_is_told_since_it_was_said(enable: int) -> None:
    found = list(heard(1_000_000, enable=enable).found(1_000_010, age_us=AGE_US))
    told = [(Fault.UPSTREAM_DISABLED, 1_000_000)] if not enable else []
    assert [(each.fault, each.since_us) for each in found] == told


def test_other_frames_of_the_vehicle_are_no_commands() -> None:
    upstream = Upstream(DRIVE_BY_WIRE)
    gear = {"MANUAL_INPUT": 3, "COMMANDED_VALUE": 3, "OUTPUT_VALUE": 3}
    upstream.receive(*framed("SHIFT_RPT", gear), 5)
    upstream.receive(framed("ACCEL_CMD", {"ACCEL_CMD": 0.0})[0], b"", 5)
    assert len(list(upstream.found(6, age_us=AGE_US))) == len(NAMES)


def test_a_brake_goes_before_an_accelerator_and_below_its_map_nothing_is_meant() -> None:
    low, high = PEDALS.accelerator.commands
    assert low > 0.001
    for accel, expected in (
        (0.0, 0.0),
        (math.floor(low * 1000.0 - 1e-9) / 1000.0, 0.0),
        (1.0, PEDALS.accelerator.middle(high)),
    ):
        assert heard(1, accel=accel).wanted(0.0).acceleration_mps2 == expected
    both = heard(1, accel=1.0, brake=1.0).wanted(0.0)
    assert both.acceleration_mps2 == -PEDALS.brake.middle(PEDALS.brake.commands[1])


def test_at_the_low_end_of_a_map_the_map_counts() -> None:
    """Where a pedal's map begins it may mean something: here it accelerates by 1/16 m/s^2."""
    begins = Curve((0.25, 1.0), (0.0625, 4.0), (0.0625, 4.0))
    vehicle = replace(DRIVE_BY_WIRE, pedals=replace(PEDALS, accelerator=begins))
    for accel, expected in ((0.249, 0.0), (0.25, 0.0625)):
        upstream = heard(1, accel=accel, vehicle=vehicle)
        assert upstream.wanted(0.0).acceleration_mps2 == expected


@pytest.mark.parametrize("wheel", [-1.0, 0.0, 2.0])
@pytest.mark.parametrize("read_back", [-0.5, 0.25])
def test_a_steering_command_is_reached_within_our_own_lead(wheel: float, read_back: float) -> None:
    road = STEERING.road_wheel
    rate = heard(1, wheel=wheel).wanted(read_back).steering_rate_radps
    assert rate == (road.middle(wheel) - road.middle(read_back)) / STEERING.lead_s


OWN = Wanted(0.25, 0.03125)
MARGIN = Wanted(0.125, 0.015625)


@pytest.mark.parametrize(
    ("accel", "expected"),
    [(0.25, 0.25), (0.125, 0.125), (0.375, 0.375), (0.0, 0.125), (9.0, 0.375), (0.3, 0.3),
     (math.nan, 0.25), (math.inf, 0.375), (-math.inf, 0.125)],
)  # fmt: skip
def test_what_passes_is_the_nearest_within_the_margin(accel: float, expected: float) -> None:
    found = passed(Wanted(accel, 0.03125), OWN, MARGIN, DRIVE_BY_WIRE)
    assert found == Wanted(expected, 0.03125)


def test_nothing_passes_the_limits_of_what_was_proved() -> None:
    limit, wide = STEERING.rate_limit_radps, Wanted(9.0, 9.0)
    for accel, rate, expected in (
        (8.0, 8.0, Wanted(PEDALS.accel_max_mps2, limit)),
        (-8.0, -8.0, Wanted(PEDALS.accel_min_mps2, -limit)),
    ):
        assert passed(Wanted(accel, rate), OWN, wide, DRIVE_BY_WIRE) == expected
