"""Scenarios of the CommonRoad collection: the planning problem's way, and the people around it."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.people_data import PersonTrack
from workbench.models.spline_path import SplinePath
from workbench.simulation.scenarios.commonroad_lanes import lanelets, way_ahead
from workbench.simulation.scenarios.commonroad_xml import (
    Element,
    child,
    exact,
    label,
    number,
    point,
    position,
    read_xml,
)
from workbench.simulation.scenarios.company import Company, FromRecording, checked
from workbench.simulation.scenarios.scenario import Scenario
from workbench.simulation.walkers.moving import GUARD

_KINDS: Final = {"pedestrian": "ped", "bicycle": "cyclist"}
_PACE_MPS: Final = 2.0
_MARGIN_M: Final = 4.0


@final
@dataclass(frozen=True, slots=True)
class Imported:
    """A scenario, without expectations, and what was left out or is not as in the file."""

    scenario: Scenario
    notes: tuple[str, ...]


def from_commonroad(
    path: str | Path, *, length_m: float = 60.0, problem: str | None = None,
    with_vehicles: bool = False,
) -> Imported:  # fmt: skip
    """A CommonRoad scenario (2018b, 2020a; .xml or .xml.gz) for a car that starts at standstill.

    Path: centre lines of lanelets from the planning problem's place straight ahead, length_m at
    most. People: pedestrians and bicycles with trajectories, linear between their states, in a disc
    around their shape. Time 0 is the planning problem's. with_vehicles: all other dynamic obstacles
    move along as discs too, which is far wider than they are; otherwise they are left out, as is
    everything static, and named. problem: which planning problem, where there are several. Raises
    InputError for what is not supported: uncertain states, occupancies, other versions.
    """
    file = Path(path)
    root = read_xml(file)
    try:
        return _imported(root, _name(file), (length_m, problem, with_vehicles))
    except InputError as fault:
        raise InputError(f"{file}: {fault}") from None


def _imported(root: Element, name: str, wanted: tuple[float, str | None, bool]) -> Imported:
    length_m, problem, with_vehicles = wanted
    step_s = _step_s(root)
    start = child(_problem(root, problem), "initialState")
    begin_s = step_s * exact(start, "time")
    waypoints, off_m = way_ahead(
        lanelets(root), position(start), exact(start, "orientation"), length_m=length_m
    )
    tracks, notes = _tracks(root, step_s, begin_s, with_vehicles=with_vehicles)
    notes = [
        f"the car starts at standstill, its rear axle on the lane's middle, {off_m:.2f} m from the "
        "file's place",
        *notes,
    ]
    driven = SplinePath.through(waypoints)
    last_s = max((float(track.tracks[0].t_s[-1]) for track in tracks), default=0.0)
    scenario = Scenario(
        name=name,
        title=f"CommonRoad {root.get('benchmarkID', name)}",
        story=f"Imported, by {root.get('author', 'an unnamed author')}: {'; '.join(notes)}.",
        waypoints=waypoints,
        duration_s=max(driven.length_m / _PACE_MPS, last_s),
        passed_m=driven.length_m - _MARGIN_M,
        cast=checked(Company(tuple(tracks)), driven),
    )
    return Imported(scenario, tuple(notes))


def _step_s(root: Element) -> float:
    text = root.get("timeStepSize", "")
    try:
        step_s = float(text)
    except ValueError:
        step_s = math.nan
    if not 0.0 < step_s < math.inf:
        raise InputError(f"timeStepSize: expected seconds above 0, got {text!r}")
    return step_s


def _problem(root: Element, wanted: str | None) -> Element:
    found = {each.get("id", ""): each for each in root.findall("planningProblem")}
    if wanted is None and len(found) == 1:
        return next(iter(found.values()))
    if not found:
        raise InputError(
            "expected a <planningProblem>, got none: it says where the car begins; take a file "
            "that has one"
        )
    if wanted is None or wanted not in found:
        raise InputError(
            f"expected one of the planning problems {', '.join(found)}, got "
            f"{'no choice' if wanted is None else repr(wanted)}; keep one of them in the file"
        )
    return found[wanted]


def _tracks(
    root: Element, step_s: float, begin_s: float, *, with_vehicles: bool
) -> tuple[list[FromRecording], list[str]]:
    tracks, left, notes = [], [], []
    for element, kind in _dynamic(root):
        if kind not in _KINDS and not with_vehicles:
            left.append(f"{kind} {element.get('id')}")
            continue
        track = _track(element, _KINDS.get(kind, kind), step_s, begin_s)
        tracks.append(FromRecording((track,), _radius_m(child(element, "shape"))))
        fastest = _fastest_mps(track)
        if kind == "pedestrian" and fastest > GUARD.speed_mps:
            notes.append(f"pedestrian {track.agent} moves at up to {fastest:.1f} m/s")
    if left:
        notes.append(f"left out: {', '.join(left)}")
    static = len(root.findall("staticObstacle")) + sum(
        1 for each in root.findall("obstacle") if (each.findtext("role") or "") == "static"
    )
    if static:
        notes.append(f"left out: {static} static obstacles")
    return tracks, notes


def _dynamic(root: Element) -> Iterator[tuple[Element, str]]:
    """Dynamic obstacles and their types, as 2020a and as 2018b write them."""
    old = (each for each in root.findall("obstacle") if each.findtext("role") == "dynamic")
    for element in itertools.chain(root.findall("dynamicObstacle"), old):
        yield element, (child(element, "type").text or "").strip()


def _track(element: Element, kind: str, step_s: float, begin_s: float) -> PersonTrack:
    if element.find("trajectory") is None:
        raise InputError(f"{label(element)}: expected a <trajectory>; occupancies are not imported")
    states = [child(element, "initialState"), *child(element, "trajectory").findall("state")]
    name = f"{kind} {element.get('id', '')}"
    times = np.array([step_s * exact(state, "time") - begin_s for state in states])
    return PersonTrack("CommonRoad", name, kind, times, np.array([position(s) for s in states]))


def _fastest_mps(track: PersonTrack) -> float:
    ways = np.hypot(*np.diff(track.xy_m, axis=0).T)
    return float(np.max(ways / np.diff(track.t_s), initial=0.0))


def _radius_m(shape: Element) -> float:
    """Of a disc around the reference point that contains every part of a shape."""
    radii = []
    for part in shape:
        off_m = 0.0
        if part.find("center") is not None:
            off_m = math.hypot(*point(child(part, "center")))
        if part.tag == "circle":
            radii.append(off_m + number(part, "radius"))
        elif part.tag == "rectangle":
            radii.append(off_m + 0.5 * math.hypot(number(part, "length"), number(part, "width")))
        elif part.tag == "polygon":
            radii.append(max((math.hypot(*point(p)) for p in part.findall("point")), default=0.0))
        else:
            raise InputError(f"<shape>: expected circle, rectangle or polygon, got <{part.tag}>")
    if not radii:
        raise InputError("<shape>: expected circle, rectangle or polygon, got nothing")
    return max(radii)


def _name(file: Path) -> str:
    word = file.name.removesuffix(".gz").removesuffix(".xml").lower()
    return re.sub(r"[^a-z0-9_-]+", "_", word)
