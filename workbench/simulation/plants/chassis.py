"""What every simulated car is to those who drive and watch it: commands in, motion out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, final

from workbench.errors import InputError


@final
@dataclass(frozen=True, slots=True)
class Start:
    """Middle of a car's rear axle, heading, speed along it and road wheels at the start, m, rad and
    m/s; it moves there as the bicycle does.

    Raises InputError for numbers that are not finite and for a speed below 0.
    """

    x_m: float
    y_m: float
    heading: float
    speed_mps: float = 0.0
    road_wheel_rad: float = 0.0

    def __post_init__(self) -> None:
        values = (self.x_m, self.y_m, self.heading, self.speed_mps, self.road_wheel_rad)
        if not all(map(math.isfinite, values)) or self.speed_mps < 0.0:
            raise InputError(
                f"start: expected finite numbers and a speed >= 0 m/s, got {values!r}; cars start "
                "forwards or at rest"
            )

    def require_possible(self, wheelbase_m: float, steering_limit_rad: float) -> None:
        """Raise InputError unless a car of this wheelbase and limit of its road wheels can be."""
        if not (0.0 < wheelbase_m < math.inf and 0.0 < steering_limit_rad < 1.5):
            raise InputError(
                "expected a wheelbase > 0 m and a steering limit within (0, 1.5) rad, got "
                f"{wheelbase_m!r} and {steering_limit_rad!r}"
            )
        if abs(self.road_wheel_rad) > steering_limit_rad:
            raise InputError(
                f"start: expected road wheels within {steering_limit_rad!r} rad, got "
                f"{self.road_wheel_rad!r}"
            )

    def yaw_rate_radps(self, wheelbase_m: float) -> float:
        """Of a bicycle: v tan(steering) / L."""
        return self.speed_mps * math.tan(self.road_wheel_rad) / wheelbase_m


@final
@dataclass(frozen=True, slots=True)
class Motion:
    """A car at an instant, about the middle of its rear axle.

    x_m, y_m: position; heading: rad, not wrapped; speed_mps, lateral_mps: velocity of that point
    along the body and to its left; yaw_rate_radps; road_wheel_rad: angle of the front wheels;
    acceleration_mps2: rate of speed_mps.
    """

    x_m: float
    y_m: float
    heading: float
    speed_mps: float
    lateral_mps: float
    yaw_rate_radps: float
    road_wheel_rad: float
    acceleration_mps2: float


class Chassis(Protocol):
    """A car without its actuators: what is asked of it happens at once, as far as tyres allow."""

    @property
    def motion(self) -> Motion:
        """Where it is and how it moves."""

    def advance(
        self, acceleration_mps2: float, steering_rate_radps: float, duration_s: float
    ) -> None:
        """Go on for a time with a longitudinal acceleration by wheels' torque and a rate of the
        road wheels; the car does not roll backwards."""


def not_finite(acceleration_mps2: float, steering_rate_radps: float) -> InputError:
    """What to raise where a motion is no longer finite."""
    return InputError(
        "expected a motion that stays finite, got one that does not after an acceleration of "
        f"{acceleration_mps2!r} m/s^2 and a steering rate of {steering_rate_radps!r} rad/s; ask "
        "for what a car can do"
    )
