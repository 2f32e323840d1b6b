"""The real decision kernel of the shipped vehicle, and its queries and answers by name."""

from __future__ import annotations

import ctypes
import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.codegen import MonitorSpec
from workbench.codegen.bundle import bundle_files
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.native_calls import load_function
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
        states: Array = np.array(self.center) + signs * np.array(self.radius)
        return states.T


STARTS = {
    "initial set": Start(
        (0.0, 0.3, 0.0, 2.5, 0.0, 0.0, 0.0), (0.2, 0.2, 0.02, 0.2, 0.05, 0.0, 0.0)
    ),
    "point": Start((0.0, 0.0, 0.0, 2.8, 0.0, 0.0, 0.0), (0.0,) * 7),
    "accelerating": Start(
        (0.1, -0.2, 0.05, 1.0, 0.1, 0.0, 0.1), (0.1, 0.2, 0.02, 0.3, 0.05, 0.2, 0.1)
    ),
    "rate limit": Start(
        (0.0, 0.8, 0.0, 2.0, 0.1, 0.0, 0.0), (0.1, 0.05, 0.02, 0.1, 0.02, 0.1, 0.1)
    ),
    "braking": Start(
        (0.0, 0.1, 0.0, 2.4, 0.0, 0.0, 0.0), (0.1, 0.1, 0.01, 0.2, 0.02, 0.05, 0.05), 0.0
    ),
    "standing": Start(
        (0.0, -0.3, 0.2, 0.05, 0.05, 0.0, 0.0), (0.1, 0.1, 0.02, 0.1, 0.05, 0.0, 0.0), 0.0
    ),
}


def query(
    path: PathTable,
    start: Start,
    people: Sequence[Sequence[float]] = (),
    **changed: Sequence[float],
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
