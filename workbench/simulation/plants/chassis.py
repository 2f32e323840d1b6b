"""What every simulated car is to those who drive and watch it: commands in, motion out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, final


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
