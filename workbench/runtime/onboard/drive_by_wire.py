"""What a vehicle's drive-by-wire does with a command, as far as its file knows: values, checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.arc import Interval
from workbench.runtime.onboard.curve import Curve

COUNT = 0.001
"""One count of every pedal ratio (1), wheel angle (rad) and wheel rate (rad/s) of PACMod."""


def _require(part: object, *names: str, most: float = math.inf, zero: bool = False) -> None:
    for name in names:
        value = getattr(part, name)
        if not (
            math.isfinite(value) and (value > 0.0 or (zero and value == 0.0)) and value <= most
        ):
            least = ">= 0" if zero else "> 0"
            limit = f" and <= {most:g}" if most < math.inf else ""
            raise InputError(f"{name}: expected a number {least}{limit}, got {value!r}")


def _require_times(part: object, *names: str) -> None:
    for name in names:
        low, high = getattr(part, name)
        if not 0.0 <= low <= high < math.inf:
            raise InputError(f"{name}: expected [lowest, highest] in s, >= 0, got {(low, high)!r}")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Steering:
    """The steering: what it may be told, and what it makes of that.

    road_wheel: steering-wheel angle (rad) -> road-wheel angle (rad), both positive to the left.
    angle_limit_rad, rate_limit_radps: what the proof lets the road wheels do; slew_radps2: how fast
    the commanded rate may change. wheel_limit_rad, wheel_rate_limit_radps: most that is ever sent;
    wheel_rate_floor_radps: least rate that is sent. lead_s: how far ahead of the wheel its target
    lies. dead_band_rad: distance of wheel and target below which the wheel may rest. rate_error:
    share by which the road wheels' rate may miss. delay_s, build_up_s: from a frame to its effect.
    report_error_rad, report_age_s: how wrong and how old the read-back may be. withheld_radps: how
    far the rate sent may stay behind the rate wanted within the proof. Raises InputError.
    """

    road_wheel: Curve
    angle_limit_rad: float
    rate_limit_radps: float
    slew_radps2: float
    wheel_limit_rad: float
    wheel_rate_limit_radps: float
    wheel_rate_floor_radps: float
    lead_s: float
    dead_band_rad: float
    rate_error: float
    delay_s: Interval
    build_up_s: Interval
    report_error_rad: float
    report_age_s: float
    withheld_radps: float

    def __post_init__(self) -> None:
        _require(self, "angle_limit_rad", "rate_limit_radps", "slew_radps2", "lead_s")
        _require(self, "wheel_limit_rad", most=12.0)
        _require(self, "wheel_rate_limit_radps", "wheel_rate_floor_radps", most=20.0)
        _require(self, "dead_band_rad", "report_error_rad", "report_age_s", "withheld_radps",
                 zero=True)  # fmt: skip
        _require(self, "rate_error", zero=True, most=0.5)
        _require_times(self, "delay_s", "build_up_s")
        wheel_rad = self.road_wheel.command_for(self.angle_limit_rad)
        other_rad = self.road_wheel.command_for(-self.angle_limit_rad)
        if (
            not max(abs(wheel_rad), abs(other_rad))
            <= self.wheel_limit_rad
            <= min(-self.road_wheel.commands[0], self.road_wheel.commands[1])
        ):
            raise InputError(
                "wheel_limit_rad: expected an angle within the steering map, "
                f"{self.road_wheel.commands!r}, and no less than what turns the road wheels by "
                f"{self.angle_limit_rad!r} rad, "
                f"{max(abs(wheel_rad), abs(other_rad))!r}, got {self.wheel_limit_rad!r}"
            )
        needed = self.rate_limit_radps / min(self.road_wheel.slopes)
        if not self.wheel_rate_floor_radps <= needed <= self.wheel_rate_limit_radps:
            raise InputError(
                "expected wheel_rate_floor_radps <= rate_limit_radps / (flattest slope of the "
                f"steering map) = {needed!r} <= wheel_rate_limit_radps, got "
                f"{self.wheel_rate_floor_radps!r} and {self.wheel_rate_limit_radps!r}"
            )

    @property
    def longest_s(self) -> float:
        """From a frame to its full effect, at most."""
        return self.delay_s[1] + self.build_up_s[1]

    def needed_lead_rad(self, rate_radps: float, turn_s: float) -> float:
        """How far ahead of the read-back a target must lie, so that the wheel cannot arrive early.

        What the road wheels turn from the report until the next command has its full effect, t_r =
        report_age + turn + delay + build-up, at up to (1 + rate_error) (|u| + slew t_r), and the
        dead band, the report's error and half a count, seen at the road wheels.
        """
        until_s = self.report_age_s + turn_s + self.longest_s
        turned = (1.0 + self.rate_error) * (abs(rate_radps) + self.slew_radps2 * until_s) * until_s
        rest_rad = self.dead_band_rad + self.report_error_rad + 0.5 * COUNT
        return turned + rest_rad * max(self.road_wheel.slopes)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Pedals:
    """Accelerator and brake: what they may be told, and what they make of that.

    accelerator: ratio -> acceleration (m/s^2); brake: ratio -> deceleration (m/s^2).
    accel_min_mps2, accel_max_mps2: what the proof lets TRACK command; slew_mps3: how fast that may
    change. coast_below_mps2: commands smaller than this, either way, press no pedal, which
    accelerates the car by anything in coast_mps2. accelerator_limit, brake_limit: most that is ever
    sent; brake_profile: the ratio that BRAKE sends. delay_s, build_up_s: from a frame to its
    effect. withheld_mps2: how far the acceleration sent may stay behind the one wanted within the
    proof. Raises InputError.
    """

    accelerator: Curve
    brake: Curve
    accel_min_mps2: float
    accel_max_mps2: float
    slew_mps3: float
    coast_below_mps2: float
    coast_mps2: Interval
    accelerator_limit: float
    brake_limit: float
    brake_profile: float
    delay_s: Interval
    build_up_s: Interval
    withheld_mps2: float

    def __post_init__(self) -> None:
        _require(self, "accel_max_mps2", "slew_mps3", "coast_below_mps2")
        _require(self, "accelerator_limit", "brake_limit", "brake_profile", most=1.0)
        _require(self, "withheld_mps2", zero=True)
        _require_times(self, "delay_s", "build_up_s")
        low, high = self.coast_mps2
        if not -math.inf < low <= high < math.inf:
            raise InputError(f"coast_mps2: expected [lowest, highest], got {self.coast_mps2!r}")
        if not (math.isfinite(self.accel_min_mps2) and self.accel_min_mps2 < 0.0):
            raise InputError(f"accel_min_mps2: expected a number < 0, got {self.accel_min_mps2!r}")
        if self.brake_profile > self.brake_limit:
            raise InputError(
                f"brake_profile: expected at most brake_limit = {self.brake_limit!r}, got "
                f"{self.brake_profile!r}"
            )
        _require_covered("accelerator", self.accelerator, self.accelerator_limit,
                         (self.coast_below_mps2, self.accel_max_mps2))  # fmt: skip
        _require_covered("brake", self.brake, self.brake_limit,
                         (self.coast_below_mps2, -self.accel_min_mps2))  # fmt: skip
        _require_inside("brake", self.brake, self.brake_profile)

    @property
    def longest_s(self) -> float:
        """From a frame to its full effect, at most."""
        return self.delay_s[1] + self.build_up_s[1]


def _require_covered(name: str, curve: Curve, limit: float, effects: Interval) -> None:
    """Every effect that may be wanted lies in the map, with room for a rounded ratio."""
    least, most = curve.command_for(effects[0]), curve.command_for(effects[1])
    if not (curve.commands[0] >= 0.0 and most <= limit):
        raise InputError(
            f"{name}: expected a map from ratios >= 0 that reaches {effects!r} m/s^2 by "
            f"{name}_limit = {limit!r}, got ratios {curve.commands!r} and "
            f"{(least, most)!r} for these; lengthen the map, or narrow the limits"
        )
    _require_inside(name, curve, least)
    _require_inside(name, curve, most)


def _require_inside(name: str, curve: Curve, ratio: float) -> None:
    if not curve.commands[0] + COUNT <= ratio <= curve.commands[1] - COUNT:
        raise InputError(
            f"{name}: expected a map that reaches a count of {COUNT} beyond every ratio used, got "
            f"{curve.commands!r} and {ratio!r}; lengthen the map"
        )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DriveByWire:
    """A vehicle's drive-by-wire.

    protocol: of the frames; turn_s: longest time from the begin of a turn of the sender until the
    last command of the next one is on the bus; speed_error_mps: how wrong the speed report may be;
    stop_speed_mps: where braking freezes the steering (see `VehicleBrake`). Raises InputError for
    times or errors that cannot be.
    """

    protocol: str
    turn_s: float
    speed_error_mps: float
    stop_speed_mps: float
    steering: Steering
    pedals: Pedals

    def __post_init__(self) -> None:
        _require(self, "turn_s", "stop_speed_mps")
        _require(self, "speed_error_mps", zero=True)
        if not self.protocol:
            raise InputError("protocol: expected the name of a protocol, got ''")
