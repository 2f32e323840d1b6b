"""Bounds of the path's chart (station, offset) -> plane over a strip; when it is one-to-one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, final

from workbench.runtime.arc import Interval, hull, times

if TYPE_CHECKING:
    from workbench.runtime.path import PathTable

LEAST_FACTOR = 0.05
"""Smallest 1 - kappa e that is still used."""


@final
class RefusedError(Exception):
    """Ends a projection; its text becomes NoProjection's reason."""


def _bins(path: PathTable, station: Interval) -> range:
    last = len(path.x) - 2
    scaled = [(end - path.start_m) / path.spacing_m for end in station]
    # Half a bin beyond either end counts as the path's continuation within its last bin's
    # curvature.
    if scaled[0] < -0.5 or scaled[1] > last + 1.5:
        raise RefusedError(
            f"the box reaches from station {station[0]:.2f} m to {station[1]:.2f} m, the path from "
            f"{path.start_m:.2f} m to {path.end_m:.2f} m; it needs a margin at both ends"
        )
    low, high = (min(max(math.floor(end), 0), last) for end in scaled)
    return range(low, high + 1)


def curvature_range(path: PathTable, station: Interval) -> Interval:
    """Hull of the curvature bounds over a range of stations."""
    bins = _bins(path, station)
    return (
        min(path.curvature_lower[bins.start : bins.stop]),
        max(path.curvature_upper[bins.start : bins.stop]),
    )


def heading_range(path: PathTable, station: Interval) -> Interval:
    """Directions of the tangent over a range of stations; in a bin, as seen from both nodes."""
    bins = _bins(path, station)
    parts = []
    for j in bins:
        curvature = (path.curvature_lower[j], path.curvature_upper[j])
        begin = station[0] if j == bins.start else path.station_m(j)
        end = station[1] if j == bins.stop - 1 else path.station_m(j + 1)
        left, right = path.station_m(j), path.station_m(j + 1)
        ahead = times((begin - left, end - left), curvature)
        behind = times((begin - right, end - right), curvature)
        low = max(path.heading[j] + ahead[0], path.heading[j + 1] + behind[0])
        high = min(path.heading[j] + ahead[1], path.heading[j + 1] + behind[1])
        # Nodes may disagree by the table's tolerance, which turns an exact range inside out.
        parts.append((min(low, high), max(low, high)))
    return hull(*parts)


def stretch_range(path: PathTable, station: Interval, offset: Interval) -> Interval:
    """Range of 1 - kappa e over the strip station x offset, refused unless clearly positive."""
    product = times(curvature_range(path, station), offset)
    if 1.0 - product[1] < LEAST_FACTOR:
        raise RefusedError(
            f"1 - curvature * offset > 0 is not proved near station {station[0]:.2f} m for offsets "
            f"{offset[0]:.2f} m to {offset[1]:.2f} m"
        )
    return 1.0 - product[1], 1.0 - product[0]


def require_one_to_one(path: PathTable, station: Interval, offset: Interval) -> Interval:
    """Refuse a strip on which the chart might fold back onto itself; else the range of 1 - kappa e.

    With D = 1 - kappa e and the tangent within +-a of the middle direction, the chart's Jacobian,
    turned by that direction, has a positive definite symmetric part if 4 D cos^2 a > (D - 1)^2
    sin^2 a; on a convex set that makes the map one-to-one. The condition is convex in D: its ends
    suffice.
    """
    tangent = heading_range(path, station)
    half = 0.5 * (tangent[1] - tangent[0])
    ends = stretch_range(path, station, offset)
    folds = half >= 1.5 or any(
        4.0 * d * math.cos(half) ** 2 <= (d - 1.0) ** 2 * math.sin(half) ** 2 for d in ends
    )
    if folds:
        raise RefusedError(
            f"no unique projection is proved: the path turns by {2.0 * half:.2f} rad between "
            f"stations {station[0]:.2f} m and {station[1]:.2f} m; the box is too large for its "
            "curvature"
        )
    return ends
