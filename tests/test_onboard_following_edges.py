"""What a vehicle has done with its commands is reckoned to the microsecond and the bit."""

from __future__ import annotations

from dataclasses import astuple, replace

import pytest
from onboard_following_cases import FREE, LIMITS, S, bare, sends, with_speed, with_system

from workbench.runtime.onboard.actuation import Outputs
from workbench.runtime.onboard.following import Following, reported
from workbench.runtime.onboard.report_names import Place, SystemPlaces


def test_a_signal_is_known_from_its_first_report_on() -> None:
    made, place = bare(), Place("VEHICLE_SPEED_RPT", "VEHICLE_SPEED")
    assert reported(made, place) is None
    assert reported(with_speed(made, 1.5, S), place) == 1.5


def test_silence_forgets_everything_and_is_how_it_begins() -> None:
    following = replace(sends(), apart_us={"brake": 1}, wheel=(1, 2.0), braking=(1, 2.0))
    assert following.silent() == Following()
    assert astuple(following.silent()) == ((), {}, None, 0.0, 0.0, 0.0, 0, None)


def commanded(following: Following, at_us: int, from_mps: float | None) -> Following:
    return following.commanding(at_us, FREE, acceleration_mps2=-2.0, brakes_from_mps=from_mps)


def test_a_brake_counts_from_its_first_turn_until_it_ends() -> None:
    first = commanded(Following(), 1, 3.0)
    assert first.braking == (1, 3.0)
    second = commanded(first, 2, 2.0)
    assert second.braking == (1, 3.0)
    third = commanded(second, 3, None)
    assert third.braking is None
    assert commanded(third, 4, 1.0).braking == (4, 1.0)


def test_the_last_32_turns_are_kept() -> None:
    following = Following()
    for at_us in range(40):
        following = commanded(following, at_us, None)
    assert following.sent == tuple((at_us, FREE) for at_us in range(8, 40))


@pytest.mark.parametrize(
    ("sent", "then_us", "now_us", "pushed_mps"),
    [(True, S, 2 * S, 4.0), (True, S, S + 250_000, 2.5), (True, S, S, 2.0), (True, S, 0, 2.0),
     (False, S, 2 * S, 0.0)],
)  # fmt: skip
def test_commands_add_up_over_the_time_that_they_hold(
    sent: bool, then_us: int, now_us: int, pushed_mps: float
) -> None:
    following = replace(
        sends() if sent else Following(), acceleration_mps2=2.0, pushed_mps=2.0, pushed_us=then_us
    )
    turn = following.commanding(now_us, FREE, acceleration_mps2=9.0, brakes_from_mps=None)
    assert (turn.acceleration_mps2, turn.pushed_mps, turn.pushed_us) == (9.0, pushed_mps, now_us)
    # A report that is the same as before changes nothing.
    made = with_speed(bare(), 1.0, 0, 1)
    looked = following.compared(made, LIMITS, now_us)
    assert (looked.acceleration_mps2, looked.pushed_mps) == (2.0, pushed_mps)
    assert (looked.pushed_us, looked.sent) == (now_us, following.sent)


@pytest.mark.parametrize(
    ("report_us", "pushed_us", "now_us", "pushed_mps"),
    [
        # Since the report, or since the last turn where that is later.
        (S, S // 2, S + 250_000, 0.5),
        (S // 2, S, S + 250_000, 0.5),
        (S, S, S, 0.0),
        (S, S, S - 250_000, 0.0),
        # Nothing reported: nothing to compare with.
        (None, S, S + 250_000, 0.0),
    ],
)
def test_a_new_speed_begins_anew(
    report_us: int | None, pushed_us: int, now_us: int, pushed_mps: float
) -> None:
    made = bare() if report_us is None else with_speed(bare(), 1.0, report_us)
    following = replace(sends(), acceleration_mps2=2.0, pushed_mps=7.0, pushed_us=pushed_us)
    assert following.compared(made, LIMITS, now_us).pushed_mps == pushed_mps


def turned(
    wheel: tuple[int, float] | None, target_rad: float, to_rad: float, now_us: int,
    *, behind_rad: float = 0.0,
) -> Following:  # fmt: skip
    """What a look finds once the wheel was told a target at 2 rad/s."""
    told = Outputs(0.0, 0.0, target_rad, 2.0)
    sent = ((0, FREE), (1, FREE), (2, told))
    made = with_system(bare(), "STEERING_RPT_1", 0.0, to_rad, 0)
    before = Following(sent=sent, wheel=wheel, behind_rad=behind_rad)
    return before.compared(made, LIMITS, now_us)


@pytest.mark.parametrize(
    ("target_rad", "to_rad", "kept_rad", "span_us", "behind_rad"),
    [
        # Due at 2 rad/s: half a radian in a quarter of a second, less where the target is nearer.
        (9.0, 1.0, 0.0, 250_000, 0.5),
        (9.0, 1.25, 0.0, 250_000, 0.25),
        (9.0, 2.0, 0.0, 250_000, -0.5),
        (-9.0, 1.0, 0.0, 250_000, -0.5),
        (-9.0, 0.5, 0.0, 250_000, 0.0),
        (1.25, 1.0, 0.0, 250_000, 0.25),
        (0.75, 1.0, 0.0, 250_000, -0.25),
        # What was behind fades within a second.
        (1.0, 1.0, 0.75, 250_000, 0.5625),
        (1.0, 1.0, 0.75, 1_000_000, 0.0),
        (1.0, 1.0, 0.75, 3_000_000, 0.0),
        # No time, or time that runs backwards: nothing was due.
        (9.0, 1.0, 0.75, 0, 0.75),
        (9.0, 1.0, 0.75, -250_000, 0.75),
    ],
)
def test_a_wheel_stays_behind_by_what_was_due_and_did_not_come(
    target_rad: float, to_rad: float, kept_rad: float, span_us: int, behind_rad: float
) -> None:
    found = turned((S, 1.0), target_rad, to_rad, S + span_us, behind_rad=kept_rad)
    assert found.behind_rad == behind_rad
    assert found.wheel == (S + span_us, to_rad)


def test_a_first_look_finds_no_wheel_behind() -> None:
    assert turned(None, 9.0, 1.0, S, behind_rad=3.0).behind_rad == 0.0
    made = with_system(bare(), "STEERING_RPT_1", 0.0, 1.0, 0)
    silent = Following(wheel=(0, 0.0), behind_rad=3.0)
    assert silent.compared(made, LIMITS, S).behind_rad == 0.0
    unseen = replace(sends(), wheel=(0, 0.0), behind_rad=3.0).compared(bare(), LIMITS, S)
    assert (unseen.behind_rad, unseen.wheel) == (0.0, None)


@pytest.mark.parametrize(
    ("message", "name"), [("ACCEL_RPT", "accelerator"), ("BRAKE_RPT", "brake")]
)
@pytest.mark.parametrize(
    ("commanded", "output", "apart"),
    [(0.25, 0.5, False), (0.5, 0.25, False), (0.25, 0.501, True), (0.501, 0.25, True),
     (0.5, 0.5, False)],
)  # fmt: skip
def test_a_pedal_is_apart_from_beyond_its_error_on(
    message: str, name: str, commanded: float, output: float, apart: bool
) -> None:
    made = with_system(bare(), message, commanded, output, S)
    assert sends().compared(made, LIMITS, S + 7).apart_us == ({name: S} if apart else {})
    # Since it began, and no longer once it is over.
    before = replace(sends(), apart_us={name: 5})
    assert before.compared(made, LIMITS, S + 7).apart_us == ({name: 5} if apart else {})


@pytest.mark.parametrize("target_rad", [9.0, -9.0])
@pytest.mark.parametrize(("span_us", "apart"), [(250_000, False), (250_001, True)])
def test_a_wheel_is_apart_by_what_it_stays_behind_and_nothing_else(
    target_rad: float, span_us: int, apart: bool
) -> None:
    found = turned((S, 1.0), target_rad, 1.0, S + span_us)
    assert found.apart_us == ({"steering": 0} if apart else {})


def test_what_is_apart_is_so_since_the_later_of_both_reports() -> None:
    for earlier, later in (("ACCEL_RPT", "BRAKE_RPT"), ("BRAKE_RPT", "ACCEL_RPT")):
        made = bare()
        # A vehicle that says in one message what was commanded, and in another what is put out.
        split = SystemPlaces(
            made.names.brake.manual,
            Place("BRAKE_RPT", "COMMANDED_VALUE"),
            Place("ACCEL_RPT", "OUTPUT_VALUE"),
        )
        made.names = replace(made.names, brake=split)
        with_system(made, earlier, 0.0, 0.0, S)
        assert sends().compared(made, LIMITS, S).apart_us == {}
        value = (0.75, 0.0) if later == "BRAKE_RPT" else (0.75, 0.75)
        with_system(made, later, *value, 2 * S)
        assert sends().compared(made, LIMITS, 2 * S).apart_us == {"brake": 2 * S}
