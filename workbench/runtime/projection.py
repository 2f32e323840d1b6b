"""Outward-safe path coordinates of a box of poses.

Corners: with the nearest node's frame, F(s) = (p - r(s)) . t(s) has F' = -(1 - kappa e), so one
interval Newton step s0 + F(s0) / (1 - kappa e) encloses the foot, and proves it the only one
nearby. Edges: along a unit direction d, s' = (t . d) / (1 - kappa e) and e' = n . d. With both
bounded over a trial interval of stations, the edge's values lie between the lines of extreme slope
through its ends; the result lying inside the trial interval proves the trial (continuation along
the edge). Interior: on the hull of the edges' values the chart is one-to-one
(`require_one_to_one`), so the box's rim comes from a closed curve in that hull, and the box's
inside from the inside of that curve. Floats round to nearest here; `_ALLOWANCE` covers that, and
the path table's own tolerance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from workbench.runtime.arc import Interval, cosine, displacement, hull, sine, times
from workbench.runtime.chart import (
    LEAST_FACTOR,
    RefusedError,
    curvature_range,
    heading_range,
    require_one_to_one,
    stretch_range,
)

if TYPE_CHECKING:
    from workbench.runtime.path import PathTable

_SEARCH_M = 10.0
_ALLOWANCE = 4e-6
_TRIALS = 8
_MOVES = 400
_ROUNDING = 1e-15


@final
@dataclass(frozen=True, slots=True)
class PathPose:
    """Path coordinates, each as (lower, upper): station and offset in m, heading error in rad."""

    station: Interval
    offset: Interval
    heading_error: Interval


@final
@dataclass(frozen=True, slots=True)
class NoProjection:
    """Why a box of poses has no proved path coordinates."""

    reason: str


@final
@dataclass(frozen=True, slots=True)
class _Foot:
    station: Interval
    offset: Interval


def project(
    path: PathTable, x: Interval, y: Interval, heading: Interval, *, near_station_m: float | None
) -> PathPose | NoProjection:
    """See `PathTable.project`."""
    numbers = (*x, *y, *heading)
    ordered = x[0] <= x[1] and y[0] <= y[1] and heading[0] <= heading[1]
    if not (all(map(math.isfinite, numbers)) and ordered):
        return NoProjection(f"expected finite intervals lower <= upper, got {x}, {y}, {heading}")
    try:
        return _pose(path, x, y, heading, near_station_m)
    except RefusedError as refused:
        return NoProjection(str(refused))


def project_part(
    path: PathTable, whole: PathPose, x: Interval, y: Interval, heading: Interval
) -> PathPose | NoProjection:
    """See `PathTable.project_part`."""
    try:
        return _part(path, whole, x, y, heading)
    except RefusedError as refused:
        return NoProjection(str(refused))


def _pose(
    path: PathTable, x: Interval, y: Interval, heading: Interval, near_station_m: float | None
) -> PathPose:
    node = _nearest_node(path, x, y, heading, near_station_m)
    corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]
    feet = [_foot(path, *corner, node) for corner in corners]
    width, height = x[1] - x[0], y[1] - y[0]
    edges = [
        _edge(path, feet[0], feet[1], 0.0, width),
        _edge(path, feet[1], feet[2], 0.5 * math.pi, height),
        _edge(path, feet[3], feet[2], 0.0, width),
        _edge(path, feet[0], feet[3], 0.5 * math.pi, height),
    ]
    station = hull(*(edge.station for edge in edges))
    offset = hull(*(edge.offset for edge in edges))
    stretch = require_one_to_one(path, station, offset)
    return _widened(path, _Foot(station, offset), stretch, (x, y, heading))


def _part(
    path: PathTable, whole: PathPose, x: Interval, y: Interval, heading: Interval
) -> PathPose:
    station = 0.5 * (whole.station[0] + whole.station[1])
    node = round((station - path.start_m) / path.spacing_m)
    middle = 0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1])
    foot = _foot(path, *middle, min(max(node, 0), len(path.x) - 1))
    if not (_inside(foot.station, whole.station) and _inside(foot.offset, whole.offset)):
        raise RefusedError("the middle of a part of the box lies outside of the whole")
    stretch = stretch_range(path, whole.station, whole.offset)
    tangent = heading_range(path, whole.station)
    turned = [max(map(abs, both)) for both in (cosine(tangent), sine(tangent))]
    half = [max(b - c, c - a) for (a, b), c in zip((x, y), middle, strict=True)]
    ahead = (half[0] * turned[0] + half[1] * turned[1]) / stretch[0]
    aside = half[0] * turned[1] + half[1] * turned[0]
    around = _Foot(
        (foot.station[0] - ahead, foot.station[1] + ahead),
        (foot.offset[0] - aside, foot.offset[1] + aside),
    )
    return _widened(path, around, stretch, (x, y, heading))


def _widened(
    path: PathTable, found: _Foot, stretch: Interval, box: tuple[Interval, Interval, Interval]
) -> PathPose:
    """The pose with the allowance for rounding, and the heading against the path's there."""
    (x, y, heading), station, offset = box, found.station, found.offset
    reach = max(abs(offset[0]), abs(offset[1]))
    slack = _ALLOWANCE * (1.0 + reach) / stretch[0]
    slack += 64.0 * _ROUNDING * max(map(abs, (*x, *y, *station)))
    station = (station[0] - slack, station[1] + slack)
    offset = (offset[0] - slack, offset[1] + slack)
    tangent = heading_range(path, station)
    low, high = heading[0] - tangent[1], heading[1] - tangent[0]
    turn = math.tau * round(0.5 * (low + high) / math.tau)
    spare = _ALLOWANCE + 4.0 * _ROUNDING * max(map(abs, (*heading, *tangent)))
    return PathPose(station, offset, (low - turn - spare, high - turn + spare))


def _nearest_node(
    path: PathTable, x: Interval, y: Interval, heading: Interval, near_station_m: float | None
) -> int:
    middle_x, middle_y = 0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1])
    facing = 0.5 * (heading[0] + heading[1])

    def faces(j: int) -> bool:
        return math.cos(facing - path.heading[j]) > 0.0

    def distance(j: int) -> float:
        return math.hypot(path.x[j] - middle_x, path.y[j] - middle_y)

    last = len(path.x) - 1
    if near_station_m is not None:
        hint = (near_station_m - path.start_m) / path.spacing_m
        reach = _SEARCH_M / path.spacing_m + 1.0
        low, high = max(0, math.floor(hint - reach)), min(last, math.ceil(hint + reach))
        local = next(filter(faces, sorted(range(low, high + 1), key=distance)), None)
        # A minimum on the rim of the search is no minimum of the path, unless the path ends there.
        if local is not None and (low < local or low == 0) and (local < high or high == last):
            return local
    nearest = min(filter(faces, range(last + 1)), key=distance, default=None)
    if nearest is None:
        raise RefusedError(
            f"no stretch of the path faces within 90 degrees of the heading {facing:.3f} rad"
        )
    box = math.hypot(x[1] - x[0], y[1] - y[0])
    reach = distance(nearest) + path.spacing_m + box
    rivals = [j for j in range(last + 1) if distance(j) <= reach and faces(j)]
    if rivals[-1] - rivals[0] != len(rivals) - 1:
        raise RefusedError(
            "two stretches of the path are equally near, at stations "
            f"{path.station_m(rivals[0]):.2f} m and {path.station_m(rivals[-1]):.2f} m; "
            "say near which station the vehicle is"
        )
    return nearest


def _foot(path: PathTable, x: float, y: float, node: int) -> _Foot:
    """Enclose station and offset of one point, starting the search at `node`."""
    last = len(path.x) - 1
    for _ in range(_MOVES):
        dx, dy = x - path.x[node], y - path.y[node]
        turn_cos, turn_sin = math.cos(path.heading[node]), math.sin(path.heading[node])
        along, across = turn_cos * dx + turn_sin * dy, turn_cos * dy - turn_sin * dx
        side = node if along >= 0.0 else node - 1
        if not 0 <= side < last:
            end = "start" if side < 0 else "end"
            if abs(along) > _ALLOWANCE:
                raise RefusedError(f"({x:.3f}, {y:.3f}) m lies beyond the path's {end}")
            side = min(max(side, 0), last - 1)
        curvature = (path.curvature_lower[side], path.curvature_upper[side])
        arc = _arc_to_foot(along, across, 0.5 * (curvature[0] + curvature[1]))
        if abs(arc) <= 0.6 * path.spacing_m:
            return _newton(path, node, arc, (along, across), curvature)
        node = min(max(node + (1 if arc > 0.0 else -1), 0), last)
    raise RefusedError(f"no foot on the path found for ({x:.3f}, {y:.3f}) m")


def _arc_to_foot(along: float, across: float, curvature: float) -> float:
    """Arc length to the foot on a circle of the given curvature: atan2(k a, 1 - k b) / k."""
    if 1.0 - curvature * across <= LEAST_FACTOR:
        raise RefusedError(
            f"1 - curvature * offset > 0 fails: {across:.2f} m off a path of curvature "
            f"{curvature:.4f} 1/m"
        )
    if abs(curvature) < 1e-9:
        return along
    return math.atan2(curvature * along, 1.0 - curvature * across) / curvature


def _newton(
    path: PathTable, node: int, arc: float, point: tuple[float, float], curvature: Interval
) -> _Foot:
    forward, sideways = displacement(arc, curvature)
    turn = times((arc, arc), curvature)
    along = (point[0] - forward[1], point[0] - forward[0])
    across = (point[1] - sideways[1], point[1] - sideways[0])
    cos_turn, sin_turn = cosine(turn), sine(turn)
    terms = times(along, cos_turn), times(across, sin_turn)
    miss = (terms[0][0] + terms[1][0], terms[0][1] + terms[1][1])
    terms = times(across, cos_turn), times(along, sin_turn)
    offset = (terms[0][0] - terms[1][1], terms[0][1] - terms[1][0])
    largest_miss = max(abs(miss[0]), abs(miss[1])) + _ALLOWANCE
    start = path.station_m(node) + arc
    spread = 2.0 * largest_miss / stretch_range(path, (start, start), offset)[0]
    # Over |s - start| <= spread: |e| <= far, |F'| <= 1 + k far, and e' = -kappa F.
    bends = curvature_range(path, (start - spread, start + spread))
    sharpest = max(-bends[0], bends[1], 0.0)
    far = math.hypot(largest_miss, max(abs(offset[0]), abs(offset[1]))) + spread
    drift = sharpest * spread * (largest_miss + (1.0 + sharpest * far) * spread)
    offset = (offset[0] - drift, offset[1] + drift)
    stretch = stretch_range(path, (start - spread, start + spread), offset)
    if largest_miss / stretch[0] >= spread:
        raise RefusedError(
            f"no unique foot on the path is proved near station {start:.2f} m; "
            "the curvature bounds there are too far apart for this offset"
        )
    moves = [value / bound for value in miss for bound in stretch]
    return _Foot((start + min(moves), start + max(moves)), offset)


def _edge(path: PathTable, first: _Foot, second: _Foot, direction: float, length: float) -> _Foot:
    """Enclose station and offset along the straight line from `first`'s point to `second`'s."""
    station, offset = hull(first.station, second.station), hull(first.offset, second.offset)
    if length == 0.0:
        return _Foot(station, offset)
    spare = 0.02 * length + _ALLOWANCE
    for _ in range(_TRIALS):
        trial = _Foot(
            (station[0] - spare, station[1] + spare), (offset[0] - spare, offset[1] + spare)
        )
        stretch = require_one_to_one(path, trial.station, trial.offset)
        tangent = heading_range(path, trial.station)
        angle = (direction - tangent[1], direction - tangent[0])
        inverse = (1.0 / stretch[1], 1.0 / stretch[0])
        found = _Foot(
            _between(first.station, second.station, times(cosine(angle), inverse), length),
            _between(first.offset, second.offset, sine(angle), length),
        )
        if _inside(found.station, trial.station) and _inside(found.offset, trial.offset):
            return found
        spare *= 2.0
    raise RefusedError(f"the box is too large for the path's curvature: an edge of {length:.2f} m")


def _inside(inner: Interval, outer: Interval) -> bool:
    return outer[0] < inner[0] and inner[1] < outer[1]


def _between(first: Interval, second: Interval, slope: Interval, length: float) -> Interval:
    """Values on [0, length] of a function with these end values and slopes."""
    highest = _peak(first[1], second[1], slope, length)
    lowest = -_peak(-first[0], -second[0], (-slope[1], -slope[0]), length)
    return min(lowest, first[0], second[0]), max(highest, first[1], second[1])


def _peak(first: float, second: float, slope: Interval, length: float) -> float:
    # The line up from the first end meets the line up, seen backwards, from the second.
    steepest_up, steepest_down = max(slope[1], 0.0), max(-slope[0], 0.0)
    if steepest_up == 0.0 or steepest_down == 0.0:
        return max(first, second)
    meeting = (second - first + steepest_down * length) / (steepest_up + steepest_down)
    return first + steepest_up * min(max(meeting, 0.0), length)
