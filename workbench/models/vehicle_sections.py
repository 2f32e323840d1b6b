"""The sections of a vehicle file as checked values."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import final

from workbench.controllers import VehicleBrake
from workbench.errors import InputError
from workbench.models.closed_loop import Disturbance, EstimationError
from workbench.models.section_reading import require_positive
from workbench.sets import Box

STATE_KEYS = {
    "station_m": "station",
    "offset_m": "offset",
    "steering_rad": "steering",
    "speed_mps": "speed",
    "heading_error_rad": "heading_error",
    "speed_integral_m": "speed_integral",
    "offset_integral_ms": "offset_integral",
}
REGION_KEYS = {key: name for key, name in STATE_KEYS.items() if name != "station"}


@final
@dataclass(frozen=True, slots=True)
class Geometry:
    """Axle distance and body about the rear axle: front and rear bumper, half the width (m)."""

    wheelbase_m: float
    front_m: float
    rear_m: float
    half_width_m: float
    provenance: str

    def __post_init__(self) -> None:
        require_positive(self, "wheelbase_m", "front_m", "rear_m", "half_width_m")
        if self.front_m < self.wheelbase_m:
            raise InputError(
                f"front_m: expected the distance from the rear axle to the front bumper, at least "
                f"wheelbase_m = {self.wheelbase_m!r}, got {self.front_m!r}"
            )


@final
@dataclass(frozen=True, slots=True)
class Limits:
    """Road-wheel angle and its rate (magnitudes), acceleration interval."""

    steering_rad: float
    steering_rate_radps: float
    accel_min_mps2: float
    accel_max_mps2: float
    provenance: str

    def __post_init__(self) -> None:
        require_positive(self, "steering_rad", "steering_rate_radps", "accel_max_mps2")
        if self.steering_rad >= math.pi / 2:
            raise InputError(f"steering_rad: expected less than pi/2, got {self.steering_rad!r}")
        if self.accel_min_mps2 >= 0.0:
            raise InputError(f"accel_min_mps2: expected a number < 0, got {self.accel_min_mps2!r}")


@final
@dataclass(frozen=True, slots=True)
class SteeringGains:
    """Gains of the steering PID and its look-ahead distance; see `SteeringPid`."""

    proportional_radps_per_m: float
    integral_radps_per_ms: float
    derivative_rad_per_m: float
    look_ahead_m: float
    provenance: str

    def __post_init__(self) -> None:
        if self.look_ahead_m < 0.0:
            raise InputError(f"look_ahead_m: expected a number >= 0, got {self.look_ahead_m!r}")


@final
@dataclass(frozen=True, slots=True)
class SpeedGains:
    """Gains of the speed PID; see `SpeedPid`."""

    proportional_per_s: float
    integral_per_s2: float
    provenance: str


@final
@dataclass(frozen=True, slots=True)
class Operation:
    """Reference speed, and the region of path states (no station) that bounds are derived for.

    curvature_per_m: what no path bends more than, to either side; a bundle brakes where one does.
    The region's offsets, with the error of reading them, must stay below its radius.
    reference_change_mps: see `Track.change_mps`; no vehicle file says it, since a monitor decides
    anew whenever the reference changes.
    """

    reference_speed_mps: float
    region: Box
    provenance: str
    curvature_per_m: float = 0.5
    reference_change_mps: tuple[float, float] = field(default=(0.0, 0.0), kw_only=True)

    def __post_init__(self) -> None:
        require_positive(self, "curvature_per_m")


@final
@dataclass(frozen=True, slots=True)
class Brake:
    """The vehicle's own brake; see `VehicleBrake`."""

    deceleration_min_mps2: float
    deceleration_max_mps2: float
    delay_s: float
    build_up_s: float
    stop_speed_mps: float
    provenance: str

    def __post_init__(self) -> None:
        self.mode()

    def mode(self) -> VehicleBrake:
        """The BRAKE mode with these numbers."""
        return VehicleBrake(
            self.deceleration_min_mps2,
            self.deceleration_max_mps2,
            self.delay_s,
            self.build_up_s,
            self.stop_speed_mps,
        )


@final
@dataclass(frozen=True, slots=True)
class Guard:
    """How fast a person may move at most, and how fast that velocity may change (magnitudes).

    The guard of a person is every position they can reach under both bounds: |velocity| <=
    speed_max_mps and |acceleration| <= accel_max_mps2 at every instant, in any direction.
    """

    speed_max_mps: float
    accel_max_mps2: float
    provenance: str

    def __post_init__(self) -> None:
        require_positive(self, "speed_max_mps", "accel_max_mps2")


@final
@dataclass(frozen=True, slots=True)
class Uncertainty:
    """What bundles take the loop to be unsure of; every key may be left out and is 0 then.

    N: errors (magnitudes) of what the controller reads: lateral_m, heading_rad, speed_mps. W: what
    acts on the car besides the commands: acceleration_mps2, steering_rate_radps; upstream_...: by
    how much more an upstream controller may differ from ours in GATE. wheelbase_m: by how much the
    geometry's wheelbase may be wrong. includes_drive_by_wire: W was found from what the law
    commands to how the car moves, so that what [drive_by_wire] brings about is in it already.
    """

    lateral_m: float = 0.0
    heading_rad: float = 0.0
    speed_mps: float = 0.0
    acceleration_mps2: float = 0.0
    steering_rate_radps: float = 0.0
    wheelbase_m: float = 0.0
    upstream_acceleration_mps2: float = 0.0
    upstream_steering_rate_radps: float = 0.0
    includes_drive_by_wire: bool = False
    provenance: str = "assumed to be none"

    def __post_init__(self) -> None:
        if not 0.0 <= self.wheelbase_m < math.inf:
            raise InputError(f"wheelbase_m: expected a number >= 0, got {self.wheelbase_m!r}")
        self.estimation_error()
        self.disturbance()
        Disturbance(self.upstream_acceleration_mps2, self.upstream_steering_rate_radps)
        upstream = (self.upstream_acceleration_mps2, self.upstream_steering_rate_radps)
        if self.includes_drive_by_wire and any(upstream):
            raise InputError(
                "includes_drive_by_wire: expected false where upstream_... grants another "
                "controller room, got true; what the drive-by-wire makes of its commands was not "
                "in those drives"
            )

    def more(self, *, acceleration_mps2: float, steering_rate_radps: float) -> Uncertainty:
        """With so much more of W, in magnitude, rounded up."""
        return dataclasses.replace(
            self,
            acceleration_mps2=_sum(self.acceleration_mps2, acceleration_mps2),
            steering_rate_radps=_sum(self.steering_rate_radps, steering_rate_radps),
        )

    def estimation_error(self) -> EstimationError:
        """The set N."""
        return EstimationError(self.lateral_m, self.heading_rad, self.speed_mps)

    def disturbance(self) -> Disturbance:
        """The set W."""
        return Disturbance(self.acceleration_mps2, self.steering_rate_radps)

    def parameter_ranges(self, geometry: Geometry) -> dict[str, tuple[float, float]]:
        """Ranges of the loop's parameters about their values."""
        if self.wheelbase_m == 0.0:
            return {}
        least = geometry.wheelbase_m - self.wheelbase_m
        return {"wheelbase": (least, geometry.wheelbase_m + self.wheelbase_m)}


def _sum(one: float, more: float) -> float:
    """Both magnitudes together, rounded up; exact where one of them is 0."""
    return one + more if 0.0 in (one, more) else math.nextafter(one + more, math.inf)
