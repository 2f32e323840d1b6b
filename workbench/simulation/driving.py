"""The simulated car: a vehicle's closed loop along a path, stepped by Runge-Kutta."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from workbench.controllers import Mode
from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.spline_path import Array, SplinePath
from workbench.models.system import Ode
from workbench.models.vehicle import Vehicle
from workbench.runtime import Action
from workbench.runtime.monitor import STATES

_LONGEST_STEP_S = 0.01
_WHOLE = 1e-9
_GRID_M = 0.02


@final
@dataclass(frozen=True, slots=True)
class CarState:
    """The car between two decisions: where it is in the plane, its path states, its last action.

    values: station, offset, steering, raw speed, heading error, both integrals, and last the brake
    clock when action is BRAKE.
    """

    x_m: float
    y_m: float
    heading: float
    values: tuple[float, ...]
    action: Action

    @property
    def steering(self) -> float:
        """Road-wheel angle, rad."""
        return self.values[2]

    @property
    def speed_mps(self) -> float:
        """Speed; the raw speed of a braked car goes below 0, the car does not."""
        return max(0.0, self.values[3])

    @property
    def speed_integral_m(self) -> float:
        """The speed controller's integral: reset whenever the mode switches."""
        return self.values[5]

    @property
    def offset_integral_ms(self) -> float:
        """The steering controller's integral."""
        return self.values[6]


@final
class Driver:
    """Moves a `CarState` along `path` in TRACK or in the vehicle's BRAKE.

    Curvature is the path's own at the current station, disturbances are nominal. Beyond the path's
    ends it goes on straight. deceleration_mps2: of BRAKE once it has built up; None: the middle of
    the vehicle's interval. Raises InputError for one outside of it.
    """

    def __init__(
        self, vehicle: Vehicle, path: SplinePath, *, deceleration_mps2: float | None = None
    ) -> None:
        self._path = path
        self._grid = np.linspace(0.0, path.length_m, max(2, math.ceil(path.length_m / _GRID_M)))
        self._curvature = path.curvature(self._grid)
        frame = PathFrame(float(self._curvature.min()), float(self._curvature.max()))
        if deceleration_mps2 is not None:
            _require_within(vehicle, deceleration_mps2)
        modes: dict[Action, Mode] = {
            Action.TRACK: vehicle.track(),
            Action.BRAKE: vehicle.brake.mode(),
        }
        felt = {} if deceleration_mps2 is None else {"brake_deceleration": deceleration_mps2}
        self._plants = {
            action: _Plant(vehicle.closed_loop(mode, frame).ode, felt)
            for action, mode in modes.items()
        }

    def start(self, speed_mps: float) -> CarState:
        """On the path's begin, straight wheels, integrals zero; at standstill under BRAKE."""
        values = (0.0, 0.0, 0.0, speed_mps, 0.0, 0.0, 0.0)
        if speed_mps > 0.0:
            return self._state(values, Action.TRACK)
        rest = (0.0,) * (self._plants[Action.BRAKE].size - len(values))
        return self._state(values + rest, Action.BRAKE)

    def drive(self, state: CarState, action: Action, duration_s: float) -> CarState:
        """The car after obeying `action` for `duration_s`."""
        plant = self._plants[action]
        values = np.array(self._switched(state, action, plant.size))
        count = math.ceil(duration_s / _LONGEST_STEP_S - _WHOLE)
        for _ in range(count):
            values = self._rk4(plant, values, duration_s / count)
        return self._state(tuple(float(value) for value in values), action)

    def _switched(self, state: CarState, action: Action, size: int) -> tuple[float, ...]:
        if action is state.action:
            return state.values
        station, offset, steering, _, heading_error, _, offset_integral = state.values[:7]
        kept = (station, offset, steering, state.speed_mps, heading_error, 0.0, offset_integral)
        return kept + (0.0,) * (size - len(kept))

    def _rk4(self, plant: _Plant, values: Array, step_s: float) -> Array:
        first = plant.rate(values, self._curvature_at(values[0]))
        middle = values + 0.5 * step_s * first
        second = plant.rate(middle, self._curvature_at(middle[0]))
        middle = values + 0.5 * step_s * second
        third = plant.rate(middle, self._curvature_at(middle[0]))
        end = values + step_s * third
        fourth = plant.rate(end, self._curvature_at(end[0]))
        return values + step_s / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)

    def _curvature_at(self, station_m: float) -> float:
        return float(np.interp(station_m, self._grid, self._curvature, left=0.0, right=0.0))

    def _state(self, values: tuple[float, ...], action: Action) -> CarState:
        inside = min(max(values[0], 0.0), self._path.length_m)
        x_m, y_m = (float(value) for value in self._path.position(inside))
        tangent = float(self._path.heading(inside))
        beyond, offset = values[0] - inside, values[1]
        return CarState(
            x_m + beyond * math.cos(tangent) - offset * math.sin(tangent),
            y_m + beyond * math.sin(tangent) + offset * math.cos(tangent),
            tangent + values[4],
            values,
            action,
        )


def _require_within(vehicle: Vehicle, deceleration_mps2: float) -> None:
    brake = vehicle.brake
    if not brake.deceleration_min_mps2 <= deceleration_mps2 <= brake.deceleration_max_mps2:
        raise InputError(
            f"deceleration_mps2: expected {brake.deceleration_min_mps2:g} to "
            f"{brake.deceleration_max_mps2:g}, what the vehicle's brake does, got "
            f"{deceleration_mps2!r}"
        )


@final
class _Plant:
    """One mode's field with nominal parameters; `felt` replaces nominal disturbances by name."""

    def __init__(self, ode: Ode, felt: Mapping[str, float]) -> None:
        if ode.names[: len(STATES)] != STATES:
            raise ValueError(f"expected the states {STATES} first, got {ode.names}")
        self.size = len(ode.names)
        self._field = ode.function()
        self._parameters = ode.parameter_values()
        self._disturbances = [felt.get(signal.name, signal.nominal) for signal in ode.disturbances]
        self._curvature = [signal.name for signal in ode.disturbances].index("curvature")

    def rate(self, values: Array, curvature_per_m: float) -> Array:
        disturbances = self._disturbances.copy()
        disturbances[self._curvature] = curvature_per_m
        return np.asarray(ca.DM(self._field(values, self._parameters, disturbances)).full()[:, 0])
