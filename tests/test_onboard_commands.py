"""Every PACMod 2 frame set keeps the vehicle's rules, from whatever is asked in whatever order."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import pytest
from actuation_cases import shipped, values
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.errors import InputError
from workbench.runtime.onboard.commands import Commander, Frame

GLOBAL, ACCEL, BRAKE, STEERING = 0x69, 0x67, 0x6B, 0x6D
_ANY = st.floats() | st.floats(-12.0, 12.0) | st.floats(-0.2, 0.2)
_ACTS = (
    st.tuples(st.sampled_from(["silent", "clear_override", "give_up", "hold"]))
    | st.tuples(st.just("enable"), _ANY)
    | st.tuples(st.just("track"), _ANY, _ANY, _ANY, _ANY)
    | st.tuples(st.just("brake"), _ANY, _ANY, _ANY)
)


def _done(commander: Commander, act: tuple[str | float, ...]) -> tuple[Frame, ...]:
    name, *numbers = act
    named: dict[str, float] = {}
    if name in ("track", "brake"):
        named = {"read_back_rad": float(numbers[-2]), "elapsed_s": float(numbers[-1])}
        numbers = numbers[:-2]
    method: Callable[..., tuple[Frame, ...]] = getattr(commander, str(name))
    return method(*numbers, **named)


def _ready(read_back: float = 0.0) -> Commander:
    commander = Commander(shipped())
    commander.clear_override()
    assert commander.enable(read_back)
    return commander


@settings(max_examples=300, deadline=None)
@given(st.lists(_ACTS, max_size=12))
def test_rules_hold_in_any_order(acts: list[tuple[str | float, ...]]) -> None:
    commander, enabled, before = Commander(shipped()), False, "silent"
    for act in acts:
        frames = _done(commander, act)
        name = str(act[0])
        if not frames:
            assert name in ("silent", "enable") or not enabled
            enabled = enabled and name not in ("silent", "enable", "give_up")
            before = name
            continue
        said = values(frames)
        assert said["IGNORE_OVERRIDE"] == 0
        assert not (said["PACMOD_ENABLE"] and said["CLEAR_OVERRIDE"])
        if said["PACMOD_ENABLE"]:
            # The pedal that is let go comes first, and pedals before all else.
            pedals = [BRAKE, ACCEL] if said["ACCEL_CMD"] > 0.0 else [ACCEL, BRAKE]
            assert [frame.identifier for frame in frames] == [*pedals, STEERING, GLOBAL]
            assert said["ACCEL_CMD"] == 0.0 or said["BRAKE_CMD"] == 0.0
            assert said["ACCEL_CMD"] <= 0.48
            assert said["BRAKE_CMD"] <= 0.8
            assert abs(said["POSITION_VALUE"]) <= 10.98
            assert 0.05 <= said["SPEED_LIMIT"] <= 5.0
            assert enabled or name == "enable"
        else:
            assert [frame.identifier for frame in frames] == [GLOBAL]
            assert name in ("clear_override", "give_up")
            assert name != "give_up" or before != "give_up"
        if name == "enable":
            assert said["ACCEL_CMD"] == said["BRAKE_CMD"] == 0.0
        enabled = bool(said["PACMOD_ENABLE"])
        assert commander.enabled == enabled
        before = name


def test_clearing_and_enabling_are_two_sets() -> None:
    commander = Commander(shipped())
    cleared, enabled = values(commander.clear_override()), values(commander.enable(1.5))
    assert cleared == {"PACMOD_ENABLE": 0, "CLEAR_OVERRIDE": 1, "IGNORE_OVERRIDE": 0}
    assert (enabled["PACMOD_ENABLE"], enabled["CLEAR_OVERRIDE"]) == (1, 0)
    assert (enabled["ACCEL_CMD"], enabled["BRAKE_CMD"]) == (0.0, 0.0)
    assert enabled["POSITION_VALUE"] == 1.5


def test_yielding_says_so_once_and_then_nothing() -> None:
    commander = _ready()
    assert values(commander.give_up()) == {
        "PACMOD_ENABLE": 0, "CLEAR_OVERRIDE": 0, "IGNORE_OVERRIDE": 0,
    }  # fmt: skip
    for _ in range(3):
        assert commander.give_up() == commander.hold() == ()
        assert commander.track(0.5, 0.0, read_back_rad=0.0, elapsed_s=0.03) == ()
        assert commander.brake(0.0, read_back_rad=0.0, elapsed_s=0.03) == ()
    assert not commander.enabled
    assert commander.last is None


@pytest.mark.parametrize("read_back", [math.nan, math.inf, 11.5, -11.5])
def test_nothing_is_enabled_without_a_known_steering_wheel(read_back: float) -> None:
    commander = Commander(shipped())
    assert commander.enable(read_back) == ()
    assert not commander.enabled
    assert commander.hold() == ()


def test_tracking_presses_the_right_pedal_and_braking_the_brake() -> None:
    for acceleration, pedal in ((0.5, "ACCEL_CMD"), (-0.5, "BRAKE_CMD")):
        commander = _ready()
        for _ in range(20):
            said = values(commander.track(acceleration, 0.1, read_back_rad=0.0, elapsed_s=0.033))
        other = {"ACCEL_CMD", "BRAKE_CMD"} - {pedal}
        assert said[pedal] > 0.0
        assert said[other.pop()] == 0.0
        assert said["POSITION_VALUE"] > 0.0
        assert commander.last is not None
        assert commander.last.covered
        said = values(commander.brake(0.1, read_back_rad=0.0, elapsed_s=0.033))
        assert said["ACCEL_CMD"] == 0.0
        assert said["BRAKE_CMD"] == pytest.approx(0.312, abs=0.001)
        assert said["POSITION_VALUE"] > 0.0
        assert commander.enable(0.0)
        assert commander.last is None


@pytest.mark.parametrize("place", range(4))
def test_what_is_no_number_brakes_where_the_wheel_was(place: int) -> None:
    commander = _ready(2.0)
    for _ in range(5):
        commander.track(0.5, 0.1, read_back_rad=2.0, elapsed_s=0.033)
    assert commander.last is not None
    hold_rad = commander.last.sent.hold_rad
    asked = [0.5, 0.1, 2.0, 0.033]
    asked[place] = math.nan
    frames = commander.track(asked[0], asked[1], read_back_rad=asked[2], elapsed_s=asked[3])
    said = values(frames)
    assert said["ACCEL_CMD"] == 0.0
    assert said["BRAKE_CMD"] == pytest.approx(0.312, abs=0.001)
    assert said["POSITION_VALUE"] == pytest.approx(hold_rad, abs=0.001)
    assert commander.last.fault
    assert values(commander.hold())["POSITION_VALUE"] == said["POSITION_VALUE"]


def test_a_protocol_that_it_cannot_command_is_refused() -> None:
    other = dataclasses.replace(shipped(), protocol="pacmod3")
    with pytest.raises(InputError, match=r"commanded by pacmod2, got 'pacmod3'.*mode shadow"):
        Commander(other)
