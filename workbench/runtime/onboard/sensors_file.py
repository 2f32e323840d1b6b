"""What sensors, clocks and people around a vehicle keep to, as a bundle says it: checked TOML."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from typing import Any, final

from workbench.errors import InputError
from workbench.runtime.arc import Interval
from workbench.runtime.manifest import Manifest
from workbench.runtime.onboard.actuation import Wanted
from workbench.runtime.onboard.limits import pacmod2_limits
from workbench.runtime.onboard.loop import LONGEST_WAIT_US
from workbench.runtime.onboard.onboard_settings import OnboardSettings, ReadingErrors
from workbench.runtime.onboard.sensor_bounds import PersonBounds, SensorBounds
from workbench.runtime.onboard.stamps import StampBounds
from workbench.runtime.person_guard import MotionLimits


@final
@dataclass(frozen=True, slots=True)
class _Table:
    """A table of the file whose every key is taken once; `done` refuses what is left."""

    where: str
    left: dict[str, Any]

    def take(self, key: str) -> Any:
        if key not in self.left:
            raise InputError(f"{self.where}: expected a key {key!r}, found none")
        return self.left.pop(key)

    def number(self, key: str) -> float:
        value = self.take(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{self.where}.{key}: expected a number, got {value!r}")
        return float(value)

    def micros(self, key: str) -> int:
        value = self.take(key)
        if isinstance(value, bool) or not isinstance(value, int):
            raise InputError(f"{self.where}.{key}: expected a whole number, got {value!r}")
        return value

    def interval(self, key: str) -> Interval:
        value = self.take(key)
        if not isinstance(value, list) or len(value) != 2:
            raise InputError(f"{self.where}.{key}: expected [lower, upper], got {value!r}")
        pair = _Table(f"{self.where}.{key}", {"lower": value[0], "upper": value[1]})
        low, high = pair.number("lower"), pair.number("upper")
        if not low <= high:
            raise InputError(f"{self.where}.{key}: expected lower <= upper, got {value!r}")
        return low, high

    def part(self, key: str) -> _Table:
        value = self.take(key)
        if not isinstance(value, dict):
            raise InputError(f"{self.where}: expected a table [{key}], got {value!r}")
        return _Table(f"{self.where}: {key}", dict(value))

    def done(self) -> None:
        if self.left:
            raise InputError(f"{self.where}: unknown keys {sorted(self.left)}; remove them")


def settings_from(manifest: Manifest, *, signed: bool, tag: int) -> OnboardSettings:
    """All that a core is set up with, from a manifest with drive_by_wire, monitor and sensors.

    Delays are stated up to the frame's arrival; the loop may read it LONGEST_WAIT_US later, which
    is added here. Raises InputError: what the sensors' text says is believed, and what it says too
    small is not covered by any proof.
    """
    wire, monitor, text = manifest.drive_by_wire, manifest.monitor, manifest.sensors
    if wire is None or monitor is None or text is None:
        raise InputError(
            "expected a bundle with drive_by_wire, monitor and sensors; see `workbench build "
            "--path --clearance --sensors`, and [drive_by_wire] of the vehicle file"
        )
    try:
        top = _Table("sensors", tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"sensors: expected TOML, got a text that is not ({error})") from None
    sensors = _sensors(top, manifest)
    reading, gate, vehicle = (top.part(key) for key in ("reading", "gate", "vehicle"))
    settings = OnboardSettings(
        timing=monitor.timing,
        release_steps=monitor.release_steps,
        clearance_required_m=monitor.clearance_required_m,
        start_station_m=vehicle.number("start_station_m")
        if "start_station_m" in vehicle.left
        else None,
        reference_speed_mps=next(
            each.nominal for each in manifest.parameters if each.name == "reference_speed"
        ),
        # A set of commands may come no later than either proof has it: the tube's disturbance
        # turn_s, the plan's switch send_gap_s.
        drive_by_wire=replace(wire, turn_s=min(wire.turn_s, monitor.timing.send_gap_s)),
        sensors=sensors,
        limits=pacmod2_limits(
            localisation_age_us=sensors.localisation_age_us, people_age_us=sensors.people_age_us
        ),
        reading=ReadingErrors(
            offset_m=reading.number("offset_m"),
            heading_rad=reading.number("heading_rad"),
            speed_mps=reading.number("speed_mps"),
        ),
        gate=Wanted(gate.number("acceleration_mps2"), gate.number("steering_rate_radps")),
        maker=_maker(vehicle),
        signed=signed,
        bundle_tag=tag,
    )
    for table in (reading, gate, vehicle, top):
        table.done()
    return settings


def _maker(vehicle: _Table) -> int | None:
    """Three characters as the vehicle reports them, such as "52C"; "any" asks for none."""
    text = vehicle.take("maker")
    if text == "any":
        return None
    if not isinstance(text, str) or not text.isascii() or len(text) != 3:
        raise InputError(f"{vehicle.where}.maker: expected three characters or 'any', got {text!r}")
    return int.from_bytes(text.encode("ascii"), "big")


def _sensors(top: _Table, manifest: Manifest) -> SensorBounds:
    wire = manifest.drive_by_wire
    assert wire is not None, "asked for before"
    clocks, reports, people = (top.part(key) for key in ("clocks", "reports", "people"))
    steering, wheel = wire.steering, wire.steering.road_wheel
    least_us, most_us = (round(end) for end in clocks.interval("delay_us"))
    soonest_us, latest_us = (round(end) for end in reports.interval("delay_us"))
    bounds = SensorBounds(
        stamps=StampBounds(
            delay_us=(least_us, most_us + LONGEST_WAIT_US),
            drift_ppm=clocks.micros("drift_ppm"),
            window_us=clocks.micros("window_us"),
        ),
        report_delay_us=(soonest_us, latest_us + LONGEST_WAIT_US),
        speed_gain=reports.interval("speed_gain"),
        speed_error_mps=wire.speed_error_mps,
        speed_range_mps=reports.interval("speed_range_mps"),
        acceleration_mps2=reports.interval("acceleration_mps2"),
        steering_wheel_error_rad=steering.report_error_rad,
        steering_wheel_limit_rad=min(-wheel.commands[0], wheel.commands[1]),
        road_wheel=wheel.at,
        steering_limit_rad=reports.number("steering_limit_rad"),
        steering_rate_radps=reports.number("steering_rate_radps"),
        wheelbase_m=reports.interval("wheelbase_m"),
        on_foot=_person(people.part("on_foot")),
        on_wheels=_person(people.part("on_wheels")),
        unseen_speed_mps=people.number("unseen_speed_mps"),
        localisation_age_us=clocks.micros("localisation_age_us"),
        people_age_us=clocks.micros("people_age_us"),
        report_age_us=reports.micros("age_us"),
    )
    for table in (clocks, reports, people):
        table.done()
    return bounds


def _person(table: _Table) -> PersonBounds:
    limits = MotionLimits(table.number("speed_mps"), table.number("acceleration_mps2"))
    bounds = PersonBounds(limits, table.number("intent_mps2"))
    table.done()
    return bounds
