"""How good a localisation is: NEES beside its chi-square band, errors, and coverage of the sets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy import stats

from workbench.estimation.lanes import Array
from workbench.estimation.localisation import Car, Flags, Localiser
from workbench.estimation.localisation_sets import Shape
from workbench.estimation.localisation_states import STATES, VEHICLE_STATES
from workbench.estimation.localisation_world import Drive

ENTRIES: Final = (*STATES, "joint")
"""Columns of a NEES table; joint: over the vehicle's five states."""
_HEADING: Final = STATES.index("heading")


@final
@dataclass(frozen=True, slots=True)
class Run:
    """Estimates at the K instants of a drive: errors (K, n, 7; headings to the nearest turn),
    covariances (K, n, 7, 7), and of whom heading and place were known (K, n)."""

    times_s: Array
    errors: Array
    covariances: Array
    aligned: Flags


@final
@dataclass(frozen=True, slots=True)
class NeesRow:
    """Mean NEES of n cars at one moment, divided by its degrees of freedom, per `ENTRIES`."""

    moment: str
    values: Mapping[str, float]
    bands: Mapping[str, tuple[float, float]]

    @property
    def outside(self) -> tuple[str, ...]:
        """The entries outside their bands."""
        return tuple(
            name for name, value in self.values.items()
            if not self.bands[name][0] <= value <= self.bands[name][1]
        )  # fmt: skip


def estimated(localiser: Localiser, drive: Drive) -> Run:
    """Feed a drive to the filter, message by message, and note what it said after each report."""
    # A beacon whose range reached somebody was due for everybody.
    due = (np.isfinite(drive.ranges_m).sum(axis=1) > 0).tolist()
    beacons = {k: [b for b, sent in enumerate(row) if sent] for k, row in enumerate(due)}
    asked = {k: sent for k, sent in beacons.items() if sent}
    cars = range(drive.truth.shape[1])
    found = [_estimated_car(localiser, drive, car, asked) for car in cars]
    means, covariances, aligned = (np.stack(part, axis=1) for part in zip(*found, strict=True))
    errors = means - drive.truth
    errors[:, :, _HEADING] -= math.tau * np.round(errors[:, :, _HEADING] / math.tau)
    unknown = np.where(aligned[:, :, None, None], covariances, np.eye(len(STATES)))
    return Run(drive.times_s, errors, unknown, aligned)


def _estimated_car(
    localiser: Localiser, drive: Drive, n: int, asked: Mapping[int, Sequence[int]]
) -> tuple[Array, Array, Flags]:
    """Means (K, 7), covariances (K, 7, 7) and whether they are known (K), of one car.

    asked: by instant, the beacons whose ranges were due.
    """
    times = drive.times_s.tolist()
    reports = zip(
        times, drive.speed_mps[:, n].tolist(), drive.steering_rad[:, n].tolist(),
        drive.commands[:, n].tolist(), strict=True,
    )  # fmt: skip
    ranges = dict(zip(asked, drive.ranges_m[list(asked), n].tolist(), strict=True))
    car, aligned = Car(localiser.site, localiser.steps, at_s=times[0]), []
    means, covariances = bytearray(), bytearray()
    for k, (at_s, speed, steering, (push, turn)) in enumerate(reports):
        car.reported(at_s=at_s, speed_mps=speed, steering_rad=steering, commands=(push, turn))
        for beacon in asked.get(k, ()):
            came = ranges[k][beacon]
            car.ranged(at_s=at_s, beacon=beacon, range_m=came if math.isfinite(came) else None)
        means += car.mean
        covariances += car.covariance
        aligned.append(car.aligned)
    size = len(STATES)
    return (
        np.frombuffer(means).reshape(-1, size),
        np.frombuffer(covariances).reshape(-1, size, size),
        np.array(aligned),
    )


def nees_row(run: Run, moment: str, instants: Array, *, certainty: float) -> NeesRow:
    """Mean of e' P^-1 e over cars, over its degrees of freedom, each car at its own instant (n).

    e: estimate minus truth. If errors are Gaussian with covariance P, and cars independent, n times
    the mean is chi-square with n d degrees of freedom, d = 1 for a state and 5 for all of the
    vehicle; the band leaves (1 - certainty) / 2 on either side. Expects aligned cars. Bar-Shalom,
    Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 5.4.
    """
    cars = np.arange(run.errors.shape[1])
    at = np.clip(np.searchsorted(run.times_s, instants - 1e-9), 0, len(run.times_s) - 1)
    assert run.aligned[at, cars].all(), f"{moment}: expected cars that are aligned"
    error, covariance = run.errors[at, cars], run.covariances[at, cars]
    each = error**2 / np.einsum("nii->ni", covariance)
    part = slice(VEHICLE_STATES)
    solved = np.linalg.solve(covariance[:, part, part], error[:, part, None])[:, :, 0]
    joint = np.einsum("ni,ni->n", error[:, part], solved) / VEHICLE_STATES
    values = dict(zip(STATES, each.mean(axis=0).tolist(), strict=True)) | {
        "joint": float(joint.mean())
    }
    single, whole = (chi_square_band(len(cars), d, certainty) for d in (1, VEHICLE_STATES))
    return NeesRow(moment, values, dict.fromkeys(STATES, single) | {"joint": whole})


def chi_square_band(cars: int, freedom: int, certainty: float) -> tuple[float, float]:
    """Where the mean over cars, over its freedom, of a chi-square number lies so certainly."""
    tail, n = 0.5 * (1.0 - certainty), cars * freedom
    low, high = stats.chi2.ppf(tail, n), stats.chi2.isf(tail, n)
    return float(low) / n, float(high) / n


def nees_table(run: Run, moments: Mapping[str, Array], *, certainty: float) -> tuple[NeesRow, ...]:
    """One row per moment; the whole table is inside its bands with at least this certainty.

    Each entry gets its share of what may fail (union bound).
    """
    each = 1.0 - (1.0 - certainty) / (len(moments) * len(ENTRIES))
    return tuple(nees_row(run, name, at, certainty=each) for name, at in moments.items())


def alignment_instants(run: Run) -> Array:
    """When each car's heading became known (n); the end of the run where it never did."""
    first = np.argmax(run.aligned, axis=0)
    return run.times_s[np.where(run.aligned.any(axis=0), first, len(run.times_s) - 1)]


@final
@dataclass(frozen=True, slots=True)
class ErrorSummary:
    """Of all aligned cars and instants: percentiles of the distance between estimated and true
    place (m), the share within 0.2 m, and of the heading's error (rad)."""

    place_m: Mapping[float, float]
    within_20_cm: float
    heading_rad: Mapping[float, float]


def error_summary(run: Run, percents: Sequence[float]) -> ErrorSummary:
    """Sort the errors of a run; 100 asks for the worst."""
    place = np.hypot(run.errors[:, :, 0], run.errors[:, :, 1])[run.aligned]
    heading = np.abs(run.errors[:, :, _HEADING])[run.aligned]
    return ErrorSummary(
        {p: float(np.percentile(place, p)) for p in percents},
        float(np.mean(place <= 0.2)),
        {p: float(np.percentile(heading, p)) for p in percents},
    )


def coverage_at(
    run: Run, time_s: float, shape: Shape, levels: Sequence[float]
) -> dict[float, float]:
    """Share of aligned cars whose state, at one instant, is in the set of each level, jointly."""
    k = int(np.searchsorted(run.times_s, time_s - 1e-9))
    part, cars = slice(VEHICLE_STATES), run.aligned[k]
    deviations = np.sqrt(np.einsum("nii->ni", run.covariances[k]))
    ratio = (np.abs(run.errors[k]) / deviations)[:, part].max(axis=1)
    return {
        level: float(np.mean(ratio[cars] <= shape.deviations(level, VEHICLE_STATES)))
        for level in levels
    }


def half_widths(
    run: Run, shape: Shape, level: float, percents: Sequence[float]
) -> dict[str, dict[float, float]]:
    """Percentiles of half the sides of a level's set, per state of the vehicle, over all aligned
    cars and instants (m, m, rad, m/s, rad)."""
    wide = shape.deviations(level, VEHICLE_STATES)
    deviations = np.sqrt(np.einsum("knii->kni", run.covariances))[run.aligned]
    return {
        name: {p: wide * float(np.percentile(deviations[:, k], p)) for p in percents}
        for k, name in enumerate(STATES[:VEHICLE_STATES])
    }
