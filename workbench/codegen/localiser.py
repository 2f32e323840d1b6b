"""From a site file to a localiser's folder: shared object, C text, numbers and hashes."""

from __future__ import annotations

import platform
from array import array
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench import __version__
from workbench.codegen.c_source import FLOOR, function_text
from workbench.codegen.compiler import Compiled, compile_shared
from workbench.codegen.whole_folder import write_folder
from workbench.errors import InputError
from workbench.estimation.localisation_filter import filter_functions
from workbench.estimation.localisation_sets import LEVELS, Shape
from workbench.estimation.localisation_states import HYPOTHESES, STATES, VEHICLE_STATES, WINDOW
from workbench.runtime.contents import CHECKSUM_FILE, Golden
from workbench.runtime.localiser.folder import FILES, LIBRARY_FILE, SOURCE_FILE, called
from workbench.runtime.localiser.native_steps import native_steps
from workbench.runtime.localiser.numbers import (
    NUMBERS_FILE,
    Clocks,
    Numbers,
    SetLevel,
    Vehicle,
    numbers_to_json,
)
from workbench.runtime.localiser.site import Site
from workbench.runtime.localiser.steps import NAMES, Steps
from workbench.runtime.manifest import checksums_text
from workbench.runtime.signature import SIGNATURE_FILE


@final
@dataclass(frozen=True, slots=True)
class LocaliserSpec:
    """What a localiser is built for; shape: how a level becomes a box; level: of the sets sent."""

    site: Site
    vehicle: Vehicle
    clocks: Clocks
    shape: Shape
    level: float


def localiser_files(spec: LocaliserSpec) -> dict[str, bytes]:
    """The files of a localiser's folder, name -> content. Raises InputError as `Numbers` does."""
    functions = filter_functions(spec.site, wheelbase_m=spec.vehicle.wheelbase_m).all()
    source = "\n".join(["#include <math.h>", FLOOR, function_text(functions)])
    compiled = compile_shared(source)
    numbers = _numbers(spec, compiled)
    files = {
        NUMBERS_FILE: numbers_to_json(numbers).encode(),
        LIBRARY_FILE: compiled.shared_object,
        SOURCE_FILE: source.encode(),
    }
    return files | {CHECKSUM_FILE: checksums_text(files).encode()}


def write_localiser(files: Mapping[str, bytes], folder: Path, *, replaces: bool) -> Path:
    """Write such files into a new folder, whole or not at all, and return it.

    replaces: an older localiser in its place gives way. Raises InputError as `require_place` does.
    """
    require_place(folder, replaces=replaces)
    return write_folder(files, folder, what="localiser")


def require_place(folder: Path, *, replaces: bool) -> None:
    """Raise InputError where something stands that must not be replaced."""
    if folder.exists() and not (replaces and _is_localiser(folder)):
        raise InputError(
            f"{folder} exists; choose another folder, or --force to replace a localiser there"
        )


def _is_localiser(folder: Path) -> bool:
    """Whether it is a folder with nothing but what a localiser holds."""
    names = {*FILES, CHECKSUM_FILE, SIGNATURE_FILE}
    return folder.is_dir() and {path.name for path in folder.iterdir()} <= names


def _numbers(spec: LocaliserSpec, compiled: Compiled) -> Numbers:
    return Numbers(
        created_by=f"workbench {__version__}", machine=platform.machine(),
        compiler=compiled.compiler, flags=compiled.flags, site=spec.site, vehicle=spec.vehicle,
        clocks=spec.clocks, shape=type(spec.shape).__name__, level=spec.level,
        levels=tuple(
            SetLevel(level, spec.shape.deviations(level, VEHICLE_STATES)) for level in LEVELS
        ),
        golden=_golden(spec.site, native_steps(compiled.shared_object)),
    )  # fmt: skip


def _golden(site: Site, steps: Steps) -> tuple[Golden, ...]:
    """One call of each function, with numbers as they occur in the middle of the beacons."""
    beacons, n = site.beacons, len(STATES)
    places = [(b.x_m, b.y_m, b.height_m) for b in (beacons * WINDOW)[:WINDOW]]
    x, y = (sum(b[k] for b in places) / WINDOW for k in (0, 1))
    mean = [x, y, 0.3, 1.5, 0.05, 0.01, -0.004]
    spread = [0.01 if i == j else 0.001 / (1 + i + j) for i in range(n) for j in range(n)]
    ranges = [0.1 + ((x - bx) ** 2 + (y - by) ** 2) ** 0.5 for bx, by, _ in places]
    learning, many = [1.0] * n, range(HYPOTHESES)
    given = (
        [*mean, *spread, 0.2, 0.05, 0.03, 0.0],
        [*mean, *spread, 1.55, *learning],
        [*mean, *spread, 0.04, *learning],
        [*mean, *spread, ranges[0], *places[0], *learning],
        [*(number for place in places for number in place), *ranges, *[1.0] * WINDOW],
        [*(m + 0.01 * k for k in many for m in mean), *spread * HYPOTHESES,
         *(-0.1 * k for k in many)],
    )  # fmt: skip
    return tuple(
        Golden(tuple(numbers), called(getattr(steps, name), array("d", numbers)))
        for name, numbers in zip(NAMES, given, strict=True)
    )
