"""No contradiction is found within the bounds; wrong sensors and parameters give some."""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import Callable, Iterator

import pytest
from can_cases import plain_values
from onboard_sensors import (
    BOUNDS,
    OWN,
    PACMOD2,
    STEERING_RATIO,
    Frame,
    Scenario,
    Sender,
    SenderClock,
    localisation,
    pacmod2_reports,
    played,
)
from onboard_truth import GRID_US, CarState

from workbench.runtime.onboard.cross_checks import Check, Contradiction, contradictions
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.onboard.set_streams import SetSeen
from workbench.runtime.protocols import Refusal, decode, encode, load_protocol

PACMOD3 = load_protocol("pacmod3")
UNTIL_US = 3_000_000


def found_in(
    frames: list[Frame], settings: SensorBounds, *, vehicle: str = "pacmod2"
) -> Iterator[tuple[int, Contradiction]]:
    """Every contradiction, asked for whenever a localisation has come."""
    intake = Intake(load_protocol(vehicle), OWN, stamps=settings.stamps)
    last = None
    for now_us in played(frames, intake.receive, steps_us=range(0, UNTIL_US, GRID_US)):
        place = intake.localisation
        if isinstance(place, SetSeen) and place is not last:
            last = place
            for each in contradictions(intake, settings, moved_m=0.05, yaw_rate_error_radps=0.02):
                yield now_us, each


def changed(frames: list[Frame], identifier: int, change: Callable[[float], float]) -> list[Frame]:
    """Frames of one PACMod 2 report with its quantity changed."""
    signal = {0x6F: "VEHICLE_SPEED", 0x6E: "OUTPUT_VALUE"}[identifier]
    return [
        _changed(frame, signal, change) if frame[1] == identifier else frame for frame in frames
    ]


def _changed(frame: Frame, signal: str, change: Callable[[float], float]) -> Frame:
    decoded = decode(PACMOD2, frame[1], frame[2])
    assert not isinstance(decoded, Refusal)
    values = {**decoded.values, signal: change(decoded.values[signal])}
    data = encode(PACMOD2, decoded.message, values)
    assert isinstance(data, bytes)
    return frame[0], frame[1], data


def test_within_the_bounds_nothing_contradicts() -> None:
    for seed in range(25):
        assert not list(found_in(Scenario(seed).frames(UNTIL_US), BOUNDS)), seed


def steered(angle_rad: float) -> tuple[float, float]:
    """A published map with a precedence error: 100 degrees of steering wheel give -117.5."""
    degrees = math.degrees(angle_rad)
    wrong = math.radians(-0.1084 * degrees**2 / 1000.0 + 21.775 * degrees / -18.0)
    return min(max(wrong, -0.6), 0.6), min(max(wrong, -0.6), 0.6)


@pytest.mark.parametrize(
    ("checks", "identifier", "change", "wrong"),
    [
        ({Check.SPEED, Check.WAY}, 0x6F, lambda v: 2.23694 * v, {}),
        ({Check.SPEED, Check.WAY}, 0x6F, lambda v: 0.44704 * v, {}),
        ({Check.TURN, Check.WAY}, 0x6E, lambda angle: -angle, {}),
        ({Check.TURN, Check.WAY}, 0x6F, lambda v: v, {"wheelbase_m": (2.40, 2.50)}),
        ({Check.TURN, Check.WAY}, 0x6F, lambda v: v, {"road_wheel": steered}),
        ({Check.CHANGE}, 0x6F, lambda v: v + (9.0 if v > 3.0 else 0.0), {}),
    ],
)
def test_a_wrong_unit_or_parameter_is_found(
    checks: set[Check],
    identifier: int,
    change: Callable[[float], float],
    wrong: dict[str, object],
) -> None:
    settings = dataclasses.replace(BOUNDS, **wrong)  # type: ignore[arg-type]
    seen: set[Check] = set()
    scenarios = 0
    for seed in range(10):
        frames = changed(Scenario(seed).frames(UNTIL_US), identifier, change)
        found = {each.check for _, each in found_in(frames, settings)}
        scenarios += bool(found & checks)
        seen |= found
    assert seen & checks
    # Who drives straight, or hardly at all, shows nothing.
    assert scenarios >= 3, (scenarios, seen)


def test_a_localisation_that_stays_the_same_is_found() -> None:
    """Counter and stamp live on, the pose does not, and its radius hides the way for a while."""
    world = Scenario(3)
    sets, frames = 0, []
    still: dict[int, bytes] = {}
    for arrival, identifier, data in world.frames(UNTIL_US):
        if identifier in (0x6C1, 0x6C2, 0x6C3):
            data = _renumbered(still.setdefault(identifier, data), data)
            sets += 1
        frames.append((arrival, identifier, data))
    assert sets > 20
    found = list(found_in(frames, BOUNDS))
    assert Check.FROZEN in {each.check for _, each in found}


def _renumbered(old: bytes, new: bytes) -> bytes:
    """The old frame with the new one's SET."""
    message = next(m for m in OWN.by_id.values() if _is(m.frame_id, old) and _is(m.frame_id, new))
    before, now = decode(OWN, message.frame_id, old), decode(OWN, message.frame_id, new)
    assert not isinstance(before, Refusal)
    assert not isinstance(now, Refusal)
    values = {k: v for k, v in before.values.items() if k != "CRC"} | {"SET": now.values["SET"]}
    data = encode(OWN, message.name, values)
    assert isinstance(data, bytes)
    return data


def _is(identifier: int, data: bytes) -> bool:
    return not isinstance(decode(OWN, identifier, data), Refusal)


@pytest.mark.parametrize("error_radps", [0.0, 0.015, 0.2, -0.2])
def test_a_yaw_rate_that_the_bicycle_does_not_give_is_found(error_radps: float) -> None:
    speed, wheel = 3.0, 4.0
    rate = speed * math.tan(wheel / STEERING_RATIO) / 1.75
    intake = Intake(PACMOD3, OWN, stamps=BOUNDS.stamps)
    car = CarState(0.0, 0.0, 0.0, speed, wheel / STEERING_RATIO)
    local = Sender(random.Random(1), SenderClock(-(10**6), 0.0), BOUNDS.stamps.delay_us)
    frames = [*localisation(local, car, 50_000, radii=(0.1,) * 4, errors=(0.0,) * 4)]
    for at_us in range(0, 150_000, 10_000):
        frames += [(at_us, identifier, data) for identifier, data in pacmod3_reports(
            speed_mps=speed, wheel_rad=wheel, yaw_radps=rate + error_radps
        )]  # fmt: skip
    for frame in sorted(frames):
        intake.receive(frame[1], frame[2], frame[0])
    found = contradictions(intake, BOUNDS, moved_m=0.05, yaw_rate_error_radps=0.02)
    assert {each.check for each in found} == ({Check.YAW_RATE} if abs(error_radps) > 0.1 else set())


def pacmod3_reports(
    *, speed_mps: float, wheel_rad: float, yaw_radps: float
) -> Iterator[tuple[int, bytes]]:
    for name, values in (
        ("VEHICLE_SPEED_RPT", {"VEHICLE_SPEED": speed_mps}),
        ("STEERING_RPT", {"OUTPUT_VALUE": wheel_rad}),
        ("ANG_VEL_RPT", {"YAW_VEL": round(yaw_radps, 3)}),
    ):
        message = PACMOD3.by_name[name]
        data = encode(PACMOD3, name, plain_values(message, values))
        assert isinstance(data, bytes)
        yield message.frame_id, data


def test_without_a_localisation_or_a_usable_angle_nothing_is_compared() -> None:
    intake = Intake(PACMOD2, OWN, stamps=BOUNDS.stamps)
    assert contradictions(intake, BOUNDS, moved_m=0.05, yaw_rate_error_radps=0.02) == ()
    for frame in Scenario(1).frames(1_000_000):
        intake.receive(frame[1], frame[2], frame[0])
    for identifier, data in pacmod2_reports(speed_mps=1.0, wheel_rad=30.0):
        intake.receive(identifier, data, 1_100_000)
    assert contradictions(intake, BOUNDS, moved_m=0.05, yaw_rate_error_radps=0.02) == ()
