"""The helm's integrals and its reference speed begin anew exactly where the proof's do."""

from __future__ import annotations

import math

import pytest
from onboard_core_bench import PACMOD2, framed
from onboard_core_cases import DRIVE_BY_WIRE, SETTINGS, bundle

from workbench.runtime.onboard.core import Mode
from workbench.runtime.onboard.gate import Upstream
from workbench.runtime.onboard.helm import Helm
from workbench.runtime.onboard.pid import Reading
from workbench.runtime.onboard.states import Order
from workbench.runtime.protocols import Decoded, decode

STOP_MPS = DRIVE_BY_WIRE.stop_speed_mps
RESTING_MS = -0.6 * 0.5 / 0.05
"""Of a car 0.5 m beside its path by the gains of these tests; more than is remembered."""
MOST_MS = 2.4


def reading(speed_mps: float, offset_m: float = 0.01) -> Reading:
    return Reading(offset_m, 0.0, 0.0, speed_mps, 0.0)


def helm(mode: Mode = Mode.DRIVE) -> Helm:
    return Helm(SETTINGS, bundle(0).manifest.parameters, upstream=None, mode=mode)


def told(
    made: Helm, order: Order, read: Reading | None = None, *, elapsed_s: float = 0.0
) -> tuple[object, ...]:
    return made.carry_out(order, read, read_back_rad=0.0, elapsed_s=elapsed_s)


def enabled() -> Helm:
    made = helm()
    told(made, Order.ENABLE)
    return made


def offset_ms(made: Helm) -> float:
    return made.integrals.offset[0]


def tracked() -> Helm:
    """One that tracks at 1 m/s, with both integrals away from 0."""
    made = enabled()
    told(made, Order.BRAKE, reading(1.0))
    made.follow(1.02)
    told(made, Order.TRACK, reading(1.0))
    made.elapse(0.5)
    assert made.fault == ""
    assert made.integrals.speed[0] == pytest.approx(0.5 * 0.02)
    assert offset_ms(made) == pytest.approx(0.5 * 0.01)
    return made


def test_the_speed_s_integral_begins_anew_with_every_switch_and_only_then() -> None:
    made = tracked()
    before = made.integrals
    told(made, Order.TRACK, reading(1.0))
    assert made.integrals.speed == before.speed
    told(made, Order.BRAKE, reading(1.0))
    assert made.integrals.speed == (0.0, 0.0)
    assert made.integrals.offset == before.offset


def test_a_track_that_cannot_be_followed_is_a_switch_to_brake() -> None:
    made = tracked()
    frames = told(made, Order.TRACK)
    assert made.fault == "the control law gives no command here"
    assert made.integrals.speed == (0.0, 0.0)
    assert len(frames) == 4
    # Nothing is known of the offset, so that its integral stays.
    before = made.integrals
    made.elapse(0.5)
    assert made.integrals.offset == before.offset
    told(made, Order.BRAKE, reading(1.0))
    assert made.fault == ""


@pytest.mark.parametrize("order", [Order.SILENT, Order.DISABLE, Order.ENABLE])
def test_while_nothing_is_driven_nothing_is_remembered(order: Order) -> None:
    made = tracked()
    told(made, order)
    made.elapse(0.5)
    assert made.integrals.speed == made.integrals.offset == (0.0, 0.0)


def test_who_is_enabled_after_a_silence_rests_at_once() -> None:
    # Only a car that stands is armed.
    made = enabled()
    told(made, Order.BRAKE, reading(0.0))
    assert offset_ms(made) == pytest.approx(-0.6 * 0.01 / 0.05)
    told(made, Order.BRAKE, reading(0.0, offset_m=0.5))
    assert RESTING_MS < -MOST_MS
    assert offset_ms(made) == -MOST_MS


@pytest.mark.parametrize(
    ("turns", "speed_mps", "rests"),
    [(4, 0.0, True), (3, 0.0, False), (4, STOP_MPS, True), (9, STOP_MPS + 1e-9, False)],
)
def test_a_braked_car_rests_after_a_second_of_standing(
    turns: int, speed_mps: float, rests: bool
) -> None:
    made = tracked()
    for _ in range(turns):
        told(made, Order.BRAKE, reading(speed_mps, offset_m=0.02), elapsed_s=0.25)
    expected = -0.6 * 0.02 / 0.05 if rests else 0.5 * 0.01
    assert offset_ms(made) == pytest.approx(expected)


def test_a_second_of_standing_is_counted_anew_after_any_motion() -> None:
    made = tracked()
    before = offset_ms(made)
    for speed_mps in (0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0):
        told(made, Order.BRAKE, reading(speed_mps), elapsed_s=0.25)
        assert offset_ms(made) == before
    # Turns on which nothing is known do not count, in neither sense.
    told(made, Order.BRAKE, None, elapsed_s=0.25)
    assert offset_ms(made) == before
    told(made, Order.BRAKE, reading(0.0), elapsed_s=0.25)
    assert offset_ms(made) == pytest.approx(-0.6 * 0.01 / 0.05)


def test_a_second_of_standing_is_counted_anew_after_track() -> None:
    made = enabled()
    told(made, Order.BRAKE, reading(0.0), elapsed_s=0.25)
    before = offset_ms(made)
    told(made, Order.TRACK, reading(0.0))
    for _ in range(3):
        told(made, Order.BRAKE, reading(0.0, offset_m=0.02), elapsed_s=0.25)
        assert offset_ms(made) == before
    told(made, Order.BRAKE, reading(0.0, offset_m=0.02), elapsed_s=0.25)
    assert offset_ms(made) == pytest.approx(-0.6 * 0.02 / 0.05)


def test_a_helm_that_was_never_enabled_has_not_rested_either() -> None:
    made = helm()
    for _ in range(3):
        assert told(made, Order.BRAKE, reading(0.0), elapsed_s=0.25) == ()
        assert offset_ms(made) == 0.0
    told(made, Order.BRAKE, reading(0.0), elapsed_s=0.25)
    assert offset_ms(made) == pytest.approx(-0.6 * 0.01 / 0.05)


@pytest.mark.parametrize(("speed_mps", "begins_mps"), [(0.4, 0.4), (0.0, 0.0), (-0.3, 0.0)])
@pytest.mark.parametrize("elapsed_s", [0.0, 0.03, 5.0])
def test_the_reference_begins_at_the_speed_and_rises_by_a_turn_s_slew(
    speed_mps: float, begins_mps: float, elapsed_s: float
) -> None:
    made = enabled()
    told(made, Order.BRAKE, reading(speed_mps))
    made.elapse(elapsed_s)
    rise_mps = DRIVE_BY_WIRE.pedals.slew_mps3 / 1.0 * min(elapsed_s, DRIVE_BY_WIRE.turn_s)
    expected = pytest.approx(min(begins_mps + rise_mps, SETTINGS.reference_speed_mps))
    assert made.integrals.reference_speed_mps == expected
    # Neither an unknown speed nor TRACK begins anew.
    told(made, Order.BRAKE)
    made.elapse(elapsed_s)
    assert made.integrals.reference_speed_mps == expected
    told(made, Order.TRACK, reading(2.0))
    made.elapse(elapsed_s)
    assert made.integrals.reference_speed_mps == expected


def test_a_shadow_has_no_hands() -> None:
    made = helm(Mode.SHADOW)
    for order in Order:
        assert told(made, order, reading(1.0), elapsed_s=0.1) == ()
        made.elapse(0.1)
    assert made.integrals.reference_speed_mps == SETTINGS.reference_speed_mps
    assert (made.outputs, made.acceleration_mps2, made.fault) == (None, 0.0, "")


def test_nothing_is_asked_of_the_pedals_before_anything_was_driven() -> None:
    made = helm()
    assert (made.outputs, made.acceleration_mps2, made.fault) == (None, 0.0, "")
    assert made.integrals.reference_speed_mps == SETTINGS.reference_speed_mps
    assert told(made, Order.TRACK, reading(2.8)) == ()
    assert made.fault == "nothing is enabled"


@pytest.mark.parametrize(
    ("elapsed_s", "fault"),
    [
        (0.033, ""),
        (0.1, "what is sent stays behind by 0.000 m/s^2 and 0.000 rad/s"),
        (math.nan, "nan s since the last turn"),
    ],
)
def test_what_the_proof_does_not_cover_is_said_in_its_own_words(
    elapsed_s: float, fault: str
) -> None:
    made = enabled()
    told(made, Order.TRACK, reading(0.0), elapsed_s=elapsed_s)
    assert made.fault == fault


@pytest.mark.parametrize(
    ("order", "enable", "clear", "count"),
    [
        (Order.CLEAR_OVERRIDE, 0, 1, 1),
        (Order.ENABLE, 1, 0, 4),
        (Order.DISABLE, 0, 0, 1),
        (Order.BRAKE, 1, 0, 4),
        (Order.SILENT, None, None, 0),
    ],
)
def test_each_order_has_frames_of_its_own(
    order: Order, enable: int | None, clear: int | None, count: int
) -> None:
    frames = enabled().carry_out(order, reading(1.0), read_back_rad=0.0, elapsed_s=0.033)
    assert len(frames) == count
    if frames:
        flags = decode(PACMOD2, frames[-1].identifier, frames[-1].data)
        assert isinstance(flags, Decoded)
        expected = {"PACMOD_ENABLE": enable, "CLEAR_OVERRIDE": clear, "IGNORE_OVERRIDE": 0}
        assert flags.values == expected


def test_while_the_path_is_known_brake_steers_along_it_and_otherwise_holds() -> None:
    made = enabled()
    told(made, Order.BRAKE, reading(1.0, offset_m=0.5), elapsed_s=0.033)
    assert made.outputs is not None
    along_rad = made.outputs.wheel_rad
    assert along_rad < -0.05
    told(made, Order.BRAKE, None, elapsed_s=0.033)
    told(made, Order.BRAKE, None, elapsed_s=0.033)
    held = made.outputs
    told(made, Order.BRAKE, None, elapsed_s=0.033)
    assert made.outputs == held


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_upstream_asks_moves_the_command_by_the_whole_margin(side: float) -> None:
    upstream = Upstream(DRIVE_BY_WIRE)
    for name, values in (
        ("GLOBAL_CMD", {"PACMOD_ENABLE": 1, "CLEAR_OVERRIDE": 0, "IGNORE_OVERRIDE": 0}),
        ("ACCEL_CMD", {"ACCEL_CMD": max(side, 0.0)}),
        ("BRAKE_CMD", {"BRAKE_CMD": max(-side, 0.0)}),
        ("STEERING_CMD", {"POSITION_VALUE": 10.0 * side, "SPEED_LIMIT": 4.0}),
    ):
        upstream.receive(*framed(name, values), 0)
    parameters = bundle(0).manifest.parameters
    made = Helm(SETTINGS, parameters, upstream=upstream, mode=Mode.GATE)
    told(made, Order.ENABLE)
    made.follow(1.02)
    told(made, Order.TRACK, reading(1.0, offset_m=0.0), elapsed_s=0.033)
    # Our own law asks for 0.02 m/s^2.
    expected_mps2 = 0.02 + side * SETTINGS.gate.acceleration_mps2
    assert made.acceleration_mps2 == pytest.approx(expected_mps2)
    assert made.outputs is not None
    assert made.outputs.wheel_rad * side > 0.0
