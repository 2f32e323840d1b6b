"""Radii that hold a stated share of the errors of predictions, fitted to recorded errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError

Values = NDArray[np.float64]

WALKING_MPS = 1.2
"""Errors of people faster than this are counted per multiple of it: fast people err by more."""
_HALF_WINDOW_S = 0.26
"""Errors this near to a knot count for it: those of the neighbours at half a second, halved."""


@final
@dataclass(frozen=True, slots=True)
class QuantileRadii:
    """Radius by share of people, time since the last measurement, and speed.

    levels: (k,), shares, increasing; leads_s: (n,), increasing; radii_m: k rows of n, which fall
    neither along a row nor from a row to the next. Raises InputError where that does not hold.
    """

    levels: tuple[float, ...]
    leads_s: tuple[float, ...]
    radii_m: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        table = np.array(self.radii_m, dtype=np.float64)
        if table.shape != (len(self.levels), len(self.leads_s)) or len(self.leads_s) < 2:
            raise InputError(
                f"radii: expected {len(self.levels)} rows of {len(self.leads_s)} (at least 2) "
                f"numbers, got the shape {table.shape}"
            )
        inside = all(0.0 < level < 1.0 for level in self.levels)
        if not (inside and _rises(self.levels) and _rises(self.leads_s)):
            raise InputError("radii: expected increasing levels between 0 and 1 and times in order")
        fair = np.isfinite(table).all() and (table >= 0.0).all()
        if not (fair and (np.diff(table) >= 0.0).all() and (np.diff(table, axis=0) >= 0.0).all()):
            raise InputError("radii: expected finite metres that fall neither with time nor level")

    def radius_m(self, level: float, lead_s: float, speed_mps: float) -> float:
        """Radius (m) that holds a share `level` of the people lead_s after their last measurement.

        Linear between the knots, and as steep as between the last two after them; times
        max(1, speed / 1.2 m/s). Holds at each time alone, not at all times together; NUMERICAL at
        best: the share is that of the recordings it was fitted to. Raises InputError for a level
        that was not fitted: a quantile is not guessed.
        """
        if level not in self.levels:
            raise InputError(
                f"expected one of the fitted levels {', '.join(map(str, self.levels))}, "
                f"got {level}; fit that level, or take the next larger one"
            )
        if not (math.isfinite(lead_s) and math.isfinite(speed_mps)):
            raise InputError(f"expected finite time and speed, got {lead_s} and {speed_mps}")
        row, leads = self.radii_m[self.levels.index(level)], self.leads_s
        radius = float(np.interp(lead_s, leads, row))
        if lead_s > leads[-1]:
            radius += (row[-1] - row[-2]) / (leads[-1] - leads[-2]) * (lead_s - leads[-1])
        return radius * float(multiples(speed_mps))


def multiples(speed_mps: float | Values) -> Values:
    """max(1, speed / 1.2 m/s): what errors and radii are counted in."""
    counted: Values = np.maximum(1.0, np.abs(speed_mps) / WALKING_MPS)
    return counted


def fit_radii(
    leads_s: Values, errors_m: Values, speeds_mps: Values, *, levels: Sequence[float],
    knots_s: Sequence[float], least: int,
) -> QuantileRadii:  # fmt: skip
    """Radii from recorded errors: leads_s, errors_m, speeds_mps (n,), NaN errors left out.

    At each knot the smallest radius that holds level (m + 1) of the m errors within 0.26 s of it,
    the split conformal quantile: of a further person, exchangeable with those, it holds the share
    `level` at least. Errors of one person depend on each other, and people of one place do: what it
    holds elsewhere is measured by leaving recordings out. Knots with fewer than `least` errors are
    left out; radii are then raised to grow with time and level. Raises InputError with fewer than
    two knots left, or so few errors that the highest level has no quantile.
    """
    known = np.isfinite(errors_m)
    leads, scaled = leads_s[known], errors_m[known] / multiples(speeds_mps[known])
    kept, columns = [], []
    for knot in knots_s:
        near = np.sort(scaled[np.abs(leads - knot) <= _HALF_WINDOW_S])
        ranks = [math.ceil(level * (len(near) + 1)) for level in levels]
        if len(near) >= max(least, ranks[-1]):
            kept.append(float(knot))
            columns.append([near[rank - 1] for rank in ranks])
    if len(kept) < 2:
        raise InputError(
            f"expected at least {least} errors near two of the times {list(knots_s)}, got "
            f"{len(scaled)} in all; give longer or more recordings, or lower levels"
        )
    table = np.maximum.accumulate(np.maximum.accumulate(np.array(columns).T, axis=1), axis=0)
    rows = tuple(tuple(round(float(radius), 3) for radius in row) for row in table)
    return QuantileRadii(tuple(levels), tuple(kept), rows)


def _rises(numbers: Sequence[float]) -> bool:
    return bool((np.diff(numbers) > 0.0).all())
