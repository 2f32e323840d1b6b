"""Commissioning finds heading, zero, scale and wheelbase, with standard errors that hold."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
import pytest
from localisation_cases import USUAL, WHEELBASE_M, hall

from workbench.errors import InputError
from workbench.estimation.commissioning import ESTIMATED, Commissioned, DriveLog, commission
from workbench.estimation.lanes import Array
from workbench.estimation.localisation_scores import chi_square_band
from workbench.estimation.localisation_world import Drive, Faults, Leg, generated_drive

PROCEDURE = (Leg(8.0, 2.0, 0.0), Leg(18.0, 2.0, 0.25), Leg(28.0, 2.0, -0.25))
DRIVES, MANY = 5, 60


def log_of(drive: Drive, car: int) -> DriveLog:
    at, beacon = np.nonzero(np.isfinite(drive.ranges_m[:, car]))
    return DriveLog(
        drive.times_s, drive.speed_mps[:, car], drive.steering_rad[:, car], drive.times_s[at],
        beacon.astype(np.int64), drive.ranges_m[at, car, beacon],
    )  # fmt: skip


def truth_of(drive: Drive, car: int) -> Array:
    zero, scale = drive.truth[:, car, 6].mean(), drive.truth[:, car, 5].mean()
    return np.array([*drive.truth[0, car, :3], zero, scale, WHEELBASE_M])


@functools.cache
def drive(cars: int) -> Drive:
    return driven(USUAL, PROCEDURE, cars)


def driven(faults: Faults, legs: tuple[Leg, ...], cars: int = 1) -> Drive:
    return generated_drive(hall(), legs, faults, cars=cars, wheelbase_m=WHEELBASE_M, seed=51)


@functools.cache
def found(car: int, cars: int = DRIVES) -> Commissioned:
    log = log_of(drive(cars), car)
    return commission(hall(), log, wheelbase_m=1.76, wheelbase_error_m=0.02)


def nees(cars: int) -> tuple[Array, float]:
    each, joint = [], []
    for car in range(cars):
        one = found(car, cars)
        error = one.estimate - truth_of(drive(cars), car)
        error[2] = math.remainder(error[2], math.tau)
        each.append(error**2 / one.covariance.diagonal())
        joint.append(error @ np.linalg.solve(one.covariance, error))
    # The wheelbase is given with an error that is not drawn: only the others are tested each.
    return np.mean(each, axis=0)[:5], float(np.mean(joint)) / len(ESTIMATED)


def check(cars: int) -> None:
    each, joint = nees(cars)
    share = 1.0 - 0.01 / 6
    low, high = chi_square_band(cars, 1, share)
    assert ((low <= each) & (each <= high)).all(), each
    low, high = chi_square_band(cars, len(ESTIMATED), share)
    assert low <= joint <= high


def test_standard_errors_hold_and_are_small() -> None:
    check(DRIVES)
    for car in range(DRIVES):
        assert found(car).deviation("heading") < 0.02
        assert found(car).deviation("steering_zero") < 0.002
        assert found(car).deviation("speed_scale") < 0.003
        assert found(car).deviation("wheelbase") < 0.015
        assert 0.7 < found(car).residual < 1.2
        assert sum(found(car).strays) > 0


@pytest.mark.campaign
def test_standard_errors_hold_over_many_drives() -> None:
    check(MANY)


def test_a_straight_drive_says_that_it_tells_nothing_of_the_wheelbase() -> None:
    straight = driven(USUAL, (Leg(10.0, 2.0, 0.0),))
    only = commission(hall(), log_of(straight, 0), wheelbase_m=1.75, wheelbase_error_m=0.02)
    assert only.deviation("wheelbase") > 0.015
    assert only.deviation("steering_zero") > found(0).deviation("steering_zero")


def test_biased_beacons_show_in_the_residual() -> None:
    biased = driven(dataclasses.replace(USUAL, bias_m=0.2), PROCEDURE)
    seen = commission(hall(), log_of(biased, 0), wheelbase_m=1.75, wheelbase_error_m=0.02)
    assert seen.residual > 1.2


def test_reports_are_corrected_and_the_site_knows_how_well() -> None:
    speed, steering = found(0).corrected(np.array([2.0]), np.array([0.1]))
    assert speed[0] * (1 + found(0).value("speed_scale")) == pytest.approx(2.0)
    assert steering[0] + found(0).value("steering_zero") == pytest.approx(0.1)
    site = found(0).on(hall(), provenance="a drive")
    assert site.reports.steering_zero_rad == found(0).deviation("steering_zero")
    assert site.reports.speed_scale == found(0).deviation("speed_scale")
    assert site.reports.provenance == "a drive"


def test_logs_that_cannot_be_used_are_refused() -> None:
    log = log_of(drive(DRIVES), 0)
    with pytest.raises(InputError, match="rising instants"):
        dataclasses.replace(log, times_s=log.times_s[::-1])
    with pytest.raises(InputError, match="at least 30 ranges"):
        dataclasses.replace(log, ranges_m=log.ranges_m[:5])
    with pytest.raises(InputError, match="range_times_s"):
        dataclasses.replace(log, range_times_s=log.range_times_s + 5.0)
    with pytest.raises(InputError, match="wheelbase_m"):
        commission(hall(), log, wheelbase_m=0.0, wheelbase_error_m=0.02)
