"""Discs about simple predictions, as large as the tubes: what the equations are worth."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.optimize import brentq

from workbench.errors import InputError
from workbench.simulation.conformance.enclosing import Enclosed
from workbench.simulation.conformance.windows import Array, Measured


class Prediction(enum.Enum):
    """Where a disc's centre goes from the window's first pose, straight ahead."""

    CONSTANT_VELOCITY = "constant velocity"
    CONSTANT_ACCELERATION = "constant acceleration, until it stands"


@final
@dataclass(frozen=True, slots=True)
class Disc:
    """Radius error_m + growth_mps2 t^2 / 2 about a prediction."""

    prediction: Prediction
    error_m: float
    growth_mps2: float

    def radius_m(self, times_s: Array) -> Array:
        """(K+1,)."""
        return np.asarray(self.error_m + 0.5 * self.growth_mps2 * times_s**2)

    def area_m2(self, times_s: Array) -> float:
        """Mean over the instants."""
        return float(np.mean(np.pi * self.radius_m(times_s) ** 2))

    def enclosed(self, measured: Measured) -> Enclosed:
        """As tubes are judged, by the distance from the centre."""
        away = _distances(self.prediction, measured)
        radius = np.broadcast_to(self.radius_m(measured.times_s), away.shape)
        owners = tuple(window.recording for window in measured.windows)
        return Enclosed(
            owners, away[:, :, None], radius[:, :, None], away <= radius, np.pi * radius**2
        )


def of_area(
    prediction: Prediction, measured: Measured, *, error_m: float, mean_area_m2: float
) -> Disc:
    """The disc whose mean area over the instants is this.

    Raises InputError where error_m alone takes more.
    """

    def excess(growth: float) -> float:
        return Disc(prediction, error_m, growth).area_m2(measured.times_s) - mean_area_m2

    if not (math.isfinite(mean_area_m2) and excess(0.0) < 0.0):
        raise InputError(
            f"expected a mean area above that of a disc of {error_m:.3g} m, got {mean_area_m2:.3g} "
            "m^2"
        )
    most = 1.0
    while excess(most) < 0.0:
        most *= 2.0
    return Disc(prediction, error_m, float(brentq(excess, 0.0, most)))


def containing(prediction: Prediction, measured: Measured, *, error_m: float) -> Disc:
    """The least disc that contains all windows."""
    away, times = _distances(prediction, measured)[:, 1:], measured.times_s[1:]
    growth = float(np.max(2.0 * (away - error_m) / times**2, initial=0.0))
    return Disc(prediction, error_m, math.nextafter(growth * (1.0 + 1e-12), math.inf))


def _distances(prediction: Prediction, measured: Measured) -> Array:
    """(W, K+1): from the centre to the measured position, the first two outputs."""
    times = measured.times_s
    start = [
        dict(zip(window.initial.names, window.initial.center, strict=True))
        for window in measured.windows
    ]
    speed = np.array([each["speed"] for each in start])[:, None]
    ahead = speed * times
    if prediction is Prediction.CONSTANT_ACCELERATION:
        rate = np.array([each["acceleration"] for each in start])[:, None]
        stops = np.where(rate < 0.0, -speed / np.where(rate < 0.0, rate, -1.0), np.inf)
        until = np.minimum(times, stops)
        ahead = speed * until + 0.5 * rate * until**2
    seen = np.array([window.measured[:, :2] for window in measured.windows])
    return np.asarray(np.hypot(seen[:, :, 0] - ahead, seen[:, :, 1]))
