"""What a monitor sends to its kernel besides the measured sets, and whether they fit each other."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from typing import final

from workbench.errors import InputError
from workbench.runtime.contents import Field, Manifest
from workbench.runtime.judgement import CannotJudgeError
from workbench.runtime.layout import MOST_PIECES_IN_ALL, query_counts, result_counts
from workbench.runtime.measuring import STATES
from workbench.runtime.path import PathTable
from workbench.runtime.person_tubes import (
    PIECE_NUMBERS,
    TUBE_NUMBERS,
    TrackedPerson,
    packed,
)
from workbench.runtime.policies.cycle import Ground

_REFERENCE_SPEED = "reference_speed"
# A tube that begins at standstill reaches back: the motion of its model may be slower than 0.
_NODES_BEHIND = 16
_NODES_PER_SHIFT = 8


@final
class PathWindows:
    """The stretch of a path around the vehicle, as a query holds it; made anew only as it moves."""

    def __init__(self, path: PathTable, *, nodes: int) -> None:
        self._path = path
        self._nodes = nodes
        self._start_m: float | None = None
        self._window: dict[str, Sequence[float]] = {}

    def around(self, station_m: float) -> Mapping[str, Sequence[float]]:
        """The window that begins some nodes before `station_m`."""
        path = self._path
        node = math.floor((station_m - path.start_m) / path.spacing_m) - _NODES_BEHIND
        start_m = path.station_m(max(node, 0) // _NODES_PER_SHIFT * _NODES_PER_SHIFT)
        if start_m != self._start_m:
            # Half a bin on, so that rounding cannot choose the node before.
            window = path.window(start_m + 0.5 * path.spacing_m, count=self._nodes)
            self._window = _window_values(window, self._nodes)
            self._start_m = start_m
        return self._window


def _window_values(window: PathTable, nodes: int) -> dict[str, Sequence[float]]:
    def padded(column: Sequence[float]) -> array[float]:
        return array("d", (*column, *[0.0] * (nodes - len(column))))

    return {
        "path_count": (float(len(window.x)),),
        "path_start_m": (window.start_m,),
        "path_spacing_m": (window.spacing_m,),
        "path_x": padded(window.x),
        "path_y": padded(window.y),
        "path_heading": padded(window.heading),
        "path_curvature_lower": padded(window.curvature_lower),
        "path_curvature_upper": padded(window.curvature_upper),
    }


def crowd_values(people: Sequence[TrackedPerson]) -> dict[str, Sequence[float]]:
    """Everybody's tubes as a query holds them; raises CannotJudgeError where they do not fit."""
    crowd = packed(people)
    pieces = len(crowd.pieces) // PIECE_NUMBERS
    if pieces > MOST_PIECES_IN_ALL:
        raise CannotJudgeError(
            f"people's tubes have {pieces} pieces, the kernel holds {MOST_PIECES_IN_ALL}"
        )
    return {
        "people_count": (float(crowd.count),),
        "tubes_count": (float(len(crowd.tubes) // TUBE_NUMBERS),),
        "people_tubes": crowd.tubes,
        "people_pieces": crowd.pieces,
    }


def parameter_values(manifest: Manifest, reference_speed_mps: float) -> list[float]:
    """Nominal parameters with this reference speed; raises CannotJudgeError outside its range."""
    values = []
    for parameter in manifest.parameters:
        value = parameter.nominal
        if parameter.name == _REFERENCE_SPEED:
            value = reference_speed_mps
            if not parameter.lower <= value <= parameter.upper:
                raise CannotJudgeError(
                    f"reference speed: the proof covers [{parameter.lower!r}, "
                    f"{parameter.upper!r}] m/s, got {value!r}",
                    Ground.REGION,
                )
        values.append(value)
    return values


def check_interface(manifest: Manifest) -> None:
    """Raise InputError unless the bundle's kernel takes and gives what a monitor needs."""
    states = tuple(state.name for state in manifest.states)
    if states != STATES:
        raise InputError(f"expected a kernel in the states {STATES}, the bundle has {states}")
    if _REFERENCE_SPEED not in (parameter.name for parameter in manifest.parameters):
        raise InputError(f"expected a kernel with the parameter {_REFERENCE_SPEED!r}, it has none")
    nodes = [field.count for field in manifest.query if field.name == "path_x"]
    wanted = query_counts(
        states=len(STATES),
        parameters=len(manifest.parameters),
        path_nodes=max([2, *nodes]),
        levels=len(manifest.levels),
    )
    _check_fields("query", wanted, manifest.query)
    answered = result_counts(states=len(STATES), steps=manifest.steps, levels=len(manifest.levels))
    _check_fields("result", answered, manifest.result)
    unknown = [f.name for f in manifest.query if f.default is None and f.name not in wanted]
    if unknown:
        raise InputError(f"the kernel's query needs {unknown}, which a monitor does not know")


def _check_fields(buffer: str, wanted: Mapping[str, int], fields: Sequence[Field]) -> None:
    found = {field.name: field.count for field in fields}
    wrong = {name: count for name, count in wanted.items() if found.get(name) != count}
    instead = {name: found.get(name, 0) for name in wrong}
    if wrong:
        raise InputError(
            f"the kernel's {buffer} does not fit a monitor: expected {wrong} (numbers per field), "
            f"got {instead}; rebuild with `workbench build`"
        )
