"""Where the vehicle was when an image was taken, from a table of its poses."""

from __future__ import annotations

import bisect
import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from workbench.errors import InputError
from workbench.estimation.outward import cosine, minus, product, sine
from workbench.estimation.tables import Row, Table
from workbench.runtime.arc import Interval
from workbench.runtime.onboard.dead_reckoning import Pose, around

STANDING: Final = Pose((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
"""The rear axle at the origin, heading along x."""
COLUMNS: Final = ("t", "x", "y", "heading")
HALF_COLUMNS: Final = ("x_half", "y_half", "heading_half")
# More than tyres can do on a road in any direction.
_ACCELERATION_MPS2: Final = 10.0
# More than a car's heading can: at 8 m/s and a steering rate of 1 rad/s about 7.
_TURNING_RADPS2: Final = 10.0
# Interpolating rounds a few times, relatively to the numbers involved.
_ROUNDING: Final = 2.0**-48


@final
@dataclass(frozen=True, slots=True)
class Stated:
    """One row: time (s), then middle (m, m, rad) and half width of x, y and heading."""

    t_s: float
    middle: tuple[float, float, float]
    half: tuple[float, float, float]


@final
@dataclass(frozen=True, slots=True)
class Poses:
    """Poses over time. rows: of one reference point, reference_ahead_m ahead of the rear axle."""

    rows: tuple[Stated, ...]
    reference_ahead_m: float
    path: Path

    def at(self, t_s: float) -> Pose:
        """Boxes that hold the pose of the rear axle at t_s.

        Between rows at t0 and t1 a quantity q with |q''| <= B is within B (t - t0)(t1 - t) / 2 of
        the line through both; B is 10 m/s^2 for x and y and 10 rad/s^2 for the heading, more than
        a car on tyres can. Raises InputError before the first and after the last row.
        """
        times = [row.t_s for row in self.rows]
        if not times[0] <= t_s <= times[-1]:
            raise InputError(
                f"{self.path}: expected poses from before {t_s!r} s until after it, got "
                f"{times[0]!r} s to {times[-1]!r} s; put images and vehicle on one clock with a "
                "start time, or leave images out"
            )
        k = min(bisect.bisect_right(times, t_s) - 1, max(len(times) - 2, 0))
        first, second = self.rows[k], self.rows[min(k + 1, len(times) - 1)]
        x, y, heading = (_between(first, second, axis, t_s) for axis in range(3))
        ahead = (self.reference_ahead_m, self.reference_ahead_m)
        if self.reference_ahead_m == 0.0:
            return Pose(x, y, heading)
        return Pose(
            minus(x, product(ahead, cosine(heading))),
            minus(y, product(ahead, sine(heading))),
            heading,
        )


def load_poses(
    path: Path,
    *,
    recording: str | None,
    half_m_rad: tuple[float, float] | None,
    reference_ahead_m: float,
) -> Poses:
    """Read a table (.csv or .csv.gz) with the columns t, x, y, heading (s, m, m, rad).

    recording: takes these rows of a table with a column `recording`; half_m_rad: half widths of
    position and heading for a table without the columns x_half, y_half and heading_half;
    reference_ahead_m: how far ahead of the rear axle the table's positions are. Raises InputError
    for a table that lacks columns or rows, mixes vehicles, goes back in time, jumps in heading by
    half a turn, or states how sure it is twice or not at all.
    """
    table = _table(path)
    rows = _of_one_vehicle(table, recording)
    stated = [name for name in HALF_COLUMNS if name in table.columns]
    if stated if half_m_rad is not None else len(stated) < len(HALF_COLUMNS):
        raise InputError(
            f"{table.path}: expected the half widths either as columns {', '.join(HALF_COLUMNS)} "
            f"or as two numbers for all rows, got the columns {', '.join(stated) or 'none'} and "
            f"{'two numbers' if half_m_rad is not None else 'no numbers'}"
        )
    found = tuple(_stated(row, half_m_rad) for row in rows)
    for (before, after), row in zip(itertools.pairwise(found), rows[1:], strict=True):
        if not after.t_s > before.t_s:
            raise InputError(
                f"{row.place('t')}: expected a time after {before.t_s!r}, got {after.t_s!r}"
            )
        if abs(after.middle[2] - before.middle[2]) > math.pi:
            raise InputError(
                f"{row.place('heading')}: expected a heading that does not jump by half a turn, "
                f"got {before.middle[2]!r} and then {after.middle[2]!r}; unwrap it"
            )
    return Poses(found, reference_ahead_m, table.path)


def _table(path: Path) -> Table:
    for ending in (".csv.gz", ".csv"):
        if path.name.endswith(ending) and path.is_file():
            return Table.read(path.parent, path.name.removesuffix(ending), COLUMNS)
    raise InputError(f"{path}: expected a table of poses (.csv or .csv.gz), found none")


def _of_one_vehicle(table: Table, recording: str | None) -> list[Row]:
    rows = list(table.rows)
    if "recording" in table.columns and recording is not None:
        rows = [row for row in rows if row.text("recording") == recording]
    keys = [name for name in ("recording", "agent") if name in table.columns]
    vehicles = {tuple(row.text(name) for name in keys) for row in rows}
    if len(vehicles) > 1:
        listed = "; ".join(sorted(", ".join(each) for each in vehicles)[:12])
        raise InputError(
            f"{table.path}: expected the poses of one vehicle, got those of {len(vehicles)} "
            f"({listed}); name the recording, or write a table of one vehicle"
        )
    if not rows:
        of = "" if recording is None else f" of the recording {recording!r}"
        raise InputError(f"{table.path}: expected poses{of}, found no row")
    return rows


def _stated(row: Row, half_m_rad: tuple[float, float] | None) -> Stated:
    x, y, heading = (row.number(name) for name in COLUMNS[1:])
    if half_m_rad is not None:
        half = (half_m_rad[0], half_m_rad[0], half_m_rad[1])
    else:
        along, across, turned = (row.number(name) for name in HALF_COLUMNS)
        half = (along, across, turned)
        for name, value in zip(HALF_COLUMNS, half, strict=True):
            if value < 0.0:
                raise InputError(f"{row.place(name)}: expected a half width >= 0, got {value!r}")
    return Stated(row.number("t"), (x, y, heading), half)


def _between(first: Stated, second: Stated, axis: int, t_s: float) -> Interval:
    """The line through both rows at t_s, widened as `Poses.at` says and outward for rounding."""
    for row in (first, second):
        if t_s == row.t_s:
            return around(row.middle[axis], row.half[axis])
    ahead_s, back_s = second.t_s - t_s, t_s - first.t_s
    part = back_s / (second.t_s - first.t_s)
    a, b = first.middle[axis], second.middle[axis]
    most = _TURNING_RADPS2 if axis == 2 else _ACCELERATION_MPS2
    half = (1.0 - part) * first.half[axis] + part * second.half[axis]
    bulge = 0.5 * most * back_s * ahead_s
    slack = _ROUNDING * (abs(a) + abs(b) + half + bulge)
    return around(a + part * (b - a), half + bulge + slack)
