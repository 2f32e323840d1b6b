"""From a vehicle to a bundle on disk: the only bridge from analysis to the vehicle."""

from __future__ import annotations

import math
import platform
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench import __version__
from workbench.claims import Assumption, Rigor
from workbench.codegen.compiler import Compiled, compile_shared
from workbench.codegen.decision_source import decision_layout, decision_source
from workbench.codegen.golden import golden_vectors
from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.system import Ode
from workbench.models.vehicle import Vehicle
from workbench.runtime.manifest import (
    CHECKSUM_FILE,
    LIBRARY_FILE,
    MANIFEST_FILE,
    SOURCE_FILE,
    Kernel,
    Manifest,
    Parameter,
    StateSignal,
    VehicleBody,
    checksums_text,
    manifest_to_json,
)
from workbench.sets import Box

# The kernel takes curvature from the path table; the model's own interval is a placeholder.
_ANY_CURVATURE = PathFrame(-0.5, 0.5)
# Every step is a row of the result and of the tables; memory and compile time follow.
LONGEST_S = 60.0
MOST_STEPS = 350
# A station is a place along the path: the path table limits it, not the proof.
_STATIONS_M = (-1e6, 1e6)

ASSUMPTIONS = (
    Assumption(
        "model", "the car moves as the kinematic bicycle under the bundle's control law",
        "none yet: no conformance fit; slip, lag and slope are not covered",
    ),
    Assumption(
        "initial set", "the true state lies in the intervals of the observation",
        "whoever fills the observation",
    ),
    Assumption(
        "estimation", "the controller reads the state without error, and nothing disturbs the car",
        "none: no estimation error and no disturbance but the path's curvature enter the tube",
    ),
    Assumption(
        "time", "the observation is of now, and commands act at once",
        "none: age, clock skew, computation and actuation delay are not in the tube",
    ),
    Assumption(
        "compiled code", "the compiler kept the operations of the generated C",
        "flags without contraction or reassociation, golden vectors compared bit for bit",
    ),
    Assumption(
        "floating point", "round to nearest, subnormal numbers kept",
        "checked at loading and around every call",
    ),
    Assumption(
        "rounding", "rounding, truncation and motion between instants are inside the tube",
        "proved: a budget over the operating region, see docs/online-kernel.md",
    ),
    Assumption(
        "people", "everybody stays in the disc predicted for them", "the prediction's own model",
    ),
    Assumption("sight", "nobody is where the sensors cannot see", "none: a stated limit"),
)  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class MonitorSpec:
    """What a bundle is built for.

    vehicle: geometry, limits, gains, operating region; horizon_s: length of every tube, s;
    step_s: grid of the tube, s (the horizon must be a whole number of steps).
    """

    vehicle: Vehicle
    horizon_s: float
    step_s: float

    def __post_init__(self) -> None:
        if not (0 < self.step_s <= self.horizon_s and math.isfinite(self.horizon_s)):
            raise InputError(
                f"expected 0 < step_s <= horizon_s, got {self.step_s!r} and {self.horizon_s!r}; "
                "give both in seconds, the step no longer than the horizon"
            )
        if self.horizon_s > LONGEST_S or self.horizon_s / self.step_s > MOST_STEPS + 0.5:
            raise InputError(
                f"expected a horizon of at most {LONGEST_S:g} s and {MOST_STEPS} steps, got "
                f"{self.horizon_s:g} s in steps of {self.step_s:g} s; give a shorter horizon or a "
                "longer step"
            )
        if abs(self.steps * self.step_s - self.horizon_s) > 1e-9:
            raise InputError(
                f"expected a horizon of whole steps, got {self.horizon_s} s in steps of "
                f"{self.step_s} s"
            )

    @property
    def steps(self) -> int:
        """Number of tube segments."""
        return round(self.horizon_s / self.step_s)


def build_bundle(spec: MonitorSpec, folder: Path) -> Path:
    """Compile the monitor of `spec` into `folder` and return it.

    Writes manifest.json, kernel.so, kernel.c and SHA256SUMS through a temporary folder, so nothing
    half-written stays; an existing bundle there is replaced, anything else refused (InputError).
    """
    target = Path(folder)
    if target.exists() and not (target / MANIFEST_FILE).is_file() and any(target.iterdir()):
        raise InputError(f"{target} exists and is not a bundle; choose another folder")
    files = bundle_files(spec)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=".bundle-", dir=target.parent))
    except OSError as error:
        raise InputError(
            f"cannot write a bundle to {target} ({error.strerror}); choose a folder you may write"
        ) from None
    try:
        for name, content in files.items():
            (fresh / name).write_bytes(content)
        fresh.chmod(0o755)
        if target.exists():
            shutil.rmtree(target)
        fresh.rename(target)
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise
    return target


def bundle_files(spec: MonitorSpec) -> dict[str, bytes]:
    """The files of a bundle, name -> content."""
    ode = spec.vehicle.closed_loop(spec.vehicle.track(), _ANY_CURVATURE).ode
    region = operating_region(spec.vehicle)
    source = decision_source(ode, region, steps=spec.steps, step_s=spec.step_s)
    compiled = compile_shared(source)
    text = manifest_to_json(_manifest(spec, ode, compiled))
    files = {
        MANIFEST_FILE: text.encode(),
        LIBRARY_FILE: compiled.shared_object,
        SOURCE_FILE: source.encode(),
    }
    return files | {CHECKSUM_FILE: checksums_text(files).encode()}


def operating_region(vehicle: Vehicle) -> Box:
    """The vehicle's operating region over all path states (stations unlimited)."""
    region = vehicle.operation.region
    intervals = {"station": _STATIONS_M}
    return Box.from_intervals(intervals | {name: region.interval(name) for name in region.names})


def _manifest(spec: MonitorSpec, ode: Ode, compiled: Compiled) -> Manifest:
    query, result = decision_layout(ode, spec.steps)
    body, region = spec.vehicle.geometry, spec.vehicle.operation.region
    kernel, golden = golden_vectors(compiled.shared_object, query, result, spec, ode)
    reference = (0.0, region.interval("speed")[1])
    return Manifest(
        name=spec.vehicle.name,
        created_by=f"workbench {__version__}",
        machine=platform.machine(),
        compiler=compiled.compiler,
        flags=compiled.flags,
        kernel=Kernel("wb_decide", **kernel),
        query=query,
        result=result,
        states=tuple(StateSignal(state.name, state.unit) for state in ode.states),
        parameters=tuple(
            Parameter(
                q.name,
                q.unit,
                q.nominal,
                *(reference if q.name == "reference_speed" else (q.lower, q.upper)),
            )
            for q in ode.parameters
        ),
        vehicle=VehicleBody(
            spec.vehicle.name, body.wheelbase_m, body.front_m, body.rear_m, body.half_width_m
        ),
        steps=spec.steps,
        step_s=spec.step_s,
        horizon_s=spec.horizon_s,
        region=region,
        rigor=Rigor.ENCLOSED,
        assumptions=ASSUMPTIONS,
        golden=golden,
    )
