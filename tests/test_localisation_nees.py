"""Estimates are as good as they say, at start, in motion, standing and after stops; faults show.

Bands are chi-square's for the number of cars, split over the table's entries; nothing is tuned.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping

import casadi as ca
import numpy as np
import pytest
from localisation_cases import (
    USUAL,
    WHEELBASE_M,
    changed,
    compiled,
    compiled_functions,
    hall,
    localiser,
)
from scipy import stats

from workbench.estimation import localisation_filter
from workbench.estimation.lanes import Array
from workbench.estimation.localisation import Localiser
from workbench.estimation.localisation_filter import filter_functions
from workbench.estimation.localisation_scores import (
    NeesRow,
    Run,
    alignment_instants,
    chi_square_band,
    coverage_at,
    error_summary,
    estimated,
    nees_table,
)
from workbench.estimation.localisation_sets import LEVELS, EllipsoidHull, UnionBound
from workbench.estimation.localisation_site import Site
from workbench.estimation.localisation_world import Faults, Leg, figure_eight, generated_drive

CARS, CERTAINTY = 120, 0.99
FEW = 60
FAULTY_DRIVE = (*figure_eight()[:2], Leg(16.0, 2.5, 0.22))


@functools.cache
def usual_run() -> Run:
    drive = generated_drive(
        hall(), figure_eight(), USUAL, cars=CARS, wheelbase_m=WHEELBASE_M, seed=11
    )
    return estimated(localiser(), drive)


def moments(run: Run) -> Mapping[str, Array]:
    start = alignment_instants(run)
    at = {"start": start, "start + 1 s": start + 1.0, "start + 3 s": start + 3.0}
    for name, time in (("driving, 14 s", 14.0), ("curve, 18 s", 18.0), ("standing, 23 s", 23.0),
                       ("standing, 30.9 s", 30.9), ("off again, 31.5 s", 31.5),
                       ("driving, 34 s", 34.0), ("end, 43 s", 43.0)):  # fmt: skip
        at[name] = np.full(run.errors.shape[1], time)
    return at


def faulty_table(
    faults: Faults, *, site: Site | None = None, mine: Localiser | None = None
) -> tuple[NeesRow, ...]:
    """A short drive of cars in a world that the filter does not expect."""
    drive = generated_drive(
        site or hall(), FAULTY_DRIVE, faults, cars=FEW, wheelbase_m=WHEELBASE_M, seed=12
    )
    run = estimated(mine or localiser(), drive)
    at = {f"{time} s": np.full(FEW, time) for time in (12.0, 14.0, 16.0)}
    return nees_table(run, at, certainty=CERTAINTY)


def test_nees_is_in_its_band_for_every_state_and_jointly() -> None:
    run = usual_run()
    assert run.aligned[-1].all()
    found = {row.moment: row.outside for row in nees_table(run, moments(run), certainty=CERTAINTY)}
    assert not any(found.values()), found


def test_coming_to_rest_the_estimate_is_no_better_than_it_says_only_by_its_speed() -> None:
    """Until the reports have told a standstill the filter allows for accelerations that are over:
    its speed is then surer than it says, never less sure."""
    run = usual_run()
    (row,) = nees_table(run, {"rest": np.full(CARS, 21.7)}, certainty=CERTAINTY)
    assert set(row.outside) <= {"speed"}, row.values
    assert row.values["speed"] <= row.bands["speed"][1]


def test_place_is_within_20_cm_with_drops_and_strays() -> None:
    found = error_summary(usual_run(), (50.0, 95.0, 99.0))
    assert found.place_m[99.0] < 0.2
    assert found.within_20_cm > 0.999


def test_joint_sets_hold_their_share() -> None:
    run = usual_run()
    for time in (9.0, 15.0, 25.0, 35.0, 43.0):
        for shape in (EllipsoidHull(), UnionBound()):
            for level, share in coverage_at(run, time, shape, LEVELS).items():
                held = round(share * CARS)
                assert stats.binom.cdf(held, CARS, level) > 1e-4, (time, shape, level, share)


@pytest.mark.parametrize(
    "faults",
    [
        dataclasses.replace(USUAL, noise_factor=1.5),
        dataclasses.replace(USUAL, noise_factor=0.5),
        dataclasses.replace(USUAL, bias_m=0.15),
        dataclasses.replace(USUAL, stray=0.4),
    ],
    ids=["more noise", "less noise", "biased beacons", "more strays"],
)  # fmt: skip
def test_a_world_with_other_errors_is_noticed(faults: Faults) -> None:
    assert any(row.outside for row in faulty_table(faults))


def test_a_world_that_slips_more_is_noticed() -> None:
    world = changed(hall(), "motion", heading_slip=3 * hall().motion.heading_slip)
    assert any("heading" in row.outside for row in faulty_table(USUAL, site=world))


def test_a_world_with_another_zero_of_the_steering_is_noticed() -> None:
    world = changed(hall(), "reports", steering_zero_rad=4 * hall().reports.steering_zero_rad)
    assert any("steering_zero" in row.outside for row in faulty_table(USUAL, site=world))


def test_a_jacobian_with_a_wrong_sign_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right = localisation_filter._gradient

    def wrong(expected: ca.SX, mean: ca.SX) -> ca.SX:
        row = right(expected, mean)
        row[2] = -row[2]
        return row

    monkeypatch.setattr(localisation_filter, "_gradient", wrong)
    faulty = filter_functions(hall(), wheelbase_m=WHEELBASE_M).range_update
    functions = dataclasses.replace(compiled_functions(), range_update=compiled(faulty)[0])
    made = Localiser.of(hall(), functions)
    assert any(row.outside for row in faulty_table(USUAL, mine=made))


def test_band_is_that_of_drawn_numbers() -> None:
    rng = np.random.default_rng(13)
    low, high = chi_square_band(50, 5, 0.98)
    drawn = (rng.normal(0, 1, (20_000, 250)) ** 2).mean(axis=1)
    assert stats.binom.cdf(int((drawn < low).sum()), 20_000, 0.01) == pytest.approx(0.5, abs=0.499)
    assert stats.binom.cdf(int((drawn > high).sum()), 20_000, 0.01) == pytest.approx(0.5, abs=0.499)
