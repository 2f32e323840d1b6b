"""From an observation to nested sets of path states, and from these to a kernel's query."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import final

from workbench.runtime.arc import Interval
from workbench.runtime.contents import Manifest
from workbench.runtime.judgement import CannotJudgeError
from workbench.runtime.observation import Observation
from workbench.runtime.path import NoProjection, PathPose, PathTable
from workbench.runtime.policies.cycle import Ground
from workbench.sets import Box

STATES = (
    "station",
    "offset",
    "steering",
    "speed",
    "heading_error",
    "speed_integral",
    "offset_integral",
)
"""The kernel's states, in order, that a `Monitor` can fill from an `Observation`."""


@final
class Measuring:
    """Turns observations into nested boxes of path states; remembers near which station it was.

    path: the whole route; shares: see `NestedLevel`; station_m: where the vehicle is at first, None
    to find it out.
    """

    def __init__(
        self, path: PathTable, shares: Sequence[float], *, station_m: float | None
    ) -> None:
        self._path = path
        self._shares = tuple(shares)
        self._station_m = station_m

    def boxes(self, observation: Observation) -> tuple[Box, ...]:
        """One box per level, each inside the one before; raises CannotJudgeError.

        Level k holds the observation's intervals about their centres, times the level's share. Its
        path coordinates are what `PathTable.project` and, from the second on, `project_part` prove,
        met with those of the level before. A car that may stand may do so at every level.
        """
        seen, path = observation, self._path
        whole = path.project(seen.x, seen.y, seen.heading, near_station_m=self._station_m)
        if isinstance(whole, NoProjection):
            raise CannotJudgeError(f"no path coordinates: {whole.reason}")
        self._station_m = 0.5 * (whole.station[0] + whole.station[1])
        boxes = [_box(seen, whole, 1.0)]
        for share in self._shares[1:]:
            pose = path.project_part(
                whole, _part(seen.x, share), _part(seen.y, share), _part(seen.heading, share)
            )
            if isinstance(pose, NoProjection):
                raise CannotJudgeError(f"no path coordinates: {pose.reason}")
            part, before = _box(seen, pose, share), boxes[-1]
            lower = tuple(map(max, part.lower, before.lower))
            upper = tuple(map(min, part.upper, before.upper))
            boxes.append(Box(STATES, lower, upper))
        return tuple(boxes)


def _box(seen: Observation, pose: PathPose, share: float) -> Box:
    slowest, fastest = _part(seen.speed, share)
    if seen.speed[0] <= 0.0 <= seen.speed[1]:
        # Standstill may lie at an end or beside the centre: no part about it would hold 0.
        slowest, fastest = min(slowest, 0.0), max(fastest, 0.0)
    intervals = (
        pose.station,
        pose.offset,
        _part(seen.steering, share),
        (slowest, fastest),
        pose.heading_error,
        _part(seen.speed_integral, share),
        _part(seen.offset_integral, share),
    )
    return Box(STATES, tuple(ends[0] for ends in intervals), tuple(ends[1] for ends in intervals))


def _part(ends: Interval, share: float) -> Interval:
    if share == 1.0:
        return ends
    low, high = ends
    middle, radius = low + 0.5 * (high - low), 0.5 * (high - low) * share
    return max(middle - radius, low), min(middle + radius, high)


def initial_sets(boxes: Sequence[Box]) -> dict[str, list[float]]:
    """initial_center and initial_radius of a query: around one centre, so that they are nested.

    The radius of level k is the larger distance from the centre of the first box to the ends of box
    k, rounded up: monotone operations, so that radii cannot grow from level to level.
    """
    middle = boxes[0].center
    radii: list[float] = []
    for box in boxes:
        for low, at, high in zip(box.lower, middle, box.upper, strict=True):
            reach = max(high - at, at - low)
            radii.append(0.0 if reach == 0.0 else math.nextafter(reach, math.inf))
    return {"initial_center": [*middle] * len(boxes), "initial_radius": radii}


def check_region(manifest: Manifest, box: Box) -> None:
    """Raise CannotJudgeError where the box reaches beyond what the bundle's proof covers."""
    if manifest.region is None:
        return
    for name in manifest.region.names:
        lower, upper = manifest.region.interval(name)
        low, high = box.interval(name)
        if not (lower <= low and high <= upper):
            raise CannotJudgeError(
                f"{name}: the proof covers [{lower!r}, {upper!r}], got [{low!r}, {high!r}]",
                Ground.REGION,
            )
