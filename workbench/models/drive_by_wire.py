"""The optional section [drive_by_wire] of a vehicle file: what commands bring about."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.models.actuation_bound import acceleration_bound, steering_bound
from workbench.models.section_reading import (
    as_interval,
    as_number,
    as_numbers,
    as_table,
    as_text,
    require_keys,
)
from workbench.models.vehicle_sections import Brake, Limits, SteeringGains, Uncertainty
from workbench.runtime.onboard.curve import Curve
from workbench.runtime.onboard.drive_by_wire import COUNT, DriveByWire, Pedals, Steering

_WHERE: Final = "[drive_by_wire]"
_PARTS: Final = ("steering", "accelerator", "brake", "pedals")
_FROM_LIMITS: Final = {
    "steering": ("angle_limit_rad", "rate_limit_radps"),
    "pedals": ("accel_min_mps2", "accel_max_mps2"),
}


@final
@dataclass(frozen=True, slots=True)
class DriveByWireSection:
    """What the file says of the drive-by-wire, and where each part's figures come from."""

    value: DriveByWire
    provenance: tuple[tuple[str, str], ...]

    def check(self, limits: Limits, brake: Brake) -> None:
        """Raise InputError unless it keeps to [limits] and brakes as [brake] says."""
        s, p = self.value.steering, self.value.pedals
        mine = (s.angle_limit_rad, s.rate_limit_radps, p.accel_min_mps2, p.accel_max_mps2)
        theirs = (limits.steering_rad, limits.steering_rate_radps,
                  limits.accel_min_mps2, limits.accel_max_mps2)  # fmt: skip
        if mine != theirs or self.value.stop_speed_mps != brake.stop_speed_mps:
            raise InputError(
                f"{_WHERE}: expected the limits {theirs!r} of [limits] and the stop speed of "
                f"[brake], got {mine!r}; read both from one file"
            )
        # What is sent is the nearest count.
        sent = (p.brake_profile - 0.5 * COUNT, p.brake_profile + 0.5 * COUNT)
        least, most = p.brake.effect(sent)
        known = (brake.deceleration_min_mps2, brake.deceleration_max_mps2)
        if not known[0] <= least <= most <= known[1]:
            raise InputError(
                f"{_WHERE} brake_profile: expected a ratio that gives the decelerations of [brake],"
                f" {known!r} m/s^2, {p.brake_profile!r} gives {(least, most)!r}; change one of them"
            )
        if p.delay_s[1] > brake.delay_s or p.longest_s > brake.delay_s + brake.build_up_s:
            raise InputError(
                f"{_WHERE} pedals: expected to act within the delay and build-up of [brake], "
                f"{brake.delay_s!r} and {brake.build_up_s!r} s, got {p.delay_s!r} and "
                f"{p.build_up_s!r}; lengthen those of [brake]"
            )

    def joined(self, uncertainty: Uncertainty, *, reading_gain_per_s: float) -> Uncertainty:
        """`uncertainty` and what the drive-by-wire itself brings about; W adds up, readings not.

        A W that was found with the drive-by-wire in between stays as it is.
        """
        reading_mps = max(uncertainty.speed_mps, self.value.speed_error_mps)
        if uncertainty.includes_drive_by_wire:
            return dataclasses.replace(uncertainty, speed_mps=reading_mps)
        speeding = acceleration_bound(self.value).total
        turning = steering_bound(self.value, reading_gain_per_s=reading_gain_per_s).total
        return dataclasses.replace(
            uncertainty.more(acceleration_mps2=speeding, steering_rate_radps=turning),
            speed_mps=reading_mps,
            provenance=f"{uncertainty.provenance}; {_WHERE}: maps, dead bands, delays",
        )


def reading_gain_per_s(gains: SteeringGains, *, wheelbase_m: float, speed_mps: float,
                       tangent_rise: float) -> float:  # fmt: skip
    """How much the law's steering rate changes with the road-wheel angle read (1/s), at most.

    |du / d steering| = kd l |cos psi| v / L (1 + tan^2 steering) <= kd l v / L * tangent_rise.
    """
    slowest = abs(gains.derivative_rad_per_m) * gains.look_ahead_m * speed_mps / wheelbase_m
    return slowest * tangent_rise


def drive_by_wire_section(
    table: Mapping[str, object], limits: Limits, brake: Brake
) -> DriveByWireSection:
    """Read and check the section; its limits are those of [limits]."""
    require_keys(_WHERE, table, ("protocol", "turn_s", "speed_error_mps", "provenance", *_PARTS))
    parts = {name: as_table(f"drive_by_wire.{name}", table[name]) for name in _PARTS}
    steering, pedals = parts["steering"], parts["pedals"]
    try:
        value = DriveByWire(
            protocol=as_text(_WHERE, "protocol", table),
            turn_s=as_number(_WHERE, "turn_s", table["turn_s"]),
            speed_error_mps=as_number(_WHERE, "speed_error_mps", table["speed_error_mps"]),
            stop_speed_mps=brake.stop_speed_mps,
            steering=Steering(
                road_wheel=_mirrored(steering),
                angle_limit_rad=limits.steering_rad,
                rate_limit_radps=limits.steering_rate_radps,
                **_figures(Steering, "steering", steering),  # type: ignore[arg-type]
            ),
            pedals=Pedals(
                accelerator=_curve("accelerator", parts["accelerator"], "acceleration_mps2"),
                brake=_curve("brake", parts["brake"], "deceleration_mps2"),
                accel_min_mps2=limits.accel_min_mps2,
                accel_max_mps2=limits.accel_max_mps2,
                **_figures(Pedals, "pedals", pedals),  # type: ignore[arg-type]
            ),
        )
    except InputError as error:
        where = "" if str(error).startswith("[drive_by_wire") else f"{_WHERE} "
        raise InputError(f"{where}{error}") from None
    provenance = {name: as_text(f"[drive_by_wire.{name}]", "provenance", parts[name])
                  for name in _PARTS}  # fmt: skip
    own = as_text(_WHERE, "provenance", table)
    return DriveByWireSection(value, tuple(({"drive_by_wire": own} | provenance).items()))


_MAPS: Final = {
    "steering": ("steering_wheel_rad", "road_wheel_rad", "road_wheel_error_rad"),
    "accelerator": ("ratio", "acceleration_mps2", "acceleration_error_mps2"),
    "brake": ("ratio", "deceleration_mps2", "deceleration_error_mps2"),
}


def _figures(
    kind: type[Steering] | type[Pedals], name: str, table: Mapping[str, object]
) -> dict[str, object]:
    """The fields of a part that its table gives: intervals, or single numbers."""
    where, given = f"[drive_by_wire.{name}]", (*_FROM_LIMITS[name], "road_wheel", *_MAPS)
    fields = [item for item in dataclasses.fields(kind) if item.name not in given]
    require_keys(
        where, table, (*(item.name for item in fields), *_MAPS.get(name, ()), "provenance")
    )
    return {
        item.name: (as_interval if item.type == "Interval" else as_number)(
            where, item.name, table[item.name]
        )
        for item in fields
    }


def _columns(name: str, table: Mapping[str, object]) -> list[tuple[float, ...]]:
    where = f"[drive_by_wire.{name}]"
    columns = [as_numbers(where, key, table[key]) for key in _MAPS[name]]
    if len({len(column) for column in columns}) != 1 or min(columns[2], default=-1.0) < 0.0:
        raise InputError(
            f"{where}: expected lists of equal length, errors >= 0, in {', '.join(_MAPS[name])}, "
            f"got lengths {[len(column) for column in columns]} and errors {columns[2]!r}"
        )
    return columns


def _curve(name: str, table: Mapping[str, object], effect: str) -> Curve:
    require_keys(f"[drive_by_wire.{name}]", table, (*_MAPS[name], "provenance"))
    assert effect in _MAPS[name], "each map names its own effect"
    command, middle, error = _columns(name, table)
    return _band(command, middle, error)


def _mirrored(table: Mapping[str, object]) -> Curve:
    """The steering map for both sides, from its half to the left."""
    where = "[drive_by_wire.steering]"
    missing = [key for key in _MAPS["steering"] if key not in table]
    if missing:
        raise InputError(f"{where} lacks the key {', '.join(missing)}; add it")
    wheel, road, error = _columns("steering", table)
    if not wheel or wheel[0] != 0.0 or road[0] != 0.0:
        raise InputError(
            f"{where}: expected maps that begin at straight ahead, 0 and 0, got {wheel[:1]!r} and "
            f"{road[:1]!r}; give the side to the left, the other one is taken to be its mirror"
        )
    mirrored = [tuple(-each for each in reversed(column[1:])) for column in (wheel, road)]
    return _band((*mirrored[0], *wheel), (*mirrored[1], *road), (*reversed(error[1:]), *error))


def _band(command: tuple[float, ...], middle: tuple[float, ...], error: tuple[float, ...]) -> Curve:
    pairs = list(zip(middle, error, strict=True))
    return Curve(command, tuple(m - e for m, e in pairs), tuple(m + e for m, e in pairs))
