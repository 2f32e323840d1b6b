"""A hand-written kernel with the real interface, and bundles, paths and observations around it."""

from __future__ import annotations

import functools
import math
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from workbench.claims import Assumption, Rigor
from workbench.runtime import Bundle, Observation, PathTable, Person, load_bundle
from workbench.runtime.layout import query_counts, result_counts, tile
from workbench.runtime.manifest import (
    CHECKSUM_FILE,
    LIBRARY_FILE,
    MANIFEST_FILE,
    SOURCE_FILE,
    Golden,
    Kernel,
    Manifest,
    Parameter,
    StateSignal,
    VehicleBody,
    checksums_text,
    manifest_to_json,
)
from workbench.runtime.monitor import STATES
from workbench.runtime.native import NativeKernel
from workbench.sets import Box

STEPS, STEP_S, NODES, PEOPLE = 60, 0.05, 128, 32
FLAGS = ("-O2", "-shared", "-fPIC", "-ffp-contract=off", "-fno-fast-math")
PARAMETERS = (
    Parameter("reference_speed", "m/s", 2.8, 0.0, 6.0),
    Parameter("mischief", "1", 0.0, 0.0, 99.0),
)
QUERY = tile(
    {
        **query_counts(states=7, parameters=2, path_nodes=NODES, people=PEOPLE),
        "acceleration_bound": 1,
    },
    defaults={"acceleration_bound": (0.1,)},
)
RESULT = tile(result_counts(states=7, steps=STEPS), defaults={})
QUERY_SIZE = QUERY[-1].offset + QUERY[-1].count
RESULT_SIZE = RESULT[-1].offset + RESULT[-1].count

# The vehicle keeps its speed interval and everything else; the body is a disc about the rear axle.
# "Mischief" makes the kernel answer wrongly in one chosen way.
_BODY = r"""
#include <fenv.h>
#include <math.h>
long long wb_query_size(void) { return QUERY_SIZE; }
long long wb_result_size(void) { return RESULT_SIZE; }
long long wb_work_size(void) { return 4; }

static double position(const double *q, const double *column, double station) {
    double at = (station - q[Q_path_start_m]) / q[Q_path_spacing_m];
    double node = floor(fmin(fmax(at, 0.0), q[Q_path_count] - 2.0));
    int j = (int)node;
    return column[j] + (at - node) * (column[j + 1] - column[j]);
}

int wb_decide(const double *q, double *r, double *work) {
    int kind = (int)q[Q_parameters + 1];
    if (kind == 1) return 7;
    if (kind == 2) return 0;
    for (int i = 0; i < RESULT_SIZE; i++) r[i] = 0.0;
    for (int i = 0; i < QUERY_SIZE; i++)
        if (!isfinite(q[i])) { r[R_verdict] = 2.0; r[R_status] = 4.0; return 0; }
    const double *c = q + Q_initial_center, *d = q + Q_initial_radius;
    double body = hypot(fmax(q[Q_front_m], q[Q_rear_m]), q[Q_half_width_m]);
    double best = 1e300, when = 0.0, who = -1.0, end = q[Q_path_start_m]
        + q[Q_path_spacing_m] * (q[Q_path_count] - 1.0);
    int k, status = 0;
    for (k = 0; k < STEPS; k++) {
        double from = k * STEP_S, to = from + STEP_S, slow = c[3] - d[3], fast = c[3] + d[3];
        double low = c[0] - d[0] + fmin(slow * from, slow * to);
        double high = c[0] + d[0] + fmax(fast * from, fast * to);
        double *lo = r + R_tube_lower + 7 * k, *hi = r + R_tube_upper + 7 * k;
        double *box = r + R_occupancy + 5 * k, mid = 0.5 * (low + high);
        if (low < q[Q_path_start_m] || high > end) { status = 1; break; }
        for (int i = 0; i < 7; i++) { lo[i] = c[i] - d[i]; hi[i] = c[i] + d[i]; }
        lo[0] = low; hi[0] = high;
        box[2] = position(q, q + Q_path_heading, mid);
        box[0] = position(q, q + Q_path_x, mid) - c[1] * sin(box[2]);
        box[1] = position(q, q + Q_path_y, mid) + c[1] * cos(box[2]);
        box[3] = body + 0.5 * (high - low);
        box[4] = body + d[1];
        for (int i = 0; i < (int)q[Q_people_count]; i++) {
            const double *p = q + Q_people + 7 * i;
            double gap = hypot(p[0] + p[2] * to - box[0], p[1] + p[3] * to - box[1])
                - hypot(box[3], box[4]) - p[4] - p[5] * to - 0.5 * p[6] * to * to;
            if (gap < best) { best = gap; when = to; who = i; }
        }
    }
    int near = who >= 0.0 && best < q[Q_clearance_required_m];
    r[R_verdict] = (status || near) ? 1.0 : 0.0;
    r[R_status] = status;
    r[R_steps_done] = k;
    r[R_clearance_m] = best;
    r[R_clearance_time_s] = when;
    r[R_clearance_person] = who;
    work[0] = best;
    switch (kind) {
        case 3: r[R_verdict] = 7.0; break;
        case 4: r[R_verdict] = 0.5; break;
        case 5: r[R_status] = 9.0; break;
        case 6: r[R_steps_done] = 2.5; break;
        case 7: r[R_steps_done] = STEPS + 1; break;
        case 8: r[R_tube_lower + 24] = -INFINITY; break;
        case 9: r[R_tube_upper + 7 * STEPS - 1] = NAN; break;
        case 10: r[R_occupancy + 12] = NAN; break;
        case 11: r[R_tube_lower + 7] = r[R_tube_upper + 7] + 1.0; break;
        case 12: r[R_tube_lower + 3] = r[R_tube_upper + 3]; break;
        case 13: r[R_occupancy + 8] = -0.1; break;
        case 14: r[R_verdict] = 0.0; r[R_status] = 1.0; break;
        case 15: r[R_steps_done] = STEPS - 1; break;
        case 16: r[R_verdict] = 0.0; r[R_clearance_m] = q[Q_clearance_required_m] - 0.01; break;
        case 17: r[R_clearance_person] = -1.0; r[R_clearance_m] = 1e300; break;
        case 18: r[R_clearance_person] = q[Q_people_count]; break;
        case 19: r[R_clearance_time_s] = -0.1; break;
        case 20: r[R_clearance_time_s] = NAN; break;
        case 21: r[R_clearance_m] = NAN; break;
        case 22: r[R_clearance_person] = -1.0; break;
        case 23: r[R_verdict] = 1.0; r[R_status] = 2.0; r[R_steps_done] = 0.0; break;
        case 24: r[R_verdict] = 1.0; r[R_status] = 3.0; r[R_steps_done] = 10.0; break;
        case 25: r[R_verdict] = 2.0; break;
        case 26: r[R_verdict] = 1.0; r[R_status] = 4.0; break;
        case 27: fesetround(FE_UPWARD); break;
        case 28: r[R_verdict] = 1.0; r[R_clearance_person] = -1.0; r[R_clearance_m] = 1e300; break;
        case 29: r[R_occupancy + 9] = -0.1; break;
        case 30: r[R_tube_upper + 3] = r[R_tube_lower + 3]; break;
        default: break;
    }
    return 0;
}
"""


def fake_source() -> str:
    """The fake kernel's C text, with the layout as macros."""
    macros = [f"#define Q_{field.name} {field.offset}" for field in QUERY]
    macros += [f"#define R_{field.name} {field.offset}" for field in RESULT]
    macros += [f"#define QUERY_SIZE {QUERY_SIZE}", f"#define RESULT_SIZE {RESULT_SIZE}"]
    macros += [f"#define STEPS {STEPS}", f"#define STEP_S {STEP_S}"]
    return "\n".join(macros) + _BODY


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
def fake_manifest() -> Manifest:
    """The manifest that fits the fake kernel, golden vectors recorded from it (one with NaN)."""
    kernel = Kernel("wb_decide", QUERY_SIZE, RESULT_SIZE, 4)
    native = NativeKernel(compiled(fake_source()), kernel)
    query = [0.0] * QUERY_SIZE
    fields = {field.name: field for field in QUERY}
    query[fields["path_spacing_m"].offset] = 0.5
    query[fields["path_count"].offset] = 128.0
    query[fields["people_count"].offset] = 1.0
    query[fields["initial_center"].offset + 3] = 1.7
    golden = []
    for first in (1.0, math.nan):
        query[0] = first
        native.query[:] = memoryview(bytes(8 * QUERY_SIZE)).cast("d")
        for place, value in enumerate(query):
            native.query[place] = value
        golden.append(Golden(tuple(query), tuple(native.result.tolist()), native.run()))
        golden[-1] = replace(golden[-1], result=tuple(native.result.tolist()))
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
) -> Path:
    """Write a bundle with right hashes; `change` alters the manifest, the others replace files."""
    text = manifest_to_json(change(fake_manifest())) if manifest_text is None else manifest_text
    source = fake_source()
    files = {
        MANIFEST_FILE: text.encode(),
        LIBRARY_FILE: compiled(source) if library is None else library,
        SOURCE_FILE: source.encode(),
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
def fake_bundle(kind: int = 0) -> Bundle:
    """The loaded fake bundle, with one kind of mischief (0: none)."""
    with tempfile.TemporaryDirectory() as folder:
        return load_bundle(write_bundle(Path(folder), change=with_mischief(kind)))


def arc_table(
    curvature: float, *, nodes: int = 200, spacing_m: float = 0.25, start_m: float = -10.0
) -> PathTable:
    """An arc through the origin at station 0, facing along x there."""
    stations = [start_m + j * spacing_m for j in range(nodes)]
    points = [arc_point(curvature, s, 0.0) for s in stations]
    return PathTable(
        start_m,
        spacing_m,
        tuple(x for x, _ in points),
        tuple(y for _, y in points),
        tuple(curvature * s for s in stations),
        (curvature,) * (nodes - 1),
        (curvature,) * (nodes - 1),
    )


def arc_point(curvature: float, station: float, offset: float) -> tuple[float, float]:
    """The point with these path coordinates, in closed form."""
    turn = curvature * station
    if abs(turn) < 1e-12:
        return station, offset
    along = math.sin(turn) / curvature
    across = 2.0 * math.sin(0.5 * turn) ** 2 / curvature
    return along - offset * math.sin(turn), across + offset * math.cos(turn)


def observation(*people: Person, at: tuple[float, float] = (0.0, 0.0)) -> Observation:
    """A vehicle at 2 m/s near `at`, facing along x, with 0.1 m of position error."""
    x, y = at
    return Observation(
        x=(x - 0.1, x + 0.1),
        y=(y - 0.1, y + 0.1),
        heading=(-0.01, 0.01),
        steering=(-0.01, 0.01),
        speed=(1.9, 2.1),
        speed_integral=(0.0, 0.0),
        offset_integral=(0.0, 0.0),
        reference_speed_mps=2.8,
        people=people,
    )


def standing(name: str, x_m: float, y_m: float) -> Person:
    """A person who stands still."""
    return Person(name, x_m, y_m, 0.0, 0.0, 0.3, 0.0, 0.0)
