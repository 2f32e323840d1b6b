"""TRACK, the paper's BRAKE and the vehicle's BRAKE.

Initial values at a switch: every mode starts with `speed_integral` = 0 (it is reset),
`VehicleBrake` with `brake_clock` = 0; all other states carry over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, final

import casadi as ca

from workbench.controllers.pid import Command, SpeedPid, require_finite
from workbench.controllers.symbols import Symbols, clip
from workbench.errors import InputError


@final
@dataclass(frozen=True, slots=True)
class Reading:
    """What a mode works with: readings of speed (m/s) and speed integral (m), and the PIDs."""

    speed: ca.SX
    speed_integral: ca.SX
    speed_pid: SpeedPid
    steering: Command


@final
@dataclass(frozen=True, slots=True)
class ModeAction:
    """What a mode does: both commands with their integrals' rates, and rates of further states."""

    acceleration: Command
    steering: Command
    further_rates: tuple[tuple[str, ca.SX], ...] = ()


class Mode(Protocol):
    """A driving mode of the closed loop."""

    def moving_speed(self, speed: ca.SX) -> ca.SX:
        """The speed (m/s) with which the car moves, from the state `speed`."""

    def act(self, symbols: Symbols, reading: Reading) -> ModeAction:
        """Acceleration and steering rate of this mode, from `reading`."""


@final
@dataclass(frozen=True, slots=True)
class Track:
    """Follow the path at `reference_speed_mps` (parameter `reference_speed`).

    change_mps: by how much the reference may differ from it at any time, as while it is ramped
    (disturbance `reference_speed_change`, which a decision kernel can be told the pace of, in
    `reference_ramp`); (0, 0): it is held, and there is no such disturbance.
    """

    reference_speed_mps: float
    change_mps: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        lower, upper = self.change_mps
        require_finite(
            "Track", reference_speed_mps=self.reference_speed_mps, change_lower_mps=lower,
            change_upper_mps=upper,
        )  # fmt: skip
        if not lower <= 0.0 <= upper:
            raise InputError(
                f"Track: expected change_mps as (lower <= 0, upper >= 0), got {self.change_mps!r}"
            )

    def moving_speed(self, speed: ca.SX) -> ca.SX:
        """The speed state itself."""
        return speed

    def act(self, symbols: Symbols, reading: Reading) -> ModeAction:
        """Speed PID to the reference; steering as the steering PID asks."""
        reference = symbols.parameter("reference_speed", "m/s", self.reference_speed_mps)
        lower, upper = self.change_mps
        if lower < upper:
            reference += symbols.disturbance(
                "reference_speed_change", "m/s", 0.0, lower=lower, upper=upper
            )
        acceleration = reading.speed_pid.command(
            symbols, reading.speed, reference=reference, integral=reading.speed_integral
        )
        return ModeAction(acceleration, reading.steering)


@final
@dataclass(frozen=True, slots=True)
class ReferenceZeroBrake:
    """The paper's BRAKE: TRACK with reference speed 0, for comparison only.

    Without an integral the speed decays like exp(-kp t) and never reaches 0; with one it goes below
    0, the car reverses. The integral gain is the speed PID's own.
    """

    def moving_speed(self, speed: ca.SX) -> ca.SX:
        """The speed state itself: it may become negative."""
        return speed

    def act(self, symbols: Symbols, reading: Reading) -> ModeAction:
        """Speed PID to zero speed; steering as the steering PID asks."""
        return Track(0.0).act(symbols, reading)


@final
@dataclass(frozen=True, slots=True)
class VehicleBrake:
    """The vehicle's own BRAKE, down to a standstill that lasts.

    With the clock c (state `brake_clock`, c' = 1, c(0) = 0) the share of braking in force is
    g = clip((c - delay) / build_up, 0, 1). The state `speed` is the raw speed q, q' = -g d, and the
    car moves with v = max(0, q); the deceleration d is any function of time in
    [deceleration_min_mps2, deceleration_max_mps2] (disturbance `brake_deceleration`). For constant
    d and q(0) >= d build_up / 2 the car stands from t = delay + build_up / 2 + q(0) / d on. Below
    stop_speed_mps the steering and its integral are frozen: both rates are scaled by clip(v /
    stop_speed - 1, 0, 1), a ramp between stop_speed and twice that, so that the field stays
    continuous. Before the delay has passed the car keeps its speed.

    delay_s and build_up_s may both be 0 (no clock state then); a delay without build-up would make
    the field jump and is refused with InputError, as are 0 >= deceleration_min and an empty
    interval.
    """

    deceleration_min_mps2: float
    deceleration_max_mps2: float
    delay_s: float
    build_up_s: float
    stop_speed_mps: float

    def __post_init__(self) -> None:
        require_finite(
            "VehicleBrake",
            deceleration_min_mps2=self.deceleration_min_mps2,
            deceleration_max_mps2=self.deceleration_max_mps2,
            delay_s=self.delay_s,
            build_up_s=self.build_up_s,
            stop_speed_mps=self.stop_speed_mps,
        )
        if not 0.0 < self.deceleration_min_mps2 <= self.deceleration_max_mps2:
            raise InputError(
                "VehicleBrake: expected 0 < deceleration_min_mps2 <= deceleration_max_mps2 "
                f"(positive numbers slow the car), got {self.deceleration_min_mps2!r} and "
                f"{self.deceleration_max_mps2!r}"
            )
        if self.delay_s < 0.0 or self.build_up_s < 0.0 or self.stop_speed_mps <= 0.0:
            raise InputError(
                "VehicleBrake: expected delay_s >= 0, build_up_s >= 0 and stop_speed_mps > 0, got "
                f"{self.delay_s!r}, {self.build_up_s!r} and {self.stop_speed_mps!r}"
            )
        if self.delay_s > 0.0 and self.build_up_s == 0.0:
            raise InputError(
                "VehicleBrake: a delay needs build_up_s > 0, otherwise the deceleration jumps; "
                f"got delay_s={self.delay_s!r}, build_up_s=0"
            )

    def moving_speed(self, speed: ca.SX) -> ca.SX:
        """max(0, speed): the car does not roll back."""
        return ca.fmax(speed, 0)

    def standstill_time_s(self, speed_mps: float, deceleration_mps2: float) -> float:
        """Time (s) from the command to standstill at a constant deceleration, in closed form."""
        if speed_mps <= 0.0:
            return 0.0
        if speed_mps <= deceleration_mps2 * self.build_up_s / 2.0:
            ramp: float = (2.0 * speed_mps * self.build_up_s / deceleration_mps2) ** 0.5
            return self.delay_s + ramp
        return self.delay_s + self.build_up_s / 2.0 + speed_mps / deceleration_mps2

    def act(self, symbols: Symbols, reading: Reading) -> ModeAction:
        """Open-loop deceleration; the speed PID is not used and its integral stays."""
        deceleration = symbols.disturbance(
            "brake_deceleration",
            "m/s^2",
            0.5 * (self.deceleration_min_mps2 + self.deceleration_max_mps2),
            lower=self.deceleration_min_mps2,
            upper=self.deceleration_max_mps2,
        )
        further: tuple[tuple[str, ca.SX], ...] = ()
        braking = -deceleration
        if self.build_up_s > 0.0:
            clock = symbols.state("brake_clock", "s")
            delay = symbols.parameter("brake_delay", "s", self.delay_s)
            build_up = symbols.parameter("brake_build_up", "s", self.build_up_s)
            braking = -(clip((clock - delay) / build_up, ca.SX(0), ca.SX(1)) * deceleration)
            further = (("brake_clock", ca.SX(1)),)
        stop = symbols.parameter("stop_speed", "m/s", self.stop_speed_mps)
        share = clip(reading.speed / stop - 1, ca.SX(0), ca.SX(1))
        steering = Command(
            reading.steering.raw,
            share * reading.steering.applied,
            share * reading.steering.integral_rate,
        )
        return ModeAction(Command(braking, braking, ca.SX(0)), steering, further)
