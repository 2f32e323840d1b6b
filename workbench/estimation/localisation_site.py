"""The site file: where the beacons stand and what the estimate may assume, read and checked."""

from __future__ import annotations

import importlib.resources
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from workbench.errors import InputError
from workbench.models.section_reading import (
    as_number,
    as_table,
    as_text,
    read_file,
    read_section,
    require_keys,
)
from workbench.runtime.localiser.site import (
    Antenna,
    Beacon,
    Limits,
    Motion,
    Ranges,
    Reports,
    Site,
)

__all__ = [
    "Antenna", "Beacon", "Limits", "Motion", "Ranges", "Reports", "Site", "hall_path", "load_site",
]  # fmt: skip

_SECTIONS: Final = ("antenna", "ranges", "reports", "motion", "limits")


def hall_path() -> Path:
    """The site file shipped with this package."""
    return Path(str(importlib.resources.files("workbench.estimation") / "data" / "hall.toml"))


def load_site(path: str | Path) -> Site:
    """Read and check a site file, with the sections and keys of the shipped one (`hall_path`).

    Raises InputError with file, section, what was expected, what came and how to mend it.
    """
    return read_file(path, _site, what="site", shipped=hall_path())


def _site(document: Mapping[str, object]) -> Site:
    require_keys("the file", document, (*_SECTIONS, "beacon"), what="section")
    listed = document["beacon"]
    if not isinstance(listed, list):
        raise InputError(f"beacon: expected [[beacon]] sections, got {listed!r}")
    return Site(
        beacons=tuple(_beacon(entry) for entry in listed),
        antenna=read_section(Antenna, "antenna", document["antenna"]),
        ranges=read_section(Ranges, "ranges", document["ranges"]),
        reports=read_section(Reports, "reports", document["reports"]),
        motion=read_section(Motion, "motion", document["motion"]),
        limits=read_section(Limits, "limits", document["limits"]),
    )


def _beacon(entry: object) -> Beacon:
    table, where = as_table("beacon", entry), "[[beacon]]"
    numbers = ("x_m", "y_m", "height_m")
    require_keys(where, table, ("name", *numbers))
    return Beacon(
        as_text(where, "name", table), *(as_number(where, key, table[key]) for key in numbers)
    )
