"""Kinematic bicycle, reference point on the rear axle, in the plane and in path coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, final

import casadi as ca

from workbench.controllers.symbols import Symbols, clip
from workbench.errors import InputError
from workbench.models.signals import Ranged, Signal


@final
@dataclass(frozen=True, slots=True)
class Pose:
    """Offset from the path (m), heading (rad; from the path's), steering (rad), speed (m/s)."""

    offset: ca.SX
    heading: ca.SX
    steering: ca.SX
    speed: ca.SX


@final
@dataclass(frozen=True, slots=True)
class PoseRates:
    """Rates of the coordinate along the path, of the offset and of the heading."""

    along: ca.SX
    offset: ca.SX
    heading: ca.SX


class Plant(Protocol):
    """A vehicle whose steering rate and acceleration are commanded."""

    @property
    def states(self) -> tuple[Signal, ...]:
        """Along, offset, steering, speed, heading: the plant's states, in this order."""

    def rates(self, symbols: Symbols, pose: Pose) -> PoseRates:
        """How the pose changes; also evaluated at an estimated pose by the controller."""


def _checked(owner: str, wheelbase_m: float, steering_limit_rad: float | None) -> None:
    if not (math.isfinite(wheelbase_m) and wheelbase_m > 0.0):
        raise InputError(
            f"{owner}.wheelbase_m: expected the distance between the axles, a number > 0, "
            f"got {wheelbase_m!r}"
        )
    if steering_limit_rad is not None and not 0.0 < steering_limit_rad < math.pi / 2:
        raise InputError(
            f"{owner}.steering_limit_rad: expected a road-wheel angle in (0, pi/2), or None for "
            f"no limit, got {steering_limit_rad!r}"
        )


def _yaw_rate(
    symbols: Symbols, pose: Pose, *, wheelbase_m: float, steering_limit_rad: float | None
) -> ca.SX:
    wheelbase = symbols.parameter("wheelbase", "m", wheelbase_m)
    steering = pose.steering
    if steering_limit_rad is not None:
        lower = symbols.parameter("steering_min", "rad", -steering_limit_rad)
        upper = symbols.parameter("steering_max", "rad", steering_limit_rad)
        steering = clip(steering, lower, upper)
    return pose.speed * ca.tan(steering) / wheelbase


@final
@dataclass(frozen=True, slots=True)
class PlaneBicycle:
    """The bicycle in the plane; the path is the line y = 0.

    x' = v cos(heading), y' = v sin(heading), heading' = v tan(clip(steering))/L.

    wheelbase_m: L, the distance between the axles. steering_limit_rad: limit on |steering| inside
    the tangent, or None. Raises InputError on a wheelbase <= 0 or a limit outside (0, pi/2).
    """

    wheelbase_m: float
    steering_limit_rad: float | None

    def __post_init__(self) -> None:
        _checked("PlaneBicycle", self.wheelbase_m, self.steering_limit_rad)

    @property
    def states(self) -> tuple[Signal, ...]:
        """x, y, steering, speed, heading."""
        return (
            Signal("x", "m"),
            Signal("y", "m"),
            Signal("steering", "rad"),
            Signal("speed", "m/s"),
            Signal("heading", "rad"),
        )

    def rates(self, symbols: Symbols, pose: Pose) -> PoseRates:
        """The equations above."""
        yaw_rate = _yaw_rate(
            symbols,
            pose,
            wheelbase_m=self.wheelbase_m,
            steering_limit_rad=self.steering_limit_rad,
        )
        return PoseRates(
            pose.speed * ca.cos(pose.heading), pose.speed * ca.sin(pose.heading), yaw_rate
        )


@final
@dataclass(frozen=True, slots=True)
class PathBicycle:
    """The bicycle along a path of curvature kappa, in station s, offset e and heading error psi.

    s' = v cos(psi)/(1 - kappa e), e' = v sin(psi), psi' = v tan(clip(steering))/L - kappa s'.

    curvature (1/m, positive to the left): an arbitrary function of time within its bounds, so that
    a bound holds for every path whose curvature keeps to them. Valid only while 1 - kappa e > 0 and
    the projection onto the path is unique; whoever uses a tube checks both on the whole of it.
    """

    wheelbase_m: float
    steering_limit_rad: float | None
    curvature: Ranged

    def __post_init__(self) -> None:
        _checked("PathBicycle", self.wheelbase_m, self.steering_limit_rad)
        if (self.curvature.name, self.curvature.unit) != ("curvature", "1/m"):
            raise InputError(
                "PathBicycle.curvature: expected a Ranged named 'curvature' in '1/m', "
                f"got {self.curvature!r}"
            )

    @property
    def states(self) -> tuple[Signal, ...]:
        """station, offset, steering, speed, heading_error."""
        return (
            Signal("station", "m"),
            Signal("offset", "m"),
            Signal("steering", "rad"),
            Signal("speed", "m/s"),
            Signal("heading_error", "rad"),
        )

    def rates(self, symbols: Symbols, pose: Pose) -> PoseRates:
        """The equations above."""
        bounds = self.curvature
        curvature = symbols.disturbance(
            bounds.name, bounds.unit, bounds.nominal, lower=bounds.lower, upper=bounds.upper
        )
        yaw_rate = _yaw_rate(
            symbols,
            pose,
            wheelbase_m=self.wheelbase_m,
            steering_limit_rad=self.steering_limit_rad,
        )
        along = pose.speed * ca.cos(pose.heading) / (1 - curvature * pose.offset)
        return PoseRates(along, pose.speed * ca.sin(pose.heading), yaw_rate - curvature * along)


class Frame(Protocol):
    """Coordinates in which the closed loop is written."""

    def bicycle(self, wheelbase_m: float, steering_limit_rad: float | None) -> Plant:
        """The bicycle in these coordinates."""


@final
@dataclass(frozen=True, slots=True)
class PlaneFrame:
    """Plane coordinates; the path is the line y = 0."""

    def bicycle(self, wheelbase_m: float, steering_limit_rad: float | None) -> Plant:
        """A `PlaneBicycle`."""
        return PlaneBicycle(wheelbase_m, steering_limit_rad)


@final
@dataclass(frozen=True, slots=True)
class PathFrame:
    """Path coordinates for every path whose curvature (1/m) stays in the interval."""

    curvature_lower_per_m: float
    curvature_upper_per_m: float

    def bicycle(self, wheelbase_m: float, steering_limit_rad: float | None) -> Plant:
        """A `PathBicycle`; nominal curvature in the middle of the interval."""
        lower, upper = self.curvature_lower_per_m, self.curvature_upper_per_m
        nominal = min(max(lower + 0.5 * (upper - lower), lower), upper)
        curvature = Ranged("curvature", "1/m", nominal, lower, upper)
        return PathBicycle(wheelbase_m, steering_limit_rad, curvature)
