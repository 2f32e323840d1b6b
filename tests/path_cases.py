"""A path of changing curvature, and brute force for path coordinates of boxes beside it."""

from __future__ import annotations

import functools
import itertools
import math
import random
from collections.abc import Callable

from workbench.runtime.path import NoProjection, PathPose, PathTable

Point = tuple[float, float]
_NODES = [(-0.906179845938664, 0.23692688505618908), (-0.5384693101056831, 0.47862867049936647),
          (0.0, 0.5688888888888889), (0.5384693101056831, 0.47862867049936647),
          (0.906179845938664, 0.23692688505618908)]  # fmt: skip


def wavy_heading(station: float) -> float:
    return 0.05 * station + 0.6 * math.sin(0.35 * station)


def wavy_curvature(station: float) -> float:
    return 0.05 + 0.21 * math.cos(0.35 * station)


def arc_integral(begin: float, end: float) -> Point:
    half, middle = 0.5 * (end - begin), 0.5 * (begin + end)
    headings = [(w, wavy_heading(middle + half * u)) for u, w in _NODES]
    return (
        half * sum(w * math.cos(h) for w, h in headings),
        half * sum(w * math.sin(h) for w, h in headings),
    )


@functools.cache
def wavy_nodes() -> tuple[Point, ...]:
    pieces = [(0.0, 0.0)] + [arc_integral(0.2 * j, 0.2 * (j + 1)) for j in range(200)]
    return tuple(
        zip(*(itertools.accumulate(column) for column in zip(*pieces, strict=True)), strict=True)
    )


@functools.cache
def wavy_table() -> PathTable:
    nodes = wavy_nodes()
    stations = [0.2 * j for j in range(len(nodes))]
    ends = [(wavy_curvature(a), wavy_curvature(b)) for a, b in itertools.pairwise(stations)]
    # The curvature's own extrema lie inside a bin; its second derivative bounds what they add.
    spare = 0.21 * 0.35**2 * 0.2**2 / 8.0
    return PathTable(
        0.0,
        0.2,
        tuple(x for x, _ in nodes),
        tuple(y for _, y in nodes),
        tuple(map(wavy_heading, stations)),
        tuple(min(pair) - spare for pair in ends),
        tuple(max(pair) + spare for pair in ends),
    )


def wavy_point(station: float, offset: float) -> Point:
    node = round(station / 0.2)
    dx, dy = arc_integral(0.2 * node, station)
    x, y = wavy_nodes()[node]
    heading = wavy_heading(station)
    return x + dx - offset * math.sin(heading), y + dy + offset * math.cos(heading)


def projected(
    table: PathTable, x: float, y: float, heading: float, radii: tuple[float, float, float]
) -> PathPose | NoProjection:
    (width, height, turn) = radii
    return table.project(
        (x - width, x + width),
        (y - height, y + height),
        (heading - turn, heading + turn),
        near_station_m=None,
    )


def assert_encloses(
    pose: PathPose, point_of: Callable[[float, float], Point], box: tuple[Point, Point], seed: int
) -> tuple[float, float]:
    """Draw path coordinates around `pose`, keep those in the box; returns the width they span."""
    rng = random.Random(seed)
    (x_low, x_high), (y_low, y_high) = box
    found: list[Point] = []
    for _ in range(6000):
        s = rng.uniform(pose.station[0] - 0.05, pose.station[1] + 0.05)
        e = rng.uniform(pose.offset[0] - 0.05, pose.offset[1] + 0.05)
        x, y = point_of(s, e)
        if x_low <= x <= x_high and y_low <= y <= y_high:
            found.append((s, e))
            assert pose.station[0] <= s <= pose.station[1]
            assert pose.offset[0] <= e <= pose.offset[1]
    assert len(found) > 100
    stations, offsets = zip(*found, strict=True)
    return max(stations) - min(stations), max(offsets) - min(offsets)
