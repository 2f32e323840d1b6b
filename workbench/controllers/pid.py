"""Steering and speed PID with integral states, limits and back-calculation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.controllers.symbols import Symbols, clip
from workbench.errors import InputError


def require_finite(owner: str, **values: float | None) -> None:
    """Raise InputError unless every value is None or a finite number."""
    for name, value in values.items():
        if value is not None and not math.isfinite(value):
            raise InputError(f"{owner}.{name}: expected a finite number, got {value!r}")


@final
@dataclass(frozen=True, slots=True)
class Command:
    """A PID's output: `raw` before its limit, `applied` after it, and the rate of its integral."""

    raw: ca.SX
    applied: ca.SX
    integral_rate: ca.SX


@final
@dataclass(frozen=True, slots=True)
class Deviation:
    """Offset (m) and heading error (rad) as the controller reads them, with their rates."""

    offset: ca.SX
    heading: ca.SX
    offset_rate: ca.SX
    heading_rate: ca.SX


@final
@dataclass(frozen=True, slots=True)
class SteeringPid:
    """PID from the deviation of a point ahead to the steering rate.

    e_l = e + l sin(psi), e_l' = e' + l cos(psi) psi';
    u_raw = -(kp e_l + ki I + kd e_l'), u = clip(u_raw, -limit, limit), I' = e_l + (u_raw - u).

    proportional (rad/(s m)), integral (rad/(s^2 m)), derivative (rad/m): gains. look_ahead_m: l.
    rate_limit_radps: limit on |u|, or None for no limit (then I' = e_l). With l = 0 the loop is
    never asymptotically stable, whatever the gains (`models.control_view` shows it); it is allowed
    for that comparison. Raises InputError on values that are not finite, l < 0 or a limit <= 0.
    """

    proportional: float
    integral: float
    derivative: float
    look_ahead_m: float
    rate_limit_radps: float | None

    def __post_init__(self) -> None:
        require_finite(
            "SteeringPid",
            proportional=self.proportional,
            integral=self.integral,
            derivative=self.derivative,
            look_ahead_m=self.look_ahead_m,
            rate_limit_radps=self.rate_limit_radps,
        )
        if self.look_ahead_m < 0.0:
            raise InputError(
                f"SteeringPid.look_ahead_m: expected a distance >= 0 ahead of the rear axle, "
                f"got {self.look_ahead_m!r}"
            )
        if self.rate_limit_radps is not None and self.rate_limit_radps <= 0.0:
            raise InputError(
                f"SteeringPid.rate_limit_radps: expected a limit > 0, or None for no limit, "
                f"got {self.rate_limit_radps!r}"
            )

    def command(self, symbols: Symbols, deviation: Deviation, integral: ca.SX) -> Command:
        """The law above as expressions of `deviation` and the integral state."""
        look_ahead = symbols.parameter("look_ahead", "m", self.look_ahead_m)
        proportional = symbols.parameter(
            "steering_gain_proportional", "rad/(s m)", self.proportional
        )
        integral_gain = symbols.parameter("steering_gain_integral", "rad/(s^2 m)", self.integral)
        derivative = symbols.parameter("steering_gain_derivative", "rad/m", self.derivative)
        error = deviation.offset + look_ahead * ca.sin(deviation.heading)
        error_rate = (
            deviation.offset_rate + look_ahead * ca.cos(deviation.heading) * deviation.heading_rate
        )
        raw = -(proportional * error + integral_gain * integral + derivative * error_rate)
        if self.rate_limit_radps is None:
            return Command(raw, raw, error)
        lower = symbols.parameter("steering_rate_min", "rad/s", -self.rate_limit_radps)
        upper = symbols.parameter("steering_rate_max", "rad/s", self.rate_limit_radps)
        applied = clip(raw, lower, upper)
        return Command(raw, applied, error + (raw - applied))


@final
@dataclass(frozen=True, slots=True)
class SpeedPid:
    """PI from the speed error to the acceleration.

    a_raw = kp (v_ref - v) + ki I, a = clip(a_raw, accel_min, accel_max), I' = v_ref - v - (a_raw -
    a).

    proportional (1/s), integral (1/s^2): gains. accel_min_mps2 < 0 < accel_max_mps2: limits, or
    None for no limit on that side. Raises InputError on values that are not finite or limits of
    wrong sign.
    """

    proportional: float
    integral: float
    accel_min_mps2: float | None
    accel_max_mps2: float | None

    def __post_init__(self) -> None:
        require_finite(
            "SpeedPid",
            proportional=self.proportional,
            integral=self.integral,
            accel_min_mps2=self.accel_min_mps2,
            accel_max_mps2=self.accel_max_mps2,
        )
        low, high = self.accel_min_mps2, self.accel_max_mps2
        if (low is not None and low >= 0.0) or (high is not None and high <= 0.0):
            raise InputError(
                f"SpeedPid: expected accel_min_mps2 < 0 < accel_max_mps2 (None for no limit), "
                f"got {low!r} and {high!r}"
            )

    def command(
        self, symbols: Symbols, speed: ca.SX, *, reference: ca.SX, integral: ca.SX
    ) -> Command:
        """The law above as expressions of speed reading, reference and integral state."""
        proportional = symbols.parameter("speed_gain_proportional", "1/s", self.proportional)
        integral_gain = symbols.parameter("speed_gain_integral", "1/s^2", self.integral)
        error = reference - speed
        raw = proportional * error + integral_gain * integral
        applied = raw
        if self.accel_min_mps2 is not None:
            lower = symbols.parameter("acceleration_min", "m/s^2", self.accel_min_mps2)
            applied = ca.fmax(applied, lower)
        if self.accel_max_mps2 is not None:
            upper = symbols.parameter("acceleration_max", "m/s^2", self.accel_max_mps2)
            applied = ca.fmin(applied, upper)
        if self.accel_min_mps2 is None and self.accel_max_mps2 is None:
            return Command(raw, raw, error)
        return Command(raw, applied, error - (raw - applied))


@final
@dataclass(frozen=True, slots=True)
class PathFollowing:
    """The two PIDs of the loop."""

    steering: SteeringPid
    speed: SpeedPid
