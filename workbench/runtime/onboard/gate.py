"""An upstream controller's commands, and how much of them may pass: GATE."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, final

from workbench.runtime.onboard.actuation import Curve, DriveByWire, Wanted
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.protocols import Decoded, decode, load_protocol

_COMMANDS: Final = ("GLOBAL_CMD", "ACCEL_CMD", "BRAKE_CMD", "STEERING_CMD")


@final
class Upstream:
    """The last usable command of each kind, from the side of the bus where the upstream controller
    is; a frame that is refused counts as none. Only PACMod 2 is commanded."""

    def __init__(self, drive_by_wire: DriveByWire) -> None:
        self._dbw = drive_by_wire
        self._protocol = load_protocol(drive_by_wire.protocol)
        self._last: dict[str, tuple[int, Decoded]] = {}

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        """One frame from upstream; never raises."""
        frame = decode(self._protocol, identifier, data)
        if isinstance(frame, Decoded) and frame.message in _COMMANDS:
            self._last[frame.message] = (at_us, frame)

    def found(self, now_us: int, *, age_us: int) -> Iterator[Found]:
        """UPSTREAM_LOST and UPSTREAM_DISABLED. age_us: oldest command that counts."""
        for name in _COMMANDS:
            last_us = self._last[name][0] if name in self._last else 0
            if name not in self._last or now_us - last_us > age_us:
                detail = f"{name}: {now_us - last_us} us old" if name in self._last else name
                yield Found(Fault.UPSTREAM_LOST, detail, last_us + age_us)
        if "GLOBAL_CMD" in self._last:
            at_us, frame = self._last["GLOBAL_CMD"]
            if not frame.values["PACMOD_ENABLE"]:
                yield Found(Fault.UPSTREAM_DISABLED, "ENABLE is 0", at_us)

    def wanted(self, read_back_rad: float) -> Wanted:
        """What upstream asks for, by the middles of the vehicle's maps; NaN where it is unknown.

        A brake command goes before an accelerator's. Steering: the rate that brings the road wheels
        to the commanded angle within the lead of our own commands.
        """
        pedals, steering = self._dbw.pedals, self._dbw.steering
        accelerator, brake = self._value("ACCEL_CMD"), self._value("BRAKE_CMD")
        if brake > 0.0:
            acceleration = -_effect(pedals.brake, brake)
        else:
            acceleration = _effect(pedals.accelerator, accelerator)
        target = _clamped(self._value("STEERING_CMD", "POSITION_VALUE"), steering.wheel_limit_rad)
        road = steering.road_wheel
        rate = (road.middle(target) - road.middle(read_back_rad)) / steering.lead_s
        return Wanted(acceleration, rate)

    def _value(self, message: str, signal: str | None = None) -> float:
        _, frame = self._last[message]
        return frame.values[message if signal is None else signal]


def passed(wanted: Wanted, own: Wanted, margin: Wanted, dbw: DriveByWire) -> Wanted:
    """The nearest to `wanted` that the proof covers: within `margin` of our own command.

    own: what our law commands here; margin: the part of the tubes' disturbance that is left to
    upstream; never beyond what the proof lets TRACK command. A wanted value that is not finite
    gives our own.
    """
    acceleration = _within(
        wanted.acceleration_mps2, own.acceleration_mps2, margin.acceleration_mps2
    )
    rate = _within(wanted.steering_rate_radps, own.steering_rate_radps, margin.steering_rate_radps)
    limit = dbw.steering.rate_limit_radps
    return Wanted(
        min(max(acceleration, dbw.pedals.accel_min_mps2), dbw.pedals.accel_max_mps2),
        min(max(rate, -limit), limit),
    )


def _within(wanted: float, own: float, margin: float) -> float:
    # Comparisons with NaN are false: what is not a number becomes our own command.
    if not own - margin <= wanted:
        return own - margin if wanted < own else own
    return wanted if wanted <= own + margin else own + margin


def _clamped(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def _effect(curve: Curve, ratio: float) -> float:
    """What a pedal's ratio aims at; below the map nothing, above it as much as its end."""
    low, high = curve.commands
    return 0.0 if ratio < low else curve.middle(min(ratio, high))
