"""The bundle format: manifest.json as text and back, SHA256SUMS, and the values they hold.

Who writes bundles and who loads them import everything about the format from here.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict

from workbench.claims import Assumption, Rigor
from workbench.errors import InputError
from workbench.runtime.contents import (
    CHECKED_FILES,
    CHECKSUM_FILE,
    FORMAT,
    HEADER_FILE,
    LIBRARY_FILE,
    MANIFEST_FILE,
    SOURCE_FILE,
    Field,
    Golden,
    Kernel,
    Manifest,
    NestedLevel,
    Parameter,
    StateSignal,
    VehicleBody,
)
from workbench.runtime.driving_entries import driving_entries, read_driving
from workbench.runtime.json_reader import JsonReader, as_finite, as_text, no_constant, refuse
from workbench.runtime.monitor_settings import MonitorSettings
from workbench.runtime.policies.horizon import BrakeBounds
from workbench.runtime.runs import packed_runs, unpacked_runs
from workbench.sets import Box

__all__ = [
    "CHECKED_FILES", "CHECKSUM_FILE", "FORMAT", "HEADER_FILE", "LIBRARY_FILE", "MANIFEST_FILE",
    "SOURCE_FILE", "Field", "Golden", "Kernel", "Manifest", "MonitorSettings", "NestedLevel",
    "Parameter", "StateSignal", "VehicleBody", "checksums_text", "manifest_from_json",
    "manifest_to_json",
]  # fmt: skip


# A run of numbers says how many there are, and must not fill the memory.
_MOST_NUMBERS = 1_000_000


def checksums_text(files: Mapping[str, bytes]) -> str:
    """SHA256SUMS over `files` (name -> content), as `sha256sum -c` reads it."""
    return "".join(f"{hashlib.sha256(files[name]).hexdigest()}  {name}\n" for name in sorted(files))


def manifest_to_json(manifest: Manifest) -> str:
    """The text of manifest.json, one line per top-level key.

    Golden numbers are written by float.hex, many equal ones in a row as [how many, number].
    """
    m = manifest
    body = asdict(m.vehicle)
    del body["further"]
    region = m.region
    content: dict[str, object] = {
        "format": FORMAT,
        "name": m.name,
        "created_by": m.created_by,
        "machine": m.machine,
        "compiler": m.compiler,
        "flags": list(m.flags),
        "kernel": {"file": LIBRARY_FILE} | asdict(m.kernel),
        "query": [_field(field) | {"default": field.default} for field in m.query],
        "result": [_field(field) for field in m.result],
        "states": [asdict(state) for state in m.states],
        "parameters": [asdict(parameter) for parameter in m.parameters],
        "vehicle": dict(m.vehicle.further) | body,
        "steps": m.steps,
        "step_s": m.step_s,
        "horizon_s": m.horizon_s,
        "region": {} if region is None else {n: region.interval(n) for n in region.names},
        "levels": [asdict(level) for level in m.levels],
        "deciding_level": m.deciding_level,
        "deciding": m.deciding,
        "brake": asdict(m.brake),
        "guard": _guard(m),
        "budget": m.budget,
        "tubes": m.tubes,
        "rigor": m.rigor.name,
        "assumptions": [asdict(assumption) for assumption in m.assumptions],
        "golden": [_golden(golden) for golden in m.golden],
    }
    content |= driving_entries(m)
    lines = (f"{json.dumps(key)}: {json.dumps(value)}" for key, value in content.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _field(field: Field) -> dict[str, object]:
    return {"name": field.name, "offset": field.offset, "count": field.count}


def _guard(m: Manifest) -> dict[str, object]:
    return {"speed_max_mps": m.guard_speed_max_mps, "accel_max_mps2": m.guard_accel_max_mps2}


def _golden(golden: Golden) -> dict[str, object]:
    return {
        "query": packed_runs(golden.query),
        "result": packed_runs(golden.result),
        "returns": golden.returns,
    }


def manifest_from_json(text: str) -> Manifest:
    """Read and check manifest.json; raises InputError that names the key at fault."""
    try:
        content = json.loads(text, parse_constant=no_constant)
    except (ValueError, RecursionError) as error:
        refuse("", f"expected JSON, got text that is not ({error})")
    top = JsonReader(content, "")
    number = top.integer("format")
    if number != FORMAT:
        raise InputError(
            f"{MANIFEST_FILE}: format {number} is unknown, this workbench reads format {FORMAT}; "
            "rebuild the bundle with `workbench build`, or install the workbench that built it"
        )
    manifest = _manifest(top)
    top.finish()
    return manifest


def _manifest(top: JsonReader) -> Manifest:
    rigor = top.text("rigor")
    if rigor not in Rigor.__members__:
        refuse("rigor", f"expected one of {list(Rigor.__members__)}, got {rigor!r}")
    guard = top.part("guard")
    guard_mps, guard_mps2 = (guard.number(key) for key in ("speed_max_mps", "accel_max_mps2"))
    return Manifest(
        name=top.text("name"),
        created_by=top.text("created_by"),
        machine=top.text("machine"),
        compiler=top.text("compiler"),
        flags=tuple(as_text(flag, "flags") for flag in top.items("flags")),
        kernel=_read_kernel(top.part("kernel")),
        query=tuple(_read_field(part, query=True) for part in top.parts("query")),
        result=tuple(_read_field(part, query=False) for part in top.parts("result")),
        states=tuple(_read_state(part) for part in top.parts("states")),
        parameters=tuple(_read_parameter(part) for part in top.parts("parameters")),
        vehicle=_read_vehicle(top.part("vehicle")),
        steps=top.integer("steps"),
        step_s=top.number("step_s"),
        horizon_s=top.number("horizon_s"),
        region=_read_region(top.part("region")),
        levels=tuple(_read_level(part) for part in top.parts("levels")),
        deciding_level=top.text("deciding_level"),
        deciding=top.text("deciding"),
        brake=_read_brake(top.part("brake")),
        guard_speed_max_mps=guard_mps,
        guard_accel_max_mps2=guard.done(guard_mps2),
        budget=top.integer("budget"),
        tubes=top.text("tubes"),
        rigor=Rigor[rigor],
        assumptions=tuple(_read_assumption(part) for part in top.parts("assumptions")),
        golden=tuple(_read_golden(part) for part in top.parts("golden")),
        **read_driving(top),
    )


def _read_kernel(part: JsonReader) -> Kernel:
    file = part.text("file")
    if file != LIBRARY_FILE:
        refuse("kernel.file", f"expected {LIBRARY_FILE!r}, got {file!r}")
    sizes = [part.integer(key) for key in ("query_size", "result_size", "work_size")]
    return part.done(Kernel(part.text("entry"), *sizes))


def _read_field(part: JsonReader, *, query: bool) -> Field:
    default = None
    if query and part.take("default", list | None) is not None:
        default = tuple(
            as_finite(value, f"{part.where}.default") for value in part.items("default")
        )
    name, offset, count = part.text("name"), part.integer("offset"), part.integer("count")
    return part.done(Field(name, offset, count, default))


def _read_state(part: JsonReader) -> StateSignal:
    return part.done(StateSignal(part.text("name"), part.text("unit")))


def _read_parameter(part: JsonReader) -> Parameter:
    numbers = [part.number(key) for key in ("nominal", "lower", "upper")]
    return part.done(Parameter(part.text("name"), part.text("unit"), *numbers))


def _read_vehicle(part: JsonReader) -> VehicleBody:
    name = part.text("name")
    numbers = [part.number(k) for k in ("wheelbase_m", "front_m", "rear_m", "half_width_m")]
    further = tuple((key, part.number(key)) for key in part.left())
    wheelbase_m, front_m, rear_m, half_width_m = numbers
    return part.done(VehicleBody(name, wheelbase_m, front_m, rear_m, half_width_m, further))


def _read_region(part: JsonReader) -> Box | None:
    intervals = {}
    for name in part.left():
        ends = [as_finite(value, f"region.{name}") for value in part.items(name)]
        if len(ends) != 2 or ends[0] > ends[1]:
            refuse(f"region.{name}", f"expected [lower, upper], got {ends!r}")
        intervals[name] = (ends[0], ends[1])
    return Box.from_intervals(intervals) if intervals else None


def _read_assumption(part: JsonReader) -> Assumption:
    return part.done(Assumption(*(part.text(key) for key in ("name", "statement", "evidence"))))


def _read_level(part: JsonReader) -> NestedLevel:
    return part.done(NestedLevel(part.text("name"), part.number("share")))


def _read_brake(part: JsonReader) -> BrakeBounds:
    figures = {key: part.number(key) for key in BrakeBounds.__dataclass_fields__}
    try:
        return part.done(BrakeBounds(**figures))
    except InputError as error:
        refuse(part.where, str(error))


def _read_golden(part: JsonReader) -> Golden:
    numbers = []
    for key in ("query", "result"):
        try:
            numbers.append(unpacked_runs(part.items(key), most=_MOST_NUMBERS))
        except ValueError as error:
            refuse(f"{part.where}.{key}", str(error))
    query, result = numbers
    return part.done(Golden(query, result, part.integer("returns")))
