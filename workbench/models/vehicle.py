"""Vehicle files: TOML with units in the key names, read into one checked value."""

from __future__ import annotations

import dataclasses
import importlib.resources
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, final

from workbench.controllers import Mode, PathFollowing, SpeedPid, SteeringPid, Track
from workbench.errors import InputError
from workbench.models.bicycle import Frame
from workbench.models.closed_loop import ClosedLoop, Disturbance, EstimationError
from workbench.models.drive_by_wire import (
    DriveByWireSection,
    drive_by_wire_section,
    reading_gain_per_s,
)
from workbench.models.section_reading import (
    as_interval,
    as_number,
    as_table,
    as_text,
    read_file,
    read_section,
    require_keys,
)
from workbench.models.vehicle_sections import (
    REGION_KEYS,
    STATE_KEYS,
    Brake,
    Geometry,
    Guard,
    Limits,
    Operation,
    SpeedGains,
    SteeringGains,
    Uncertainty,
)
from workbench.sets import Box

_Section = TypeVar(
    "_Section", Geometry, Limits, SteeringGains, SpeedGains, Guard, Brake, Uncertainty
)


@final
@dataclass(frozen=True, slots=True)
class Vehicle:
    """One vehicle: all that its closed loop, its body, its operating region and its guard need.

    `guard` bounds how people move around it. `initial_set` is in path states. Change parts with
    `dataclasses.replace` or `with_geometry`. Raises InputError when the initial set leaves the
    operating region.
    """

    name: str
    provenance: str
    geometry: Geometry
    limits: Limits
    steering_pid: SteeringGains
    speed_pid: SpeedGains
    operation: Operation
    initial_set: Box
    initial_set_provenance: str
    guard: Guard
    brake: Brake
    uncertainty: Uncertainty = dataclasses.field(default_factory=Uncertainty)
    drive_by_wire: DriveByWireSection | None = None

    def __post_init__(self) -> None:
        if self.drive_by_wire is not None:
            self.drive_by_wire.check(self.limits, self.brake)
        self._check_uncertainty()
        for name in REGION_KEYS.values():
            low, high = self.operation.region.interval(name)
            start_low, start_high = self.initial_set.interval(name)
            if start_low < low or start_high > high:
                raise InputError(
                    f"initial_set: expected {name} inside the operating region [{low}, {high}], "
                    f"got [{start_low}, {start_high}]; shrink the set or widen the region"
                )

    def _check_uncertainty(self) -> None:
        unsure, source = self.unsure(), "[uncertainty]"
        if self.drive_by_wire is not None:
            source += " with [drive_by_wire]"
        for key, below, why in (
            ("wheelbase_m", self.geometry.wheelbase_m, "the wheelbase itself"),
            ("acceleration_mps2", self.brake.deceleration_min_mps2,
             "[brake] deceleration_min_mps2, or the car would not stand still"),
            ("speed_mps", self.brake.stop_speed_mps,
             "[brake] stop_speed_mps, or a standing car would steer"),
        ):  # fmt: skip
            value = getattr(unsure, key)
            if not value < below:
                raise InputError(
                    f"{source} {key}: expected less than {below!r} ({why}), got {value!r}"
                )

    def unsure(self) -> Uncertainty:
        """What its loop is unsure of: [uncertainty] with what it grants to an upstream controller,
        and what [drive_by_wire] implies."""
        granted = self.uncertainty.more(
            acceleration_mps2=self.uncertainty.upstream_acceleration_mps2,
            steering_rate_radps=self.uncertainty.upstream_steering_rate_radps,
        )
        if self.drive_by_wire is None:
            return granted
        tangent = math.tan(self.limits.steering_rad)
        gain_per_s = reading_gain_per_s(
            self.steering_pid,
            wheelbase_m=self.geometry.wheelbase_m - self.uncertainty.wheelbase_m,
            speed_mps=max(map(abs, self.operation.region.interval("speed"))),
            tangent_rise=1.0 + tangent * tangent,
        )
        return self.drive_by_wire.joined(granted, reading_gain_per_s=gain_per_s)

    def with_geometry(self, geometry: Geometry, *, name: str) -> Vehicle:
        """The same controllers and limits on another body, under another name."""
        return dataclasses.replace(self, name=name, geometry=geometry)

    def track(self) -> Track:
        """The TRACK mode at the reference speed."""
        operation = self.operation
        return Track(operation.reference_speed_mps, operation.reference_change_mps)

    def controller(self) -> PathFollowing:
        """The two PIDs with the vehicle's limits."""
        steering, speed, limits = self.steering_pid, self.speed_pid, self.limits
        return PathFollowing(
            SteeringPid(
                proportional=steering.proportional_radps_per_m,
                integral=steering.integral_radps_per_ms,
                derivative=steering.derivative_rad_per_m,
                look_ahead_m=steering.look_ahead_m,
                rate_limit_radps=limits.steering_rate_radps,
            ),
            SpeedPid(
                proportional=speed.proportional_per_s,
                integral=speed.integral_per_s2,
                accel_min_mps2=limits.accel_min_mps2,
                accel_max_mps2=limits.accel_max_mps2,
            ),
        )

    def closed_loop(
        self,
        mode: Mode,
        frame: Frame,
        *,
        estimation_error: EstimationError | None = None,
        disturbance: Disturbance | None = None,
        parameter_ranges: Mapping[str, tuple[float, float]] | None = None,
    ) -> ClosedLoop:
        """The loop of this vehicle in `mode`, in the coordinates of `frame`."""
        return ClosedLoop(
            frame.bicycle(self.geometry.wheelbase_m, self.limits.steering_rad),
            self.controller(),
            mode,
            estimation_error=estimation_error or EstimationError(),
            disturbance=disturbance or Disturbance(),
            parameter_ranges=parameter_ranges or {},
        )

    def uncertain_loop(self, mode: Mode, frame: Frame) -> ClosedLoop:
        """The loop with all that the vehicle file is unsure of."""
        unsure = self.unsure()
        return self.closed_loop(
            mode,
            frame,
            estimation_error=unsure.estimation_error(),
            disturbance=unsure.disturbance(),
            parameter_ranges=unsure.parameter_ranges(self.geometry),
        )


def gem_e2_path() -> Path:
    """The vehicle file shipped with this package."""
    return Path(str(importlib.resources.files("workbench.models") / "data" / "gem_e2.toml"))


def gem_e2_recommended_path() -> Path:
    """The shipped vehicle with the steering gains that `studies/demo_gains.toml` recommends."""
    return gem_e2_path().with_name("gem_e2_recommended.toml")


def gem_e2_drive_path() -> Path:
    """The shipped vehicle once more, with what its drive-by-wire makes of commands."""
    return gem_e2_path().with_name("gem_e2_drive.toml")


def gem_e2() -> Vehicle:
    """The shipped vehicle: a Polaris GEM e2 as a low-speed shuttle."""
    return load_vehicle(gem_e2_path())


def load_vehicle(path: str | Path) -> Vehicle:
    """Read and check a vehicle file.

    path: a TOML file with the sections and keys of the shipped one (`gem_e2_path`). Raises
    InputError for a missing file, broken TOML, unknown or missing keys and values that cannot be,
    each with the section, what was expected, what came and how to mend it.
    """
    return read_file(path, _vehicle, what="vehicle", shipped=gem_e2_path())


def _vehicle(document: Mapping[str, object]) -> Vehicle:
    sections = (
        "vehicle",
        "geometry",
        "limits",
        "steering_pid",
        "speed_pid",
        "operation",
        "initial_set",
        "guard",
        "brake",
    )
    require_keys("the file", document, sections, ("uncertainty", "drive_by_wire"), what="section")
    tables = {name: as_table(name, value) for name, value in document.items()}
    require_keys("[vehicle]", tables["vehicle"], ("name", "provenance"))
    initial_set = tables["initial_set"]
    require_keys("[initial_set]", initial_set, ("center", "radius", "provenance"))
    limits = read_section(Limits, "limits", tables["limits"])
    brake = read_section(Brake, "brake", tables["brake"])
    return Vehicle(
        name=as_text("[vehicle]", "name", tables["vehicle"]),
        provenance=as_text("[vehicle]", "provenance", tables["vehicle"]),
        geometry=read_section(Geometry, "geometry", tables["geometry"]),
        limits=limits,
        steering_pid=read_section(SteeringGains, "steering_pid", tables["steering_pid"]),
        speed_pid=read_section(SpeedGains, "speed_pid", tables["speed_pid"]),
        operation=_operation(tables["operation"]),
        initial_set=_initial_set(initial_set),
        initial_set_provenance=as_text("[initial_set]", "provenance", initial_set),
        guard=read_section(Guard, "guard", tables["guard"]),
        brake=brake,
        uncertainty=read_section(Uncertainty, "uncertainty", tables["uncertainty"])
        if "uncertainty" in tables
        else Uncertainty(),
        drive_by_wire=drive_by_wire_section(tables["drive_by_wire"], limits, brake)
        if "drive_by_wire" in tables
        else None,
    )


def _operation(table: Mapping[str, object]) -> Operation:
    keys = ("reference_speed_mps", "region", "provenance")
    require_keys("[operation]", table, keys, ("curvature_per_m",))
    where = "[operation.region]"
    region = as_table("operation.region", table["region"])
    require_keys(where, region, REGION_KEYS)
    intervals = {}
    for key, name in REGION_KEYS.items():
        intervals[name] = as_interval(where, key, region[key])
    speed_mps, *curvature = (
        as_number("[operation]", key, table[key])
        for key in ("reference_speed_mps", "curvature_per_m")
        if key in table
    )
    said = as_text("[operation]", "provenance", table)
    try:
        return Operation(speed_mps, Box.from_intervals(intervals), said, *curvature)
    except InputError as error:
        raise InputError(f"[operation] {error}") from None


def _initial_set(table: Mapping[str, object]) -> Box:
    values: dict[str, dict[str, float]] = {}
    for part in ("center", "radius"):
        where = f"[initial_set.{part}]"
        entries = as_table(f"initial_set.{part}", table[part])
        require_keys(where, entries, STATE_KEYS)
        values[part] = {
            name: as_number(where, key, entries[key]) for key, name in STATE_KEYS.items()
        }
        for key, name in STATE_KEYS.items():
            if part == "radius" and values[part][name] < 0.0:
                raise InputError(f"{where} {key}: expected a radius >= 0, got {entries[key]!r}")
    return Box.around(values["center"], radius=values["radius"])
