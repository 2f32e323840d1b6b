"""The benchmark loops and initial sets on which every method is measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from workbench.controllers import PathFollowing, ReferenceZeroBrake, SpeedPid, SteeringPid, Track
from workbench.models.bicycle import PathBicycle, PlaneBicycle
from workbench.models.closed_loop import ClosedLoop, Disturbance, EstimationError
from workbench.models.signals import Ranged
from workbench.models.system import System
from workbench.sets import Box

WHEELBASE_M = 1.75
REFERENCE_SPEED_MPS = 2.8
PLANE_STATES = ("x", "y", "steering", "speed", "heading", "speed_integral", "offset_integral")
PATH_STATES = (
    "station",
    "offset",
    "steering",
    "speed",
    "heading_error",
    "speed_integral",
    "offset_integral",
)
_CENTER = (0.0, 0.3, 0.0, 2.5, 0.0, 0.0, 0.0)
_RADIUS = (0.2, 0.2, 0.02, 0.2, 0.05, 0.0, 0.0)
_SMALL_RADIUS = (0.05, 0.05, 0.005, 0.05, 0.01, 0.0, 0.0)


@final
@dataclass(frozen=True, slots=True)
class Benchmark:
    """A closed loop with the initial set it is measured from."""

    name: str
    system: System
    initial_set: Box


def _around(names: tuple[str, ...], radius: tuple[float, ...]) -> Box:
    return Box.around(
        dict(zip(names, _CENTER, strict=True)), radius=dict(zip(names, radius, strict=True))
    )


def _controller(*, speed_integral: float, limited: bool, rate_limit_radps: float) -> PathFollowing:
    return PathFollowing(
        SteeringPid(
            proportional=0.6,
            integral=0.05,
            derivative=1.0,
            look_ahead_m=2.0,
            rate_limit_radps=rate_limit_radps if limited else None,
        ),
        SpeedPid(
            proportional=1.0,
            integral=speed_integral,
            accel_min_mps2=-2.0 if limited else None,
            accel_max_mps2=1.0 if limited else None,
        ),
    )


def _unlimited(speed_integral: float) -> PathFollowing:
    return _controller(speed_integral=speed_integral, limited=False, rate_limit_radps=0.0)


def _limited(rate_limit_radps: float) -> PathFollowing:
    return _controller(speed_integral=0.1, limited=True, rate_limit_radps=rate_limit_radps)


def b1() -> Benchmark:
    """B1: straight path, no limits, initial radii 0.2 m, 0.2 m, 0.02 rad, 0.2 m/s, 0.05 rad."""
    plant = PlaneBicycle(WHEELBASE_M, None)
    system = ClosedLoop(plant, _unlimited(0.1), Track(REFERENCE_SPEED_MPS))
    return Benchmark("B1", system, _around(PLANE_STATES, _RADIUS))


def b1_small() -> Benchmark:
    """B1 from radii 0.05 m, 0.05 m, 0.005 rad, 0.05 m/s, 0.01 rad."""
    return Benchmark("B1-small", b1().system, _around(PLANE_STATES, _SMALL_RADIUS))


def b1_brake() -> Benchmark:
    """B1 with reference speed 0 and no speed integral: the paper's BRAKE."""
    plant = PlaneBicycle(WHEELBASE_M, None)
    system = ClosedLoop(plant, _unlimited(0.0), ReferenceZeroBrake())
    return Benchmark("B1-brake", system, _around(PLANE_STATES, _RADIUS))


def _saturated(name: str, rate_limit_radps: float) -> Benchmark:
    plant = PlaneBicycle(WHEELBASE_M, 0.6)
    system = ClosedLoop(plant, _limited(rate_limit_radps), Track(REFERENCE_SPEED_MPS))
    return Benchmark(name, system, _around(PLANE_STATES, _RADIUS))


def b2() -> Benchmark:
    """B1 with |u| <= 0.2 rad/s, |steering| <= 0.6 rad, a in [-2, 1] m/s^2 and anti-windup."""
    return _saturated("B2", 0.2)


def b2_slow() -> Benchmark:
    """B2 with a steering rate of at most 0.1 rad/s."""
    return _saturated("B2-slow", 0.1)


def b2_path() -> Benchmark:
    """B2 in path coordinates on an arc of radius 10 m, turning left."""
    curvature = Ranged.exactly("curvature", "1/m", 0.1)
    plant = PathBicycle(WHEELBASE_M, 0.6, curvature)
    system = ClosedLoop(plant, _limited(0.2), Track(REFERENCE_SPEED_MPS))
    return Benchmark("B2-path", system, _around(PATH_STATES, _RADIUS))


def b2_noise() -> Benchmark:
    """B2 with estimation error 0.1 m, 0.02 rad, 0.05 m/s and disturbance 0.1 m/s^2, 0.01 rad/s."""
    system = ClosedLoop(
        PlaneBicycle(WHEELBASE_M, 0.6),
        _limited(0.2),
        Track(REFERENCE_SPEED_MPS),
        estimation_error=EstimationError(lateral_m=0.1, heading_rad=0.02, speed_mps=0.05),
        disturbance=Disturbance(acceleration_mps2=0.1, steering_rate_radps=0.01),
    )
    return Benchmark("B2-noise", system, _around(PLANE_STATES, _RADIUS))


def all_benchmarks() -> tuple[Benchmark, ...]:
    """All of them, in the order of their description."""
    return (b1(), b1_small(), b1_brake(), b2(), b2_slow(), b2_path(), b2_noise())
