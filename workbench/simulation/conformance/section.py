"""The fitted figures as the [uncertainty] section of a vehicle file, the rest left as it was."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from typing import Final

from workbench.errors import InputError
from workbench.models.vehicle_sections import Uncertainty

_NAME: Final = "uncertainty"
_HEADER: Final = re.compile(r"\s*\[\[?\s*([A-Za-z0-9_\-\"'.\s]+?)\s*\]\]?\s*(#.*)?")


def section_text(uncertainty: Uncertainty) -> str:
    """The section as TOML; figures that are 0 and false are left out."""
    lines = [f"[{_NAME}]"]
    for field in dataclasses.fields(uncertainty):
        value = getattr(uncertainty, field.name)
        if field.name == "provenance" or not value:
            continue
        lines.append(f"{field.name} = {'true' if value is True else repr(value)}")
    text = uncertainty.provenance.replace("\\", "\\\\").replace('"', '\\"')
    return "\n".join([*lines, f'provenance = """\n{text}"""', ""])


def with_section(vehicle_file: str, uncertainty: Uncertainty) -> str:
    """The file's text with this section instead of its own, all else letter by letter the same.

    Raises InputError for a file whose section cannot be told from the rest by its lines, such as
    one written as an inline table.
    """
    lines = vehicle_file.splitlines()
    begin, end = _place(lines)
    kept = [*lines[:begin], *lines[end:]]
    while kept and not kept[-1].strip():
        kept.pop()
    text = "\n".join(kept) + "\n\n" + section_text(uncertainty)
    before, after = tomllib.loads(vehicle_file), tomllib.loads(text)
    before.pop(_NAME, None)
    after.pop(_NAME)
    if before != after:
        raise InputError(
            f"expected a vehicle file with [{_NAME}] as a section of its own, after which another "
            "section or the end follows; write it so, or remove it"
        )
    return text


def _place(lines: list[str]) -> tuple[int, int]:
    """First line of the section and the line after its last; the file's end where it has none."""
    quoted = False
    begin = end = len(lines)
    for place, line in enumerate(lines):
        header = None if quoted else _HEADER.fullmatch(line)
        quoted ^= line.count('"""') % 2 == 1
        if header is None:
            continue
        if header.group(1) == _NAME:
            begin, end = place, len(lines)
        elif begin < place and end == len(lines):
            end = place
    return begin, end
