"""A sweep's folder: what is swept, the kernels, and rows in parts that are whole or missing.

manifest.json, study.toml, vehicle.toml
kernels/tube.so, kernels/runs.so        machine code, by its SHA-256 in kernels/kernels.json
parts/FIRST-LAST.parquet                one row per point and case
bundles, drives                         of finalists, see `driving`
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

from workbench import __version__
from workbench.errors import InputError
from workbench.models.vehicle import Vehicle, load_vehicle
from workbench.simulation.campaign.parts import Parts, require_same, write_whole
from workbench.simulation.gain_sweep.drives_section import check_drives
from workbench.simulation.gain_sweep.gains import GAINS, own_gains, with_gains
from workbench.simulation.gain_sweep.kernels import Kernels, Sources, build_kernels
from workbench.simulation.gain_sweep.plan import Plan, load_plan
from workbench.simulation.gain_sweep.scores import inputs_of

PART: Final = 64
"""Points per part, at most."""


@final
@dataclass(frozen=True, slots=True)
class Manifest:
    """What must be the same for rows to stand in one table."""

    version: str
    study_sha256: str
    vehicle_sha256: str


@final
@dataclass(frozen=True, slots=True)
class SweepStore:
    """A sweep's folder."""

    folder: Path

    def begin(self, study: Path) -> Plan:
        """Make it from a study file, or go on with one of the same. Raises InputError on a study
        that cannot be, and where something else was swept here."""
        plan = load_plan(study)
        vehicle = load_vehicle(plan.vehicle)
        _check(plan, vehicle)
        texts = [path.read_text(encoding="utf-8") for path in (study, plan.vehicle)]
        wanted = Manifest(__version__, *(hashlib.sha256(t.encode()).hexdigest() for t in texts))
        if self._manifest.exists():
            require_same(self.folder, wanted, self.manifest())
            return plan
        if self.folder.exists() and any(self.folder.iterdir()):
            raise InputError(
                f"{self.folder}: expected a sweep's folder or an empty one, got other files; name "
                "another with --out"
            )
        write_whole(self.folder / "study.toml", texts[0])
        write_whole(self.folder / "vehicle.toml", texts[1])
        write_whole(self._manifest, json.dumps(dataclasses.asdict(wanted), indent=2) + "\n")
        return plan

    def plan(self) -> Plan:
        """The study, of the vehicle's copy in the folder."""
        self.manifest()
        plan = load_plan(self.folder / "study.toml")
        return dataclasses.replace(plan, vehicle=self.folder / "vehicle.toml")

    def vehicle(self) -> Vehicle:
        """Whose gains are swept."""
        return load_vehicle(self.folder / "vehicle.toml")

    def manifest(self) -> Manifest:
        """Of what is there; raises InputError for a folder that is not a sweep's."""
        try:
            return Manifest(**json.loads(self._manifest.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError) as fault:
            raise InputError(
                f"{self.folder}: expected a sweep's folder with its manifest.json ({fault}); "
                "`workbench gains sweep STUDY --out DIR` makes one"
            ) from fault

    def build(self) -> None:
        """Compile the kernels unless they are there."""
        if self._kernels("kernels.json").exists():
            return
        plan, vehicle = self.plan(), self.vehicle()
        sources = build_kernels(vehicle, _ranges(plan, vehicle))
        digests = {}
        for name in ("tube", "runs"):
            code: bytes = getattr(sources, name)
            write_whole(self._kernels(f"{name}.so"), code)
            digests[name] = hashlib.sha256(code).hexdigest()
        write_whole(self._kernels("kernels.json"), json.dumps(digests, indent=2) + "\n")

    def kernels(self) -> Kernels:
        """Load what was built. Raises InputError where files are not as they were written."""
        digests = json.loads(self._kernels("kernels.json").read_text(encoding="utf-8"))
        found = {}
        for name in ("tube", "runs"):
            code = self._kernels(f"{name}.so").read_bytes()
            if hashlib.sha256(code).hexdigest() != digests.get(name):
                raise InputError(
                    f"{self._kernels(f'{name}.so')}: expected the file that the sweep wrote, got "
                    "another; remove the folder `kernels` to have it built again"
                )
            found[name] = code
        return Kernels.of(self.vehicle(), Sources(found["tube"], found["runs"]))

    def missing(self) -> list[range]:
        """Points that were not scored yet, in parts."""
        return self._parts.missing(self.plan().count + 1)

    def write(self, indices: range, rows: list[dict[str, Any]]) -> None:
        """One part, whole or not at all."""
        self._parts.write(indices, rows)

    def rows(self) -> list[dict[str, Any]]:
        """All rows, by point and case."""
        return self._parts.rows()

    @property
    def _parts(self) -> Parts:
        return Parts(self.folder / "parts", PART)

    @property
    def _manifest(self) -> Path:
        return self.folder / "manifest.json"

    def _kernels(self, name: str) -> Path:
        return self.folder / "kernels" / name


def _check(plan: Plan, vehicle: Vehicle) -> None:
    """Raise InputError on cases outside of what the vehicle file's proofs are about, and on drives
    that it cannot do."""
    if plan.drives is not None:
        check_drives(vehicle)
    most = vehicle.operation.curvature_per_m
    low, high = vehicle.operation.region.interval("speed")
    for case in plan.cases:
        if max(map(abs, case.curvature_per_m)) > most:
            raise InputError(
                f"[cases] curvatures_per_m: expected at most the vehicle's {most:g}, got "
                f"{list(case.curvature_per_m)}; bend less, or raise [operation] curvature_per_m"
            )
        if not low < case.speed_mps < high:
            raise InputError(
                f"[cases] speeds_mps: expected speeds inside the vehicle's operating region, "
                f"({low:g}, {high:g}), got {case.speed_mps:g}"
            )


def _ranges(plan: Plan, vehicle: Vehicle) -> dict[str, tuple[float, float]]:
    """Of the loop's parameters and disturbances over all points and cases."""
    values = own_gains(vehicle)
    ranges = {
        name: _hull(value, *plan.ranges.get(name, (value, value))) for name, value in values.items()
    }
    found = {GAINS[name].parameter: each for name, each in ranges.items()}
    found["reference_speed"] = _hull(*(case.speed_mps for case in plan.cases))
    # N and W grow with kd and look-ahead where [drive_by_wire] implies them.
    largest = {name: max(each, key=abs) for name, each in ranges.items()}
    for gains in (values, largest):
        inputs = inputs_of(with_gains(vehicle, gains, plan.cases[0].speed_mps), plan.cases[0])
        for name, each in inputs.items():
            found[name] = _hull(*each, *found.get(name, each))
    most = vehicle.operation.curvature_per_m
    return found | {"curvature": (-most, most)}


def _hull(*values: float) -> tuple[float, float]:
    return min(values), max(values)
