"""The path a recorded car followed, smoothed: the route it is taken to have planned."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.interpolate import make_lsq_spline

from workbench.errors import InputError
from workbench.models.spline_path import Array, SplinePath
from workbench.runtime.path import PathTable
from workbench.simulation.frames import Point
from workbench.simulation.observing import rear_axle
from workbench.simulation.recording import Recording

_DEGREE = 3
_LEAST_STEP_M = 0.05


@final
@dataclass(frozen=True, slots=True)
class PathSmoothing:
    """knot_spacing_m: between knots of the cubic fit; least_driven_m: below it there is no path;
    table_spacing_m: nodes of the monitor's table; before_m, after_m: its straight continuation, so
    that a prediction does not run off the ends. Raises InputError for a figure not above zero.
    """

    knot_spacing_m: float
    least_driven_m: float
    table_spacing_m: float
    before_m: float
    after_m: float

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{name}: expected finite metres above zero, got {value!r}")

    @classmethod
    def usual(cls) -> PathSmoothing:
        """Knots every 4 m, at least 3 m driven, nodes every 0.25 m, 10 m before and 40 m after."""
        return cls(4.0, 3.0, 0.25, 10.0, 40.0)

    def table(self, path: SplinePath) -> PathTable:
        """The monitor's table of `path`."""
        return path.table(self.table_spacing_m, before_m=self.before_m, after_m=self.after_m)


def recorded_path(
    recording: Recording, smoothing: PathSmoothing, *, reference_ahead_m: float
) -> SplinePath:
    """The way of the rear axle, as least-squares cubic splines x(s), y(s).

    s is the integral of the forward speed: position noise would make the sum of recorded steps too
    long. Standing and reversing samples are left out. Uses the whole recording: a route is known
    before it is driven. Raises InputError when less than least_driven_m is driven.
    """
    station = [0.0]
    points = [rear_axle(recording.vehicle[0], reference_ahead_m)]
    driven = 0.0
    for before, after in itertools.pairwise(recording.vehicle):
        speed = 0.5 * (before.speed_mps + after.speed_mps)
        driven += max(speed, 0.0) * (after.t_s - before.t_s)
        if driven >= station[-1] + _LEAST_STEP_M:
            station.append(driven)
            points.append(rear_axle(after, reference_ahead_m))
    if driven < smoothing.least_driven_m:
        raise InputError(
            f"recording {recording.name!r}: the vehicle drives {driven:.2f} m in "
            f"{recording.vehicle[-1].t_s - recording.vehicle[0].t_s:.1f} s, replay needs at least "
            f"{smoothing.least_driven_m:g} m to have a path; choose a recording that moves"
        )
    return SplinePath.through(_waypoints(np.array(station), np.array(points), smoothing))


def corners(table: PathTable) -> tuple[Point, ...]:
    """Every fourth node of a table and its last one, for drawing."""
    nodes = list(zip(table.x, table.y, strict=True))
    return (*nodes[:-1:4], nodes[-1])


def _waypoints(station: Array, points: Array, smoothing: PathSmoothing) -> Array:
    pieces = max(2, round(station[-1] / smoothing.knot_spacing_m))
    knots = np.linspace(0.0, station[-1], pieces + 1)
    # A stretch with fewer samples than pieces cannot determine a spline; take it as recorded.
    if np.histogram(station, knots)[0].min() < 1 or len(station) < len(knots) + _DEGREE:
        return points
    padded = np.r_[[knots[0]] * _DEGREE, knots, [knots[-1]] * _DEGREE]
    return np.asarray(make_lsq_spline(station, points, padded, _DEGREE)(knots))
