"""Recommended gains as the [steering_pid] section of a vehicle file, all else letter by letter."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Final

from workbench.errors import InputError

_NAME: Final = "steering_pid"
_HEADER: Final = re.compile(r"\s*\[\[?\s*([A-Za-z0-9_\-.]+)\s*\]\]?\s*(#.*)?")
_KEYS: Final = {
    "kp": "proportional_radps_per_m", "ki": "integral_radps_per_ms", "kd": "derivative_rad_per_m",
    "look-ahead": "look_ahead_m",
}  # fmt: skip


def with_steering_gains(vehicle_file: str, gains: Mapping[str, float], provenance: str) -> str:
    """The file's text with these gains by name (kp, ki, kd, look-ahead) and where they come from.

    Raises InputError for a file whose section cannot be told from the rest by its lines.
    """
    lines = vehicle_file.splitlines()
    begin, end = _place(lines)
    said = provenance.replace("\\", "\\\\").replace('"', '\\"')
    section = [
        f"[{_NAME}]", *(f"{key} = {gains[name]!r}" for name, key in _KEYS.items()),
        'provenance = """', *said.splitlines()[:-1], said.splitlines()[-1] + '"""', "",
    ]  # fmt: skip
    text = "\n".join([*lines[:begin], *section, *lines[end:]]) + "\n"
    before, after = _read(vehicle_file), _read(text)
    before.pop(_NAME, None)
    after.pop(_NAME, None)
    if begin == end or before != after:
        raise InputError(
            f"expected a vehicle file with [{_NAME}] as a section of its own, after which another "
            "section or the end follows; write it so"
        )
    return text


def _read(text: str) -> dict[str, object]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return {}


def _place(lines: list[str]) -> tuple[int, int]:
    """First line of the section and the line after its last; both the end where it has none."""
    quoted, begin, end = False, len(lines), len(lines)
    for place, line in enumerate(lines):
        header = None if quoted else _HEADER.fullmatch(line)
        quoted ^= line.count('"""') % 2 == 1
        if header is None:
            continue
        if header.group(1) == _NAME:
            begin = place
        elif begin < place and end == len(lines):
            end = place
    return begin, end
