"""The filter is the exact conditional expectation of its model; predictions know nothing later;
constant velocity is exact on straight ways; arrays and single calls agree."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_cases import NUMBERS, crowd, walker

from workbench.errors import InputError
from workbench.estimation.motion_filter import (
    MotionNumbers,
    _wander,
    estimate,
    estimates,
    forecast_step,
)
from workbench.estimation.motion_queries import (
    HORIZONS_S,
    ask,
    constant_velocity,
    known_by_then,
    preferred_velocity,
)
from workbench.estimation.people_data import PersonTrack
from workbench.estimation.prediction import ConstantVelocity, PreferredVelocity

METHODS = (ConstantVelocity(1.0), PreferredVelocity(NUMBERS))


def _velocity_covariance(s, t):
    """Of the true velocity at s and t: the sum of the two processes."""
    return sum(
        deviation**2 * np.exp(-abs(s - t) / constant)
        for deviation, constant in (
            (NUMBERS.preferred_mps, NUMBERS.preferred_s), (NUMBERS.wavering_mps, NUMBERS.wavering_s)
        )
    )  # fmt: skip


def _way_covariance(a, b):
    """Of the ways from time 0 to a and to b, by quadrature of the velocity's covariance."""
    nodes, weights = np.polynomial.legendre.leggauss(40)

    def line(upper, other):
        pieces = sorted({0.0, min(upper, other), upper})
        for low, high in itertools.pairwise(pieces):
            yield from zip(
                0.5 * (high - low) * nodes + 0.5 * (high + low), 0.5 * (high - low) * weights,
                strict=True,
            )  # fmt: skip

    return sum(ws * wt * _velocity_covariance(s, t) for s, ws in line(a, b) for t, wt in line(b, s))


def test_the_filter_is_the_conditional_expectation_by_quadrature():
    t_s = np.array([0.0, 0.4, 0.5, 1.7, 1.9])
    xy_m = np.random.default_rng(3).normal(size=(5, 2)).cumsum(axis=0)
    found = estimate(PersonTrack("r", "p", "ped", t_s, xy_m), NUMBERS)
    # The first place is known to within the measurement's deviation; the ways from it add up.
    noise = NUMBERS.measurement_m**2
    ways = np.array([[_way_covariance(a, b) for b in t_s[1:]] for a in t_s[1:]])
    seen = noise + ways + noise * np.eye(4)
    last = noise + ways[:, -1]
    expected = xy_m[0] + last @ np.linalg.solve(seen, xy_m[1:] - xy_m[0])
    np.testing.assert_allclose(found.mean[0], expected, atol=1e-6)
    left = noise + ways[-1, -1] - last @ np.linalg.solve(seen, last)
    assert found.covariance[0, 0] == pytest.approx(left, rel=1e-6)


def test_the_transition_is_a_semigroup_for_short_times_too():
    for constant in (1.0, 240.0):
        for dt in (1e-3, 0.1, 3.0):
            way, kept, place, both, velocity = (float(x) for x in _wander(dt, 0.7, constant))
            way2, kept2, place2, both2, velocity2 = (
                float(x) for x in _wander(2 * dt, 0.7, constant)
            )
            np.testing.assert_allclose(kept2, kept**2, rtol=1e-12)
            np.testing.assert_allclose(way2, way + kept * way, rtol=1e-12)
            np.testing.assert_allclose(velocity2, kept**2 * velocity + velocity, rtol=1e-9)
            np.testing.assert_allclose(both2, kept * (both + way * velocity) + both, rtol=1e-9)
            np.testing.assert_allclose(
                place2, place + 2 * way * both + way**2 * velocity + place, rtol=1e-4
            )


def test_all_tracks_side_by_side_give_what_each_gives_alone():
    tracks = crowd(4)
    for track, found in zip(tracks, estimates(tracks, NUMBERS), strict=True):
        assert len(found) == len(track.t_s)
        for count in (1, 2, 17, len(track.t_s)):
            alone = estimate(track.until(track.t_s[count - 1]), NUMBERS)
            assert np.array_equal(alone.mean, found[count - 1].mean)
            np.testing.assert_allclose(alone.covariance, found[count - 1].covariance, atol=1e-15)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.3, 8.0), st.sampled_from(METHODS))
def test_later_measurements_leave_every_answer_as_it_was(seed, after_s, method):
    rng = np.random.default_rng(seed)
    track = walker(rng, "r", "p")
    at_s = track.t_s[0] + after_s
    # `until` takes what is no more than rounding later.
    later = track.t_s > at_s + 1e-9
    altered = track.xy_m + np.where(later[:, None], rng.normal(size=track.xy_m.shape), 0.0)
    other = PersonTrack("r", "p", "ped", track.t_s, altered)
    before, then = (method.places_m(t.until(at_s), at_s, HORIZONS_S) for t in (track, other))
    assert np.array_equal(before, then)


def test_questions_in_bulk_know_nothing_later_either():
    tracks = crowd(5)
    changed = tuple(
        PersonTrack(
            t.recording, t.agent, t.kind, t.t_s, t.xy_m + 5.0 * (t.t_s > t.t_s[0] + 4.0)[:, None]
        )
        for t in tracks
    )
    answers = []
    for measured in (tracks, changed):
        queries = ask(tracks, measured)
        places, _ = preferred_velocity(
            queries, known_by_then(queries, NUMBERS), NUMBERS, HORIZONS_S
        )
        answers.append((places, constant_velocity(queries, METHODS[0])))
    begun = np.array([queries.measured[who].t_s[0] for who in queries.who])
    early = queries.at_s <= begun + 4.0
    assert 0 < early.sum() < len(early)
    for before, after in zip(*answers, strict=True):
        assert np.array_equal(before[early], after[early])
        assert not np.array_equal(before[~early], after[~early])


def test_questions_in_bulk_get_what_a_single_call_gets():
    tracks = crowd(6)
    queries = ask(tracks, tracks)
    bulk, speeds = preferred_velocity(queries, known_by_then(queries, NUMBERS), NUMBERS, HORIZONS_S)
    straight = constant_velocity(queries, METHODS[0])
    for k in range(0, len(queries.who), 23):
        at_s = float(queries.at_s[k])
        history = tracks[queries.who[k]].until(at_s)
        np.testing.assert_allclose(METHODS[1].places_m(history, at_s, HORIZONS_S), bulk[k])
        speed = METHODS[1].speed_mps(estimate(history, NUMBERS), at_s)
        assert speed == pytest.approx(speeds[k], abs=1e-12)
        np.testing.assert_allclose(METHODS[0].places_m(history, at_s, HORIZONS_S), straight[k])


def test_on_straight_ways_both_are_right_and_constant_velocity_exactly():
    t_s = np.arange(0.0, 6.0, 0.25)
    track = PersonTrack("r", "p", "ped", t_s, np.column_stack([1.4 * t_s, -0.3 * t_s]))
    at_s = float(t_s[-1]) + 0.1
    truth = np.outer(at_s + np.array([1.0, 5.0]), [1.4, -0.3])
    straight, ours = (method.places_m(track, at_s, [1.0, 5.0]) for method in METHODS)
    np.testing.assert_allclose(straight, truth, atol=1e-12)
    assert np.hypot(*(ours - truth).T).max() < 0.1 * np.hypot(1.4, 0.3) * 5.1


def test_who_stands_is_not_sent_away_and_who_was_long_unseen_neither():
    mean = np.array([[0.0, 0.0], [0.05, 0.0], [0.0, 0.0]])
    forecast = forecast_step()
    assert float(forecast(mean, 0.0, 5.0, NUMBERS.row)[0][0]) < 0.02
    mean[1] = (1.3, 0.0)
    way = [float(forecast(mean, age, 2.0, NUMBERS.row)[0][0]) for age in (0.0, 3.0, 12.0)]
    assert way[0] > 2.4
    assert way[1] == pytest.approx(0.5 * 1.3 * 5.0, rel=0.1)
    assert way[2] < 0.1


def test_a_single_measurement_stands_and_none_is_refused():
    once = PersonTrack("r", "p", "ped", np.array([1.0]), np.array([[2.0, 3.0]]))
    for method in METHODS:
        np.testing.assert_allclose(method.places_m(once, 1.5, [1.0, 5.0]), [[2, 3], [2, 3]])
        with pytest.raises(InputError, match="at least one measurement"):
            method.places_m(once.until(0.5), 0.5, [1.0])
        with pytest.raises(InputError, match="until"):
            method.places_m(once, 0.5, [1.0])
    with pytest.raises(InputError, match="wavering_s"):
        MotionNumbers(0.03, 1.2, 60.0, 0.2, 0.0, 0.2, 3.0)
