"""From a vehicle to a bundle on disk: the only bridge from analysis to the vehicle."""

from __future__ import annotations

import math
import platform
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench import __version__
from workbench.claims import Rigor
from workbench.codegen.assumptions import assumptions
from workbench.codegen.compiler import Compiled, compile_shared
from workbench.codegen.decision_header import decision_header
from workbench.codegen.decision_source import DecisionSizes, decision_layout, decision_source
from workbench.codegen.golden import golden_vectors
from workbench.codegen.whole_folder import write_folder
from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.system import Ode
from workbench.models.vehicle import Vehicle
from workbench.models.vehicle_sections import Uncertainty
from workbench.reach.learned.tube import LearnedTube
from workbench.reach.online.kernels import LOCAL_LINEAR, Method
from workbench.reach.ranged_parameters import with_ranged_parameters_as_disturbances
from workbench.runtime.contents import NestedLevel
from workbench.runtime.manifest import (
    CHECKED_FILES,
    CHECKSUM_FILE,
    HEADER_FILE,
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
from workbench.runtime.monitor_settings import MonitorSettings
from workbench.runtime.onboard.actuation import Wanted
from workbench.runtime.onboard.onboard_settings import ReadingErrors
from workbench.runtime.onboard.sensors_file import settings_from
from workbench.runtime.path import PathTable
from workbench.runtime.policies import BrakeBounds, Deciding
from workbench.runtime.signature import SIGNATURE_FILE
from workbench.sets import Box

# Every step is a row of the result and of the tables; memory and compile time follow.
LONGEST_S = 60.0
MOST_STEPS = 350
LEVELS = (
    NestedLevel("whole", 1.0),
    NestedLevel("two thirds", 2 / 3),
    NestedLevel("one third", 1 / 3),
)
MOST_LEVELS = 8
BUDGET = 3000
MOST_BUDGET = 10**6
# A station is a place along the path: the path table limits it, not the proof.
_STATIONS_M = (-1e6, 1e6)


@final
@dataclass(frozen=True, slots=True)
class MonitorSpec:
    """What a bundle is built for.

    vehicle: geometry, limits, gains, operating region; horizon_s: length of every tube, s;
    step_s: grid of the tube, s (the horizon must be a whole number of steps). levels: nested sets
    as shares of the observation's radii, the largest (1) first; deciding_level: the name of the one
    whose SAFE permits TRACK, the others advise. deciding: whose TRACK counts. budget: most steps of
    integration tried in one decision; what is not done by then is not proved. method: kernel and
    form that compute the tubes. learned: computes TRACK's in their place, on the same grid; such a
    bundle is SAMPLED, and no monitor drives or gates with it. path, monitor, sensors (the text of a
    TOML file, see `onboard.sensors_file`): what the vehicle's monitor needs besides a vehicle with
    [drive_by_wire]; None for a bundle that does not drive.
    """

    vehicle: Vehicle
    horizon_s: float
    step_s: float
    levels: tuple[NestedLevel, ...] = LEVELS
    deciding_level: str = LEVELS[0].name
    deciding: Deciding = Deciding.BOTH
    budget: int = BUDGET
    method: Method = LOCAL_LINEAR
    path: PathTable | None = None
    monitor: MonitorSettings | None = None
    sensors: str | None = None
    learned: LearnedTube | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "deciding", Deciding.named(self.deciding))
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
        names = [level.name for level in self.levels]
        if self.deciding_level not in names or len(names) > MOST_LEVELS:
            raise InputError(
                f"expected at most {MOST_LEVELS} levels and a deciding_level among them, got "
                f"{names} and {self.deciding_level!r}"
            )
        if not 1 <= self.budget <= MOST_BUDGET:
            raise InputError(f"expected a budget of 1 to {MOST_BUDGET} steps, got {self.budget!r}")
        if self.learned is not None and self.learned.step_s != self.step_s:
            raise InputError(
                f"expected a learned tube in steps of {self.step_s} s, as the others, got "
                f"{self.learned.step_s} s"
            )

    @property
    def steps(self) -> int:
        """Number of tube segments."""
        return round(self.horizon_s / self.step_s)

    @property
    def tubes(self) -> str:
        """What computes them, in words."""
        return str(self.method) if self.learned is None else f"TRACK learned, others {self.method}"

    @property
    def sizes(self) -> DecisionSizes:
        """What the kernel is built for."""
        deciding = [level.name for level in self.levels].index(self.deciding_level)
        return DecisionSizes(
            self.steps, self.step_s, len(self.levels), deciding, self.budget, self.method
        )


def build_bundle(spec: MonitorSpec, folder: Path) -> Path:
    """Compile the monitor of `spec` into `folder` and return it.

    Writes manifest.json, kernel.so, kernel.c, kernel.h and SHA256SUMS through a temporary folder,
    so nothing half-written stays; an existing bundle there is replaced, anything else refused
    (InputError).
    """
    target = Path(folder)
    if target.exists() and not _replaceable(target):
        raise InputError(f"{target} exists and is not a bundle; choose another folder")
    return write_folder(bundle_files(spec), target, what="bundle")


def _replaceable(target: Path) -> bool:
    """Whether it is a folder with nothing but what a bundle holds."""
    files = {*CHECKED_FILES, CHECKSUM_FILE, SIGNATURE_FILE}
    return target.is_dir() and {path.name for path in target.iterdir()} <= files


def bundle_files(spec: MonitorSpec) -> dict[str, bytes]:
    """The files of a bundle, name -> content."""
    ode = _track_loop(spec.vehicle)
    region = operating_region(spec.vehicle)
    source = decision_source(
        ode, spec.vehicle.brake.mode(), region, spec.sizes, learned=spec.learned
    )
    compiled = compile_shared(source)
    manifest = _manifest(spec, ode, compiled)
    if spec.sensors is not None:
        settings = settings_from(manifest, signed=False, tag=0)
        _check_granted(settings.reading, settings.gate, spec.vehicle.unsure())
    files = {
        MANIFEST_FILE: manifest_to_json(manifest).encode(),
        LIBRARY_FILE: compiled.shared_object,
        SOURCE_FILE: source.encode(),
        HEADER_FILE: decision_header(manifest.query, manifest.result).encode(),
    }
    return files | {CHECKSUM_FILE: checksums_text(files).encode()}


def _check_granted(reading: ReadingErrors, gate: Wanted, proved: Uncertainty) -> None:
    """Refuse a monitor that would let the controller read worse, or an upstream controller differ
    more, than the tubes take it to."""
    for name, allowed, granted in (
        ("[reading] offset_m", reading.offset_m, proved.lateral_m),
        ("[reading] heading_rad", reading.heading_rad, proved.heading_rad),
        ("[reading] speed_mps", reading.speed_mps, proved.speed_mps),
        ("[gate] acceleration_mps2", gate.acceleration_mps2, proved.upstream_acceleration_mps2),
        (
            "[gate] steering_rate_radps",
            gate.steering_rate_radps,
            proved.upstream_steering_rate_radps,
        ),
    ):
        if allowed > granted:
            raise InputError(
                f"sensors: expected {name} within the {granted:g} that the vehicle "
                f"file's [uncertainty] brings into the proof, got {allowed:g}; raise the one, or "
                "lower the other and measure better"
            )


def _track_loop(vehicle: Vehicle) -> Ode:
    """TRACK with all that the vehicle file is unsure of as disturbances."""
    # The kernel takes curvature from the path table, and refuses what lies outside of this.
    most = vehicle.operation.curvature_per_m
    loop = vehicle.uncertain_loop(vehicle.track(), PathFrame(-most, most))
    return with_ranged_parameters_as_disturbances(loop.ode)


def operating_region(vehicle: Vehicle) -> Box:
    """The vehicle's operating region over all path states (stations unlimited)."""
    region = vehicle.operation.region
    intervals = {"station": _STATIONS_M}
    return Box.from_intervals(intervals | {name: region.interval(name) for name in region.names})


def _manifest(spec: MonitorSpec, ode: Ode, compiled: Compiled) -> Manifest:
    brake, guard = spec.vehicle.brake, spec.vehicle.guard
    query, result = decision_layout(ode, brake.mode(), spec.sizes)
    body, region = spec.vehicle.geometry, spec.vehicle.operation.region
    wire = spec.vehicle.drive_by_wire
    kernel, golden = golden_vectors(compiled.shared_object, query, result, spec, ode)
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
        parameters=_parameters(ode, fastest_mps=region.interval("speed")[1]),
        vehicle=VehicleBody(
            spec.vehicle.name, body.wheelbase_m, body.front_m, body.rear_m, body.half_width_m
        ),
        steps=spec.steps,
        step_s=spec.step_s,
        horizon_s=spec.horizon_s,
        region=region,
        levels=spec.levels,
        deciding_level=spec.deciding_level,
        deciding=spec.deciding.value,
        brake=brake_bounds(spec.vehicle),
        guard_speed_max_mps=guard.speed_max_mps,
        guard_accel_max_mps2=guard.accel_max_mps2,
        budget=spec.budget,
        tubes=spec.tubes,
        rigor=Rigor.ENCLOSED if spec.learned is None else Rigor.SAMPLED,
        assumptions=assumptions(spec),
        golden=golden,
        drive_by_wire=None if wire is None else wire.value,
        path=spec.path,
        monitor=spec.monitor,
        sensors=spec.sensors,
    )


def brake_bounds(vehicle: Vehicle) -> BrakeBounds:
    """What BRAKE does at least in spite of an acceleration disturbance w.

    Until delay + build-up the speed grows by at most w (delay + build-up), then it falls by at
    least d - w: as if the brake had d - w alone and came later by the time that this growth takes.
    """
    brake, push = vehicle.brake, vehicle.unsure().acceleration_mps2
    if push == 0.0:
        return BrakeBounds(
            deceleration_min_mps2=brake.deceleration_min_mps2,
            delay_s=brake.delay_s,
            build_up_s=brake.build_up_s,
        )
    left = math.nextafter(brake.deceleration_min_mps2 - push, 0.0)
    later = push * (brake.delay_s + brake.build_up_s) / left
    return BrakeBounds(
        deceleration_min_mps2=left,
        delay_s=(brake.delay_s + later) * (1.0 + 2.0**-50),
        build_up_s=brake.build_up_s,
    )


def _parameters(ode: Ode, *, fastest_mps: float) -> tuple[Parameter, ...]:
    """The loop's parameters; the reference speed may be anything up to the region's fastest."""
    ranges = {q.name: (q.lower, q.upper) for q in ode.parameters}
    ranges["reference_speed"] = (0.0, fastest_mps)
    return tuple(Parameter(q.name, q.unit, q.nominal, *ranges[q.name]) for q in ode.parameters)
