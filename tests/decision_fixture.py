"""The real decision kernel of the shipped vehicle, and its queries and answers by name."""

from __future__ import annotations

import ctypes
import functools
import itertools
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from decision_answers import Answer, Array

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.codegen import MonitorSpec
from workbench.codegen.bundle import LEVELS, bundle_files, operating_region
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.decision_source import DecisionSizes, decision_layout, decision_source
from workbench.models.bicycle import PathFrame
from workbench.models.vehicle import gem_e2
from workbench.runtime.manifest import (
    LIBRARY_FILE,
    MANIFEST_FILE,
    SOURCE_FILE,
    Field,
    Manifest,
    manifest_from_json,
)
from workbench.runtime.path import PathTable
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import (
    FOREVER_S,
    DiscPiece,
    Person,
    PersonTube,
    TrackedPerson,
    TubeKind,
    packed,
    tracked,
)

HORIZON_S, STEP_S = 3.0, 0.05
BODY = (2.26, 0.47, 0.8825)
SAFE, UNPROVED, INVALID = 0.0, 1.0, 2.0
COMPLETE, LEFT_REGION, NO_ENCLOSURE, BAD_INPUT, UNFINISHED = 0.0, 1.0, 2.0, 4.0, 5.0
PROVED, NOT_PREDICTED, NOT_ASKED = 0.0, 1.0, 3.0
BUDGET = 3000
SHARES = tuple(level.share for level in LEVELS)
# A command one period after the next check, at a monitor of 30 Hz.
SWITCH_S, BRAKE_S = (0.15, 0.1834), (0.0, 0.0834)


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


@dataclass(frozen=True, slots=True)
class Text:
    """C text of a kernel, and how its queries and results are laid out."""

    source: str
    query: tuple[Field, ...]
    result: tuple[Field, ...]

    def edited(self, *edits: tuple[str, str]) -> Text:
        """Places of the text changed, each pattern matching once."""
        source = self.source
        for pattern, replacement in edits:
            source, count = re.subn(pattern, replacement, source)
            assert count == 1, (pattern, count)
        return Text(source, self.query, self.result)


@functools.cache
def real_text() -> Text:
    manifest = real_manifest()
    return Text(real_files()[SOURCE_FILE].decode(), manifest.query, manifest.result)


@functools.cache
def text_of(*, levels: int = 3, deciding: int = 0, budget: int = BUDGET) -> Text:
    """The text for the shipped vehicle under other levels or another budget."""
    vehicle = gem_e2()
    track = vehicle.closed_loop(vehicle.track(), PathFrame(-0.5, 0.5)).ode
    sizes = DecisionSizes(60, STEP_S, levels, deciding, budget)
    brake = vehicle.brake.mode()
    layout = decision_layout(track, brake, sizes)
    return Text(decision_source(track, brake, operating_region(vehicle), sizes), *layout)


class DecisionKernel:
    """`wb_decide`, called on arrays; `fill` is what its buffers hold before a call."""

    def __init__(self, library: bytes, text: Text) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "kernel.so"
            path.write_bytes(library)
            self.handle = ctypes.CDLL(str(path))
        self.handle["wb_work_size"].restype = ctypes.c_longlong
        self._fields = {field.name: field.span for field in text.result}
        last = text.result[-1]
        self._result = np.zeros(last.offset + last.count)
        self._work = np.zeros(self.handle["wb_work_size"]())

    def __call__(self, query: Array, *, fill: float = float("nan")) -> Answer:
        self._result[:] = fill
        self._work[:] = fill
        buffers = (np.ascontiguousarray(query), self._result, self._work)
        pointers = [b.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for b in buffers]
        assert self.handle["wb_decide"](*pointers) == 0
        return Answer(self._result.copy(), self._fields)


@functools.cache
def kernel() -> DecisionKernel:
    """The kernel of the bundle."""
    return DecisionKernel(real_files()[LIBRARY_FILE], real_text())


@functools.cache
def compiled(text: Text, optimisation: str = "-O0") -> DecisionKernel:
    """A kernel of any text; plain builds give the same bits and are made soonest."""
    flags = tuple(optimisation if flag == "-O2" else flag for flag in FLAGS)
    return DecisionKernel(compile_shared(text.source, flags=flags).shared_object, text)


def with_faults(text: Text, faults: Sequence[tuple[str, str]]) -> DecisionKernel:
    """The kernel with all faults (what stands in its text once, what stands there instead);
    its variable `wb_fault` chooses one by its number from 1 on, 0 none."""
    source = text.source
    chosen: dict[str, str] = {}
    for number, (right, wrong) in enumerate(faults, 1):
        assert source.count(right) == 1, right
        chosen[right] = f"(wb_fault == {number} ? ({wrong}) : {chosen.get(right, f'({right})')})"
    for place, right in enumerate(chosen):
        source = source.replace(right, f"@{place}@")
    for place, either in enumerate(chosen.values()):
        source = source.replace(f"@{place}@", either)
    return compiled(Text("int wb_fault;\n" + source, text.query, text.result))


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

    def scaled(self, share: float) -> Start:
        return Start(self.center, tuple(share * r for r in self.radius), self.reference_mps)


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

Seen = Sequence[float] | TrackedPerson


def guarded(numbers: Sequence[float], *, spread_mps: float = 0.2) -> TrackedPerson:
    """Somebody with the disc `numbers` a second ago for what they intend, and all they can do."""
    person = Person("", *numbers)
    piece = DiscPiece(-1.0, *person.numbers)
    limits = gem_e2().guard
    place = Disc(person.x_m, person.y_m, person.radius_m)
    velocity = Disc(person.vx_mps, person.vy_mps, spread_mps)
    guard = Guard(0.0, place, velocity, MotionLimits(limits.speed_max_mps, limits.accel_max_mps2))
    intent = PersonTube(TubeKind.INTENT, ((piece,),), FOREVER_S)
    return TrackedPerson("", (intent, guard_disc(guard, from_s=-1.0, until_s=FOREVER_S)))


def people_fields(people: Sequence[Seen]) -> dict[str, Sequence[float]]:
    """Seven numbers are a disc that somebody intends to stay in."""
    seen = [p if isinstance(p, TrackedPerson) else tracked(Person("", *p)) for p in people]
    numbers = packed(seen)
    return {
        "people_count": [numbers.count], "people_tubes": numbers.tubes,
        "tubes_count": [sum(len(person.tubes) for person in seen)],
        "people_pieces": numbers.pieces,
    }  # fmt: skip


def nested(start: Start, shares: Sequence[float] = SHARES) -> dict[str, Sequence[float]]:
    """The start's box about its centre, scaled by each share."""
    return {
        "initial_center": start.center * len(shares),
        "initial_radius": [share * r for share in shares for r in start.radius],
    }


def query(
    path: PathTable,
    start: Start,
    people: Sequence[Seen] = (),
    fields: Sequence[Field] | None = None,
    /,
    **changed: Sequence[float],
) -> Array:
    """A query vector; `changed` replaces fields by name, missing numbers are zero."""
    manifest = real_manifest()
    parameters = [p.nominal for p in manifest.parameters]
    names = [p.name for p in manifest.parameters]
    parameters[names.index("reference_speed")] = start.reference_mps
    values: Mapping[str, Sequence[float]] = {
        **nested(start), "parameters": parameters,
        "path_count": [len(path.x)], "path_start_m": [path.start_m],
        "path_spacing_m": [path.spacing_m], "path_x": path.x, "path_y": path.y,
        "path_heading": path.heading, "path_curvature_lower": path.curvature_lower,
        "path_curvature_upper": path.curvature_upper, "front_m": BODY[:1], "rear_m": BODY[1:2],
        "half_width_m": BODY[2:], **people_fields(people),
        "clearance_required_m": [0.2], "switch_s": SWITCH_S, "brake_s": BRAKE_S, **changed,
    }  # fmt: skip
    fields = manifest.query if fields is None else fields
    numbers = np.zeros(fields[-1].offset + fields[-1].count)
    for field in fields:
        given = values.get(field.name, field.default or ())
        assert len(given) <= field.count, field.name
        numbers[field.offset : field.offset + len(given)] = given
    return numbers


def place(name: str, index: int = 0) -> int:
    """Position of a query field's number."""
    return next(f.offset for f in real_manifest().query if f.name == name) + index
