"""The reference path as the vehicle knows it: nodes by arc length, curvature bounds between."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.arc import Interval, displacement
from workbench.runtime.projection import NoProjection, PathPose, project, project_part

__all__ = ["NoProjection", "PathPose", "PathTable"]

TOLERANCE = 1e-6
"""How far nodes may miss the curve that the curvature bounds allow: metres, radians of heading."""

_MAX_TURN_PER_BIN_RAD = 1.0


@final
@dataclass(frozen=True, slots=True)
class PathTable:
    """A planar curve by arc length: node j lies at station start_m + j spacing_m.

    x, y, heading (n >= 2 each): position in m and direction of the tangent in rad, continuous along
    the path (no jumps by 2 pi). curvature_lower, curvature_upper (n - 1 each): bounds in 1/m over
    bin j, between nodes j and j + 1. The path meant is any curve through the nodes whose curvature
    keeps these bounds; nodes must agree with them to 1e-6 m and 1e-6 rad, an allowance that
    `project` adds again. Raises InputError that names the node or bin at fault.
    """

    start_m: float
    spacing_m: float
    x: tuple[float, ...]
    y: tuple[float, ...]
    heading: tuple[float, ...]
    curvature_lower: tuple[float, ...]
    curvature_upper: tuple[float, ...]

    def __post_init__(self) -> None:
        count = len(self.x)
        sizes = (len(self.y), len(self.heading))
        bins = (len(self.curvature_lower), len(self.curvature_upper))
        if count < 2 or sizes != (count, count) or bins != (count - 1, count - 1):
            raise InputError(
                "path table: expected n >= 2 nodes x, y, heading and n - 1 curvature bounds each, "
                f"got x {count}, y and heading {sizes}, curvature bounds {bins}"
            )
        columns = (self.x, self.y, self.heading, self.curvature_lower, self.curvature_upper)
        scalars = (self.start_m, self.spacing_m)
        if not all(map(math.isfinite, itertools.chain(scalars, *columns))) or self.spacing_m <= 0.0:
            raise InputError(
                "path table: expected finite numbers and spacing_m > 0, got spacing_m "
                f"{self.spacing_m!r}, start_m {self.start_m!r}; look for NaN in its columns"
            )
        for j in range(count - 1):
            self._check_bin(j)

    def _check_bin(self, j: int) -> None:
        low, high = self.curvature_lower[j], self.curvature_upper[j]
        step = self.spacing_m
        if not low <= high or max(-low, high) * step > _MAX_TURN_PER_BIN_RAD:
            raise InputError(
                f"path table, bin {j}: expected curvature bounds lower <= upper that turn at most "
                f"{_MAX_TURN_PER_BIN_RAD} rad in {step!r} m, got [{low!r}, {high!r}] 1/m; "
                "sample the path more densely"
            )
        turn = self.heading[j + 1] - self.heading[j]
        if not step * low - TOLERANCE <= turn <= step * high + TOLERANCE:
            raise InputError(
                f"path table, bin {j}: the heading changes by {turn!r} rad, the curvature bounds "
                f"allow [{step * low!r}, {step * high!r}]; unwrap the heading, or widen the bounds"
            )
        dx, dy = self.x[j + 1] - self.x[j], self.y[j + 1] - self.y[j]
        cosine, sine = math.cos(self.heading[j]), math.sin(self.heading[j])
        along, across = cosine * dx + sine * dy, cosine * dy - sine * dx
        forward, sideways = displacement(step, (low, high))
        miss = max(
            forward[0] - along, along - forward[1], sideways[0] - across, across - sideways[1]
        )
        if miss > TOLERANCE:
            raise InputError(
                f"path table, bin {j}: the nodes are ({along!r}, {across!r}) m apart along and "
                f"across the path, {step!r} m of arc within the curvature bounds give {forward} "
                f"and {sideways}; nodes not at equal arc lengths, or bounds too narrow"
            )

    @property
    def end_m(self) -> float:
        """Station of the last node."""
        return self.station_m(len(self.x) - 1)

    def station_m(self, node: int) -> float:
        """Station of a node."""
        return self.start_m + node * self.spacing_m

    def window(self, station_m: float, *, count: int) -> PathTable:
        """At most `count` nodes (>= 2) from the last one at or before `station_m`.

        Near the path's end the window starts earlier, so that it holds `count` nodes if the path
        does.
        """
        if count < 2:
            raise InputError(f"expected a window of at least 2 nodes, got {count}")
        wanted = math.floor((station_m - self.start_m) / self.spacing_m)
        first = max(0, min(wanted, len(self.x) - count))
        if first == 0 and count >= len(self.x):
            return self
        nodes, bins = slice(first, first + count), slice(first, first + count - 1)
        return PathTable(
            self.station_m(first),
            self.spacing_m,
            self.x[nodes],
            self.y[nodes],
            self.heading[nodes],
            self.curvature_lower[bins],
            self.curvature_upper[bins],
        )

    def project(
        self, x: Interval, y: Interval, heading: Interval, *, near_station_m: float | None
    ) -> PathPose | NoProjection:
        """Path coordinates of every pose in the box x * y * heading, enclosed.

        station s and offset e of p solve (p - r(s)) . t(s) = 0, e = (p - r(s)) . n(s); heading
        error psi = heading - theta(s), near 0. near_station_m: where to look first, such as the
        last known station; None looks everywhere and refuses when two stretches of the path are
        equally near. NUMERICAL: `projection` proves the intervals but for its fixed allowance for
        rounding. Returns NoProjection with the reason off the path's ends, where 1 - kappa e > 0 is
        not proved, or when the box is too large.
        """
        return project(self, x, y, heading, near_station_m=near_station_m)

    def project_part(
        self, whole: PathPose, x: Interval, y: Interval, heading: Interval
    ) -> PathPose | NoProjection:
        """Path coordinates of every pose in x * y * heading, a part of the box that `whole` is of.

        One foot and a mean value form in place of `project`'s corners and edges. Along any straight
        line in the whole box, s' = (t . d) / (1 - kappa e) and e' = n . d, with d its direction; so
        |s - s_c| <= (|cos theta| dx + |sin theta| dy) / (1 - kappa e) and |e - e_c| <= |sin theta|
        dx + |cos theta| dy around the middle c, with theta, kappa and e ranging over `whole`. Rigor
        and refusals are `project`'s; what lies outside of `whole` can be cut off.
        """
        return project_part(self, whole, x, y, heading)
