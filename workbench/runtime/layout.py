"""The kernel's interface by name: the fields of a query and of a result, and their sizes."""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence

from workbench.claims import Verdict
from workbench.runtime.contents import Field

PERSON_NUMBERS = 7
"""Doubles per person: x, y, vx, vy, radius_m, growth_mps, growth_mps2."""

OCCUPANCY_NUMBERS = 5
"""Doubles per segment: centre x, y, heading, half length, half width of a rectangle."""

NO_CLEARANCE_M = 1e300
"""What the kernel reports as clearance when there is nobody."""

KERNEL_VERDICTS = (Verdict.SAFE, Verdict.UNPROVED, Verdict.INVALID)
"""Verdict by the number the kernel writes."""


class KernelStatus(enum.IntEnum):
    """How far the kernel's proof went."""

    COMPLETE = 0
    LEFT_REGION = 1
    ENCLOSURE_FAILED = 2
    SINGULAR = 3
    BAD_INPUT = 4


def query_counts(*, states: int, parameters: int, path_nodes: int, people: int) -> dict[str, int]:
    """Doubles per query field that every monitor sets, in the order a kernel lays them out."""
    return {
        "initial_center": states,
        "initial_radius": states,
        "parameters": parameters,
        "path_count": 1,
        "path_start_m": 1,
        "path_spacing_m": 1,
        "path_x": path_nodes,
        "path_y": path_nodes,
        "path_heading": path_nodes,
        "path_curvature_lower": path_nodes,
        "path_curvature_upper": path_nodes,
        "front_m": 1,
        "rear_m": 1,
        "half_width_m": 1,
        "people_count": 1,
        "people": people * PERSON_NUMBERS,
        "clearance_required_m": 1,
    }


def result_counts(*, states: int, steps: int) -> dict[str, int]:
    """Doubles per result field that every monitor reads, in the order a kernel lays them out."""
    return {
        "verdict": 1,
        "status": 1,
        "steps_done": 1,
        "clearance_m": 1,
        "clearance_time_s": 1,
        "clearance_person": 1,
        "tube_lower": steps * states,
        "tube_upper": steps * states,
        "occupancy": steps * OCCUPANCY_NUMBERS,
    }


def tile(
    counts: Mapping[str, int], *, defaults: Mapping[str, Sequence[float]]
) -> tuple[Field, ...]:
    """Lay fields of the given counts one after the other from offset 0; empty ones are left out.

    >>> [field.offset for field in tile({"a": 2, "b": 1}, defaults={})]
    [0, 2]
    """
    fields = []
    end = 0
    for name, count in counts.items():
        if count:
            default = tuple(defaults[name]) if name in defaults else None
            fields.append(Field(name, end, count, default))
            end += count
    return tuple(fields)
