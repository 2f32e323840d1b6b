"""Plant, controller and mode put together into one `Ode`."""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import casadi as ca

from workbench.controllers import Deviation, Mode, PathFollowing, Reading, VehicleBrake
from workbench.errors import InputError
from workbench.models.bicycle import Plant, Pose, PoseRates
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode


def _require_bounds(owner: str, **bounds: float) -> None:
    for name, bound in bounds.items():
        if not (math.isfinite(bound) and bound >= 0.0):
            raise InputError(f"{owner}.{name}: expected a bound >= 0, got {bound!r}")


@final
@dataclass(frozen=True, slots=True)
class EstimationError:
    """Bounds on the difference between what the controller reads and the state (the set N).

    lateral_m: on the offset; heading_rad: on the heading; speed_mps: on the speed. A bound of 0
    adds no signal.
    """

    lateral_m: float = 0.0
    heading_rad: float = 0.0
    speed_mps: float = 0.0

    def __post_init__(self) -> None:
        _require_bounds(
            "EstimationError",
            lateral_m=self.lateral_m,
            heading_rad=self.heading_rad,
            speed_mps=self.speed_mps,
        )


@final
@dataclass(frozen=True, slots=True)
class Disturbance:
    """Bounds on what the plant feels besides the commands (the set W); 0 adds no signal."""

    acceleration_mps2: float = 0.0
    steering_rate_radps: float = 0.0

    def __post_init__(self) -> None:
        _require_bounds(
            "Disturbance",
            acceleration_mps2=self.acceleration_mps2,
            steering_rate_radps=self.steering_rate_radps,
        )


class _Builder:
    """Collects the symbols that plant, controller and mode declare."""

    def __init__(self) -> None:
        self.states: dict[str, tuple[Signal, ca.SX]] = {}
        self.parameters: dict[str, tuple[Ranged, ca.SX]] = {}
        self.disturbances: dict[str, tuple[Ranged, ca.SX]] = {}

    def state(self, name: str, unit: str) -> ca.SX:
        return self.states.setdefault(name, (Signal(name, unit), ca.SX.sym(name)))[1]

    def parameter(self, name: str, unit: str, value: float) -> ca.SX:
        entry = (Ranged.exactly(name, unit, value), ca.SX.sym(name))
        return self.parameters.setdefault(name, entry)[1]

    def disturbance(
        self, name: str, unit: str, nominal: float, *, lower: float, upper: float
    ) -> ca.SX:
        entry = (Ranged(name, unit, nominal, lower, upper), ca.SX.sym(name))
        return self.disturbances.setdefault(name, entry)[1]

    def with_error(self, value: ca.SX, name: str, unit: str, bound: float) -> ca.SX:
        if bound == 0.0:
            return value
        return value + self.disturbance(name, unit, 0.0, lower=-bound, upper=bound)

    def ranged_parameters(self, ranges: Mapping[str, tuple[float, float]]) -> tuple[Ranged, ...]:
        for name in ranges:
            if name not in self.parameters:
                near = difflib.get_close_matches(name, self.parameters, n=1)
                hint = f"; the nearest is {near[0]!r}" if near else ""
                raise InputError(
                    f"unknown parameter {name!r}{hint}; this loop has {sorted(self.parameters)}"
                )
        known = (ranged for ranged, _ in self.parameters.values())
        return tuple(
            Ranged(r.name, r.unit, r.nominal, *ranges[r.name]) if r.name in ranges else r
            for r in known
        )


def _column(symbols: list[ca.SX]) -> ca.SX:
    return ca.vertcat(*symbols) if symbols else ca.SX(0, 1)


@final
@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """A vehicle under its controllers in one mode: x' = f(x, p, w), field continuous.

    The controller reads offset, heading and speed with the estimation error added, and computes the
    deviation's rate from these readings; the disturbance adds to acceleration and steering rate
    after their limits. Steering and path curvature are known to the controller.

    plant, controller, mode: what to connect. estimation_error, disturbance: bounds; signals appear
    only for non-zero ones (`position_error_lateral`, `heading_estimate_error`,
    `speed_estimate_error`, `acceleration_disturbance`, `steering_rate_disturbance`).
    parameter_ranges: parameter name -> (lower, upper) around its nominal value; others are exact.
    States: the plant's five, then `speed_integral`, `offset_integral`, then the mode's own.
    Outputs: `steering_rate_command` and `acceleration_command`, before their limits. Raises
    InputError on an unknown parameter, a range without its nominal value, or an acceleration
    disturbance that could move a braked car off again.
    """

    plant: Plant
    controller: PathFollowing
    mode: Mode
    estimation_error: EstimationError = EstimationError()
    disturbance: Disturbance = Disturbance()
    parameter_ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    _ode: Ode = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        mode, bound = self.mode, self.disturbance.acceleration_mps2
        if isinstance(mode, VehicleBrake) and bound >= mode.deceleration_min_mps2:
            raise InputError(
                "ClosedLoop: standstill lasts only if the acceleration disturbance "
                f"({bound!r} m/s^2) is below deceleration_min_mps2 ({mode.deceleration_min_mps2!r})"
            )
        object.__setattr__(self, "_ode", _assemble(self))

    @property
    def ode(self) -> Ode:
        """The loop as an `Ode`; every call gives the same symbols."""
        return self._ode


def _readings(
    loop: ClosedLoop, builder: _Builder, *, pose: Pose, motion: PoseRates
) -> tuple[Deviation, ca.SX]:
    """What the controller reads: the deviation with rates, and the speed."""
    error = loop.estimation_error
    if error == EstimationError():
        return Deviation(pose.offset, pose.heading, motion.offset, motion.heading), pose.speed
    estimate = dataclasses.replace(
        pose,
        offset=builder.with_error(pose.offset, "position_error_lateral", "m", error.lateral_m),
        heading=builder.with_error(
            pose.heading, "heading_estimate_error", "rad", error.heading_rad
        ),
        speed=builder.with_error(pose.speed, "speed_estimate_error", "m/s", error.speed_mps),
    )
    rates = loop.plant.rates(builder, estimate)
    reading = Deviation(estimate.offset, estimate.heading, rates.offset, rates.heading)
    return reading, estimate.speed


def _assemble(loop: ClosedLoop) -> Ode:
    builder = _Builder()
    along, offset, steering, speed, heading = (
        builder.state(signal.name, signal.unit) for signal in loop.plant.states
    )
    speed_integral = builder.state("speed_integral", "m")
    offset_integral = builder.state("offset_integral", "m s")
    pose = Pose(offset, heading, steering, loop.mode.moving_speed(speed))
    motion = loop.plant.rates(builder, pose)
    deviation, speed_reading = _readings(loop, builder, pose=pose, motion=motion)
    turning = loop.controller.steering.command(builder, deviation, offset_integral)
    action = loop.mode.act(
        builder, Reading(speed_reading, speed_integral, loop.controller.speed, turning)
    )
    felt = loop.disturbance
    rates = {
        along.name(): motion.along,
        offset.name(): motion.offset,
        steering.name(): builder.with_error(
            action.steering.applied,
            "steering_rate_disturbance",
            "rad/s",
            felt.steering_rate_radps,
        ),
        speed.name(): builder.with_error(
            action.acceleration.applied,
            "acceleration_disturbance",
            "m/s^2",
            felt.acceleration_mps2,
        ),
        heading.name(): motion.heading,
        "speed_integral": action.acceleration.integral_rate,
        "offset_integral": action.steering.integral_rate,
        **dict(action.further_rates),
    }
    field_and_commands = ca.cse(
        ca.vertcat(
            *(rates[name] for name in builder.states),
            action.steering.raw,
            action.acceleration.raw,
        )
    )
    size = len(builder.states)
    return Ode(
        name=f"{type(loop.plant).__name__} {type(loop.mode).__name__}",
        states=tuple(signal for signal, _ in builder.states.values()),
        parameters=builder.ranged_parameters(loop.parameter_ranges),
        disturbances=tuple(ranged for ranged, _ in builder.disturbances.values()),
        x=_column([symbol for _, symbol in builder.states.values()]),
        p=_column([symbol for _, symbol in builder.parameters.values()]),
        w=_column([symbol for _, symbol in builder.disturbances.values()]),
        field=field_and_commands[:size],
        outputs=(
            ("steering_rate_command", field_and_commands[size]),
            ("acceleration_command", field_and_commands[size + 1]),
        ),
    )
