"""Maps and their inverses fit, and whatever is asked, what is sent is within limits: one pedal."""

from __future__ import annotations

import dataclasses
import math

import pytest
from actuation_cases import sent_after, shipped, started
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.errors import InputError
from workbench.runtime.onboard.actuation import (
    Actuated,
    Outputs,
    Wanted,
    actuate,
    brake_outputs,
    guarded,
    held,
    resting,
)
from workbench.runtime.onboard.curve import Curve

_ANY = st.floats(allow_nan=True, allow_infinity=True, allow_subnormal=True) | st.sampled_from(
    [0.0, -0.0, 5e-324, -5e-324, math.nan, math.inf, -math.inf, 1.7e308]
)
_SENSIBLE = st.floats(-0.2, 0.2)


def _within_limits(outputs: Outputs) -> bool:
    dbw = shipped()
    steering, pedals = dbw.steering, dbw.pedals
    return (
        0.0 <= outputs.accelerator <= pedals.accelerator_limit
        and 0.0 <= outputs.brake <= pedals.brake_limit
        and (outputs.accelerator == 0.0 or outputs.brake == 0.0)
        and abs(outputs.wheel_rad) <= steering.wheel_limit_rad
        and steering.wheel_rate_floor_radps
        <= outputs.wheel_rate_radps
        <= steering.wheel_rate_limit_radps
    )


def _brakes(actuated: Actuated) -> bool:
    outputs = actuated.sent.outputs
    return outputs.accelerator == 0.0 and outputs.brake == shipped().pedals.brake_profile


@st.composite
def curves(draw: st.DrawFn) -> Curve:
    count = draw(st.integers(2, 6))
    steps = st.lists(st.floats(1e-3, 10.0), min_size=count, max_size=count)
    command, middle = draw(st.floats(-5.0, 5.0)), draw(st.floats(-5.0, 5.0))
    commands, middles = [], []
    for run, rise in zip(draw(steps), draw(steps), strict=True):
        command, middle = command + run, middle + rise
        commands.append(command)
        middles.append(middle)
    error = draw(st.floats(0.0, 2.0))
    return Curve(
        tuple(commands), tuple(m - error for m in middles), tuple(m + error for m in middles)
    )


@settings(max_examples=200, deadline=None)
@given(curves(), st.floats(0.0, 1.0))
def test_map_and_inverse_bracket_each_other(curve: Curve, share: float) -> None:
    first, last = curve.commands
    command = min(first + share * (last - first), last)
    aimed = curve.middle(command)
    low, high = curve.at(command)
    assert low <= aimed <= high
    assert curve.command_for(aimed) == pytest.approx(command, abs=1e-7 * (1.0 + abs(command)))
    low, high = curve.at(curve.command_for(aimed))
    assert low <= aimed <= high
    assert curve.effect((first, last))[0] <= low <= high <= curve.effect((first, last))[1]


@given(curves(), st.floats(1e-9, 1e9))
def test_beyond_its_nodes_a_map_knows_nothing(curve: Curve, beyond: float) -> None:
    first, last = curve.commands
    for command in (first - beyond, last + beyond, math.nan, math.inf, -math.inf):
        if first <= command <= last:
            continue
        assert math.isnan(curve.middle(command))
        assert math.isnan(curve.slope(command))
        assert any(map(math.isnan, curve.at(command)))
    for effect in (curve.middles[0] - beyond, curve.middles[-1] + beyond, math.nan):
        inside = curve.middles[0] <= effect <= curve.middles[-1]
        assert inside or math.isnan(curve.command_for(effect))


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (((0.0,), (0.0,), (0.0,)), "n >= 2 nodes"),
        (((0.0, 1.0), (0.0,), (0.0, 1.0)), "n >= 2 nodes"),
        (((0.0, math.nan), (0.0, 1.0), (0.0, 1.0)), "finite nodes"),
        (((0.0, 0.0), (0.0, 1.0), (0.0, 1.0)), "command goes from 0.0 to 0.0 at node 1"),
        (((0.0, 1.0), (0.0, 0.0), (1.0, 1.0)), "middle of lowest and highest goes"),
        (((0.0, 1.0), (0.0, -1.0), (1.0, 4.0)), "lowest goes"),
        (((0.0, 1.0), (0.0, 4.0), (1.0, 0.5)), "highest goes"),
        (((0.0, 1.0), (2.0, 4.0), (1.0, 5.0)), "lowest <= highest"),
    ],
)
def test_a_map_that_is_none_is_refused(
    columns: tuple[tuple[float, ...], ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        Curve(*columns)


@settings(max_examples=300, deadline=None)
@given(_ANY, _ANY, _ANY, _ANY)
def test_the_last_stage_lets_nothing_else_through(
    accelerator: float, brake: float, wheel: float, rate: float
) -> None:
    raw, last = Outputs(accelerator, brake, wheel, rate), Outputs(0.1, 0.0, 3.0, 1.0)
    outputs = guarded(shipped(), raw, last)
    assert _within_limits(outputs)
    if not math.isfinite(wheel):
        assert outputs.wheel_rad == last.wheel_rad
    if (
        not all(map(math.isfinite, (accelerator, brake, wheel, rate)))
        or min(accelerator, brake) > 0
    ):
        assert (outputs.accelerator, outputs.brake) == (0.0, shipped().pedals.brake_profile)
    elif _within_limits(raw):
        assert outputs == raw


@settings(max_examples=300, deadline=None)
@given(_ANY, _ANY, _ANY, _ANY, st.booleans())
def test_whatever_is_asked_brakes_or_is_within_limits(
    acceleration: float, rate: float, read_back: float, elapsed: float, braking: bool
) -> None:
    dbw, before = shipped(), started()
    if braking:
        out = brake_outputs(dbw, rate, read_back_rad=read_back, before=before, elapsed_s=elapsed)
    else:
        wanted = Wanted(acceleration, rate)
        out = actuate(dbw, wanted, read_back_rad=read_back, before=before, elapsed_s=elapsed)
    assert _within_limits(out.sent.outputs)
    asked = (0.0 if braking else acceleration, rate, read_back, elapsed)
    limits = ((-2.0, 1.0), (-0.2, 0.2), (-10.98, 10.98), (0.0, 1.7976931348623157e308))
    sensible = all(low <= value <= high for value, (low, high) in zip(asked, limits, strict=True))
    assert bool(out.fault) != sensible
    if out.fault or braking:
        assert _brakes(out)
    if out.fault:
        assert out.sent.outputs.wheel_rad == before.hold_rad
        assert not out.covered


@pytest.mark.parametrize("elapsed", [math.inf, math.nan, -0.001, -math.inf])
def test_a_time_that_cannot_be_brakes(elapsed: float) -> None:
    wanted, before = Wanted(0.5, 0.1), started()
    for out in (
        actuate(shipped(), wanted, read_back_rad=0.0, before=before, elapsed_s=elapsed),
        brake_outputs(shipped(), 0.1, read_back_rad=0.0, before=before, elapsed_s=elapsed),
    ):
        assert "since the last turn" in out.fault
        assert _brakes(out)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.floats(-2, 1), _SENSIBLE, st.floats(-8, 8), st.floats(0, 0.1))))
def test_commands_never_outrun_their_slew(asked: list[tuple[float, float, float, float]]) -> None:
    dbw, before = shipped(), started()
    for acceleration, rate, read_back, elapsed in asked:
        wanted = Wanted(acceleration, rate)
        out = actuate(dbw, wanted, read_back_rad=read_back, before=before, elapsed_s=elapsed)
        moved, turned = (
            out.sent.command.acceleration_mps2 - before.command.acceleration_mps2,
            out.sent.command.steering_rate_radps - before.command.steering_rate_radps,
        )
        turn = min(elapsed, dbw.turn_s) + 1e-12
        assert abs(moved) <= dbw.pedals.slew_mps3 * turn
        assert abs(turned) <= dbw.steering.slew_radps2 * turn
        held_back = abs(acceleration - out.sent.command.acceleration_mps2)
        assert out.withheld.acceleration_mps2 == held_back
        kept_back = abs(rate - out.sent.command.steering_rate_radps)
        assert out.withheld.steering_rate_radps == kept_back
        assert not out.covered or (
            held_back <= 0.05 and kept_back <= 0.005 and elapsed + 0.008 <= dbw.turn_s
        )
        assert _within_limits(out.sent.outputs)
        before = out.sent


@pytest.mark.parametrize("acceleration", [-2.0, -0.5, -0.1, -0.05, 0.0, 0.05, 0.1, 0.5, 1.0])
def test_one_pedal_by_the_sign_and_none_in_the_dead_band(acceleration: float) -> None:
    outputs = sent_after(Wanted(acceleration, 0.0), turns=70).outputs
    assert (outputs.accelerator > 0.0) == (acceleration >= 0.1)
    assert (outputs.brake > 0.0) == (acceleration <= -0.1)
    if acceleration >= 0.1:
        assert outputs.accelerator == pytest.approx((acceleration + 2.3501) / 7.3454, abs=1e-4)
    if acceleration <= -0.1:
        assert outputs.brake == pytest.approx(-acceleration / 8.0)


@pytest.mark.parametrize("front_deg", [-34.0, -20.0, -7.3, 0.0, 4.7, 12.5, 30.0, 34.3])
def test_the_steering_map_is_the_published_polynomial(front_deg: float) -> None:
    wheel_deg = math.copysign(-0.1084 * front_deg**2 + 21.775 * abs(front_deg), front_deg)
    low, high = shipped().steering.road_wheel.at(math.radians(wheel_deg))
    assert low <= math.radians(front_deg) <= high
    assert high - low < 0.0021


def test_steering_to_the_left_turns_the_wheel_to_the_left_and_ahead_of_itself() -> None:
    for rate in (0.1, -0.1):
        before = sent_after(Wanted(0.0, rate), turns=20, read_back_rad=0.0)
        target = shipped().steering.road_wheel.middle(before.outputs.wheel_rad)
        assert target == pytest.approx(rate * shipped().steering.lead_s)
        assert before.outputs.wheel_rate_radps == pytest.approx(
            0.1 * math.radians(53.7645) / math.radians(2.5), rel=1e-3
        )
        held_at = shipped().steering.road_wheel.middle(before.hold_rad)
        assert held_at == pytest.approx(rate * shipped().turn_s)


def test_a_target_beyond_the_limit_is_cut_and_no_longer_covered() -> None:
    dbw = shipped()
    wheel = dbw.steering.road_wheel.command_for
    turning = Wanted(0.0, 0.2)
    for road_rad, covered in ((0.3, True), (0.45, True), (0.59, False)):
        before = sent_after(turning, turns=20, read_back_rad=wheel(road_rad))
        out = actuate(dbw, turning, read_back_rad=wheel(road_rad), before=before, elapsed_s=0.033)
        assert out.covered is covered
        target = dbw.steering.road_wheel.middle(out.sent.outputs.wheel_rad)
        assert target <= dbw.steering.angle_limit_rad + 1e-12
    back = actuate(
        dbw, Wanted(0.0, -0.19), read_back_rad=wheel(0.6), elapsed_s=0.033,
        before=sent_after(Wanted(0.0, -0.19), turns=20, read_back_rad=wheel(0.6)),
    )  # fmt: skip
    assert back.covered


def test_a_brake_without_a_path_keeps_the_last_valid_angle() -> None:
    before = sent_after(Wanted(0.5, 0.2), turns=30, read_back_rad=4.0)
    for _ in range(3):
        out = held(shipped(), before)
        assert out.covered
        assert not out.fault
        assert _brakes(out)
        assert out.sent.outputs.wheel_rad == before.hold_rad
        assert out.sent.command == Wanted(0.0, 0.0)
        before = out.sent
    assert before.hold_rad == pytest.approx(4.0, abs=0.25)


@given(_ANY)
def test_only_a_known_steering_wheel_can_be_taken_over(read_back: float) -> None:
    sent = resting(shipped(), read_back)
    assert (sent is None) == (not abs(read_back) <= 10.98)
    if sent is not None:
        assert (sent.outputs.accelerator, sent.outputs.brake) == (0.0, 0.0)
        assert sent.outputs.wheel_rad == read_back


@pytest.mark.parametrize(
    ("part", "changed", "message"),
    [
        ("steering", {"wheel_limit_rad": 9.0}, "wheel_limit_rad: expected an angle within"),
        ("steering", {"wheel_limit_rad": 11.5}, "wheel_limit_rad: expected an angle within"),
        ("steering", {"wheel_limit_rad": 12.5}, "wheel_limit_rad: expected a number > 0 and <= 12"),
        ("steering", {"angle_limit_rad": 0.62}, "wheel_limit_rad"),
        ("steering", {"wheel_rate_limit_radps": 4.0}, "wheel_rate_limit_radps, got"),
        ("steering", {"wheel_rate_floor_radps": 4.9}, "wheel_rate_floor_radps <="),
        ("steering", {"rate_error": 0.6}, "rate_error"),
        ("steering", {"delay_s": (0.1, 0.0)}, "delay_s"),
        ("steering", {"lead_s": math.nan}, "lead_s"),
        ("pedals", {"brake_profile": 0.9}, "brake_profile: expected at most brake_limit"),
        ("pedals", {"accelerator_limit": 0.4}, "accelerator: expected a map"),
        ("pedals", {"accel_max_mps2": 1.2}, "accelerator: expected a map"),
        ("pedals", {"brake_limit": 1.5}, "brake_limit"),
        ("pedals", {"brake_profile": 0.9999, "brake_limit": 1.0}, "reaches a count"),
        ("pedals", {"coast_mps2": (0.1, -0.1)}, "coast_mps2"),
        ("pedals", {"accel_min_mps2": 0.0}, "accel_min_mps2"),
        ("pedals", {"build_up_s": (0.0, math.inf)}, "build_up_s"),
        ("pedals", {"coast_below_mps2": 0.0}, "coast_below_mps2"),
    ],
)
def test_a_drive_by_wire_that_cannot_be_is_refused(
    part: str, changed: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        dataclasses.replace(getattr(shipped(), part), **changed)


def test_the_whole_is_checked_too() -> None:
    for changed, message in (
        ({"protocol": ""}, "protocol"), ({"turn_s": 0.0}, "turn_s"),
        ({"speed_error_mps": -0.1}, "speed_error_mps"), ({"stop_speed_mps": 0.0}, "stop_speed"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=message):
            dataclasses.replace(shipped(), **changed)
