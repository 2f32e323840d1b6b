"""Closed-loop runs with planted disturbances of known size, for the tests of conformance."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.models.bicycle import PathFrame
from workbench.models.spline_path import SplinePath
from workbench.models.system import Ode
from workbench.models.vehicle import Vehicle, gem_e2
from workbench.models.vehicle_sections import Uncertainty
from workbench.simulation.conformance.driven_runs import DrivenRun
from workbench.simulation.conformance.windows import SIGNALS

STEP_S = 0.05


def soft_vehicle() -> Vehicle:
    """The shipped vehicle with gains so soft that small errors do not saturate the steering."""
    vehicle = gem_e2()
    gains = dataclasses.replace(
        vehicle.steering_pid,
        proportional_radps_per_m=0.05,
        integral_radps_per_ms=0.0,
        derivative_rad_per_m=0.5,
        look_ahead_m=4.0,
    )
    return dataclasses.replace(vehicle, steering_pid=gains)


def bend() -> NDArray[np.float64]:
    """Waypoints of a straight that goes over into a left bend of 40 m radius."""
    angle = np.linspace(0.0, 1.0, 21)[1:]
    arc = np.column_stack([20.0 + 40.0 * np.sin(angle), 40.0 * (1.0 - np.cos(angle))])
    return np.vstack([np.column_stack([np.linspace(-10.0, 20.0, 16), np.zeros(16)]), arc])


def planted_run(
    name: str, planted: Uncertainty, *, seed: int, duration_s: float = 12.0
) -> DrivenRun:
    """A run in which every planted bound is reached: each signal jumps between its two bounds."""
    vehicle, path = soft_vehicle(), SplinePath.through(bend())
    rng = np.random.default_rng(seed)
    ode = _loop(vehicle, planted)
    places = [signal.name for signal in ode.disturbances]
    bounds = {SIGNALS[k]: getattr(planted, k) for k in SIGNALS}
    parameters = dict(zip((p.name for p in ode.parameters), ode.parameter_values(), strict=True))
    parameters["wheelbase"] += rng.choice([-1.0, 1.0]) * planted.wheelbase_m
    step = _step(ode)
    state = np.array([5.0, rng.uniform(-0.2, 0.2), 0.0, 2.6, rng.uniform(-0.03, 0.03), 0.0, 0.0])
    sides = np.ones(len(places))
    rows = []
    for count in range(round(duration_s / STEP_S) + 1):
        rows.append(_row(count * STEP_S, state, path))
        sides = np.where(rng.random(len(places)) < 0.03, -sides, sides)
        values = np.array([bounds.get(place, 0.0) for place in places]) * sides
        values[places.index("curvature")] = path.curvature(state[0])
        state = np.array(step(state, values, list(parameters.values()))).ravel()
    return DrivenRun(name, np.array(rows), np.ones(len(rows), dtype=bool), bend())


def _loop(vehicle: Vehicle, planted: Uncertainty) -> Ode:
    return vehicle.closed_loop(
        vehicle.track(),
        PathFrame(-1.0, 1.0),
        estimation_error=planted.estimation_error(),
        disturbance=planted.disturbance(),
    ).ode


def _step(ode: Ode) -> ca.Function:
    field, x = ode.function(), ode.x
    half = field(x + STEP_S / 2 * field(x, ode.p, ode.w), ode.p, ode.w)
    return ca.Function("step", [x, ode.w, ode.p], [x + STEP_S * half])


def _row(t_s: float, state: NDArray[np.float64], path: SplinePath) -> list[float]:
    station, offset, steering, speed, turned, speed_integral, offset_integral = map(float, state)
    heading = float(path.heading(station))
    x, y = path.position(station)
    return [
        t_s, float(x) - offset * np.sin(heading), float(y) + offset * np.cos(heading),
        heading + turned, steering, speed, speed_integral, offset_integral,
    ]  # fmt: skip
