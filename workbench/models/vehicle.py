"""Vehicle files: TOML with units in the key names, read into one checked value."""

from __future__ import annotations

import dataclasses
import difflib
import importlib.resources
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, final

from workbench.controllers import Mode, PathFollowing, SpeedPid, SteeringPid, Track
from workbench.errors import InputError
from workbench.models.bicycle import Frame
from workbench.models.closed_loop import ClosedLoop, Disturbance, EstimationError
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

    def __post_init__(self) -> None:
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
        for key, below, why in (
            ("wheelbase_m", self.geometry.wheelbase_m, "the wheelbase itself"),
            ("acceleration_mps2", self.brake.deceleration_min_mps2,
             "[brake] deceleration_min_mps2, or the car would not stand still"),
            ("speed_mps", self.brake.stop_speed_mps,
             "[brake] stop_speed_mps, or a standing car would steer"),
        ):  # fmt: skip
            value = getattr(self.uncertainty, key)
            if not value < below:
                raise InputError(
                    f"[uncertainty] {key}: expected less than {below!r} ({why}), got {value!r}"
                )

    def with_geometry(self, geometry: Geometry, *, name: str) -> Vehicle:
        """The same controllers and limits on another body, under another name."""
        return dataclasses.replace(self, name=name, geometry=geometry)

    def track(self) -> Track:
        """The TRACK mode at the reference speed."""
        return Track(self.operation.reference_speed_mps)

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
        unsure = self.uncertainty
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


def gem_e2() -> Vehicle:
    """The shipped vehicle: a Polaris GEM e2 as a low-speed shuttle."""
    return load_vehicle(gem_e2_path())


def load_vehicle(path: str | Path) -> Vehicle:
    """Read and check a vehicle file.

    path: a TOML file with the sections and keys of the shipped one (`gem_e2_path`). Raises
    InputError for a missing file, broken TOML, unknown or missing keys and values that cannot be,
    each with the section, what was expected, what came and how to mend it.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
        document = tomllib.loads(text)
    except FileNotFoundError:
        raise InputError(
            f"{path}: no such vehicle file; copy the shipped one, {gem_e2_path()}, and edit it"
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: expected a TOML file, but: {error}; compare with {gem_e2_path()}"
        ) from None
    try:
        return _vehicle(document)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


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
    _require_keys("the file", document, sections, ("uncertainty",), what="section")
    tables = {name: _table(name, value) for name, value in document.items()}
    _require_keys("[vehicle]", tables["vehicle"], ("name", "provenance"))
    initial_set = tables["initial_set"]
    _require_keys("[initial_set]", initial_set, ("center", "radius", "provenance"))
    return Vehicle(
        name=_text("[vehicle]", "name", tables["vehicle"]),
        provenance=_text("[vehicle]", "provenance", tables["vehicle"]),
        geometry=_section(Geometry, "geometry", tables["geometry"]),
        limits=_section(Limits, "limits", tables["limits"]),
        steering_pid=_section(SteeringGains, "steering_pid", tables["steering_pid"]),
        speed_pid=_section(SpeedGains, "speed_pid", tables["speed_pid"]),
        operation=_operation(tables["operation"]),
        initial_set=_initial_set(initial_set),
        initial_set_provenance=_text("[initial_set]", "provenance", initial_set),
        guard=_section(Guard, "guard", tables["guard"]),
        brake=_section(Brake, "brake", tables["brake"]),
        uncertainty=_section(Uncertainty, "uncertainty", tables["uncertainty"])
        if "uncertainty" in tables
        else Uncertainty(),
    )


def _require_keys(
    where: str, table: Mapping[str, object], expected: Iterable[str],
    optional: Iterable[str] = (), *, what: str = "key",
) -> None:  # fmt: skip
    required = tuple(expected)
    known = (*required, *optional)
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)[0]
            raise InputError(
                f"unknown {what} {key!r} in {where}; the nearest known one is {near!r}. "
                f"Rename or remove it; {where} has {', '.join(known)}"
            )
    missing = [key for key in required if key not in table]
    if missing:
        raise InputError(f"{where} lacks the {what} {', '.join(missing)}; add it")


def _table(name: str, value: object) -> Mapping[str, object]:
    if not isinstance(value, dict):
        raise InputError(
            f"[{name}]: expected a section, got {value!r}; write [{name}] and its keys"
        )
    return value


def _text(where: str, key: str, table: Mapping[str, object]) -> str:
    value = table[key]
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{where} {key}: expected a text in quotes, got {value!r}")
    return value


def _number(where: str, key: str, value: object) -> float:
    # In Python true is the number 1, so a boolean must be refused by name.
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{where} {key}: expected a finite number, got {value!r}")
    return float(value)


def _section(kind: type[_Section], name: str, table: Mapping[str, object]) -> _Section:
    where = f"[{name}]"
    fields = dataclasses.fields(kind)
    optional = [
        item.name for item in fields
        if item.default is not dataclasses.MISSING and item.name != "provenance"
    ]  # fmt: skip
    _require_keys(where, table, [i.name for i in fields if i.name not in optional], optional)
    numbers = {key: _number(where, key, table[key]) for key in table if key != "provenance"}
    provenance = _text(where, "provenance", table)
    try:
        return kind(**numbers, provenance=provenance)
    except InputError as error:
        raise InputError(f"{where} {error}") from None


def _operation(table: Mapping[str, object]) -> Operation:
    _require_keys("[operation]", table, ("reference_speed_mps", "region", "provenance"))
    where = "[operation.region]"
    region = _table("operation.region", table["region"])
    _require_keys(where, region, REGION_KEYS)
    intervals = {}
    for key, name in REGION_KEYS.items():
        ends = region[key]
        if not isinstance(ends, list) or len(ends) != 2:
            raise InputError(f"{where} {key}: expected [lowest, highest], got {ends!r}")
        low, high = (_number(where, key, end) for end in ends)
        if low > high:
            raise InputError(f"{where} {key}: expected lowest <= highest, got {ends!r}; swap them")
        intervals[name] = (low, high)
    speed = _number("[operation]", "reference_speed_mps", table["reference_speed_mps"])
    return Operation(
        speed, Box.from_intervals(intervals), _text("[operation]", "provenance", table)
    )


def _initial_set(table: Mapping[str, object]) -> Box:
    values: dict[str, dict[str, float]] = {}
    for part in ("center", "radius"):
        where = f"[initial_set.{part}]"
        entries = _table(f"initial_set.{part}", table[part])
        _require_keys(where, entries, STATE_KEYS)
        values[part] = {name: _number(where, key, entries[key]) for key, name in STATE_KEYS.items()}
        for key, name in STATE_KEYS.items():
            if part == "radius" and values[part][name] < 0.0:
                raise InputError(f"{where} {key}: expected a radius >= 0, got {entries[key]!r}")
    return Box.around(values["center"], radius=values["radius"])
