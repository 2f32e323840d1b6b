"""The bundle format: manifest.json as text and back, SHA256SUMS, and the values they hold.

Who writes bundles and who loads them import everything about the format from here.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, NoReturn, TypeVar, final

from workbench.claims import Assumption, Rigor
from workbench.errors import InputError
from workbench.runtime.contents import (
    CHECKED_FILES,
    CHECKSUM_FILE,
    FORMAT,
    LIBRARY_FILE,
    MANIFEST_FILE,
    SOURCE_FILE,
    Field,
    Golden,
    Kernel,
    Manifest,
    Parameter,
    StateSignal,
    VehicleBody,
)
from workbench.sets import Box

__all__ = [
    "CHECKED_FILES", "CHECKSUM_FILE", "FORMAT", "LIBRARY_FILE", "MANIFEST_FILE", "SOURCE_FILE",
    "Field", "Golden", "Kernel", "Manifest", "Parameter", "StateSignal", "VehicleBody",
    "checksums_text", "manifest_from_json", "manifest_to_json",
]  # fmt: skip

_Value = TypeVar("_Value")


def checksums_text(files: Mapping[str, bytes]) -> str:
    """SHA256SUMS over `files` (name -> content), as `sha256sum -c` reads it."""
    return "".join(f"{hashlib.sha256(files[name]).hexdigest()}  {name}\n" for name in sorted(files))


def manifest_to_json(manifest: Manifest) -> str:
    """The text of manifest.json, one line per top-level key; golden numbers by float.hex."""
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
        "rigor": m.rigor.name,
        "assumptions": [asdict(assumption) for assumption in m.assumptions],
        "golden": [_golden(golden) for golden in m.golden],
    }
    lines = (f"{json.dumps(key)}: {json.dumps(value)}" for key, value in content.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _field(field: Field) -> dict[str, object]:
    return {"name": field.name, "offset": field.offset, "count": field.count}


def _golden(golden: Golden) -> dict[str, object]:
    return {
        "query": [number.hex() for number in golden.query],
        "result": [number.hex() for number in golden.result],
        "returns": golden.returns,
    }


def manifest_from_json(text: str) -> Manifest:
    """Read and check manifest.json; raises InputError that names the key at fault."""
    try:
        content = json.loads(text, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        _refuse("", f"expected JSON, got text that is not ({error})")
    top = _Reader(content, "")
    number = top.integer("format")
    if number != FORMAT:
        raise InputError(
            f"{MANIFEST_FILE}: format {number} is unknown, this workbench reads format {FORMAT}; "
            "rebuild the bundle with `workbench build`, or install the workbench that built it"
        )
    manifest = _manifest(top)
    top.finish()
    return manifest


def _manifest(top: _Reader) -> Manifest:
    rigor = top.text("rigor")
    if rigor not in Rigor.__members__:
        _refuse("rigor", f"expected one of {list(Rigor.__members__)}, got {rigor!r}")
    return Manifest(
        name=top.text("name"),
        created_by=top.text("created_by"),
        machine=top.text("machine"),
        compiler=top.text("compiler"),
        flags=tuple(_string(flag, "flags") for flag in top.items("flags")),
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
        rigor=Rigor[rigor],
        assumptions=tuple(_read_assumption(part) for part in top.parts("assumptions")),
        golden=tuple(_read_golden(part) for part in top.parts("golden")),
    )


def _read_kernel(part: _Reader) -> Kernel:
    file = part.text("file")
    if file != LIBRARY_FILE:
        _refuse("kernel.file", f"expected {LIBRARY_FILE!r}, got {file!r}")
    sizes = [part.integer(key) for key in ("query_size", "result_size", "work_size")]
    return part.done(Kernel(part.text("entry"), *sizes))


def _read_field(part: _Reader, *, query: bool) -> Field:
    default = None
    if query and part.take("default", list | None) is not None:
        default = tuple(_finite(value, f"{part.where}.default") for value in part.items("default"))
    name, offset, count = part.text("name"), part.integer("offset"), part.integer("count")
    return part.done(Field(name, offset, count, default))


def _read_state(part: _Reader) -> StateSignal:
    return part.done(StateSignal(part.text("name"), part.text("unit")))


def _read_parameter(part: _Reader) -> Parameter:
    numbers = [part.number(key) for key in ("nominal", "lower", "upper")]
    return part.done(Parameter(part.text("name"), part.text("unit"), *numbers))


def _read_vehicle(part: _Reader) -> VehicleBody:
    name = part.text("name")
    numbers = [part.number(k) for k in ("wheelbase_m", "front_m", "rear_m", "half_width_m")]
    further = tuple((key, part.number(key)) for key in part.left())
    wheelbase_m, front_m, rear_m, half_width_m = numbers
    return part.done(VehicleBody(name, wheelbase_m, front_m, rear_m, half_width_m, further))


def _read_region(part: _Reader) -> Box | None:
    intervals = {}
    for name in part.left():
        ends = [_finite(value, f"region.{name}") for value in part.items(name)]
        if len(ends) != 2 or ends[0] > ends[1]:
            _refuse(f"region.{name}", f"expected [lower, upper], got {ends!r}")
        intervals[name] = (ends[0], ends[1])
    return Box.from_intervals(intervals) if intervals else None


def _read_assumption(part: _Reader) -> Assumption:
    return part.done(Assumption(*(part.text(key) for key in ("name", "statement", "evidence"))))


def _read_golden(part: _Reader) -> Golden:
    query, result = (
        tuple(_hex_float(value, f"{part.where}.{key}") for value in part.items(key))
        for key in ("query", "result")
    )
    return part.done(Golden(query, result, part.integer("returns")))


def _refuse(where: str, what: str) -> NoReturn:
    place = f"{MANIFEST_FILE}: {where}" if where else MANIFEST_FILE
    raise InputError(f"{place}: {what}; rebuild the bundle with `workbench build`")


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number")


def _string(value: object, where: str) -> str:
    if not isinstance(value, str):
        _refuse(where, f"expected a text, got {value!r}")
    return value


def _finite(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1.7e308:
        _refuse(where, f"expected a finite number, got {value!r}")
    return float(value)


def _hex_float(value: object, where: str) -> float:
    try:
        return float.fromhex(value if isinstance(value, str) else "")
    except (ValueError, OverflowError):
        _refuse(where, f"expected a number as float.hex writes it, got {value!r}")


@final
class _Reader:
    """One JSON object, read key by key; what is missing, of a wrong kind or left is refused."""

    def __init__(self, content: object, where: str) -> None:
        if not isinstance(content, dict):
            _refuse(where, f"expected an object, got {type(content).__name__}")
        self.where = where
        self._content: dict[str, Any] = content
        self._left = dict.fromkeys(content)

    def _place(self, key: str) -> str:
        return f"{self.where}.{key}" if self.where else key

    def take(self, key: str, kind: Any) -> Any:
        if key not in self._content:
            _refuse(self._place(key), "expected this key, it is missing")
        self._left.pop(key, None)
        value = self._content[key]
        if not isinstance(value, kind):
            _refuse(self._place(key), f"expected {_kind_name(kind)}, got {value!r:.80}")
        return value

    def text(self, key: str) -> str:
        value: str = self.take(key, str)
        return value

    def integer(self, key: str) -> int:
        value = self.take(key, int)
        if isinstance(value, bool):
            _refuse(self._place(key), f"expected an integer, got {value!r}")
        return int(value)

    def number(self, key: str) -> float:
        return _finite(self.take(key, object), self._place(key))

    def items(self, key: str) -> list[Any]:
        value: list[Any] = self.take(key, list)
        return value

    def part(self, key: str) -> _Reader:
        return _Reader(self.take(key, dict), self._place(key))

    def parts(self, key: str) -> list[_Reader]:
        place = self._place(key)
        return [_Reader(item, f"{place}[{index}]") for index, item in enumerate(self.items(key))]

    def left(self) -> list[str]:
        return list(self._left)

    def done(self, value: _Value) -> _Value:
        self.finish()
        return value

    def finish(self) -> None:
        if self._left:
            _refuse(self.where, f"unknown keys {self.left()}")


def _kind_name(kind: Any) -> str:
    names = {str: "a text", int: "an integer", list: "a list", dict: "an object"}
    return names.get(kind, "a list or null")
