"""The kernel's interface by name: the fields of a query and of a result, and their sizes."""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence

from workbench.claims import Verdict
from workbench.runtime.contents import Field
from workbench.runtime.person_tubes import (
    MOST_PEOPLE,
    MOST_TUBES,
    PIECE_NUMBERS,
    TUBE_NUMBERS,
)

MOST_TUBES_IN_ALL = MOST_PEOPLE * MOST_TUBES
"""Tubes of all people together that a query holds."""

MOST_PIECES_IN_ALL = 1024
"""Pieces of all people's tubes together that a query holds."""

NEAREST_NUMBERS = 5
"""Doubles per nearest person: clearance m, time s, person, tube of that person, `KernelCause`."""

OCCUPANCY_NUMBERS = 5
"""Doubles per segment: centre x, y, heading, half length, half width of a rectangle."""

NO_CLEARANCE_M = 1e300
"""What the kernel reports as clearance when there is nobody."""

TUBES = ("track", "stop", "brake")
"""The tubes of one decision, in the order of the result: TRACK over the horizon; TRACK, then BRAKE
to standstill; BRAKE to standstill."""

KERNEL_VERDICTS = (Verdict.SAFE, Verdict.UNPROVED, Verdict.INVALID)
"""Verdict by the number the kernel writes."""


class KernelStatus(enum.IntEnum):
    """How far the kernel's proof went."""

    COMPLETE = 0
    LEFT_REGION = 1
    ENCLOSURE_FAILED = 2
    SINGULAR = 3
    BAD_INPUT = 4
    UNFINISHED = 5

    @property
    def text(self) -> str:
        """What it says of a tube."""
        return _STATUS_TEXTS[self]


_STATUS_TEXTS = {
    KernelStatus.COMPLETE: "complete",
    KernelStatus.LEFT_REGION: "the tube left the path table or the operating region",
    KernelStatus.ENCLOSURE_FAILED: "no enclosure of the motion was found",
    KernelStatus.SINGULAR: "the path coordinates became singular",
    KernelStatus.BAD_INPUT: "the kernel found its input not finite or out of range",
    KernelStatus.UNFINISHED: "the kernel's rows or its budget were used up",
}


class KernelCause(enum.IntEnum):
    """Why a smallest clearance is what it is; all but PROVED stand for minus infinity.

    PROVED: it is. NOT_PREDICTED: somebody has no tube of the kind, or one that does not hold at
    that time (before its first piece, after until_s). NOT_COMPUTED: there is no rectangle, or the
    numbers overflowed. NOT_ASKED: the kind was not compared.
    """

    PROVED = 0
    NOT_PREDICTED = 1
    NOT_COMPUTED = 2
    NOT_ASKED = 3


def query_counts(*, states: int, parameters: int, path_nodes: int, levels: int) -> dict[str, int]:
    """Doubles per query field that every monitor sets, in the order a kernel lays them out.

    initial_center, initial_radius: `levels` nested sets, the largest first, state by state.
    people_tubes, people_pieces: as `packed` lays them out, the rest is not read. skew_s: people's
    time minus the vehicle's; switch_s, start_s, brake_s: see `StopAnswer` (both ends of start_s 0:
    TRACK is in force at the stamp) and, for BRAKE alone, when it may be commanded.
    """
    return {
        "initial_center": levels * states,
        "initial_radius": levels * states,
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
        "tubes_count": 1,
        "people_tubes": MOST_TUBES_IN_ALL * TUBE_NUMBERS,
        "people_pieces": MOST_PIECES_IN_ALL * PIECE_NUMBERS,
        "skew_s": 2,
        "clearance_required_m": 1,
        "switch_s": 2,
        "start_s": 2,
        "brake_s": 2,
    }


def result_counts(*, states: int, steps: int, levels: int) -> dict[str, int]:
    """Doubles per result field that every monitor reads, in the order a kernel lays them out.

    After status and spent, the same fields for each of `TUBES`, as "track_verdicts": verdicts per
    level; status, rows, level and cells of the tube that is reported; the nearest person's
    NEAREST_NUMBERS among intent tubes and among guards; the tube's rows and the ground they cover.
    """
    counts = {"status": 1, "spent": 1}
    per_tube = {
        "verdicts": levels,
        "status": 1,
        "rows": 1,
        "level": 1,
        "cells": 1,
        "intent": NEAREST_NUMBERS,
        "guard": NEAREST_NUMBERS,
        "lower": steps * states,
        "upper": steps * states,
        "occupancy": steps * OCCUPANCY_NUMBERS,
    }
    for tube in TUBES:
        counts |= {f"{tube}_{name}": count for name, count in per_tube.items()}
    return counts


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
