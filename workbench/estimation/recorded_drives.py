"""Drives as tables: what the car reported, which ranges came, and where the car then was."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.commissioning import DriveLog
from workbench.estimation.lanes import Array
from workbench.estimation.localisation import Localiser, Status
from workbench.estimation.localisation_sets import InitialSet, Shape, initial_sets
from workbench.estimation.localisation_site import Site
from workbench.estimation.localisation_world import Drive
from workbench.estimation.tables import Row, Table

REPORT_COLUMNS: Final = ("t", "speed", "steering")
COMMAND_COLUMNS: Final = ("acceleration", "steering_rate")
RANGE_COLUMNS: Final = ("t", "beacon", "range")
_STATES: Final = ("x", "y", "heading", "steering", "speed")
POSE_COLUMNS: Final = ("t", "status", *_STATES, *(f"{name}_radius" for name in _STATES))


@final
@dataclass(frozen=True, slots=True)
class RecordedDrive:
    """One drive: reports and ranges, and commands (k, 2): acceleration (m/s^2) and steering rate
    (rad/s) in force from each report on, zeros where nobody recorded them."""

    log: DriveLog
    commands: Array


@final
@dataclass(frozen=True, slots=True)
class Located:
    """What is known at one report: the nested sets, the smallest first, or why there are none."""

    t_s: float
    status: Status
    sets: tuple[InitialSet, ...]


def load_drive(folder: Path, site: Site) -> RecordedDrive:
    """Read `reports.csv` (t, speed, steering; acceleration and steering_rate where the commands are
    known) and `ranges.csv` (t, beacon, range): s, m/s, rad, m/s^2, rad/s, names of the site, m.

    Both may be gzip; rows must be in the order of their times. Ranges before the first and after
    the last report are left out. Raises InputError naming file, line and column.
    """
    if not folder.is_dir():
        raise InputError(
            f"expected a folder with reports.csv and ranges.csv at {folder}, found "
            f"{'a file' if folder.exists() else 'nothing'}; `workbench localise --generate DIR` "
            "writes one to look at"
        )
    reports = Table.read(folder, "reports", REPORT_COLUMNS)
    ranges = Table.read(folder, "ranges", RANGE_COLUMNS)
    times = _rising(reports.rows, "report", strictly=True)
    numbers = {beacon.name: k for k, beacon in enumerate(site.beacons)}
    ranged = _rising(ranges.rows, "range", strictly=False)
    own = [_numbered(row, numbers) for row in ranges.rows]
    found = np.array([_length(row) for row in ranges.rows], dtype=float)
    commanded = all(name in reports.columns for name in COMMAND_COLUMNS)
    commands = [
        [row.number(name) if commanded else 0.0 for name in COMMAND_COLUMNS] for row in reports.rows
    ]
    if len(times) < 2:
        raise InputError(f"{reports.path}: expected at least two reports, got {len(times)}")
    kept = (ranged >= times[0]) & (ranged <= times[-1])
    log = DriveLog(
        times,
        np.array([row.number("speed") for row in reports.rows]),
        np.array([row.number("steering") for row in reports.rows]),
        ranged[kept], np.array(own, dtype=np.int64)[kept], found[kept],
    )  # fmt: skip
    return RecordedDrive(log, np.array(commands))


def located(
    localiser: Localiser, drive: RecordedDrive, *, levels: Sequence[float], shape: Shape
) -> Iterator[Located]:
    """What is known at each report, from the messages until then alone.

    A car that is LOST begins anew, and is placed again when it stands.
    """
    log, next_range, everyone = drive.log, 0, np.ones(1, dtype=bool)
    known = localiser.begin(at_s=float(log.times_s[0]), cars=1)
    for k, t_s in enumerate(map(float, log.times_s)):
        while next_range < len(log.ranges_m) and log.range_times_s[next_range] <= t_s:
            known = localiser.ranged(
                known, at_s=float(log.range_times_s[next_range]),
                beacon=int(log.beacons[next_range]),
                range_m=log.ranges_m[next_range : next_range + 1], received=everyone,
            )  # fmt: skip
            next_range += 1
        known = localiser.reported(
            known, at_s=t_s, speed_mps=log.speed_mps[k : k + 1],
            steering_rad=log.steering_rad[k : k + 1], commands=drive.commands[k : k + 1],
        )  # fmt: skip
        found = initial_sets(localiser, known, now_s=t_s, levels=levels, shape=shape)
        if isinstance(found, Status):
            yield Located(t_s, found, ())
            if found is Status.LOST:
                known = localiser.begin(at_s=t_s, cars=1)
        else:
            yield Located(t_s, Status.VALID, found)


def pose_rows(moments: Sequence[Located]) -> Iterator[tuple[str, ...]]:
    """`POSE_COLUMNS` of each moment: middles and half-widths of the largest set, empty without."""
    for moment in moments:
        middles, radii = [""] * len(_STATES), [""] * len(_STATES)
        if moment.sets:
            sides = [getattr(moment.sets[-1], name) for name in _STATES]
            middles = [f"{0.5 * (low + high):.4f}" for low, high in sides]
            # Rounded up: the written set holds the set.
            radii = [f"{0.5 * (high - low) + 1e-4:.4f}" for low, high in sides]
        yield (f"{moment.t_s:.6g}", moment.status.name, *middles, *radii)


def drive_tables(drive: Drive, site: Site, *, car: int = 0) -> dict[str, str]:
    """One car of a generated drive as the texts of reports.csv, ranges.csv and truth.csv."""
    reports = [",".join((*REPORT_COLUMNS, *COMMAND_COLUMNS))]
    ranges, truth = [",".join(RANGE_COLUMNS)], [",".join(("t", "x", "y", "heading"))]
    for k, t_s in enumerate(drive.times_s):
        numbers = (drive.speed_mps[k, car], drive.steering_rad[k, car], *drive.commands[k, car])
        reports.append(",".join([f"{t_s:.4f}", *(f"{number:.5f}" for number in numbers)]))
        truth.append(",".join([f"{t_s:.4f}", *(f"{n:.4f}" for n in drive.truth[k, car, :3])]))
        for beacon, range_m in zip(site.beacons, drive.ranges_m[k, car], strict=True):
            if np.isfinite(range_m):
                ranges.append(f"{t_s:.4f},{beacon.name},{range_m:.3f}")
    named = {"reports.csv": reports, "ranges.csv": ranges, "truth.csv": truth}
    return {name: "\n".join(lines) + "\n" for name, lines in named.items()}


def _rising(rows: Sequence[Row], what: str, *, strictly: bool) -> Array:
    times = np.array([row.number("t") for row in rows])
    steps = np.diff(times)
    wrong = steps <= 0.0 if strictly else steps < 0.0
    if wrong.any():
        row = rows[int(np.argmax(wrong)) + 1]
        raise InputError(
            f"{row.place('t')}: expected a {what} after the one before it, got {row.text('t')}; "
            "sort the rows by t" + (" and drop repeated ones" if strictly else "")
        )
    return times


def _numbered(row: Row, numbers: dict[str, int]) -> int:
    name = row.text("beacon")
    if name not in numbers:
        raise InputError(
            f"{row.place('beacon')}: expected one of {', '.join(numbers)}, got {name!r}; name the "
            "site file of this place with --site"
        )
    return numbers[name]


def _length(row: Row) -> float:
    range_m = row.number("range")
    if range_m < 0.0:
        raise InputError(f"{row.place('range')}: expected metres >= 0, got {row.text('range')}")
    return range_m
