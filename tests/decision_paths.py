"""Paths with exact geometry, and runs of the closed loop along them beside the kernel's answer."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from decision_answers import Array, TubeAnswer
from decision_fixture import BODY, STARTS, STEP_S, Start, kernel, query

from workbench.models.bicycle import PathFrame
from workbench.models.spline_path import SplinePath
from workbench.models.vehicle import gem_e2
from workbench.runtime.path import PathTable

# Fine times per segment of the tube in every simulation: 5 ms.
FINE = 10
RANDOM_POINTS = 30


class ExactPath:
    """A path by arc length with closed form (arc, straight) or dense (spline) geometry."""

    def __init__(self, table: PathTable, curvature: Array, spline: SplinePath | None) -> None:
        self.table = table
        self._k = float(curvature) if spline is None else 0.0
        self._spline = spline
        self.length_m = 40.0 if spline is None else spline.length_m
        if spline is not None:
            self._grid = np.linspace(0.0, spline.length_m, 40001)
            self._dense = np.column_stack(
                [
                    spline.curvature(self._grid),
                    spline.position(self._grid),
                    spline.heading(self._grid),
                ]
            )

    def curvature(self, s: Array) -> Array:
        if self._spline is None:
            return np.full_like(s, self._k)
        # Straight on before the start, as the table has it.
        return np.where(s < 0.0, 0.0, np.interp(s, self._grid, self._dense[:, 0]))

    def pose(self, s: Array) -> tuple[Array, Array, Array]:
        """x, y, heading of the path at stations s."""
        k = self._k
        if self._spline is None and k == 0.0:
            return s, np.zeros_like(s), np.zeros_like(s)
        if self._spline is None:
            return np.sin(k * s) / k, 2.0 * np.sin(0.5 * k * s) ** 2 / k, k * s
        x, y, heading = (np.interp(s, self._grid, self._dense[:, i]) for i in (1, 2, 3))
        before = np.minimum(s, 0.0)
        return x + before * np.cos(heading), y + before * np.sin(heading), heading

    def bins(self, s: Array) -> tuple[Array, Array]:
        """The table's curvature bounds at stations s."""
        place = np.floor((s - self.table.start_m) / self.table.spacing_m).astype(int)
        low, high = np.array(self.table.curvature_lower), np.array(self.table.curvature_upper)
        return low[place], high[place]


def arc(
    curvature: float, *, widened: float = 0.0, nodes: int = 128, spacing_m: float = 0.25
) -> ExactPath:
    """An arc through the origin; bin bounds `widened` to both sides of its curvature."""
    stations: Array = -4.0 + spacing_m * np.arange(nodes, dtype=np.float64)
    bare = ExactPath(
        _table(stations, (stations, stations, stations), 0.0, 0.0), np.array(curvature), None
    )
    poses = bare.pose(stations)
    table = _table(stations, poses, curvature - widened, curvature + widened)
    return ExactPath(table, np.array(curvature), None)


def _table(stations: Array, pose: tuple[Array, Array, Array], low: float, high: float) -> PathTable:
    x, y, heading = (tuple(column.tolist()) for column in pose)
    if low == high == 0.0:
        y = heading = (0.0,) * len(x)
    bins = len(x) - 1
    spacing_m = float(stations[1] - stations[0])
    return PathTable(float(stations[0]), spacing_m, x, y, heading, (low,) * bins, (high,) * bins)


@functools.cache
def s_curve() -> ExactPath:
    """A spline that turns left and right, down to radii of 7 m, straight before its start."""
    x = np.arange(0.0, 25.0, 2.0)
    path = SplinePath.through(np.column_stack([x, 1.5 * (1.0 - np.cos(0.3 * x))]))
    return ExactPath(path.table(0.24, before_m=4.0), np.array(0.0), path)


@functools.cache
def paths() -> dict[str, ExactPath]:
    return {
        "straight": arc(0.0),
        "left": arc(0.1),
        "right": arc(-0.1),
        "unsure": arc(0.03, widened=0.04),
        "S": s_curve(),
    }


@functools.cache
def _field(columns: int) -> tuple[Callable[..., object], list[str], list[float]]:
    ode = gem_e2().closed_loop(gem_e2().track(), PathFrame(-0.5, 0.5)).ode
    return ode.function().map(columns), [p.name for p in ode.parameters], ode.parameter_values()


def simulate(
    start: Start,
    states: Array,
    curvature: Callable[[Array], Array],
    *,
    steps: int,
    held: bool = False,
) -> Array:
    """RK4 at 5 ms of the closed loop over `steps` segments, shape (fine times, 7, columns).

    curvature: of the stations, asked at every stage, or once a step when `held`.
    """
    field, names, parameters = _field(states.shape[1])
    values = list(parameters)
    values[names.index("reference_speed")] = start.reference_mps
    p = np.tile(np.array(values)[:, None], states.shape[1])
    h = STEP_S / FINE
    fine = [states]
    for _ in range(FINE * steps):
        x = fine[-1]
        constant = curvature(x[0]) if held else None

        def rate(y: Array, constant: Array | None = constant) -> Array:
            w = curvature(y[0]) if constant is None else constant
            return np.asarray(field(y, p, w[None, :]))

        k1 = rate(x)
        k2 = rate(x + h / 2 * k1)
        k3 = rate(x + h / 2 * k2)
        k4 = rate(x + h * k3)
        fine.append(x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return np.array(fine)


@functools.cache
def exact_runs(where: str, start: str) -> tuple[TubeAnswer, Array]:
    """The tube of TRACK from a start on a path, and runs along that very path while it holds."""
    path, box = paths()[where], STARTS[start]
    answer = kernel()(query(path.table, box)).track
    states = box.states(RANDOM_POINTS, np.random.default_rng(7))
    return answer, simulate(box, states, path.curvature, steps=answer.steps)


def segments(fine: Array, steps: int) -> Array:
    """The fine times of the first `steps` segments, both ends included: (steps, 11, ...)."""
    return np.stack([fine[FINE * k : FINE * (k + 1) + 1] for k in range(steps)])


def plane_pose(path: ExactPath, states: Array) -> tuple[Array, Array, Array]:
    """x, y, heading of the rear axle from path states along axis -2."""
    station, offset, error = states[..., 0, :], states[..., 1, :], states[..., 4, :]
    x, y, heading = path.pose(station)
    return x - offset * np.sin(heading), y + offset * np.cos(heading), heading + error


def body_points(
    pose: tuple[Array, Array, Array], body: tuple[float, float, float] = BODY
) -> tuple[Array, Array]:
    """x, y of corners and edge points of the car body, on a new last axis."""
    front, rear, half_width = body
    along, across = np.linspace(-rear, front, 5), np.linspace(-half_width, half_width, 3)
    edge = [(a, b) for a in along for b in (-half_width, half_width)]
    edge += [(a, b) for a in (-rear, front) for b in across]
    a, b = np.array(edge).T
    x, y, heading = (part[..., None] for part in pose)
    cos, sin = np.cos(heading), np.sin(heading)
    return x + a * cos - b * sin, y + a * sin + b * cos


def rectangle_excess(rectangle: Array, x: Array, y: Array) -> Array:
    """How far points lie outside rectangles (rows: centre, heading, half length, half width)."""
    cx, cy, heading, half_length, half_width = np.moveaxis(rectangle, -1, 0)
    dx, dy = x - cx, y - cy
    along = np.abs(dx * np.cos(heading) + dy * np.sin(heading)) - half_length
    across = np.abs(dy * np.cos(heading) - dx * np.sin(heading)) - half_width
    return np.asarray(np.maximum(along, across))
