"""Smooth paths through waypoints, described by arc length."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, make_interp_spline, make_smoothing_spline
from scipy.optimize import brentq

from workbench.errors import InputError
from workbench.runtime.path import PathTable

Array = NDArray[np.float64]

_PANEL_M = 0.25
_GAUSS_POINTS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(8)
_SAMPLES_PER_BIN = 16
# Bounds on log10 of the smoothing weight: practically interpolation, practically a straight line.
_LEAST_SMOOTHING, _MOST_SMOOTHING = -6.0, 8.0


def _checked_points(points: ArrayLike, least: int) -> Array:
    try:
        array = np.asarray(points, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"waypoints: expected an n x 2 array of metres, got {points!r}") from error
    if array.ndim != 2 or array.shape[1] != 2 or len(array) < least:
        raise InputError(
            f"waypoints: expected an n x 2 array of metres with n >= {least}, "
            f"got shape {array.shape}"
        )
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if bad.size:
        raise InputError(
            f"waypoints: expected finite numbers, got {array[bad[0]].tolist()} in row {bad[0]}; "
            "drop such rows"
        )
    return array


def _chord_length(points: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


def _grouped(points: Array, spacing_m: float) -> Array:
    starts = [0]
    for index in range(1, len(points)):
        if math.dist(points[index], points[starts[-1]]) >= spacing_m:
            starts.append(index)
    ends = [*starts[1:], len(points)]
    return np.array(
        [points[start:end].mean(axis=0) for start, end in zip(starts, ends, strict=True)]
    )


@final
@dataclass(frozen=True, slots=True, eq=False)
class SplinePath:
    """A twice differentiable plane curve by arc length.

    station s in [0, length_m]; position (x, y); heading atan2(y', x'), unwrapped along the path;
    curvature (x' y'' - y' x'') / (x'^2 + y'^2)^1.5, positive to the left. Arc length by Gauss
    quadrature on short panels, inverted by Newton steps; rigor NUMERICAL. Raises InputError when
    the curve stops or turns back within itself (zero derivative).
    """

    curve: BSpline
    _knots: Array = field(init=False, repr=False)
    _stations: Array = field(init=False, repr=False)
    _headings: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        breaks = np.unique(self.curve.t)
        pieces = [
            np.linspace(low, high, max(4, math.ceil((high - low) / _PANEL_M)), endpoint=False)
            for low, high in itertools.pairwise(breaks)
        ]
        knots = np.concatenate([*pieces, breaks[-1:]])
        tangents = self.curve(knots, 1)
        if np.hypot(*tangents.T).min() < 1e-3:
            raise InputError(
                "waypoints: the path stops or turns back on itself; remove points that go backwards"
            )
        panels = self._arc_length(knots[:-1], knots[1:])
        object.__setattr__(self, "_knots", knots)
        object.__setattr__(self, "_stations", np.concatenate([[0.0], np.cumsum(panels)]))
        object.__setattr__(self, "_headings", np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0])))

    @classmethod
    def through(cls, waypoints: ArrayLike) -> SplinePath:
        """Cubic spline (not-a-knot, chord length) through every waypoint, an n x 2 array in metres.

        Three points give the parabola through them.
        Raises InputError for fewer than 3 points, NaN, or the same point twice in a row.
        """
        points = _checked_points(waypoints, 3)
        lengths = _chord_length(points)
        repeated = np.flatnonzero(np.diff(lengths) <= 1e-9)
        if repeated.size:
            row = int(repeated[0])
            raise InputError(
                f"waypoints: expected distinct neighbours, got {points[row].tolist()} in rows "
                f"{row} and {row + 1}; drop one, or use SplinePath.smoothing for a recorded path"
            )
        return cls(make_interp_spline(lengths, points, k=min(3, len(points) - 1)))

    @classmethod
    def smoothing(
        cls, points: ArrayLike, *, noise_std_m: float, spacing_m: float = 0.5
    ) -> SplinePath:
        """Smoothing spline along a recorded path, n x 2 in metres, in the order of travel.

        Points that follow each other within spacing_m become their mean (a standing car's positions
        cluster and drift); then the penalty on the second derivative is chosen so that the root
        mean square distance of these means from the curve, at their chord length, equals
        noise_std_m. Chord length takes up noise along the path, so this is the noise across it.
        Leave out samples of a standing car whose position drifts by more than spacing_m: the curve
        would follow the drift. Raises InputError for NaN or when fewer than 5 points remain.
        """
        array = _checked_points(points, 1)
        if not (math.isfinite(noise_std_m) and noise_std_m > 0.0):
            raise InputError(f"noise_std_m: expected a standard deviation > 0, got {noise_std_m!r}")
        kept = _grouped(array, spacing_m)
        if len(kept) < 5:
            raise InputError(
                f"recorded path: expected at least 5 points {spacing_m} m apart, got {len(kept)} "
                f"of {len(array)}; the vehicle hardly moved"
            )
        lengths = _chord_length(kept)

        def fitted(log_weight: float) -> BSpline:
            each = [
                make_smoothing_spline(lengths, column, lam=10.0**log_weight) for column in kept.T
            ]
            return BSpline(each[0].t, np.column_stack([spline.c for spline in each]), 3)

        def excess(log_weight: float) -> float:
            residual = fitted(log_weight)(lengths) - kept
            return float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))) - noise_std_m

        if excess(_MOST_SMOOTHING) <= 0.0:
            return cls(fitted(_MOST_SMOOTHING))
        if excess(_LEAST_SMOOTHING) >= 0.0:
            return cls(fitted(_LEAST_SMOOTHING))
        chosen = brentq(excess, _LEAST_SMOOTHING, _MOST_SMOOTHING, xtol=1e-3)
        return cls(fitted(float(chosen)))

    @property
    def length_m(self) -> float:
        """Arc length of the whole path."""
        return float(self._stations[-1])

    def position(self, station_m: ArrayLike) -> Array:
        """(x, y) in metres at each station: shape (..., 2)."""
        return np.asarray(self.curve(self._parameter(station_m)))

    def heading(self, station_m: ArrayLike) -> Array:
        """Direction of travel (rad), unwrapped along the path."""
        parameter = self._parameter(station_m)
        tangent = self.curve(parameter, 1)
        wrapped = np.arctan2(tangent[..., 1], tangent[..., 0])
        near = np.interp(parameter, self._knots, self._headings)
        return np.asarray(wrapped + 2 * np.pi * np.round((near - wrapped) / (2 * np.pi)))

    def curvature(self, station_m: ArrayLike) -> Array:
        """Curvature (1/m), positive to the left."""
        parameter = self._parameter(station_m)
        first, second = self.curve(parameter, 1), self.curve(parameter, 2)
        cross = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
        return np.asarray(cross / np.hypot(first[..., 0], first[..., 1]) ** 3)

    def table(self, spacing_m: float, *, before_m: float = 0.0, after_m: float = 0.0) -> PathTable:
        """The path as the runtime's table of nodes with a curvature hull per bin.

        spacing_m: largest distance of nodes; the one used divides the length evenly. before_m,
        after_m: straight continuation at either end, so that a look-ahead has somewhere to go.
        Curvature bounds: hull of 17 samples per bin, widened by the largest step between
        neighbouring samples. Rigor NUMERICAL: a curvature peak between samples is not excluded.
        """
        if not (spacing_m > 0.0 and before_m >= 0.0 and after_m >= 0.0):
            raise InputError(
                "table: expected spacing_m > 0, before_m >= 0 and after_m >= 0, got "
                f"{spacing_m!r}, {before_m!r} and {after_m!r}"
            )
        total = before_m + self.length_m + after_m
        bins = max(1, math.ceil(total / spacing_m - 1e-9))
        fine = np.linspace(-before_m, self.length_m + after_m, bins * _SAMPLES_PER_BIN + 1)
        nodes = fine[::_SAMPLES_PER_BIN]
        inside = np.clip(nodes, 0.0, self.length_m)
        heading = self.heading(inside)
        beyond = (nodes - inside)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        xy = self.position(inside) + beyond
        lower, upper = self._curvature_hull(fine, bins)
        return PathTable(
            -before_m,
            total / bins,
            tuple(xy[:, 0].tolist()),
            tuple(xy[:, 1].tolist()),
            tuple(heading.tolist()),
            tuple(lower.tolist()),
            tuple(upper.tolist()),
        )

    def _curvature_hull(self, fine: Array, bins: int) -> tuple[Array, Array]:
        curvature = self.curvature(np.clip(fine, 0.0, self.length_m))
        within = np.arange(bins)[:, None] * _SAMPLES_PER_BIN + np.arange(_SAMPLES_PER_BIN + 1)
        samples, stations = curvature[within], fine[within]
        padding = np.abs(np.diff(samples, axis=1)).max(axis=1)
        lower, upper = samples.min(axis=1) - padding, samples.max(axis=1) + padding
        beyond = (stations[:, 0] < 0.0) | (stations[:, -1] > self.length_m)
        lower[beyond] = np.minimum(lower[beyond], 0.0)
        upper[beyond] = np.maximum(upper[beyond], 0.0)
        straight = (stations[:, -1] <= 0.0) | (stations[:, 0] >= self.length_m)
        lower[straight] = upper[straight] = 0.0
        return lower - 1e-9, upper + 1e-9

    def _arc_length(self, low: Array, high: Array) -> Array:
        half = 0.5 * (high - low)
        at = (low + half)[..., None] + half[..., None] * _GAUSS_POINTS
        tangent = self.curve(at, 1)
        return np.asarray(half * (np.hypot(tangent[..., 0], tangent[..., 1]) @ _GAUSS_WEIGHTS))

    def _parameter(self, station_m: ArrayLike) -> Array:
        station = np.asarray(station_m, dtype=float)
        slack = 1e-9 * max(1.0, self.length_m)
        if not ((station >= -slack) & (station <= self.length_m + slack)).all():
            raise InputError(
                f"station_m: expected values in [0, {self.length_m}] (the path's length), "
                f"got {station_m!r}"
            )
        station = np.clip(station, 0.0, self.length_m)
        panel = np.clip(
            np.searchsorted(self._stations, station, side="right") - 1, 0, len(self._knots) - 2
        )
        start = self._knots[panel]
        guess = np.interp(station, self._stations, self._knots)
        for _ in range(4):
            error = self._stations[panel] + self._arc_length(start, guess) - station
            tangent = self.curve(guess, 1)
            guess = guess - error / np.hypot(tangent[..., 0], tangent[..., 1])
        return np.asarray(np.clip(guess, self._knots[0], self._knots[-1]))
