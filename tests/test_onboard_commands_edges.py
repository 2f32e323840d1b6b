"""A frame set lets one pedal go before it presses the other, and is in time to the microsecond."""

from __future__ import annotations

import pytest
from onboard_core_bench import PACMOD2
from onboard_core_cases import DRIVE_BY_WIRE

from workbench.runtime.onboard.commands import Commander, Frame
from workbench.runtime.onboard.times import SEND_US, seconds
from workbench.runtime.protocols import Decoded, decode

LAST_S = DRIVE_BY_WIRE.turn_s - seconds(SEND_US)
"""Latest begin of a turn whose frames are out in time, if making them takes no time."""


def enabled() -> Commander:
    commander = Commander(DRIVE_BY_WIRE)
    assert commander.enable(0.0)
    return commander


def names(frames: tuple[Frame, ...]) -> list[str]:
    return [PACMOD2.by_id[frame.identifier].name for frame in frames]


def ratio(frames: tuple[Frame, ...], name: str) -> float:
    frame = next(each for each in frames if PACMOD2.by_id[each.identifier].name == name)
    said = decode(PACMOD2, frame.identifier, frame.data)
    assert isinstance(said, Decoded)
    return said.values[name]


@pytest.mark.parametrize(
    ("acceleration_mps2", "pressed", "first"),
    [(1.0, "ACCEL_CMD", "BRAKE_CMD"), (0.25, "ACCEL_CMD", "BRAKE_CMD"),
     (-2.0, "BRAKE_CMD", "ACCEL_CMD"), (0.0, None, "ACCEL_CMD")],
)  # fmt: skip
def test_the_pedal_that_is_let_go_comes_first(
    acceleration_mps2: float, pressed: str | None, first: str
) -> None:
    commander = enabled()
    for _ in range(3):
        frames = commander.track(acceleration_mps2, 0.0, read_back_rad=0.0, elapsed_s=0.05)
    second = {"ACCEL_CMD": "BRAKE_CMD", "BRAKE_CMD": "ACCEL_CMD"}[first]
    assert names(frames) == [first, second, "STEERING_CMD", "GLOBAL_CMD"]
    for name in (first, second):
        assert (ratio(frames, name) > 0.0) is (name == pressed)
    # Whichever was pressed, BRAKE frees the accelerator before it brakes.
    braked = commander.brake(0.0, read_back_rad=0.0, elapsed_s=0.05)
    assert names(braked)[:2] == ["ACCEL_CMD", "BRAKE_CMD"]


@pytest.mark.parametrize("order", ["track", "brake"])
@pytest.mark.parametrize(
    ("elapsed_s", "made_s", "covered"),
    [(0.04, None, True), (LAST_S + 1e-6, None, False), (LAST_S - 0.004, 0.003, True),
     (LAST_S - 0.004, 0.005, False)],
)  # fmt: skip
def test_frames_that_take_no_time_to_make_are_in_time_to_the_last_instant(
    order: str, elapsed_s: float, made_s: float | None, covered: bool
) -> None:
    commander, made = enabled(), {} if made_s is None else {"made_s": made_s}
    if order == "track":
        frames = commander.track(0.0, 0.0, read_back_rad=0.0, elapsed_s=elapsed_s, **made)
    else:
        frames = commander.brake(0.0, read_back_rad=0.0, elapsed_s=elapsed_s, **made)
    assert frames
    assert commander.last is not None
    assert commander.last.covered is covered


def test_nothing_is_kept_of_what_was_sent_before_it_was_enabled_again() -> None:
    """Pedals free and the wheel where it is reported, whatever the last command was."""
    commander = enabled()
    for _ in range(3):
        commander.track(1.0, 0.2, read_back_rad=0.5, elapsed_s=0.05)
    assert names(commander.enable(0.25)) == ["ACCEL_CMD", "BRAKE_CMD", "STEERING_CMD", "GLOBAL_CMD"]
    assert commander.last is None
    held = commander.hold()
    assert (ratio(held, "ACCEL_CMD"), ratio(held, "BRAKE_CMD")) == (0.0, 0.45)
    assert commander.enable(float("nan")) == ()
    assert not commander.enabled
    assert commander.hold() == ()


def test_silence_is_no_frame_at_all_and_enables_nothing() -> None:
    commander = enabled()
    assert commander.silent() == ()
    assert not commander.enabled
    assert commander.give_up() == commander.hold() == ()
