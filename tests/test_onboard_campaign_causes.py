"""What made answers late once: ages from the report on, sums up to now, pedals first, a bus that is
opened before the turn is sent."""

from __future__ import annotations

import itertools

import pytest
from onboard_campaign_injectors import fails_once
from onboard_core_bench import BEFORE_US, PACMOD2, driven, framed
from onboard_core_cases import DRIVE_BY_WIRE, SENSORS, SETTINGS
from onboard_world import World
from onboard_world_fake_core import FakeCore

from workbench.runtime.onboard.actuation import Outputs
from workbench.runtime.onboard.commands import Frame
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.following import Following
from workbench.runtime.onboard.intake import BusError, Intake
from workbench.runtime.onboard.last_resort import LastResort
from workbench.runtime.onboard.states import Mode
from workbench.runtime.onboard.times import TURN_US
from workbench.runtime.protocols import load_protocol


def test_not_following_counts_from_the_report_that_shows_it() -> None:
    bench = driven()
    bench.changes["BRAKE_RPT", "OUTPUT_VALUE"] = 0.5
    first_us = bench.at_us - BEFORE_US
    for _ in range(30):
        result = bench.step()
        found = [each for each in result.faults if each.fault is Fault.NOT_FOLLOWING]
        if found:
            break
    assert found[0].since_us == first_us + SETTINGS.limits.follow_us
    assert 0 < result.at_us - found[0].since_us <= TURN_US


def test_what_was_commanded_adds_up_from_the_report_until_now() -> None:
    intake = Intake(PACMOD2, load_protocol("workbench"), stamps=SENSORS.stamps)
    speed = framed("VEHICLE_SPEED_RPT", {"VEHICLE_SPEED": 1.0, "VEHICLE_SPEED_VALID": 1})
    resting = Outputs(0.0, 0.0, 0.0, 0.5)
    following = Following().commanding(
        0, resting, acceleration_mps2=1.0, brakes_from_mps=None
    )  # fmt: skip
    for at_us, expected in ((33_000, 0.023), (66_000, 0.056), (99_000, 0.089)):
        intake.receive(*speed, at_us - 23_000)
        following = following.compared(intake, SETTINGS.limits, at_us)
        assert following.pushed_mps == pytest.approx(expected, abs=1e-12)
    following = following.commanding(
        109_000, resting, acceleration_mps2=-2.0, brakes_from_mps=None
    )  # fmt: skip
    following = following.compared(intake, SETTINGS.limits, 132_000)
    assert following.pushed_mps == pytest.approx(0.089 + 0.010 - 0.046, abs=1e-12)


def test_the_last_resort_lets_the_accelerator_go_first_then_brakes() -> None:
    last = LastResort(DRIVE_BY_WIRE, Mode.DRIVE)
    steering = PACMOD2.by_name["STEERING_CMD"].frame_id
    last.sent((Frame(steering, bytes(8)),))
    names = [PACMOD2.by_id[frame.identifier].name for frame in last.brake()]
    assert names == ["ACCEL_CMD", "BRAKE_CMD", "STEERING_CMD", "GLOBAL_CMD"]


def test_a_bus_that_can_be_opened_again_carries_the_answer_of_the_same_turn() -> None:
    core = FakeCore(frames=(Frame(0x69, bytes([1]) + bytes(7)),))
    world = World(
        core, sends=True, injectors=[fails_once(500_000, BusError.RECEIVE, broken=True)]
    ).run(1_000_000)
    assert world.loop.counts.reopened == 1
    handed = [at_us for at_us, _, _ in world.port.handed]
    # A decision takes up to 12 ms, and its turn's frames come after it.
    assert max(b - a for a, b in itertools.pairwise(handed)) <= TURN_US + 12_000
