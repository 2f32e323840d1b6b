"""Recommended gains as sections of a vehicle file, all else letter by letter."""

from __future__ import annotations

import re
import textwrap
import tomllib
from collections.abc import Mapping
from typing import Final

from workbench.errors import InputError
from workbench.simulation.gain_sweep.gains import GAINS, SPEED, STEERING

_WIDTH: Final = 116
_HEADER: Final = re.compile(r"\s*\[\[?\s*([A-Za-z0-9_\-.]+)\s*\]\]?\s*(#.*)?")


def with_written_gains(vehicle_file: str, gains: Mapping[str, float], provenance: str) -> str:
    """The file's text with these gains by name and where they come from: [steering_pid], and
    [speed_pid] where its gains are others than before.

    Raises InputError for a file whose sections cannot be told from the rest by their lines.
    """
    mine: dict[str, dict[str, float]] = {STEERING: {}, SPEED: {}}
    for name, value in gains.items():
        mine[GAINS[name].section][GAINS[name].key] = value
    text = _with_section(vehicle_file, STEERING, mine[STEERING], provenance)
    before = _read(vehicle_file).get(SPEED)
    if not isinstance(before, dict) or any(before.get(k) != x for k, x in mine[SPEED].items()):
        text = _with_section(text, SPEED, mine[SPEED], provenance)
    return text


def _with_section(
    vehicle_file: str, name: str, values: Mapping[str, float], provenance: str
) -> str:
    lines = vehicle_file.splitlines()
    begin, end = _place(lines, name)
    said = provenance.replace("\\", "\\\\").replace('"', '\\"')
    shown = [line for each in said.splitlines() for line in textwrap.wrap(each, _WIDTH)]
    section = [
        f"[{name}]", *(f"{key} = {value!r}" for key, value in values.items()),
        'provenance = """', *shown[:-1], shown[-1] + '"""', "",
    ]  # fmt: skip
    text = "\n".join([*lines[:begin], *section, *lines[end:]]) + "\n"
    before, after = _read(vehicle_file), _read(text)
    before.pop(name, None)
    after.pop(name, None)
    if begin == end or before != after:
        raise InputError(
            f"expected a vehicle file with [{name}] as a section of its own, after which another "
            "section or the end follows; write it so"
        )
    return text


def _read(text: str) -> dict[str, object]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return {}


def _place(lines: list[str], name: str) -> tuple[int, int]:
    """First line of the section and the line after its last; both the end where it has none."""
    quoted, begin, end = False, len(lines), len(lines)
    for place, line in enumerate(lines):
        header = None if quoted else _HEADER.fullmatch(line)
        quoted ^= line.count('"""') % 2 == 1
        if header is None:
            continue
        if header.group(1) == name:
            begin = place
        elif begin < place and end == len(lines):
            end = place
    return begin, end
