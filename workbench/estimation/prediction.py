"""Where a person will be, from what was measured of them by now: constant velocity, and ours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.estimation.motion_filter import Estimate, MotionNumbers, estimate, forecast_step
from workbench.estimation.people_data import PersonTrack

Values = NDArray[np.float64]
_SAME_TIME_S = 1e-9


class Predictor(Protocol):
    """A way to predict; it is given what was measured by now, and nothing else."""

    def places_m(
        self, history: PersonTrack, at_s: float, horizons_s: Sequence[float] | Values
    ) -> Values:
        """(n, 2) places in m, at_s + horizons_s (n,)."""
        ...


@final
@dataclass(frozen=True, slots=True)
class ConstantVelocity:
    """The last place, and the velocity of the line of least squares through the last window_s.

    The window holds at least the last two measurements; with a single one the person stands. Time
    runs on from the last measurement, not from when the question is asked.
    """

    window_s: float

    def __post_init__(self) -> None:
        if not 0.0 < self.window_s < math.inf:
            raise InputError(f"expected a window above 0 s, got {self.window_s}")

    def places_m(
        self, history: PersonTrack, at_s: float, horizons_s: Sequence[float] | Values
    ) -> Values:
        """As `Predictor` says; InputError for a history that is empty or goes on after at_s."""
        age_s = age_of(history, at_s)
        lead = age_s + np.asarray(horizons_s, dtype=np.float64)
        places: Values = history.xy_m[-1] + lead[:, None] * self.velocity_mps(history)
        return places

    def velocity_mps(self, history: PersonTrack) -> Values:
        """(2,) m/s."""
        if len(history.t_s) < 2:
            return np.zeros(2)
        first = int(np.searchsorted(history.t_s, history.t_s[-1] - self.window_s - _SAME_TIME_S))
        first = min(first, len(history.t_s) - 2)
        t_s = history.t_s[first:] - history.t_s[first:].mean()
        velocity: Values = t_s @ history.xy_m[first:] / (t_s @ t_s)
        return velocity


@final
@dataclass(frozen=True, slots=True)
class PreferredVelocity:
    """Ours, the goal not known: filter and forecast of `motion_filter`."""

    numbers: MotionNumbers

    def places_m(
        self, history: PersonTrack, at_s: float, horizons_s: Sequence[float] | Values
    ) -> Values:
        """As `Predictor` says; InputError for a history that is empty or goes on after at_s."""
        age_of(history, at_s)
        return self.forecast(estimate(history, self.numbers), at_s, horizons_s)

    def forecast(
        self, known: Estimate, at_s: float, horizons_s: Sequence[float] | Values
    ) -> Values:
        """(n, 2) places in m from an estimate made by at_s."""
        horizons = np.asarray(horizons_s, dtype=np.float64)
        forecast, row = forecast_step(), self.numbers.row
        age_s = at_s - known.t_s
        places = [forecast(known.mean, age_s, ahead, row)[0].full()[0] for ahead in horizons]
        return np.array(places).reshape(-1, 2)

    def speed_mps(self, known: Estimate, at_s: float) -> float:
        """The speed that is believed at at_s: radii depend on it."""
        velocity = forecast_step()(known.mean, at_s - known.t_s, 0.0, self.numbers.row)[1].full()
        return float(np.hypot(*velocity[0]))


def age_of(history: PersonTrack, at_s: float) -> float:
    """Seconds from the last measurement to at_s; InputError if there is none, or a later one."""
    if not len(history.t_s):
        raise InputError(
            f"{history.agent!r} in {history.recording!r}: expected at least one measurement by "
            f"{at_s:g} s; ask about people once they have been seen"
        )
    age_s = at_s - float(history.t_s[-1])
    if not age_s >= -_SAME_TIME_S:
        raise InputError(
            f"{history.agent!r} in {history.recording!r}: measurements up to "
            f"{history.t_s[-1]:g} s cannot answer what was known at {at_s:g} s; give "
            "history.until(t)"
        )
    return max(age_s, 0.0)
