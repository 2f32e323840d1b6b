"""The values over time that the plots draw: tubes, sampled runs, bounds on their growth."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from workbench.claims import Rigor
from workbench.errors import InputError

Values = NDArray[np.float64]


def require_shape(what: str, values: Values, shape: tuple[int, ...]) -> None:
    """Raise InputError unless `values` has `shape`."""
    if values.shape != shape:
        raise InputError(
            f"expected {what} of shape {shape}, got {values.shape}; "
            "rows are instants or steps, columns are states"
        )


@final
@dataclass(frozen=True, slots=True)
class TubeCurves:
    """A reach tube as plain arrays.

    names, units: of the n states; times_s: (K+1,), s; lower, upper: (K, n), hold during a whole
    step; lower_at, upper_at: (K+1, n), hold at the instants; rigor: the grade of
    its containment. Raises InputError on other shapes.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    times_s: Values
    lower: Values
    upper: Values
    lower_at: Values
    upper_at: Values
    rigor: Rigor

    def __post_init__(self) -> None:
        instants, states = len(self.times_s), len(self.names)
        if len(self.units) != states or instants < 2:
            raise InputError(
                f"expected one unit per state and at least two instants, got {states} states, "
                f"{len(self.units)} units and {instants} instants"
            )
        require_shape("the tube's `lower`", self.lower, (instants - 1, states))
        require_shape("the tube's `upper`", self.upper, (instants - 1, states))
        require_shape("the tube's `lower_at`", self.lower_at, (instants, states))
        require_shape("the tube's `upper_at`", self.upper_at, (instants, states))


@final
@dataclass(frozen=True, slots=True)
class SampledRuns:
    """Sampled trajectories: times_s (M,), s; states (N, M, n). InputError on other shapes."""

    times_s: Values
    states: Values

    def __post_init__(self) -> None:
        if self.states.ndim != 3 or self.states.shape[1] != len(self.times_s):
            raise InputError(
                f"expected sampled runs of shape (runs, {len(self.times_s)} instants, states), "
                f"got {self.states.shape}"
            )


class Origin(enum.Enum):
    """Where a growth curve comes from."""

    SAMPLES = "largest deviation among sampled trajectories"
    LEARNED = "learned"
    PROVED = "proved"
    REACHED = "reached for certain"


@final
@dataclass(frozen=True, slots=True)
class Growth:
    """Half widths of a set over time, per state, and what is known about them.

    label: name of the bound; origin, rigor: how it was made; times_s: (M,), s;
    half_widths: (M, n) in the states' units; finding: the outcome of its examination in words,
    such as "refuted", "consistent", "implied by proof"; detail: norm, region, witness; error: of
    the half widths themselves (M, n), such as the runs' integration error, None where exact.
    Raises InputError when times, half widths and errors do not fit.
    """

    label: str
    origin: Origin
    rigor: Rigor
    times_s: Values
    half_widths: Values
    finding: str = ""
    detail: str = ""
    error: Values | None = None

    def __post_init__(self) -> None:
        if self.error is not None:
            require_shape(f"the error of {self.label!r}", self.error, self.half_widths.shape)
        if self.half_widths.ndim != 2 or len(self.half_widths) != len(self.times_s):
            raise InputError(
                f"expected half widths of shape ({len(self.times_s)}, states) for "
                f"{self.label!r}, got {self.half_widths.shape}"
            )

    def at(self, times_s: Values) -> Values:
        """Half widths (M', n) at other instants by interpolation; NaN after the bound's end."""
        columns = [
            np.interp(times_s, self.times_s, column, right=np.nan) for column in self.half_widths.T
        ]
        return np.stack(columns, axis=1)


def mean_ratio(bound: Growth, reference: Growth) -> Values:
    """Mean over time of bound / reference per state, (n,); NaN where the reference stays zero.

    Instants at which the reference is zero, or that either does not reach, are left out.
    """
    top, bottom = bound.at(reference.times_s), reference.half_widths
    usable = (bottom > 0.0) & np.isfinite(top)
    ratio = np.divide(top, bottom, out=np.zeros_like(bottom), where=usable)
    count = usable.sum(axis=0)
    total = np.where(usable, ratio, 0.0).sum(axis=0)
    mean: Values = np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
    return mean


def first_escape_s(bound: Growth, reference: Growth) -> float | None:
    """First instant of `reference` at which it exceeds `bound` in some state, s; None if never.

    An excess below the reference's own error is none.
    """
    slack = 1e-9 * np.abs(reference.half_widths) + 1e-12
    if reference.error is not None:
        slack = slack + reference.error
    outside = (reference.half_widths > bound.at(reference.times_s) + slack).any(axis=1)
    return float(reference.times_s[int(np.argmax(outside))]) if outside.any() else None
