"""A hand-written kernel with the real interface, and bundles around it."""

from __future__ import annotations

import functools
import math
import platform
import shutil
import subprocess
import tempfile
from array import array
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from workbench.claims import Assumption, Rigor
from workbench.runtime import Bundle, load_bundle
from workbench.runtime.layout import query_counts, result_counts, tile
from workbench.runtime.manifest import (
    CHECKSUM_FILE,
    HEADER_FILE,
    LIBRARY_FILE,
    MANIFEST_FILE,
    SOURCE_FILE,
    Golden,
    Kernel,
    Manifest,
    NestedLevel,
    Parameter,
    StateSignal,
    VehicleBody,
    checksums_text,
    manifest_to_json,
)
from workbench.runtime.monitor import STATES
from workbench.runtime.native import NativeKernel
from workbench.runtime.policies import BrakeBounds
from workbench.sets import Box

STEPS, STEP_S, NODES = 60, 0.05, 128
LEVELS = (
    NestedLevel("whole", 1.0), NestedLevel("two thirds", 2 / 3), NestedLevel("one third", 1 / 3),
)  # fmt: skip
BUDGET = 1000
FLAGS = ("-O2", "-shared", "-fPIC", "-ffp-contract=off", "-fno-fast-math")
PARAMETERS = (
    Parameter("reference_speed", "m/s", 2.8, 0.0, 6.0),
    Parameter("mischief", "1", 0.0, 0.0, 99.0),
)
QUERY = tile(
    {
        **query_counts(states=7, parameters=2, path_nodes=NODES, levels=len(LEVELS)),
        "acceleration_bound": 1,
    },
    defaults={"acceleration_bound": (1.0,)},
)
RESULT = tile(result_counts(states=7, steps=STEPS, levels=len(LEVELS)), defaults={})
QUERY_SIZE = QUERY[-1].offset + QUERY[-1].count
RESULT_SIZE = RESULT[-1].offset + RESULT[-1].count


def fake_source(deciding: int = 0) -> str:
    """The fake kernel's C text, with the layout as macros; deciding: index of a level."""
    first = next(field.offset for field in RESULT if field.name == "track_verdicts")
    track = {f.name.removeprefix("track_"): f for f in RESULT if f.name.startswith("track_")}
    size = sum(field.count for field in track.values())
    macros = [f"#define Q_{field.name} {field.offset}" for field in QUERY]
    macros += [f"#define R_{field.name} {field.offset}" for field in RESULT]
    macros += [f"#define T_{name} {field.offset - first}" for name, field in track.items()]
    macros += [f"#define QUERY_SIZE {QUERY_SIZE}", f"#define RESULT_SIZE {RESULT_SIZE}"]
    macros += [f"#define STEPS {STEPS}", f"#define STEP_S {STEP_S}", f"#define T_SIZE {size}"]
    macros += [f"#define LEVELS {len(LEVELS)}", f"#define DECIDING {deciding}"]
    return "\n".join([*macros, (Path(__file__).parent / "fake_kernel.c").read_text()])


@functools.cache
def compiled(source: str, flags: tuple[str, ...] = FLAGS) -> bytes:
    """The shared object of a C text; skips the test where there is no compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs the optional tool cc")
    with tempfile.TemporaryDirectory() as folder:
        text, library = Path(folder) / "kernel.c", Path(folder) / "kernel.so"
        text.write_text(source)
        subprocess.run([compiler, *flags, "-o", library, text, "-lm"], check=True)
        return library.read_bytes()


@functools.cache
def fake_manifest(deciding: int = 0) -> Manifest:
    """The manifest that fits the fake kernel, golden vectors recorded from it (one with NaN)."""
    kernel = Kernel("wb_decide", QUERY_SIZE, RESULT_SIZE, 4)
    native = NativeKernel(compiled(fake_source(deciding)), kernel)
    query = [0.0] * QUERY_SIZE
    fields = {field.name: field for field in QUERY}
    query[fields["path_spacing_m"].offset] = 0.5
    query[fields["path_count"].offset] = 128.0
    query[fields["initial_center"].offset + 3] = 1.7
    golden = []
    for first in (1.0, math.nan):
        query[0] = first
        native.query[:] = memoryview(array("d", query))
        returns = native.run()
        golden.append(Golden(tuple(query), tuple(native.result.tolist()), returns))
    return Manifest(
        name="fake",
        created_by="tests",
        machine=platform.machine(),
        compiler="cc",
        flags=FLAGS,
        kernel=kernel,
        query=QUERY,
        result=RESULT,
        states=tuple(StateSignal(name, "m") for name in STATES),
        parameters=PARAMETERS,
        vehicle=VehicleBody("cart", 1.75, 2.3, 0.4, 0.6, (("mass_kg", 700.0),)),
        steps=STEPS,
        step_s=STEP_S,
        horizon_s=STEPS * STEP_S,
        region=Box.from_intervals({"offset": (-2.0, 2.0), "speed": (-0.5, 6.0)}),
        levels=LEVELS,
        deciding_level=LEVELS[deciding].name,
        deciding="LookAhead",
        brake=BrakeBounds(deceleration_min_mps2=2.0, delay_s=0.0, build_up_s=0.0),
        guard_speed_max_mps=2.5,
        guard_accel_max_mps2=2.0,
        budget=BUDGET,
        tubes="local, linear",
        rigor=Rigor.ENCLOSED,
        assumptions=(Assumption("model", "the fake model is exact", "none"),),
        golden=tuple(golden),
    )


def write_bundle(
    folder: Path,
    *,
    change: Callable[[Manifest], Manifest] = lambda manifest: manifest,
    library: bytes | None = None,
    manifest_text: str | None = None,
    deciding: int = 0,
) -> Path:
    """Write a bundle with right hashes; `change` alters the manifest, the others replace files."""
    manifest = change(fake_manifest(deciding))
    text = manifest_to_json(manifest) if manifest_text is None else manifest_text
    source = fake_source(deciding)
    files = {
        MANIFEST_FILE: text.encode(),
        LIBRARY_FILE: compiled(source) if library is None else library,
        SOURCE_FILE: source.encode(),
        HEADER_FILE: b"/* the fake kernel takes and gives what the manifest says */\n",
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    (folder / CHECKSUM_FILE).write_text(checksums_text(files))
    return folder


def with_mischief(kind: int) -> Callable[[Manifest], Manifest]:
    """A manifest change that makes the kernel misbehave in every call of a monitor."""

    def change(manifest: Manifest) -> Manifest:
        speed, mischief = manifest.parameters
        return replace(manifest, parameters=(speed, replace(mischief, nominal=float(kind))))

    return change


@functools.cache
def fake_bundle(kind: int = 0, deciding: int = 0) -> Bundle:
    """The loaded fake bundle, with one kind of mischief (0: none)."""
    with tempfile.TemporaryDirectory() as folder:
        change = with_mischief(kind)
        return load_bundle(write_bundle(Path(folder), change=change, deciding=deciding))
