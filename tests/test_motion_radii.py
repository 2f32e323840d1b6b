"""Radii hold the share they state of people like those of the fit, grow with time and level, and
pass to the decision as tubes that lose no intent silently."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_cases import NUMBERS

from workbench.errors import InputError
from workbench.estimation.field_paths import Others
from workbench.estimation.motion_filter import Estimate
from workbench.estimation.motion_parameters import MotionParameters, shipped_motion
from workbench.estimation.person_intents import EveryIntent, Intent, MostLikelyIntent
from workbench.estimation.potential_field import Field, Repulsion
from workbench.estimation.prediction import PreferredVelocity
from workbench.estimation.prediction_scores import radii_m
from workbench.estimation.quantile_radii import QuantileRadii, fit_radii
from workbench.runtime.person_tubes import TrackedPerson, fault_in_person

RADII = QuantileRadii((0.9, 0.99), (0.5, 1.0, 3.0), ((0.3, 0.6, 2.0), (0.5, 1.0, 3.5)))
_LAW = Repulsion(0.0, 0.5)
PARAMETERS = MotionParameters(NUMBERS, Field(3.0, 2.0, _LAW, _LAW), RADII, RADII, "made up")
WALKING = Estimate(10.0, np.array([[0.0, 0.0], [1.3, 0.0], [0.0, 0.0]]), np.eye(3))
INTENTS = (Intent(0.5, (10.0, 0.0)), Intent(0.4, (6.0, 8.0)), Intent(0.1, None))


def _sample(rng, people):
    """Errors that grow with time, and with the speed above walking pace."""
    leads, speeds = rng.uniform(0.3, 3.2, people), rng.uniform(0.0, 5.0, people)
    errors = leads * np.maximum(1.0, speeds / 1.2) * np.abs(rng.standard_t(4, people))
    return leads, errors, speeds


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000))
def test_radii_hold_their_share_of_further_people(seed):
    rng = np.random.default_rng(seed)
    radii = fit_radii(
        *_sample(rng, 20_000), levels=(0.5, 0.9, 0.99), knots_s=np.arange(0.5, 3.1, 0.5), least=50
    )
    leads, errors, speeds = _sample(rng, 20_000)
    inside = leads >= 0.5
    for level, found in radii_m(radii, leads[:, None], speeds).items():
        assert np.mean(errors[inside] <= found[inside, 0]) == pytest.approx(level, abs=0.02)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.integers(400, 3000))
def test_fitted_radii_fall_neither_with_time_nor_with_level_nor_with_speed(seed, people):
    rng = np.random.default_rng(seed)
    errors = rng.exponential(size=people)  # no growth with time at all
    leads, speeds = rng.uniform(0.0, 3.0, people), rng.uniform(0.0, 5.0, people)
    radii = fit_radii(leads, errors, speeds, levels=(0.5, 0.9), knots_s=(0.5, 1, 2, 3), least=20)
    for level in (0.5, 0.9):
        row = [radii.radius_m(level, lead, 1.0) for lead in np.linspace(0.0, 8.0, 60)]
        assert (np.diff(row) >= 0.0).all()
    both = [[radii.radius_m(q, lead, 1.0) for lead in (0.2, 1.4, 9.0)] for q in (0.5, 0.9)]
    assert (np.diff(both, axis=0) >= 0.0).all()
    fast = [radii.radius_m(0.9, 2.0, speed) for speed in (0.0, 1.2, 2.4, 6.0)]
    assert fast[0] == fast[1]
    assert fast[2] == pytest.approx(2.0 * fast[1])


def test_the_quantile_is_the_conformal_one():
    errors = np.arange(1.0, 100.0)
    radii = fit_radii(
        np.concatenate([np.full(99, 1.0), np.full(99, 2.0)]), np.tile(errors, 2), np.zeros(198),
        levels=(0.9, 0.99), knots_s=(1.0, 2.0), least=10,
    )  # fmt: skip
    assert radii.radii_m == ((90.0, 90.0), (99.0, 99.0))


def test_arrays_and_single_radii_agree():
    leads = np.array([[0.1, 0.5, 0.8, 3.0, 6.0]])
    for level, found in radii_m(RADII, leads, np.array([2.0])).items():
        alone = [RADII.radius_m(level, lead, 2.0) for lead in leads[0]]
        np.testing.assert_allclose(found[0], alone)


def test_radii_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="one of the fitted levels"):
        RADII.radius_m(0.95, 1.0, 1.0)
    with pytest.raises(InputError, match="fall neither"):
        QuantileRadii((0.9, 0.99), (1.0, 2.0), ((0.5, 0.6), (0.4, 0.9)))
    with pytest.raises(InputError, match="at least 500 errors"):
        fit_radii(np.ones(99), np.ones(99), np.ones(99), levels=(0.9,), knots_s=(1, 2), least=500)


def test_every_intent_above_the_threshold_is_forwarded_and_the_rest_is_counted():
    forwarded = EveryIntent(PARAMETERS, 0.3, 0.99, 5.0).forward(
        WALKING, 10.2, INTENTS, Others.none()
    )
    assert [each.intent for each in forwarded.waypoints] == list(INTENTS[:2])
    assert forwarded.left_out == pytest.approx(0.1)
    for each in forwarded.waypoints:
        assert each.times_s[[0, -1]].tolist() == [0.0, 5.0]
        speed = PreferredVelocity(NUMBERS).speed_mps(WALKING, 10.2)
        expected = [RADII.radius_m(0.99, 0.2 + t, speed) for t in each.times_s]
        np.testing.assert_allclose(each.radii_m, expected, rtol=1e-12)
    assert forwarded.waypoints[1].places_m[-1][1] > forwarded.waypoints[0].places_m[-1][1] + 1.0
    tubes = tuple(each.tube(body_m=0.3) for each in forwarded.waypoints)
    assert fault_in_person(TrackedPerson("p", tubes)) is None
    assert tubes[0].until_s == 5.0


def test_the_last_place_is_the_goal_once_it_is_reached():
    near = (Intent(1.0, (2.0, 0.0)),)
    [way] = EveryIntent(PARAMETERS, 0.3, 0.9, 8.0).forward(
        WALKING, 10.0, near, Others.none()
    ).waypoints  # fmt: skip
    there = np.all(way.places_m == [2.0, 0.0], axis=1)
    first = int(np.argmax(there))
    assert there[first:].all()
    assert 2.0 / 1.3 < way.times_s[first] < 4.0
    assert np.hypot(*(way.places_m[first - 1] - [2.0, 0.0])) < 0.4


def test_with_no_intent_above_the_threshold_the_person_is_still_predicted():
    forwarded = EveryIntent(PARAMETERS, 0.6, 0.9, 3.0).forward(
        WALKING, 10.0, INTENTS, Others.none()
    )
    [way] = forwarded.waypoints
    assert way.intent.goal_m is None
    assert forwarded.left_out == pytest.approx(1.0)
    straight = PreferredVelocity(NUMBERS).forecast(WALKING, 10.0, way.times_s)
    assert np.array_equal(way.places_m, straight)


def test_the_papers_choice_is_the_likeliest_intent_with_one_radius():
    forwarded = MostLikelyIntent(PARAMETERS, 0.5, 5.0).forward(
        WALKING, 10.0, INTENTS, Others.none()
    )
    [way] = forwarded.waypoints
    assert way.intent == INTENTS[0]
    assert set(way.radii_m) == {0.5}
    assert forwarded.left_out == pytest.approx(0.5)


def test_intents_and_times_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="sum to 1"):
        MostLikelyIntent(PARAMETERS, 0.5, 5.0).forward(WALKING, 10.0, INTENTS[:2], Others.none())
    with pytest.raises(InputError, match="16 pieces"):
        EveryIntent(PARAMETERS, 0.3, 0.9, 9.0)
    with pytest.raises(InputError, match="threshold"):
        EveryIntent(PARAMETERS, 0.0, 0.9, 5.0)


def test_shipped_radii_grow_with_time_and_level():
    shipped = shipped_motion()
    for radii in (shipped.free, shipped.toward_goal):
        assert radii.levels == (0.5, 0.9, 0.99)
        assert radii.radius_m(0.9, 1.0, 1.3) < radii.radius_m(0.9, 5.0, 1.3)
        assert radii.radius_m(0.9, 3.0, 1.3) < radii.radius_m(0.99, 3.0, 1.3)
