"""The entries of a manifest that driving needs: drive-by-wire, path, settings, sensors."""

from __future__ import annotations

import dataclasses
from dataclasses import asdict
from typing import TypedDict, TypeVar

from workbench.errors import InputError
from workbench.runtime.contents import Manifest
from workbench.runtime.json_reader import JsonReader, refuse
from workbench.runtime.monitor_settings import MonitorSettings
from workbench.runtime.onboard.curve import Curve
from workbench.runtime.onboard.drive_by_wire import DriveByWire, Pedals, Steering
from workbench.runtime.path import PathTable
from workbench.runtime.policies.horizon import Timing

_Part = TypeVar("_Part", Curve, Steering, Pedals, DriveByWire, PathTable, MonitorSettings, Timing)


class Driving(TypedDict):
    """The entries, None where a manifest lacks one."""

    drive_by_wire: DriveByWire | None
    path: PathTable | None
    monitor: MonitorSettings | None
    sensors: str | None


def driving_entries(manifest: Manifest) -> dict[str, object]:
    """The entries as JSON holds them; one that is None is left out."""
    entries = {
        "drive_by_wire": manifest.drive_by_wire,
        "path": manifest.path,
        "monitor": manifest.monitor,
    }
    found: dict[str, object] = {
        name: asdict(entry) for name, entry in entries.items() if entry is not None
    }
    return found if manifest.sensors is None else found | {"sensors": manifest.sensors}


def read_driving(top: JsonReader) -> Driving:
    """What `driving_entries` wrote; raises InputError that names the key at fault."""
    wire, path, monitor = (top.optional_part(key) for key in ("drive_by_wire", "path", "monitor"))
    return {
        "drive_by_wire": None if wire is None else _filled(DriveByWire, wire),
        "path": None if path is None else _filled(PathTable, path),
        "monitor": None if monitor is None else _filled(MonitorSettings, monitor),
        "sensors": top.optional_text("sensors"),
    }


def _filled(kind: type[_Part], part: JsonReader) -> _Part:
    """The value of that kind whose fields the object holds, one key each and no other."""
    values = {field.name: _value(str(field.type), part, field.name)
              for field in dataclasses.fields(kind)}  # fmt: skip
    try:
        return part.done(kind(**values))  # type: ignore[arg-type]
    except InputError as error:
        # What names the file already has said where.
        if "workbench build" in str(error):
            raise
        refuse(part.where, str(error))


def _value(kind: str, part: JsonReader, key: str) -> object:
    """The value of a key, read as the field's type is written."""
    match kind:
        case "float":
            return part.number(key)
        case "int":
            return part.integer(key)
        case "str":
            return part.text(key)
        case "Interval":
            return part.interval(key)
        case "tuple[float, ...]":
            return part.numbers(key)
        case _:
            return _filled(_PARTS[kind], part.part(key))


_PARTS = {
    "Curve": Curve,
    "Steering": Steering,
    "Pedals": Pedals,
    "Timing": Timing,
}
