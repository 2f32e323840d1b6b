"""Lanelets of a CommonRoad file as a path: from a place straight ahead through successors."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.errors import InputError
from workbench.models.spline_path import Array
from workbench.simulation.frames import Point
from workbench.simulation.scenarios.commonroad_xml import Element, child, label, point

_OFF_M: Final = 5.0
_OFF_RAD: Final = math.pi / 3.0
_SPACING_M: Final = 4.0
_LEAST_M: Final = 16.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Lanelet:
    """Centre line (n, 2) in m, halfway between the bounds point by point, and what follows."""

    name: str
    centre: Array
    successors: tuple[str, ...]


def lanelets(root: Element) -> dict[str, Lanelet]:
    """All of a file; raises InputError for bounds of unlike lengths and for unknown successors."""
    found = {}
    for element in root.findall("lanelet"):
        left, right = (_bound(element, tag) for tag in ("leftBound", "rightBound"))
        if left.shape != right.shape or len(left) < 2:
            raise InputError(
                f"{label(element)}: expected two bounds of as many points, at least two, got "
                f"{len(left)} and {len(right)}"
            )
        name = element.get("id", "")
        follows = tuple(each.get("ref", "") for each in element.findall("successor"))
        found[name] = Lanelet(name, 0.5 * (left + right), follows)
    for lanelet in found.values():
        for each in lanelet.successors:
            if each not in found:
                raise InputError(
                    f"<lanelet id={lanelet.name!r}>: expected successors of this file, got {each!r}"
                )
    return found


def _bound(element: Element, tag: str) -> Array:
    rows = [point(each) for each in child(element, tag).findall("point")]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def way_ahead(
    known: dict[str, Lanelet], place: Point, heading: float, *, length_m: float
) -> tuple[tuple[Point, ...], float]:
    """Waypoints (m) every 4 m along centre lines, and how far the place is from the first one.

    Begins at the point nearest to the place of the lanelet that runs its way (within 60 degrees)
    and is nearest; where several follow, the one that turns least. Ends after length_m or where
    nothing follows. Raises InputError when no lanelet is within 5 m and when it is shorter than
    16 m.
    """
    name, station_m, off_m = _nearest(known, place, heading)
    line, ahead_m = known[name].centre, -station_m
    ahead_m += _length_m(line)
    while ahead_m < length_m and known[name].successors:
        name = min(known[name].successors, key=lambda each: _turn(line, known[each].centre))
        line = np.vstack([line, known[name].centre])
        ahead_m += _length_m(known[name].centre)
    stations = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    reach_m = min(length_m, float(stations[-1]) - station_m)
    if reach_m < _LEAST_M:
        raise InputError(
            f"planning problem: expected {_LEAST_M:g} m of lanelets ahead, got {reach_m:.1f} m"
        )
    wanted = station_m + np.linspace(0.0, reach_m, round(reach_m / _SPACING_M) + 1)
    columns = [np.interp(wanted, stations, column) for column in line.T]
    return tuple((float(x), float(y)) for x, y in zip(*columns, strict=True)), off_m


def _nearest(known: dict[str, Lanelet], place: Point, heading: float) -> tuple[str, float, float]:
    """Lanelet, station of its point nearest to the place, and their distance (m)."""
    best = ("", 0.0, math.inf)
    for lanelet in known.values():
        station_m = 0.0
        for (ax, ay), (bx, by) in itertools.pairwise(lanelet.centre.tolist()):
            long_m = math.hypot(bx - ax, by - ay)
            if long_m == 0.0:
                continue
            ux, uy = (bx - ax) / long_m, (by - ay) / long_m
            along = min(max((place[0] - ax) * ux + (place[1] - ay) * uy, 0.0), long_m)
            away_m = math.hypot(ax + along * ux - place[0], ay + along * uy - place[1])
            if away_m < best[2] and _apart(math.atan2(uy, ux), heading) <= _OFF_RAD:
                best = (lanelet.name, station_m + along, away_m)
            station_m += long_m
    if best[2] > _OFF_M:
        raise InputError(
            f"planning problem: expected a lanelet within {_OFF_M:g} m of {place} that runs its "
            "way, found none"
        )
    return best


def _turn(line: Array, following: Array) -> float:
    """By how much the end of what follows is turned against the end of a line, rad."""
    (ax, ay), (bx, by) = line[-1] - line[-2], following[-1] - following[-2]
    return _apart(math.atan2(by, bx), math.atan2(ay, ax))


def _apart(one: float, other: float) -> float:
    return abs(math.remainder(one - other, math.tau))


def _length_m(line: Array) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())
