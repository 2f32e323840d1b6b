"""The path that a bundle drives, from a CSV file of points."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.runtime import PathTable

_COLUMNS: Final = ["x_m", "y_m"]
_LEAST: Final = 3


def path_from_csv(file: Path) -> PathTable:
    """A smooth path through the points of a CSV file with the columns x_m and y_m.

    The interpolating cubic spline by chord length, as a table of nodes every 0.25 m, continued
    straight by 10 m before and 40 m after, so that a prediction does not run off its ends. Points
    are positions of the middle of the rear axle, in the frame of the localisation. Raises
    InputError with the line at fault.
    """
    from workbench.models.spline_path import SplinePath
    from workbench.simulation.recorded_path import PathSmoothing

    points = _points(file)
    try:
        return PathSmoothing.usual().table(SplinePath.through(points))
    except InputError as error:
        raise InputError(f"--path {file}: {error}") from None


def _points(file: Path) -> list[list[float]]:
    try:
        rows = list(csv.reader(file.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"--path: expected a CSV file of points that can be read, got {file} ({error}); write "
            "the columns x_m,y_m"
        ) from None
    header = [name.strip() for name in rows[0]] if rows else []
    if header != _COLUMNS:
        raise InputError(
            f"--path {file}: expected the first line x_m,y_m, got {','.join(header)!r}; give "
            "positions of the rear axle in metres"
        )
    points = [_point(file, line, row) for line, row in enumerate(rows[1:], start=2) if row]
    if len(points) < _LEAST:
        raise InputError(f"--path {file}: expected at least {_LEAST} points, got {len(points)}")
    return points


def _point(file: Path, line: int, row: list[str]) -> list[float]:
    try:
        numbers = [float(each) for each in row]
    except ValueError:
        numbers = []
    if len(numbers) != len(_COLUMNS) or not all(map(math.isfinite, numbers)):
        raise InputError(
            f"--path {file}: expected two finite numbers in line {line}, got {','.join(row)!r}"
        )
    return numbers
