"""The [[people]] tables of a scenario file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

from workbench.errors import InputError
from workbench.estimation.motion_parameters import load_motion, shipped_motion
from workbench.estimation.people_data import PersonTrack, load_tracks
from workbench.estimation.potential_field import Field, Repulsion
from workbench.models.section_reading import (
    as_interval,
    as_number,
    as_text,
    require_keys,
)
from workbench.models.spline_path import SplinePath
from workbench.simulation.scenarios.company import (
    ByChance,
    Chasing,
    FromRecording,
    InField,
    Part,
    Told,
)
from workbench.simulation.scenarios.frames_of_path import Frame, PathFrame, PlaneFrame
from workbench.simulation.scenarios.tables import (
    as_flag,
    as_limits,
    as_point,
    as_rows,
    as_tables,
)
from workbench.simulation.walkers.cues import AtTime, CarPassed, CarWithin, Cue
from workbench.simulation.walkers.field_walkers import Errand, Ground
from workbench.simulation.walkers.moving import GUARD, Who, body_radius_m
from workbench.simulation.walkers.pursuing import Chase
from workbench.simulation.walkers.recorded import Placement
from workbench.simulation.walkers.scripted import WALK_OFF_MPS2, Leg, Script

_Table = Mapping[str, object]
_CUES: Final[Mapping[str, Callable[[float], Cue]]] = {
    "at_s": AtTime,
    "car_within_m": CarWithin,
    "car_station_m": CarPassed,
}
KINDS: Final = ("ped", "sitting", "cyclist", "skater", "cart")
"""Of whoever is written into a file; recordings have words of their own."""
_PERSON = ("kind", "body_radius_m")
_FIELD = ("relaxation_s", "softening_m", "obstacle", "vehicle")
_SCRIPT = ("frame", "acceleration_mps2", "there_s")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What people are read with: the car's path, and the folder that file names begin at."""

    path: SplinePath
    folder: Path


def read_part(where: str, table: _Table, around: Surroundings) -> Part:
    """The people of one table; raises InputError that names the place."""
    if "walker" not in table:
        raise InputError(f"{where} lacks the key walker; add one of {', '.join(_READERS)}")
    word = as_text(where, "walker", table)
    if word not in _READERS:
        raise InputError(f"{where} walker: expected one of {', '.join(_READERS)}, got {word!r}")
    try:
        return _READERS[word](where, table, around)
    except InputError as fault:
        text = str(fault)
        raise InputError(text if where in text else f"{where} {text}") from None


def _scripted(where: str, table: _Table, around: Surroundings) -> Part:
    optional = (*_PERSON, *_SCRIPT, "start_mps")
    require_keys(where, table, ("walker", "name", "begin", "legs"), optional)
    return Told(_who(where, table), _script(where, table, around))


def _standing(where: str, table: _Table, around: Surroundings) -> Part:
    require_keys(where, table, ("walker", "name", "begin"), (*_PERSON, "frame", "there_s"))
    return Told(_who(where, table), _script(where, table, around))


def _group(where: str, table: _Table, around: Surroundings) -> Part:
    optional = (*_PERSON, *_SCRIPT, "start_mps", "legs")
    require_keys(where, table, ("walker", "name", "begin", "offsets"), optional)
    offsets = as_rows(where, "offsets", table["offsets"], 2)
    if not offsets:
        raise InputError(f"{where} offsets: expected at least one [x, y], got none")
    frame, begin = _frame(where, table, around), as_point(where, "begin", table["begin"])
    turned = tuple(frame.vector(begin, (row[0], row[1])) for row in offsets)
    return Told(_who(where, table), _script(where, table, around), turned)


def _script(where: str, table: _Table, around: Surroundings) -> Script:
    frame, begin = _frame(where, table, around), as_point(where, "begin", table["begin"])
    legs = tuple(
        _leg(f"{where} leg {k}", each)
        for k, each in enumerate(as_tables(f"{where} legs", table.get("legs", [])), start=1)
    )
    there_s = (-math.inf, math.inf)
    if "there_s" in table:
        there_s = as_interval(where, "there_s", table["there_s"])
    return Script(
        frame.place(begin), frame.legs(begin, legs), _number(where, table, "start_mps", 0.0),
        _number(where, table, "acceleration_mps2", WALK_OFF_MPS2), there_s,
    )  # fmt: skip


def _leg(where: str, table: _Table) -> Leg:
    require_keys(where, table, ("to", "speed_mps"), (*_CUES, "delay_s"))
    speed_mps = as_number(where, "speed_mps", table["speed_mps"])
    delay_s = _number(where, table, "delay_s", 0.0)
    try:
        return Leg(as_point(where, "to", table["to"]), speed_mps, _cue(where, table), delay_s)
    except InputError as fault:
        raise InputError(f"{where}: {fault}") from None


def _cue(where: str, table: _Table) -> Cue | None:
    given = [key for key in _CUES if key in table]
    if len(given) > 1:
        raise InputError(f"{where}: expected one of {', '.join(_CUES)}, got {', '.join(given)}")
    return _CUES[given[0]](as_number(where, given[0], table[given[0]])) if given else None


def _field(where: str, table: _Table, around: Surroundings) -> Part:
    optional = ("frame", "obstacles", "heeds_car", "noise_mps2", "limits", "motion", *_FIELD)
    require_keys(where, table, ("walker", "members"), optional)
    members = as_tables(f"{where} members", table["members"])
    if not members:
        raise InputError(f"{where} members: expected at least one table, got none")
    frame = _frame(where, table, around)
    errands = tuple(
        _errand(f"{where} member {k}", each, frame) for k, each in enumerate(members, start=1)
    )
    rows = as_rows(where, "obstacles", table.get("obstacles", []), 3)
    ground = Ground(
        _forces(where, table, around), as_limits(where, table, GUARD),
        tuple((*frame.place((x, y)), radius) for x, y, radius in rows),
        as_flag(where, "heeds_car", table.get("heeds_car", True)),
        _number(where, table, "noise_mps2", 0.0),
    )  # fmt: skip
    return InField(errands, ground)


def _forces(where: str, table: _Table, around: Surroundings) -> Field:
    """The field of the motion file, the shipped one if none is named, with what is given here."""
    motion = shipped_motion()
    if "motion" in table:
        motion = load_motion(around.folder / as_text(where, "motion", table))
    field = motion.field
    laws = {key: Repulsion(*as_point(where, key, table[key])) for key in _FIELD[2:] if key in table}
    return Field(
        _number(where, table, "relaxation_s", field.relaxation_s),
        _number(where, table, "softening_m", field.softening_m),
        laws.get("obstacle", field.obstacle),
        laws.get("vehicle", field.vehicle),
    )


def _errand(where: str, table: _Table, frame: Frame) -> Errand:
    require_keys(where, table, ("name", "begin", "goals", "speed_mps"), (*_PERSON, "velocity"))
    begin = as_point(where, "begin", table["begin"])
    velocity = as_point(where, "velocity", table.get("velocity", [0.0, 0.0]))
    goals = as_rows(where, "goals", table["goals"], 2)
    return Errand(
        _who(where, table), frame.place(begin), frame.vector(begin, velocity),
        tuple(frame.place((x, y)) for x, y in goals),
        as_number(where, "speed_mps", table["speed_mps"]),
    )  # fmt: skip


def _recorded(where: str, table: _Table, around: Surroundings) -> Part:
    needed = ("walker", "folder", "recording", "from_s")
    require_keys(where, table, needed, ("agents", "about", "to", "turn_rad", "body_radius_m"))
    folder = around.folder / as_text(where, "folder", table)
    name = as_text(where, "recording", table)
    tracks = [each for each in load_tracks(folder) if each.recording == name]
    if not tracks:
        raise InputError(f"{where}: expected people of recording {name!r} in {folder}, found none")
    lies = Placement(
        as_point(where, "about", table.get("about", [0.0, 0.0])),
        as_point(where, "to", table.get("to", [0.0, 0.0])),
        _number(where, table, "turn_rad", 0.0),
        as_number(where, "from_s", table["from_s"]),
    )
    chosen = _chosen(where, table, tracks)
    radius_m = None
    if "body_radius_m" in table:
        radius_m = as_number(where, "body_radius_m", table["body_radius_m"])
    return FromRecording(tuple(lies.apply(each) for each in chosen), radius_m)


def _chosen(where: str, table: _Table, tracks: list[PersonTrack]) -> list[PersonTrack]:
    """Those of `agents`, or all who can be shown at all: a track of one sample has no motion."""
    if "agents" not in table:
        return [each for each in tracks if len(each.t_s) >= 2]
    names: Any = table["agents"]
    if not isinstance(names, list) or not all(isinstance(each, str) for each in names):
        raise InputError(f"{where} agents: expected a list of texts, got {names!r}")
    known = {each.agent: each for each in tracks}
    for each in names:
        if each not in known:
            raise InputError(
                f"{where} agents: no {each!r} in this recording, which has "
                f"{', '.join(sorted(known)[:20])}"
            )
    return [known[each] for each in names]


def _adversary(where: str, table: _Table, around: Surroundings) -> Part:
    numbers = ("ahead_m", "standoff_m", "gives_up_s")
    optional = (*_PERSON, "frame", "velocity", "limits", *_CUES, *numbers)
    require_keys(where, table, ("walker", "name", "begin"), optional)
    cue = _cue(where, table)
    if cue is None:
        raise InputError(f"{where}: expected one of {', '.join(_CUES)}, got none")
    place, velocity = _start(where, table, around)
    given = {key: as_number(where, key, table[key]) for key in numbers if key in table}
    chase = Chase(place, velocity, cue, as_limits(where, table, GUARD), **given)
    return Chasing(_who(where, table), chase)


def _random(where: str, table: _Table, around: Surroundings) -> Part:
    optional = (*_PERSON, "frame", "velocity", "limits")
    require_keys(where, table, ("walker", "name", "begin", "hold_s"), optional)
    hold_s = as_interval(where, "hold_s", table["hold_s"])
    start = _start(where, table, around)
    return ByChance(_who(where, table), start, as_limits(where, table, GUARD), hold_s)


def _start(
    where: str, table: _Table, around: Surroundings
) -> tuple[tuple[float, float], tuple[float, float]]:
    frame, begin = _frame(where, table, around), as_point(where, "begin", table["begin"])
    velocity = as_point(where, "velocity", table.get("velocity", [0.0, 0.0]))
    return frame.place(begin), frame.vector(begin, velocity)


def _who(where: str, table: _Table) -> Who:
    kind = as_text(where, "kind", table) if "kind" in table else "ped"
    if kind not in KINDS:
        raise InputError(f"{where} kind: expected one of {', '.join(KINDS)}, got {kind!r}")
    radius_m = _number(where, table, "body_radius_m", body_radius_m(kind))
    return Who(as_text(where, "name", table), kind, radius_m)


def _frame(where: str, table: _Table, around: Surroundings) -> Frame:
    word = table.get("frame", "plane")
    if word not in ("plane", "path"):
        raise InputError(f"{where} frame: expected 'plane' or 'path', got {word!r}")
    return PathFrame(around.path) if word == "path" else PlaneFrame()


def _number(where: str, table: _Table, key: str, default: float) -> float:
    return as_number(where, key, table[key]) if key in table else default


_READERS: Final[Mapping[str, Callable[[str, _Table, Surroundings], Part]]] = {
    "scripted": _scripted,
    "standing": _standing,
    "group": _group,
    "field": _field,
    "recorded": _recorded,
    "adversary": _adversary,
    "random": _random,
}
