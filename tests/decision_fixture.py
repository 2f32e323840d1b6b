"""The real decision kernel of the shipped vehicle, its queries by name, and exact paths for it."""

from __future__ import annotations

import ctypes
import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.codegen import MonitorSpec
from workbench.codegen.bundle import bundle_files
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.tube_kernel import load_function
from workbench.models.bicycle import PathFrame
from workbench.models.spline_path import SplinePath
from workbench.models.vehicle import gem_e2
from workbench.runtime.manifest import (
    LIBRARY_FILE,
    MANIFEST_FILE,
    SOURCE_FILE,
    Manifest,
    manifest_from_json,
)
from workbench.runtime.path import PathTable

Array = NDArray[np.float64]
HORIZON_S, STEP_S = 3.0, 0.05
BODY = (2.26, 0.47, 0.8825)
SAFE, UNPROVED, INVALID = 0.0, 1.0, 2.0
COMPLETE, LEFT_REGION, NO_ENCLOSURE, BAD_INPUT = 0.0, 1.0, 2.0, 4.0
# Fine times per segment of the tube in every simulation: 5 ms.
FINE = 10
RANDOM_POINTS = 30


@functools.cache
def real_files() -> dict[str, bytes]:
    """The files of the shipped vehicle's bundle, made once."""
    return bundle_files(MonitorSpec(gem_e2(), HORIZON_S, STEP_S))


@functools.cache
def real_manifest() -> Manifest:
    return manifest_from_json(real_files()[MANIFEST_FILE].decode())


def write_real_bundle(folder: Path) -> Path:
    folder.mkdir(parents=True)
    for name, content in real_files().items():
        (folder / name).write_bytes(content)
    return folder


class Answer:
    """One result buffer, read by field."""

    def __init__(self, numbers: Array) -> None:
        self.numbers = numbers
        self._fields = {field.name: field.span for field in real_manifest().result}

    def scalar(self, name: str) -> float:
        return float(self.numbers[self._fields[name]][0])

    def rows(self, name: str, width: int) -> Array:
        return self.numbers[self._fields[name]].reshape(-1, width)[: self.steps]

    @property
    def verdict(self) -> float:
        return self.scalar("verdict")

    @property
    def status(self) -> float:
        return self.scalar("status")

    @property
    def steps(self) -> int:
        return int(self.scalar("steps_done"))


class DecisionKernel:
    """`wb_decide`, called on arrays; `fill` is what its buffers hold before a call."""

    def __init__(self, library: bytes) -> None:
        self._entry = load_function(library, "wb_decide")
        sizes = real_manifest().kernel
        self._result, self._work = np.zeros(sizes.result_size), np.zeros(sizes.work_size)

    def __call__(self, query: Array, *, fill: float = float("nan")) -> Answer:
        self._result[:] = fill
        self._work[:] = fill
        buffers = (np.ascontiguousarray(query), self._result, self._work)
        pointers = [b.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for b in buffers]
        assert self._entry(*pointers) == 0
        return Answer(self._result.copy())


@functools.cache
def kernel(optimisation: str = "-O2") -> DecisionKernel:
    """The kernel with the bundle's flags, but for the optimisation."""
    if optimisation == "-O2":
        return DecisionKernel(real_files()[LIBRARY_FILE])
    flags = tuple(optimisation if flag == "-O2" else flag for flag in FLAGS)
    source = real_files()[SOURCE_FILE].decode()
    return DecisionKernel(compile_shared(source, flags=flags).shared_object)


@dataclass(frozen=True, slots=True)
class Start:
    """An initial box of path states, and the reference speed."""

    center: tuple[float, ...]
    radius: tuple[float, ...]
    reference_mps: float = 2.8

    def states(self, count: int, chance: np.random.Generator) -> Array:
        """All vertices and `count` random points, as columns."""
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=7)))
        signs = np.unique(signs * (np.array(self.radius) > 0.0), axis=0)
        signs = np.vstack([signs, chance.uniform(-1.0, 1.0, (count, 7))])
        return (np.array(self.center) + signs * np.array(self.radius)).T


STARTS = {
    "initial set": Start((0.0, 0.3, 0.0, 2.5, 0.0, 0.0, 0.0), (0.2, 0.2, 0.02, 0.2, 0.05, 0.0, 0.0)),
    "point": Start((0.0, 0.0, 0.0, 2.8, 0.0, 0.0, 0.0), (0.0,) * 7),
    "accelerating": Start((0.1, -0.2, 0.05, 1.0, 0.1, 0.0, 0.1), (0.1, 0.2, 0.02, 0.3, 0.05, 0.2, 0.1)),
    "rate limit": Start((0.0, 0.8, 0.0, 2.0, 0.1, 0.0, 0.0), (0.1, 0.05, 0.02, 0.1, 0.02, 0.1, 0.1)),
    "braking": Start((0.0, 0.1, 0.0, 2.4, 0.0, 0.0, 0.0), (0.1, 0.1, 0.01, 0.2, 0.02, 0.05, 0.05), 0.0),
    "standing": Start((0.0, -0.3, 0.2, 0.05, 0.05, 0.0, 0.0), (0.1, 0.1, 0.02, 0.1, 0.05, 0.0, 0.0), 0.0),
}  # fmt: skip


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
                [spline.curvature(self._grid), spline.position(self._grid), spline.heading(self._grid)]
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
        return np.array(self.table.curvature_lower)[place], np.array(self.table.curvature_upper)[place]


def arc(curvature: float, *, widened: float = 0.0, nodes: int = 128, spacing_m: float = 0.25) -> ExactPath:
    """An arc through the origin; bin bounds `widened` to both sides of its curvature."""
    stations = -4.0 + spacing_m * np.arange(nodes)
    bare = ExactPath(_table(stations, (stations, stations, stations), 0.0, 0.0), np.array(curvature), None)
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
    """A spline that turns left and right with radii down to about 8 m, straight before its start."""
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


def query(
    path: PathTable, start: Start, people: Sequence[Sequence[float]] = (), **changed: Sequence[float]
) -> Array:
    """A query vector; `changed` replaces fields by name, missing numbers are zero."""
    manifest = real_manifest()
    parameters = [p.nominal for p in manifest.parameters]
    names = [p.name for p in manifest.parameters]
    parameters[names.index("reference_speed")] = start.reference_mps
    values: Mapping[str, Sequence[float]] = {
        "initial_center": start.center, "initial_radius": start.radius, "parameters": parameters,
        "path_count": [len(path.x)], "path_start_m": [path.start_m],
        "path_spacing_m": [path.spacing_m], "path_x": path.x, "path_y": path.y,
        "path_heading": path.heading, "path_curvature_lower": path.curvature_lower,
        "path_curvature_upper": path.curvature_upper, "front_m": BODY[:1], "rear_m": BODY[1:2],
        "half_width_m": BODY[2:], "people_count": [len(people)],
        "people": [number for person in people for number in person],
        "clearance_required_m": [0.2], **changed,
    }  # fmt: skip
    numbers = np.zeros(manifest.kernel.query_size)
    for field in manifest.query:
        given = values.get(field.name, field.default or ())
        numbers[field.offset : field.offset + len(given)] = given
    return numbers


def place(name: str, index: int = 0) -> int:
    """Position of a query field's number."""
    return next(f.offset for f in real_manifest().query if f.name == name) + index


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
def exact_runs(where: str, start: str) -> tuple[Answer, Array]:
    """The kernel's answer to a start on a path, and runs along that very path while it holds."""
    path, box = paths()[where], STARTS[start]
    answer = kernel()(query(path.table, box))
    states = box.states(RANDOM_POINTS, np.random.default_rng(7))
    return answer, simulate(box, states, path.curvature, steps=answer.steps)


def segments(fine: Array, steps: int) -> Array:
    """The fine times of each of the first `steps` segments, both ends included: (steps, 11, ...)."""
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
    return np.maximum(along, across)
