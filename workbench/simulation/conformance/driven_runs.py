"""Closed-loop runs as tables: where a driven vehicle truly was, and its controller's integrals.

A folder holds, each plain (`.csv`) or compressed (`.csv.gz`), SI units, with a header row:
`runs`: run, t, x, y, heading, steering, speed, mode, speed_integral, offset_integral
`paths`: run, x, y: the waypoints of the path that the run followed, at least three
x, y, heading are those of the rear axle; mode is TRACK or what else the vehicle did; the integrals
are the law's at that instant.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.estimation.tables import Row, Table
from workbench.simulation.conformance.windows import Array

NUMBERS: Final = (
    "t", "x", "y", "heading", "steering", "speed", "speed_integral", "offset_integral",
)  # fmt: skip
RUN_COLUMNS: Final = ("run", *NUMBERS, "mode")
PATH_COLUMNS: Final = ("run", "x", "y")
TRACK: Final = "TRACK"


@final
@dataclass(frozen=True, slots=True, eq=False)
class DrivenRun:
    """One run of a vehicle under its controller.

    table (M, 8): the columns `NUMBERS`, times increasing; tracking (M,): was the mode TRACK?;
    waypoints (P, 2): of the path, m. Raises InputError where they do not fit.
    """

    name: str
    table: Array
    tracking: NDArray[np.bool_]
    waypoints: Array

    def __post_init__(self) -> None:
        rows = len(self.table)
        if self.table.shape != (rows, len(NUMBERS)) or self.tracking.shape != (rows,):
            raise InputError(
                f"run {self.name!r}: expected {len(NUMBERS)} numbers and a mode per instant, got "
                f"shapes {self.table.shape} and {self.tracking.shape}"
            )
        late = np.flatnonzero(np.diff(self.table[:, 0]) <= 0.0)
        if late.size:
            raise InputError(
                f"run {self.name!r}: expected times that increase, got "
                f"{self.table[late[0] + 1, 0]} after {self.table[late[0], 0]}; sort its rows"
            )

    def column(self, name: str) -> Array:
        """One of `NUMBERS`, (M,)."""
        return np.asarray(self.table[:, NUMBERS.index(name)])


def holds_runs(folder: Path) -> bool:
    """Is there a table of runs in the folder?"""
    return Table.exists(folder, "runs")


def load_runs(folder: Path) -> tuple[DrivenRun, ...]:
    """All runs of a folder, by name. Raises InputError naming file, line and column."""
    runs = _grouped(Table.read(folder, "runs", RUN_COLUMNS).rows)
    paths = _grouped(Table.read(folder, "paths", PATH_COLUMNS).rows)
    lacking = sorted(set(runs) - set(paths))
    if lacking:
        raise InputError(
            f"{folder}: expected the waypoints of every run in the table of paths, got none for "
            f"{', '.join(lacking)}"
        )
    return tuple(_run(name, runs[name], paths[name]) for name in sorted(runs))


def runs_tables(runs: Sequence[DrivenRun]) -> dict[str, str]:
    """The texts of runs.csv and paths.csv; reading them gives the same runs."""
    lines, points = [",".join(RUN_COLUMNS)], [",".join(PATH_COLUMNS)]
    for run in runs:
        for numbers, tracking in zip(run.table.tolist(), run.tracking, strict=True):
            mode = TRACK if tracking else "BRAKE"
            lines.append(",".join([run.name, *map(repr, numbers), mode]))
        points += [f"{run.name},{x!r},{y!r}" for x, y in run.waypoints.tolist()]
    return {"runs.csv": "\n".join(lines) + "\n", "paths.csv": "\n".join(points) + "\n"}


def _grouped(rows: Iterable[Row]) -> dict[str, list[Row]]:
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row.text("run"), []).append(row)
    return groups


def _run(name: str, rows: Sequence[Row], points: Sequence[Row]) -> DrivenRun:
    return DrivenRun(
        name,
        np.array([[row.number(column) for column in NUMBERS] for row in rows]),
        np.array([row.text("mode") == TRACK for row in rows]),
        np.array([[row.number("x"), row.number("y")] for row in points]),
    )
