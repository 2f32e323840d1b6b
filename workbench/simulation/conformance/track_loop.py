"""Closed-loop runs: windows in path coordinates, and the vehicle's TRACK loop as their model."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import casadi as ca
import numpy as np
from scipy.spatial import KDTree

from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.signals import Ranged, Signal
from workbench.models.spline_path import SplinePath
from workbench.models.system import Ode
from workbench.models.vehicle import Vehicle
from workbench.models.vehicle_sections import Uncertainty
from workbench.sets import Box
from workbench.simulation.conformance.driven_runs import DrivenRun
from workbench.simulation.conformance.first_order import one_step
from workbench.simulation.conformance.windows import (
    LONGEST_GAP_S,
    SIGNALS,
    Array,
    Measured,
    Window,
)

_OUTPUTS: Final = ("station", "offset", "steering", "speed", "heading_error")
_STATES: Final = (*_OUTPUTS, "speed_integral", "offset_integral")
_CURVE: Final = ("curvature_at_start", "curvature_slope", "curvature_spread")
_PUSH: Final = "acceleration_mps2"
_TURN: Final = "steering_rate_radps"
_SPACING_M: Final = 0.05
# Stations before and after the measured ones that a tube may reach.
_BEFORE_M: Final = 2.0
_AFTER_M: Final = 4.0
_LEAST_WAY_M: Final = 1e-3


@final
@dataclass(frozen=True, slots=True)
class RunErrors:
    """Radii of the set that a window's tube starts from, about the motion measured then.

    As much as localisation leaves open at least: bounds fitted with these figures are for tubes
    that start from no smaller sets.
    """

    station_m: float = 0.05
    offset_m: float = 0.05
    steering_rad: float = 0.005
    speed_mps: float = 0.05
    heading_rad: float = 0.01

    def radius(self) -> dict[str, float]:
        """By state; the integrals are known."""
        values = (self.station_m, self.offset_m, self.steering_rad, self.speed_mps,
                  self.heading_rad)  # fmt: skip
        return dict(zip(_OUTPUTS, values, strict=True)) | dict.fromkeys(_STATES[5:], 0.0)


@final
@dataclass(frozen=True, slots=True)
class TrackLoop:
    """The vehicle's TRACK loop along a path of curvature c0 + c1 station + spread w, |w| <= 1.

    Station counts from the window's beginning; c0, c1 and spread are constants of the window
    (states whose derivative is 0), so that all windows share their equations. fitted: keys of
    [uncertainty]; the others of N, W and the wheelbase stay as the vehicle file has them.
    """

    vehicle: Vehicle
    fitted: tuple[str, ...]

    @property
    def outputs(self) -> tuple[str, ...]:
        """Station, offset, steering, speed, heading error."""
        return _OUTPUTS

    @property
    def weights(self) -> tuple[float, ...]:
        """Metres; a radian of heading at the front bumper, one of steering at the front axle; the
        way of a second for a speed."""
        geometry = self.vehicle.geometry
        return (1.0, 1.0, geometry.wheelbase_m, 1.0, geometry.front_m)

    def ode(self, uncertainty: Uncertainty) -> Ode:
        """The loop with these bounds where they are fitted."""
        uncertainty = self.completed(uncertainty)
        loop = self.vehicle.closed_loop(
            self.vehicle.track(),
            PathFrame(0.0, 0.0),
            estimation_error=uncertainty.estimation_error(),
            disturbance=uncertainty.disturbance(),
            parameter_ranges=uncertainty.parameter_ranges(self.vehicle.geometry),
        )
        return _with_curve(loop.ode)

    def completed(self, uncertainty: Uncertainty) -> Uncertainty:
        """The vehicle file's section with the fitted keys from `uncertainty`."""
        fitted = {key: getattr(uncertainty, key) for key in self.fitted}
        return dataclasses.replace(self.vehicle.uncertainty, **fitted)


def _with_curve(ode: Ode) -> Ode:
    """The disturbance `curvature` as c0 + c1 station + spread w."""
    place = [d.name for d in ode.disturbances].index("curvature")
    start, slope, spread = (ca.SX.sym(name) for name in _CURVE)
    within = ca.SX.sym("curvature_within")
    curvature = start + slope * ode.x[ode.names.index("station")] + spread * within
    field = ca.substitute(ode.field, ode.w[place], curvature)
    disturbances, symbols = list(ode.disturbances), ca.vertsplit(ode.w)
    disturbances[place], symbols[place] = Ranged("curvature_within", "", 0.0, -1.0, 1.0), within
    units = ("1/m", "1/m^2", "1/m")
    further = tuple(Signal(name, unit) for name, unit in zip(_CURVE, units, strict=True))
    return Ode(
        ode.name, (*ode.states, *further), ode.parameters, tuple(disturbances),
        ca.vertcat(ode.x, start, slope, spread), ode.p, ca.vertcat(*symbols),
        ca.vertcat(field, ca.SX.zeros(len(_CURVE))),
    )  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class RunWindows:
    """How windows are cut from runs: disjoint, TRACK throughout, without gaps."""

    times_s: Array
    errors: RunErrors

    def of(self, runs: tuple[DrivenRun, ...], model: TrackLoop) -> Measured:
        """All windows of these runs."""
        windows = [window for run in runs for window in self._windows(run, model)]
        return Measured(self.times_s, tuple(windows))

    def _windows(self, run: DrivenRun, model: TrackLoop) -> Iterator[Window]:
        path = SplinePath.through(run.waypoints)
        states = path_states(run, path)
        times, place, length = run.column("t"), 0, float(self.times_s[-1])
        while place < len(times):
            end = int(np.searchsorted(times, times[place] + length - 1e-9))
            if end >= len(times):
                return
            part = slice(place, end + 1)
            whole = np.diff(times[part]).max(initial=0.0) <= LONGEST_GAP_S
            if whole and run.tracking[part].all():
                yield self._window(run, path, states[part], times[part], model)
                place = end
            else:
                place += 1

    def _window(
        self, run: DrivenRun, path: SplinePath, states: Array, times: Array, model: TrackLoop
    ) -> Window:
        at = self.times_s + times[0]
        on_grid = np.column_stack([np.interp(at, times, column) for column in states.T])
        curve = _curve(path, float(on_grid[0, 0]), float(on_grid[-1, 0]))
        bent = path.curvature(np.clip(on_grid[:, 0], 0.0, path.length_m))
        on_grid[:, 0] -= on_grid[0, 0]
        centre = dict(zip((*_STATES, *_CURVE), (*map(float, on_grid[0]), *curve), strict=True))
        radius = self.errors.radius() | dict.fromkeys(_CURVE, 0.0)
        initial = Box.around(centre, radius=radius)
        outputs = on_grid[:, : len(_OUTPUTS)]
        return Window(run.name, float(times[0]), initial, outputs, self._gaps(model, on_grid, bent))

    def _gaps(self, model: TrackLoop, states: Array, curvature: Array) -> Array:
        """Motion less the undisturbed model's, step by step, along the path's own curvature:
        acceleration, steering rate, sideways speed."""
        step_s, ways = float(self.times_s[1]), np.diff(states[:, 0])
        slope = np.diff(curvature) / np.where(np.abs(ways) > _LEAST_WAY_M, ways, np.inf)
        start = curvature[:-1] - slope * states[:-1, 0]
        curve = np.column_stack([start, slope, np.zeros_like(slope)])
        start_states = np.column_stack([states[:-1], curve])
        predicted, gain = one_step(model, start_states, step_s=step_s)
        missed = states[1:, [3, 2, 1]] - predicted[:, [3, 2, 1]]
        pushed, turned = gain[SIGNALS[_PUSH]][:, 3], gain[SIGNALS[_TURN]][:, 2]
        # The controller works against what pushes within the step already.
        effect = np.column_stack([pushed, turned, np.full(len(missed), step_s)])
        return np.asarray(missed / effect)


def path_states(run: DrivenRun, path: SplinePath) -> Array:
    """(M, 7): station, offset, steering, speed, heading error and the integrals at each instant.

    The projection is the nearest point, by Newton steps from the nearest of points 0.05 m apart.
    Raises InputError where a run leaves its path's ends.
    """
    along = np.linspace(0.0, path.length_m, max(2, round(path.length_m / _SPACING_M)))
    xy = np.column_stack([run.column("x"), run.column("y")])
    station = along[KDTree(path.position(along)).query(xy)[1]]
    for _ in range(4):
        heading = path.heading(station)
        apart = xy - path.position(station)
        ahead = np.cos(heading) * apart[:, 0] + np.sin(heading) * apart[:, 1]
        left = np.cos(heading) * apart[:, 1] - np.sin(heading) * apart[:, 0]
        step = ahead / np.maximum(1.0 - path.curvature(station) * left, 0.1)
        station = np.clip(station + step, 0.0, path.length_m)
    if np.abs(step).max() > _SPACING_M:
        raise InputError(
            f"run {run.name!r}: expected a path that reaches beyond the run at both ends, got "
            f"positions {np.abs(ahead).max():.2f} m off its end; add waypoints"
        )
    turned = run.column("heading") - path.heading(station)
    return np.column_stack([
        station, left, run.column("steering"), run.column("speed"),
        (turned + np.pi) % (2 * np.pi) - np.pi,
        run.column("speed_integral"), run.column("offset_integral"),
    ])  # fmt: skip


def _curve(path: SplinePath, begin_m: float, end_m: float) -> tuple[float, float, float]:
    """c0, c1 (station from begin_m) and the largest residual about a window's stretch of path."""
    stations = np.arange(begin_m - _BEFORE_M, end_m + _AFTER_M, _SPACING_M)
    inside = np.clip(stations, 0.0, path.length_m)
    curvature = np.where(stations == inside, path.curvature(inside), 0.0)
    slope, start = np.polyfit(stations - begin_m, curvature, 1)
    residual = np.abs(curvature - start - slope * (stations - begin_m)).max()
    return float(start), float(slope), float(residual)
