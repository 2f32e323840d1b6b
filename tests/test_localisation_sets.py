"""Nested sets: monotone in the level whatever the estimate, as wide as stated, or refused."""

from __future__ import annotations

import functools
import itertools
import math
from array import array

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localisation_cases import USUAL, WHEELBASE_M, fed, hall, localiser
from scipy import stats

from workbench.errors import InputError
from workbench.estimation.localisation import Localisation
from workbench.estimation.localisation_sets import (
    LEVELS,
    EllipsoidHull,
    InitialSet,
    UnionBound,
    initial_sets,
    localised,
)
from workbench.estimation.localisation_world import Leg, generated_drive
from workbench.runtime.onboard.readings import localised_pose
from workbench.runtime.protocols.codec import Refusal
from workbench.runtime.protocols.localisation import localisation_frames

SIDES = ("x", "y", "heading", "speed", "steering")
shapes = st.sampled_from([EllipsoidHull(), UnionBound()])


@functools.cache
def known() -> Localisation:
    legs = (Leg(6.0, 0.0, 0.0), Leg(14.0, 2.0, 0.1))
    drive = generated_drive(hall(), legs, USUAL, cars=1, wheelbase_m=WHEELBASE_M, seed=31)
    return fed(drive, 0, 14.0)


def sets_of(
    found: Localisation, levels: tuple[float, ...], shape: EllipsoidHull | UnionBound
) -> tuple[InitialSet, ...]:
    sets = initial_sets(localiser(), found, now_s=found.stamp_s + 0.1, levels=levels, shape=shape)
    assert isinstance(sets, tuple)
    return sets


@settings(max_examples=50, deadline=None)
@given(
    levels=st.lists(st.floats(0.01, 1 - 1e-9), min_size=2, max_size=6, unique=True),
    mean=st.lists(st.floats(-1e4, 1e4), min_size=7, max_size=7),
    deviations=st.lists(st.floats(0.0, 0.049), min_size=7, max_size=7),
    shape=shapes,
)  # fmt: skip
def test_larger_confidence_never_has_a_smaller_side(
    levels: list[float], mean: list[float], deviations: list[float],
    shape: EllipsoidHull | UnionBound,
) -> None:  # fmt: skip
    car = known().cars[0].continued(hall(), localiser().steps)
    car.mean[:], car.covariance[:] = array("d", mean), np.diag(np.square(deviations)).ravel()
    sets = sets_of(Localisation((car,)), tuple(sorted(levels)), shape)
    for small, large in itertools.pairwise(sets):
        assert large.contains(small)
    assert all(
        getattr(s, name)[0] < mean[k] < getattr(s, name)[1]
        for s in sets for k, name in enumerate(SIDES)
    )  # fmt: skip


@settings(deadline=None)
@given(level=st.floats(0.5, 0.9999), count=st.integers(1, 7))
def test_gaussian_states_are_in_the_box_at_least_as_often_as_stated(
    level: float, count: int
) -> None:
    """Of independent states the probability is known; dependence only adds to it (Sidak, 1967)."""
    for shape in (EllipsoidHull(), UnionBound()):
        each = 2 * stats.norm.cdf(shape.deviations(level, count)) - 1
        assert each**count >= level - 1e-9
    assert UnionBound().deviations(level, count) <= EllipsoidHull().deviations(level, count) + 1e-9


def test_sides_are_the_stated_deviations_wide_and_know_their_age() -> None:
    found, (small, middle, large) = known(), sets_of(known(), LEVELS, UnionBound())
    for each, wide in ((small, 2.326), (middle, 3.090), (large, 3.719)):
        for k, name in enumerate(SIDES):
            low, high = getattr(each, name)
            deviation = math.sqrt(found.belief.covariance[0, k, k])
            assert 0.5 * (high - low) == pytest.approx(wide * deviation, rel=1e-3)
        assert each.stamp_s == found.stamp_s
        assert each.age_s == pytest.approx(0.1)
    assert 0.5 * (middle.x[1] - middle.x[0]) < 0.2, "what the vehicle's controller may be run with"


def test_what_the_bus_carries_holds_the_set() -> None:
    for each in sets_of(known(), LEVELS, EllipsoidHull()):
        sent = localised(each, number=3)
        assert not isinstance(localisation_frames(sent), Refusal)
        pose = localised_pose(sent)
        for name in ("x", "y", "heading"):
            low, high = getattr(each, name)
            assert getattr(pose, name)[0] <= low <= high <= getattr(pose, name)[1]


@pytest.mark.parametrize(
    "levels", [(), (0.9, 0.9), (0.99, 0.9), (0.0, 0.5), (0.9, 1.0), (math.nan,)]
)
def test_levels_that_do_not_rise_are_refused(levels: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="levels"):
        sets_of(known(), levels, UnionBound())


def test_an_instant_before_the_stamp_is_refused() -> None:
    with pytest.raises(InputError, match="now_s"):
        initial_sets(
            localiser(), known(), now_s=known().stamp_s - 0.1, levels=LEVELS, shape=UnionBound()
        )
