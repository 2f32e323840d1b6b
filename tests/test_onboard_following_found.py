"""A vehicle that does not do as it is told is doubted from the very edge of its limits on."""

from __future__ import annotations

from dataclasses import replace

import pytest
from onboard_following_cases import S, bare, doubts, sends, with_speed, with_system

from workbench.runtime.onboard.actuation import Outputs
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.following import Following


def test_while_nothing_is_commanded_nothing_is_doubted() -> None:
    made = with_system(bare(), "BRAKE_RPT", 0.75, 0.0, S)
    assert not doubts(Following(apart_us={"brake": 1}), made, 9 * S)


@pytest.mark.parametrize(("now_us", "told"), [(S + 500_000, False), (S + 500_001, True)])
def test_an_output_may_follow_as_late_as_stated(now_us: int, told: bool) -> None:
    found = doubts(replace(sends(), apart_us={"brake": S, "accelerator": S + 9}), bare(), now_us)
    late = Found(Fault.NOT_FOLLOWING, "brake: its output does not reach its command", S + 500_000)
    assert found == ([late] if told else [])


TOLD = tuple((k * 50_000, Outputs(0.0, ratio, 0.0, 0.5)) for k, ratio in
             enumerate((0.0, 0.125, 0.25, 0.5, 0.75, 0.375)))  # fmt: skip
"""At 0, 50, 100, 150, 200 and 250 ms after the first."""


@pytest.mark.parametrize(
    ("value", "now_us", "told"),
    [
        # Not yet: the first command may be under way.
        (1.0, 200_000, False),
        (1.0, 200_001, True),
        # Everything since 100 ms, a count to either side.
        (0.125, 300_000, False),
        (0.124, 300_000, True),
        (0.875, 300_000, False),
        (0.876, 300_000, True),
        # The command of 100 ms has had its time.
        (0.249, 300_001, True),
        (0.25, 300_001, False),
        # The one before the last counts on, for as long as it may.
        (0.75, 400_000, False),
        (0.75, 400_001, True),
        # The last counts for ever.
        (0.25, 9 * S, False),
        (0.249, 9 * S, True),
        (0.5, 9 * S, False),
        (0.501, 9 * S, True),
    ],
)
def test_a_command_is_repeated_within_its_time(value: float, now_us: int, told: bool) -> None:
    made = with_system(bare(), "BRAKE_RPT", value, value, 0)
    found = doubts(sends(*((S + at_us, out) for at_us, out in TOLD)), made, S + now_us)
    assert [(each.fault, each.since_us) for each in found] == [
        (Fault.NOT_FOLLOWING, S + now_us)
    ] * told


@pytest.mark.parametrize(
    ("message", "name", "detail"),
    [("ACCEL_RPT", "accelerator", "0.125 to 0.125"), ("BRAKE_RPT", "brake", "0.250 to 0.250"),
     ("STEERING_RPT_1", "steering", "0.500 to 0.500")],
)  # fmt: skip
def test_each_system_repeats_its_own_command(message: str, name: str, detail: str) -> None:
    told = {"ACCEL_RPT": 0.125, "BRAKE_RPT": 0.25, "STEERING_RPT_1": 0.5}
    following = sends((0, Outputs(0.125, 0.25, 0.5, 0.5)))
    made = with_system(bare(), message, told[message], told[message], 0)
    assert not doubts(following, made, S)
    made = with_system(bare(), message, 0.75, 0.75, 0)
    expected = f"{name}: commanded {detail}, reported 0.750"
    assert doubts(following, made, S) == [Found(Fault.NOT_FOLLOWING, expected, S)]


@pytest.mark.parametrize(
    ("pushed_mps", "value", "now_us", "frozen"),
    [
        (0.75, 1.0, S + 600_000, False),
        (0.75, 1.0, S + 600_001, True),
        (0.5, 1.0, 2 * S, False),
        (0.51, 1.0, 2 * S, True),
        (-0.75, 1.0, 2 * S, True),
        (-0.5, 1.0, 2 * S, False),
        # It should have set off.
        (0.75, 0.0, 2 * S, True),
        (1.5, 0.0, 2 * S, True),
        # It stands, and is held.
        (-0.75, 0.0, 2 * S, False),
        (-1.5, 0.25, 2 * S, False),
        (-1.5, 0.26, 2 * S, True),
        (0.25, 0.0, 2 * S, False),
    ],
)
def test_a_speed_is_frozen_that_commands_must_have_changed(
    pushed_mps: float, value: float, now_us: int, frozen: bool
) -> None:
    made = with_speed(bare(), value, S, S + 300_000)
    found = doubts(replace(sends(), pushed_mps=pushed_mps), made, now_us)
    detail = f"speed stays {value} m/s, {pushed_mps:.2f} m/s were commanded"
    assert found == ([Found(Fault.FROZEN, detail, now_us)] if frozen else [])


@pytest.mark.parametrize(("apart_us", "same_us"), [(S, 0), (0, S), (S, S)])
def test_a_wheel_is_frozen_where_it_stays_behind_and_its_report_stays(
    apart_us: int, same_us: int
) -> None:
    made = with_system(bare(), "STEERING_RPT_1", 0.0, 0.0, same_us)
    with_system(made, "STEERING_RPT_1", 0.0, 0.0, S + 100)
    following = replace(sends(), apart_us={"steering": apart_us})
    frozen = Found(Fault.FROZEN, "the steering's report stays the same", S + 600_000)
    assert frozen not in doubts(following, made, S + 600_000)
    assert frozen in doubts(following, made, S + 600_001)
    # One that is where it should be may stay; one that is not reported is no frozen one.
    assert not doubts(sends(), made, 9 * S)
    unseen = doubts(following, bare(), 9 * S)
    assert [each.fault for each in unseen] == [Fault.NOT_FOLLOWING]


@pytest.mark.parametrize(
    ("report_us", "value", "weak"),
    [
        # 0.125 s until it acts, 0.0625 s until it has built up, 0.03125 s for the report's age.
        (S + 1, 3.125, False),
        (S + 1, 3.13, True),
        (S + 218_750, 3.125, False),
        (S + 218_750, 3.13, True),
        # Then 2 m/s^2, and the report's error of 0.125 m/s.
        (S + 218_750 + 500_000, 2.12, False),
        (S + 218_750 + 500_000, 2.13, True),
        # In the end it stands.
        (9 * S, 0.37, False),
        (9 * S, 0.38, True),
    ],
)
def test_a_brake_is_weak_beyond_what_its_bounds_allow(
    report_us: int, value: float, weak: bool
) -> None:
    made = with_speed(bare(), value, report_us)
    following = replace(sends(), braking=(S, 3.0))
    found = doubts(following, made, report_us)
    assert [(each.fault, each.since_us) for each in found] == [(Fault.WEAK_BRAKE, report_us)] * weak
    assert not doubts(sends(), made, report_us)
    assert not doubts(following, bare(), report_us)


def test_a_brake_that_does_what_its_bounds_say_is_not_weak() -> None:
    made = with_speed(bare(), 2.5, S)
    braking = replace(sends(), braking=(S, 2.375))
    assert not doubts(braking, made, S)
    (weak,) = doubts(replace(braking, braking=(S, 2.25)), made, S)
    assert weak == Found(Fault.WEAK_BRAKE, "2.50 m/s, 2.25 m/s at most were expected", S)
