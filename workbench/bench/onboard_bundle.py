"""The bundle that the board of the vehicle's monitor drives, where none is given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from workbench.codegen.bundle import MonitorSpec, build_bundle
from workbench.errors import InputError
from workbench.models.vehicle import Vehicle, gem_e2_drive_path, load_vehicle
from workbench.models.vehicle_sections import Uncertainty
from workbench.runtime.bundle import Bundle, load_bundle
from workbench.runtime.monitor_settings import MonitorSettings
from workbench.runtime.policies import Deciding, Timing
from workbench.simulation.onboard_car import straight_road

BUDGET: Final = 200
HORIZON_S: Final = 2.0
STEP_S: Final = 0.05
_REFERENCE_MPS: Final = 1.2
_STOP_MPS: Final = 0.5
_TIMING: Final = Timing(period_s=0.12, latency_s=0.1, send_gap_s=0.055)


def shuttle() -> Vehicle:
    """The shipped driving vehicle with the shipped sensors' [reading] granted by its proof.

    A controller that knows its speed within 0.48 m/s needs a higher speed at which braking freezes
    the steering.
    """
    shipped = load_vehicle(gem_e2_drive_path())
    wire = shipped.drive_by_wire
    assert wire is not None, "the shipped driving file has the section"
    return replace(
        shipped,
        operation=replace(shipped.operation, reference_speed_mps=_REFERENCE_MPS),
        brake=replace(shipped.brake, stop_speed_mps=_STOP_MPS),
        drive_by_wire=replace(wire, value=replace(wire.value, stop_speed_mps=_STOP_MPS)),
        uncertainty=Uncertainty(
            lateral_m=0.2, heading_rad=0.05, speed_mps=0.48, provenance="the shipped sensors file"
        ),
    )


def build_driving(folder: Path, *, budget: int = BUDGET) -> Path:
    """Build it on a straight road; see `build_bundle`."""
    sensors = gem_e2_drive_path().with_name("gem_e2_sensors.toml").read_text(encoding="utf-8")
    spec = MonitorSpec(
        shuttle(), HORIZON_S, STEP_S, deciding=Deciding.FAIL_SAFE, budget=budget,
        path=straight_road(-20.0, 180.0), monitor=MonitorSettings(5, 0.2, _TIMING), sensors=sensors,
    )  # fmt: skip
    return build_bundle(spec, folder)


def require_driving(folder: Path) -> Bundle:
    """The bundle, if it is made for driving by PACMod 2; InputError otherwise."""
    bundle = load_bundle(folder)
    manifest = bundle.manifest
    parts = ("drive_by_wire", "path", "monitor", "sensors")
    missing = [name for name in parts if getattr(manifest, name) is None]
    if missing or manifest.drive_by_wire is None or manifest.drive_by_wire.protocol != "pacmod2":
        raise InputError(
            "the board `onboard` drives what it measures: expected a bundle for a car with PACMod "
            f"2, got {folder}, whose manifest lacks {missing}; build it with --path, --sensors and "
            "--clearance, or choose boards with --board"
        )
    return bundle
