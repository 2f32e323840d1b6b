"""Every command is worked out by hand, and counts as covered up to the very edge of its bounds."""

from __future__ import annotations

import dataclasses
import math

import pytest

from workbench.runtime.onboard import actuation
from workbench.runtime.onboard.actuation import (
    Actuated,
    DriveByWire,
    Outputs,
    Pedals,
    Sent,
    Steering,
    Wanted,
    actuate,
    brake_outputs,
    guarded,
    held,
    resting,
)
from workbench.runtime.onboard.curve import Curve

_ROAD = (-0.75, -0.25, 0.25, 0.75)
# All figures but a count are sums of a few powers of two, so that what is expected is exact: at a
# rate u a lead of |u| / 16 + 9 / 128 rad is needed.
DBW = DriveByWire(
    protocol="pacmod2",
    turn_s=0.0625,
    speed_error_mps=0.0,
    stop_speed_mps=0.25,
    steering=Steering(
        road_wheel=Curve((-8.0, -4.0, 4.0, 8.0), _ROAD, _ROAD),
        angle_limit_rad=0.5,
        rate_limit_radps=0.25,
        slew_radps2=2.0,
        wheel_limit_rad=7.0,
        wheel_rate_limit_radps=4.5,
        wheel_rate_floor_radps=0.5,
        lead_s=0.5,
        dead_band_rad=0.5 - 0.0005,
        rate_error=0.0,
        delay_s=(0.0, 0.0),
        build_up_s=(0.0, 0.0),
        report_error_rad=0.0,
        report_age_s=0.0,
        withheld_radps=0.0625,
    ),
    pedals=Pedals(
        accelerator=Curve((0.25, 0.75), (0.0, 2.0), (0.0, 2.0)),
        brake=Curve((0.0, 1.0), (0.0, 8.0), (0.0, 8.0)),
        accel_min_mps2=-0.75,
        accel_max_mps2=0.75,
        slew_mps3=4.0,
        coast_below_mps2=0.125,
        coast_mps2=(0.0, 0.0),
        accelerator_limit=0.5,
        brake_limit=0.75,
        brake_profile=0.3125,
        delay_s=(0.0, 0.0),
        build_up_s=(0.0, 0.0),
        withheld_mps2=0.25,
    ),
)
SEND_S = 0.008


def before(acceleration: float = 0.0, rate: float = 0.0) -> Sent:
    return Sent(Wanted(acceleration, rate), Outputs(0.0, 0.125, 1.0, 2.0), 3.0)


def tracked(
    wanted: Wanted, last: Sent, *, at_rad: float = 0.0, elapsed_s: float = 0.03125,
    made_s: float = 0.0,
) -> Actuated:  # fmt: skip
    return actuate(
        DBW, wanted, read_back_rad=at_rad, before=last, elapsed_s=elapsed_s, made_s=made_s
    )


def braked(
    rate: float, last: Sent, *, at_rad: float = 0.0, elapsed_s: float = 0.03125, made_s: float = 0.0
) -> Actuated:
    return brake_outputs(
        DBW, rate, read_back_rad=at_rad, before=last, elapsed_s=elapsed_s, made_s=made_s
    )


def wheel_for(road_rad: float) -> float:
    """The inverse of the map, by hand."""
    size = abs(road_rad)
    return math.copysign(16.0 * size if size <= 0.25 else 4.0 + 8.0 * (size - 0.25), road_rad)


@pytest.mark.parametrize(
    ("acceleration", "pedals"),
    [(0.75, (0.4375, 0.0)), (0.5, (0.375, 0.0)), (0.125, (0.28125, 0.0)), (0.1249, (0.0, 0.0)),
     (0.0, (0.0, 0.0)), (-0.1249, (0.0, 0.0)), (-0.125, (0.0, 0.015625)), (-0.5, (0.0, 0.0625)),
     (-0.75, (0.0, 0.09375))],
)  # fmt: skip
def test_each_acceleration_has_its_pedal(
    acceleration: float, pedals: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    raw = spied(monkeypatch)
    out = tracked(Wanted(acceleration, 0.0), before(acceleration))
    assert (out.sent.outputs.accelerator, out.sent.outputs.brake) == pedals
    assert out.fault == ""
    # The last stage had nothing to mend.
    assert [(each.accelerator, each.brake) for each in raw] == [pedals]


def spied(monkeypatch: pytest.MonkeyPatch) -> list[Outputs]:
    """What comes to the last stage from now on."""
    came = []

    def spy(dbw: DriveByWire, raw: Outputs, last: Outputs) -> Outputs:
        came.append(raw)
        return guarded(dbw, raw, last)

    monkeypatch.setattr(actuation, "guarded", spy)
    return came


def test_a_brake_lets_the_accelerator_go_before_the_last_stage(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    raw = spied(monkeypatch)
    for out in (braked(0.0, before()), held(DBW, before()), braked(9.0, before())):
        assert (out.sent.outputs.accelerator, out.sent.outputs.brake) == (0.0, 0.3125)
    assert [(each.accelerator, each.brake) for each in raw] == [(0.0, 0.3125)] * 3


@pytest.mark.parametrize(
    ("road_rad", "rate", "target_rad", "wheel_rate", "covered"),
    [
        (0.0, 0.25, 0.125, 4.0, True),
        (0.0, -0.25, -0.125, 4.0, True),
        (0.375, 0.25, 0.5, 2.0, True),
        # Cut at the limit, with exactly the lead that is needed, and with less.
        (0.4140625, 0.25, 0.5, 2.0, True),
        (-0.4140625, -0.25, -0.5, 2.0, True),
        (0.46875, 0.25, 0.5, 2.0, False),
        (-0.46875, -0.25, -0.5, 2.0, False),
        # Not cut: the bound counts on a lead as short as this.
        (0.46875, 0.0625, 0.5, 0.5, True),
        (0.0, 0.0625, 0.03125, 1.0, True),
        (0.0, 0.0, 0.0, 0.5, True),
    ],
)
def test_the_wheel_goes_ahead_of_the_road_wheels(
    road_rad: float, rate: float, target_rad: float, wheel_rate: float, covered: bool
) -> None:
    assert DBW.steering.needed_lead_rad(0.25, DBW.turn_s) == 0.0859375
    at_rad, last = wheel_for(road_rad), before(0.0, rate)
    hold_rad = wheel_for(min(max(road_rad + rate * 0.0625, -0.5), 0.5))
    for out, brake in (
        (tracked(Wanted(0.0, rate), last, at_rad=at_rad), 0.0),
        (braked(rate, last, at_rad=at_rad), 0.3125),
    ):
        outputs = Outputs(0.0, brake, wheel_for(target_rad), wheel_rate)
        sent = Sent(Wanted(0.0, rate), outputs, hold_rad)
        assert out == Actuated(sent, Wanted(0.0, 0.0), covered, "")


@pytest.mark.parametrize(
    ("elapsed_s", "share"), [(0.0, 0.0), (0.03125, 0.5), (0.0625, 1.0), (1.0, 1.0)]
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_commands_change_by_their_slew_and_no_more(
    elapsed_s: float, share: float, sign: float
) -> None:
    wanted = Wanted(0.75 * sign, 0.25 * sign)
    out = tracked(wanted, before(), elapsed_s=elapsed_s)
    assert out.sent.command == Wanted(0.25 * share * sign, 0.125 * share * sign)
    assert out.withheld == Wanted(0.75 - 0.25 * share, 0.25 - 0.125 * share)
    out = braked(0.25 * sign, before(0.5, 0.0), elapsed_s=elapsed_s)
    assert out.sent.command == Wanted(0.0, 0.125 * share * sign)
    assert out.withheld == Wanted(0.0, 0.25 - 0.125 * share)


@pytest.mark.parametrize(
    ("acceleration", "rate", "covered"),
    [(0.375, 0.0, True), (0.376, 0.0, False), (0.0, 0.125, True), (0.0, 0.126, False),
     (0.375, 0.125, True), (0.376, 0.126, False), (-0.375, -0.125, True)],
)  # fmt: skip
def test_a_turn_is_covered_while_no_more_is_withheld_than_granted(
    acceleration: float, rate: float, covered: bool
) -> None:
    # Half a turn lets 0.125 m/s^2 and 0.0625 rad/s through.
    assert tracked(Wanted(acceleration, rate), before()).covered is covered
    if acceleration == 0.0:
        assert braked(rate, before()).covered is covered


@pytest.mark.parametrize("made_s", [0.0, 0.015625])
@pytest.mark.parametrize("road_rad", [0.0, 0.46875])
def test_a_turn_is_covered_while_its_frames_are_out_in_time(made_s: float, road_rad: float) -> None:
    last, at_rad = before(0.0, 0.25), wheel_for(road_rad)
    most_s = DBW.turn_s - SEND_S - made_s
    while most_s + made_s + SEND_S > DBW.turn_s:
        most_s = math.nextafter(most_s, 0.0)
    assert most_s + made_s + SEND_S == DBW.turn_s
    for elapsed_s, in_time in ((most_s, True), (most_s + 1e-9, False), (0.0, True)):
        outs = (
            tracked(Wanted(0.0, 0.25), last, at_rad=at_rad, elapsed_s=elapsed_s, made_s=made_s),
            braked(0.25, last, at_rad=at_rad, elapsed_s=elapsed_s, made_s=made_s),
        )
        assert [out.covered for out in outs] == [in_time and road_rad == 0.0] * 2


def test_frames_are_made_at_the_begin_of_the_turn_if_not_said() -> None:
    last, most_s = before(), DBW.turn_s - SEND_S
    for elapsed_s, in_time in ((most_s, True), (most_s + 1e-9, False)):
        free = Wanted(0.0, 0.0)
        out = actuate(DBW, free, read_back_rad=0.0, before=last, elapsed_s=elapsed_s)
        assert out.covered is in_time
        out = brake_outputs(DBW, 0.0, read_back_rad=0.0, before=last, elapsed_s=elapsed_s)
        assert out.covered is in_time


@pytest.mark.parametrize(
    ("acceleration", "rate", "at_rad", "elapsed_s", "fault"),
    [
        (0.75, 0.25, 7.0, 0.0, ""),
        (-0.75, -0.25, -7.0, 1e300, ""),
        (0.7501, 0.0, 0.0, 0.03, "acceleration 0.7501 m/s^2 out of range"),
        (-0.7501, 0.0, 0.0, 0.03, "acceleration -0.7501 m/s^2 out of range"),
        (0.0, 0.2501, 0.0, 0.03, "steering rate 0.2501 rad/s out of range"),
        (0.0, -0.2501, 0.0, 0.03, "steering rate -0.2501 rad/s out of range"),
        (0.0, 0.0, 7.001, 0.03, "steering wheel reported at 7.001 rad, out of range"),
        (0.0, 0.0, -7.001, 0.03, "steering wheel reported at -7.001 rad, out of range"),
        (0.0, 0.0, 0.0, -0.5, "-0.5 s since the last turn"),
        (0.0, 0.0, 0.0, math.inf, "inf s since the last turn"),
        (0.0, 0.0, 0.0, math.nan, "nan s since the last turn"),
    ],
)
def test_what_is_asked_is_refused_from_the_edge_of_its_range_on(
    acceleration: float, rate: float, at_rad: float, elapsed_s: float, fault: str
) -> None:
    outs = [tracked(Wanted(acceleration, rate), before(), at_rad=at_rad, elapsed_s=elapsed_s)]
    if acceleration == 0.0 or not fault:
        outs.append(braked(rate, before(), at_rad=at_rad, elapsed_s=elapsed_s))
    for out in outs:
        assert out.fault == fault
        if fault:
            # The brake profile, at the angle held and as fast as the wheel was told last.
            sent = Sent(Wanted(0.0, 0.0), Outputs(0.0, 0.3125, 3.0, 2.0), 3.0)
            assert out == Actuated(sent, Wanted(0.0, 0.0), False, fault)


@pytest.mark.parametrize(("rate", "sent"), [(2.0, 2.0), (-2.0, 2.0), (0.25, 0.5), (9.0, 4.5)])
def test_a_wheel_that_is_held_moves_there_as_fast_as_before(rate: float, sent: float) -> None:
    last = dataclasses.replace(before(0.5, 0.25), outputs=Outputs(0.4, 0.0, 1.0, rate))
    held_at = Sent(Wanted(0.0, 0.0), Outputs(0.0, 0.3125, 3.0, sent), 3.0)
    assert held(DBW, last) == Actuated(held_at, Wanted(0.0, 0.0), True, "")


@pytest.mark.parametrize("at_rad", [-7.0, 0.0, 7.0])
def test_taking_over_moves_nothing(at_rad: float) -> None:
    outputs = Outputs(0.0, 0.0, at_rad, 0.5)
    assert resting(DBW, at_rad) == Sent(Wanted(0.0, 0.0), outputs, at_rad)
    for beyond in (math.nextafter(7.0, 8.0), -7.001, math.nan, math.inf):
        assert resting(DBW, beyond) is None


PROFILE = (0.0, 0.3125)


@pytest.mark.parametrize(
    ("raw", "leaves"),
    [
        ((0.25, 0.0, 2.0, 1.0), (0.25, 0.0, 2.0, 1.0)),
        ((0.0, 0.25, -2.0, 1.0), (0.0, 0.25, -2.0, 1.0)),
        ((0.5, 0.0, 7.0, 4.5), (0.5, 0.0, 7.0, 4.5)),
        ((0.0, 0.75, -7.0, 0.5), (0.0, 0.75, -7.0, 0.5)),
        # Each beyond its limits.
        ((0.51, 0.0, 7.1, 4.6), (0.5, 0.0, 7.0, 4.5)),
        ((0.0, 0.76, -7.1, 0.4), (0.0, 0.75, -7.0, 0.5)),
        ((-0.25, -2.0, 0.0, -1.0), (0.0, 0.0, 0.0, 0.5)),
        ((-2.0, 0.25, 0.0, 1.0), (0.0, 0.25, 0.0, 1.0)),
        # Both pedals, however little.
        ((0.001, 0.001, 2.0, 1.0), (*PROFILE, 2.0, 1.0)),
        ((2.0, 2.0, 2.0, 1.0), (*PROFILE, 2.0, 1.0)),
        # Not a number.
        ((math.nan, 0.0, 2.0, 1.0), (*PROFILE, 2.0, 1.0)),
        ((0.0, math.inf, 2.0, 1.0), (*PROFILE, 2.0, 1.0)),
        ((0.25, 0.0, math.nan, 1.0), (*PROFILE, 6.0, 1.0)),
        ((0.25, 0.0, -math.inf, 9.0), (*PROFILE, 6.0, 4.5)),
        ((0.25, 0.0, 2.0, math.nan), (*PROFILE, 2.0, 0.5)),
        ((0.25, 0.0, 2.0, math.inf), (*PROFILE, 2.0, 0.5)),
    ],
)
def test_the_last_stage_changes_what_is_beyond_limits_and_nothing_else(
    raw: tuple[float, float, float, float], leaves: tuple[float, float, float, float]
) -> None:
    assert guarded(DBW, Outputs(*raw), Outputs(0.1, 0.0, 6.0, 3.0)) == Outputs(*leaves)
