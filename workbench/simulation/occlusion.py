"""What a box hides, and where somebody may step out from behind it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Final

from workbench.simulation.frames import Disc, Point
from workbench.simulation.scenarios.scenario import Occluder

_SHARES: Final = (0.0, 1.0 / 15.0, 0.2, 7.0 / 15.0, 1.0)
"""Ends of the pieces of a shadow's edge: each is twice as long as the one before."""


def hidden(place: Point, eye: Point, occluders: Sequence[Occluder]) -> bool:
    """Whether the line from the eye to a place meets a box."""
    return any(_meets(place, eye, box) for box in occluders)


def shadow_discs(eye: Point, box: Occluder, *, reach_m: float) -> Iterator[Disc]:
    """Discs (x, y, radius) that cover both edges of a box's shadow up to reach_m from the eye.

    Whoever comes out of the shadow crosses one of them. Nothing for an eye inside of the box, which
    sees nothing at all, and for a box out of reach.
    """
    if _within(eye, box):
        return
    corners = _corners(box)
    middle = math.atan2(
        0.5 * (box.y_min_m + box.y_max_m) - eye[1], 0.5 * (box.x_min_m + box.x_max_m) - eye[0]
    )
    turned = [math.remainder(_bearing(eye, corner) - middle, math.tau) for corner in corners]
    for which in (min, max):
        corner = corners[turned.index(which(turned))]
        near_m = math.dist(eye, corner)
        if near_m < reach_m:
            yield from _along(eye, corner, (near_m, reach_m))


def _along(eye: Point, corner: Point, span_m: tuple[float, float]) -> Iterator[Disc]:
    (near_m, far_m), towards = span_m, _bearing(eye, corner)
    ends = [near_m + share * (far_m - near_m) for share in _SHARES]
    for begin_m, end_m in itertools.pairwise(ends):
        away_m = 0.5 * (begin_m + end_m)
        x_m, y_m = eye[0] + away_m * math.cos(towards), eye[1] + away_m * math.sin(towards)
        yield x_m, y_m, 0.5 * (end_m - begin_m)


def _corners(box: Occluder) -> list[Point]:
    return [(x, y) for x in (box.x_min_m, box.x_max_m) for y in (box.y_min_m, box.y_max_m)]


def _bearing(eye: Point, place: Point) -> float:
    return math.atan2(place[1] - eye[1], place[0] - eye[0])


def _within(place: Point, box: Occluder) -> bool:
    return box.x_min_m <= place[0] <= box.x_max_m and box.y_min_m <= place[1] <= box.y_max_m


def _meets(place: Point, eye: Point, box: Occluder) -> bool:
    """Clips the segment to the box, one axis after the other (slab method)."""
    low, high = 0.0, 1.0
    for axis, (least, most) in enumerate(((box.x_min_m, box.x_max_m), (box.y_min_m, box.y_max_m))):
        begin, way = eye[axis], place[axis] - eye[axis]
        if way == 0.0:
            if not least <= begin <= most:
                return False
            continue
        first, second = sorted(((least - begin) / way, (most - begin) / way))
        low, high = max(low, first), min(high, second)
    return low <= high
