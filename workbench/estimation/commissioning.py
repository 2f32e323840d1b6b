"""Commissioning: heading, steering zero, speed scale and wheelbase from one drive."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal, final

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from workbench.errors import InputError
from workbench.estimation.accepted_ranges import accepted_error
from workbench.estimation.lanes import Array
from workbench.estimation.localisation_site import Site

ESTIMATED: Final = ("x", "y", "heading", "steering_zero", "speed_scale", "wheelbase")
"""What a drive is fitted by: pose at its first instant, and what hardly changes: averages."""
_ZERO, _SCALE, _WHEELBASE = 3, 4, 5
_HEADINGS: Final = 8
_ROUGH: Final = 12
_FEWEST_RANGES: Final = 30
# Step of the differences, over each parameter's scale.
_STEP: Final = 1e-5
# Wander beside the bicycle is fitted too, constant over each such time.
_WANDER_S: Final = 2.0
# How far a residual counts in full, in deviations, before stray ranges are set aside.
_HUBER: Final = 2.0


@final
@dataclass(frozen=True, slots=True)
class DriveLog:
    """Reports of one drive at rising instants (k), and ranges (r) with their instants and beacons
    (numbers in the site's list)."""

    times_s: Array
    speed_mps: Array
    steering_rad: Array
    range_times_s: Array
    beacons: NDArray[np.int64]
    ranges_m: Array

    def __post_init__(self) -> None:
        if len(self.times_s) < 2 or not (np.diff(self.times_s) > 0.0).all():
            raise InputError("times_s: expected at least two rising instants; sort the log")
        if len(self.ranges_m) < _FEWEST_RANGES:
            raise InputError(
                f"ranges_m: expected at least {_FEWEST_RANGES} ranges, got {len(self.ranges_m)}; "
                "drive longer within reach of the beacons"
            )
        inside = (self.range_times_s >= self.times_s[0]) & (self.range_times_s <= self.times_s[-1])
        if not inside.all():
            raise InputError("range_times_s: expected instants between the first and last report")


@final
@dataclass(frozen=True, slots=True)
class Commissioned:
    """Estimates and covariance over `ESTIMATED`; residual: root mean square of accepted ranges'
    residuals over their deviation, about 1 if the site's figures hold; strays, ranges (b,): how
    many were set aside, and how many there were, per beacon."""

    estimate: Array
    covariance: Array
    residual: float
    strays: tuple[int, ...]
    ranges: tuple[int, ...]

    def deviation(self, name: str) -> float:
        """Standard error of one estimate."""
        k = ESTIMATED.index(name)
        return math.sqrt(self.covariance[k, k])

    def value(self, name: str) -> float:
        """One estimate."""
        return float(self.estimate[ESTIMATED.index(name)])

    def on(self, site: Site, *, provenance: str) -> Site:
        """The site for reports corrected by `corrected`: their zero and scale are known so well."""
        reports = dataclasses.replace(
            site.reports, speed_scale=self.deviation("speed_scale"),
            steering_zero_rad=self.deviation("steering_zero"), provenance=provenance,
        )  # fmt: skip
        return dataclasses.replace(site, reports=reports)

    def corrected(self, speed_mps: Array, steering_rad: Array) -> tuple[Array, Array]:
        """Reports without the scale and the zero."""
        scale = 1.0 + self.value("speed_scale")
        return speed_mps / scale, steering_rad - self.value("steering_zero")


def commission(site: Site, log: DriveLog, *, wheelbase_m: float, wheelbase_error_m: float
               ) -> Commissioned:  # fmt: skip
    """Fit one drive: a straight part of some 10 m, then curves to both sides.

    heading' = v tan(steering) / L, x' = v cos(heading), y' = v sin(heading), with v = reported /
    (1 + scale), steering = reported - zero. Minimised: the sum of squares of all ranges' residuals
    over their deviation, of each stretch's wander in heading and place over what `site.motion` lets
    them wander in it, and of (L - wheelbase_m) over wheelbase_error_m. The wander is fitted along,
    else the standard errors, from the inverse of J'J, would come out too small. First with a Huber
    loss from every heading; then ranges beyond the gate are set aside, and the rest count in full.

    A straight drive tells zero from the bend of the way, a curve scale and wheelbase apart; what
    the drive does not tell shows as a large standard error. Rigor: SAMPLED; linearised about the
    fit, Gaussian. Raises InputError on a wheelbase or error that is not > 0. Fails, by a `residual`
    far from 1, where the site's figures do not hold.
    """
    for name, value in (("wheelbase_m", wheelbase_m), ("wheelbase_error_m", wheelbase_error_m)):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: expected a number > 0, got {value!r}")
    fit = fit_of(site, log, (wheelbase_m, wheelbase_error_m))
    every = np.ones(len(log.ranges_m), dtype=bool)
    rough = min((_solved(fit, start, every, loss="huber", stiff=True) for start in starts(fit)),
                key=lambda found: float(found.cost))  # fmt: skip
    best = _solved(fit, rough.x, every, loss="huber").x
    gate = math.sqrt(float(stats.chi2.ppf(site.ranges.accepted, 1)))
    kept = np.abs(fit.residuals(best[None])[0, : len(every)]) <= gate
    found = _solved(fit, best, kept, loss="linear")
    count = len(ESTIMATED)
    covariance = np.linalg.inv(found.jac.T @ found.jac)[:count, :count]
    ranges = fit.residuals(found.x[None])[0, : len(every)][kept]
    return Commissioned(
        found.x[:count], covariance, float(np.sqrt(np.mean(ranges**2))),
        _by_beacon(site, log.beacons[~kept]), _by_beacon(site, log.beacons),
    )  # fmt: skip


def _by_beacon(site: Site, beacons: NDArray[np.int64]) -> tuple[int, ...]:
    return tuple(map(int, np.bincount(beacons, minlength=len(site.beacons))))


def _solved(
    fit: Fit,
    start: Array,
    kept: NDArray[np.bool_],
    *,
    loss: Literal["linear", "huber"],
    stiff: bool = False,
) -> Any:
    """Least squares over the ranges kept; stiff: a bicycle that does not wander, few iterations."""
    count = len(ESTIMATED) if stiff else len(start)
    rows = np.append(kept, np.ones(len(start) - len(ESTIMATED) + 1, dtype=bool))

    def whole(part: Array) -> Array:
        return np.append(part, start[count:])

    def residuals(part: Array) -> Array:
        return np.asarray(fit.residuals(whole(part)[None])[0][rows])

    def jacobian(part: Array) -> Array:
        return np.asarray(fit.jacobian(whole(part), count)[rows])

    found = optimize.least_squares(
        residuals, start[:count], jac=jacobian, loss=loss, f_scale=_HUBER,
        x_scale=fit.scales[:count], max_nfev=_ROUGH if stiff else None,
    )  # fmt: skip
    found.x = whole(found.x)
    return found


def starts(fit: Fit) -> Iterator[Array]:
    """The middle of the beacons, and every direction."""
    middle = fit.places[:, :2].mean(axis=0)
    for k in range(_HEADINGS):
        start = np.zeros(len(fit.scales))
        start[:2], start[2], start[_WHEELBASE] = middle, math.tau * k / _HEADINGS, fit.wheelbase[0]
        yield start


@final
@dataclass(frozen=True, slots=True)
class Fit:
    """Residuals of one drive as a function of what it is fitted by.

    Parameters: `ESTIMATED`, then three of each stretch: wander of heading, forward and lateral, in
    their deviations `wander` (3, s). share (k - 1, s): how much of a stretch's wander an interval
    has. places (r, 3): the beacon of each range. range_error: see `accepted_error`.
    """

    log: DriveLog
    site: Site
    wheelbase: tuple[float, float]
    wander: Array
    share: Array
    places: Array
    scales: Array
    range_error: tuple[float, float]

    def residuals(self, parameters: Array) -> Array:
        """Of m sets of parameters (m, p): ranges, wander, wheelbase; each over its deviation."""
        log, antenna, m = self.log, self.site.antenna, len(parameters)
        x, y, heading = self._driven(parameters)
        cosine, sine = np.cos(heading), np.sin(heading)
        away = np.stack([
            x + cosine * antenna.forward_m - sine * antenna.left_m - self.places[:, 0],
            y + sine * antenna.forward_m + cosine * antenna.left_m - self.places[:, 1],
            np.broadcast_to(antenna.height_m - self.places[:, 2], x.shape),
        ])  # fmt: skip
        error_m, deviation_m = self.range_error
        ranges = (log.ranges_m - error_m - np.sqrt((away**2).sum(axis=0))) / deviation_m
        middle, error = self.wheelbase
        length = (parameters[:, _WHEELBASE, None] - middle) / error
        return np.concatenate([ranges, parameters[:, len(ESTIMATED) :].reshape(m, -1), length], 1)

    def jacobian(self, parameters: Array, count: int) -> Array:
        """With respect to the first `count` parameters, by central differences (r, count)."""
        steps = np.diag(_STEP * self.scales)[:count]
        ends = self.residuals(np.concatenate([parameters + steps, parameters - steps]))
        return ((ends[:count] - ends[count:]) / (2.0 * _STEP * self.scales[:count, None])).T

    def _driven(self, parameters: Array) -> tuple[Array, Array, Array]:
        """Pose at the instants of the ranges, (m, r) each."""
        log, count = self.log, len(ESTIMATED)
        spans = np.diff(log.times_s)
        speed = 0.5 * (log.speed_mps[1:] + log.speed_mps[:-1]) / (1 + parameters[:, _SCALE, None])
        steering = 0.5 * (log.steering_rad[1:] + log.steering_rad[:-1]) - parameters[:, _ZERO, None]
        own = (parameters[:, count:].reshape(len(parameters), 3, -1) * self.wander) @ self.share.T
        turn = speed * np.tan(steering) / parameters[:, _WHEELBASE, None] * spans + own[:, 0]
        heading = _summed(parameters[:, 2], turn)
        middle = heading[:, :-1] + 0.5 * turn
        along, across = speed * spans + own[:, 1], own[:, 2]
        x = _summed(parameters[:, 0], along * np.cos(middle) - across * np.sin(middle))
        y = _summed(parameters[:, 1], along * np.sin(middle) + across * np.cos(middle))
        k = np.clip(np.searchsorted(log.times_s, log.range_times_s) - 1, 0, len(spans) - 1)
        part = (log.range_times_s - log.times_s[k]) / spans[k]
        return tuple(q[:, k] + part * (q[:, k + 1] - q[:, k]) for q in (x, y, heading))  # type: ignore[return-value]


def _summed(first: Array, steps: Array) -> Array:
    return np.concatenate([first[:, None], first[:, None] + np.cumsum(steps, axis=1)], axis=1)


def fit_of(site: Site, log: DriveLog, wheelbase: tuple[float, float]) -> Fit:
    """Cut the drive into stretches and state how far each may wander."""
    spans, motion, reports = np.diff(log.times_s), site.motion, site.reports
    stretch = ((log.times_s[:-1] - log.times_s[0]) / _WANDER_S).astype(int)
    _, stretch = np.unique(stretch, return_inverse=True)
    belongs = np.equal.outer(stretch, np.arange(stretch.max() + 1)).astype(float)
    speed = np.abs(0.5 * (log.speed_mps[1:] + log.speed_mps[:-1]))
    # What single reports are wrong by is wander as well: it is independent of report to report.
    turned = (speed / wheelbase[0] * reports.steering_rad * spans) ** 2
    moved = (reports.speed_mps * spans) ** 2
    variances = np.stack([
        motion.heading_slip**2 * speed * spans + turned,
        motion.forward_slip**2 * speed * spans + moved,
        motion.lateral_slip**2 * speed * spans,
    ])  # fmt: skip
    totals = variances @ belongs
    # Within a stretch the wander is spread evenly.
    share = belongs * (spans / (belongs @ (belongs.T @ spans)))[:, None]
    places = np.array([[b.x_m, b.y_m, b.height_m] for b in site.beacons])
    scales = np.concatenate(
        [[1.0, 1.0, 0.1, 0.01, 0.01, wheelbase[1]], np.ones(3 * belongs.shape[1])]
    )
    return Fit(
        log, site, wheelbase, np.sqrt(totals), share, places[log.beacons], scales,
        accepted_error(site.ranges),
    )  # fmt: skip
