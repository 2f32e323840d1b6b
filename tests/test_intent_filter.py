"""The filter's answers are distributions, depend on the person's past alone, and follow the
intent: a right goal, a change of mind, a goal that is not in the set."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from intent_cases import SQUARE

from workbench.errors import InputError
from workbench.estimation.intent_baselines import cosines
from workbench.estimation.intent_cloud import FilterSettings, NumpyUpdate
from workbench.estimation.intent_filter import Belief, Intents, advance, answer, begin, follow
from workbench.estimation.intent_scenarios import CROSSING, errands, noticed
from workbench.estimation.intent_trajectory import trajectories
from workbench.estimation.people_data import PersonTrack

CHOSEN, PAPER = FilterSettings.chosen(), FilterSettings.paper()
QUICK = dataclasses.replace(CHOSEN, particles=40)
EVEN = np.full(3, 1 / 3)


def followed(
    track: PersonTrack, numbers: FilterSettings = CHOSEN, seed: int = 1
) -> tuple[Belief, ...]:
    return follow(track, Intents(CROSSING, seed), numbers, NumpyUpdate())


def errand(name: str) -> PersonTrack:
    return next(e for e in errands() if e.name == name).track(period_s=0.2, noise_m=0.05, seed=0)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.05, 30.0), st.floats(-50, 50), st.floats(-50, 50)), min_size=1,
             max_size=6),
    st.integers(0, 2**32),
)  # fmt: skip
def test_answers_are_distributions_wherever_people_are_measured(
    measured: list[tuple[float, float, float]], seed: int
) -> None:
    t_s = np.cumsum([wait for wait, _, _ in measured])
    track = PersonTrack("r", "a", "ped", t_s, np.array([place for _, *place in measured]))
    for belief in follow(track, Intents(SQUARE, seed), QUICK, NumpyUpdate()):
        assert belief.weights.min() > 0.0
        assert math.isclose(belief.weights.sum(), 1.0, rel_tol=1e-9)
        given_out = answer(belief, np.array([0.7, 0.2, 0.1]), QUICK)
        assert given_out.min() > 0.0
        assert math.isclose(given_out.sum(), 1.0, rel_tol=1e-9)
        assert all(np.isfinite(part).all() for part in (belief.cloud.place, belief.cloud.velocity))


def test_what_is_measured_later_changes_no_earlier_belief() -> None:
    track = errand("goes across")
    altered = track.xy_m.copy()
    altered[20:] = altered[20:][::-1] + 3.0
    other = PersonTrack("r", "a", "ped", track.t_s, altered)
    for one, two in zip(followed(track)[:20], followed(other)[:20], strict=True):
        np.testing.assert_array_equal(one.weights, two.weights)
    assert not np.array_equal(followed(track)[30].weights, followed(other)[30].weights)


def test_the_seed_decides_and_persons_have_their_own() -> None:
    track = errand("goes across")
    one, again, other = followed(track), followed(track), followed(track, seed=2)
    np.testing.assert_array_equal(one[-1].weights, again[-1].weights)
    assert not np.array_equal(one[-1].weights, other[-1].weights)
    seeds = {Intents.of_person(SQUARE, "r", f"p{k}", seed=1).seed for k in range(50)}
    assert len(seeds) == 50


def test_the_paper_begins_with_equal_priors_and_no_unknown_goal() -> None:
    belief = begin(Intents(CROSSING, 1), 0.0, np.array([13.0, 0.0]), PAPER)
    np.testing.assert_allclose(belief.weights, [1 / 3, 1 / 3, 1 / 3, 0.0])
    for later in followed(errand("to a goal not in the set"), PAPER):
        assert later.unknown == 0.0
        np.testing.assert_allclose(answer(later, EVEN, PAPER), later.among_known)


def test_who_is_first_seen_at_a_goal_is_doubted_to_go_there() -> None:
    near = begin(Intents(CROSSING, 1), 0.0, np.array([14.0, 0.0]), CHOSEN).among_known
    # 1 - 0.9 at the goal itself, 1 far from it.
    np.testing.assert_allclose(near[1] / near[0], 0.1, rtol=1e-3)


def test_the_answer_is_prior_and_bearing_as_far_as_the_filter_doubts() -> None:
    belief = followed(errand("to a goal not in the set"))[-1]
    assert belief.unknown > 0.8
    prior = np.array([0.64, 0.32, 0.04])
    apart = np.sqrt(prior) * np.exp(CHOSEN.doubted_bearing * belief.cosines)
    given = answer(belief, prior, CHOSEN)
    np.testing.assert_allclose(given, apart / apart.sum(), atol=1.1 * (1 - belief.unknown))


def test_a_belief_remembers_the_way_that_the_whole_track_tells() -> None:
    track = errand("across, then right")
    for count, belief in enumerate(followed(track, QUICK), 1):
        seen = PersonTrack("r", "a", "ped", track.t_s[:count], track.xy_m[:count])
        np.testing.assert_allclose(belief.cosines, cosines(seen, CROSSING), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "within_s"),
    [("goes across", 1.0), ("across, then right", 2.0), ("right, then across", 2.0),
     ("to a goal not in the set", 2.0), ("between two goals", 6.0)],
)  # fmt: skip
def test_the_right_intent_or_the_unknown_one_leads_soon(name: str, within_s: float) -> None:
    chosen = next(each for each in errands() if each.name == name)
    found = noticed(
        chosen, period_s=0.2, noise_m=0.1, runs=5, settings=CHOSEN, update=NumpyUpdate()
    )
    assert found.share >= 0.9
    assert found.median_s <= within_s


def test_a_changed_goal_is_found_again_and_not_merely_doubted() -> None:
    belief = followed(errand("across, then right"))
    before = next(each for each in belief if each.t_s > 4.0)
    assert np.argmax(before.weights) == 0
    after = next(each for each in belief if each.t_s > 8.0)
    assert after.weights[1] > 0.8


def test_ways_begin_at_the_measurement_and_end_at_the_goal() -> None:
    belief = followed(errand("goes across"))[20]
    probability = belief.weights
    ways = trajectories(belief, probability, CHOSEN, least=0.0, horizon_s=40.0, step_s=0.2)
    assert [way.probability for way in ways] == sorted(probability, reverse=True)
    for way in ways:
        np.testing.assert_array_equal(way.xy_m[0], belief.place_m)
        np.testing.assert_allclose(np.diff(way.t_s), 0.2)
        if way.goal is not None:
            goal = next(each for each in CROSSING if each.name == way.goal)
            assert np.hypot(*(way.xy_m[-1] - (goal.x_m, goal.y_m))) < 0.5
    single = trajectories(belief, probability, CHOSEN, least=0.5, horizon_s=40.0, step_s=0.2)
    assert [way.goal for way in single] == ["across"]


def test_misuse_is_refused() -> None:
    belief = begin(Intents(CROSSING, 1), 1.0, np.zeros(2), CHOSEN)
    with pytest.raises(InputError, match="after 1 s"):
        advance(belief, 1.0, np.zeros(2), CHOSEN, NumpyUpdate())
    with pytest.raises(InputError, match="finite metres"):
        advance(belief, 2.0, np.array([np.nan, 0.0]), CHOSEN, NumpyUpdate())
    with pytest.raises(InputError, match="at least one goal"):
        Intents((), 1)
    with pytest.raises(InputError, match="prior above zero"):
        answer(belief, np.array([1.0, 0.0, 0.0]), CHOSEN)
    with pytest.raises(InputError, match="floor"):
        dataclasses.replace(CHOSEN, floor=0.0)
    with pytest.raises(InputError, match="unknown"):
        dataclasses.replace(CHOSEN, unknown=1.0)
    with pytest.raises(InputError, match="switch_per_s"):
        dataclasses.replace(CHOSEN, switch_per_s=-1.0)
    with pytest.raises(InputError, match="horizon"):
        trajectories(belief, belief.weights, CHOSEN, least=0.0, horizon_s=0.1, step_s=0.2)
    with pytest.raises(InputError, match="unknown one last"):
        trajectories(belief, belief.weights[:-1], CHOSEN, least=0.0, horizon_s=1.0, step_s=0.2)
    with pytest.raises(InputError, match="at least one run"):
        noticed(errands()[0], period_s=0.2, noise_m=0.1, runs=0, settings=CHOSEN,
                update=NumpyUpdate())  # fmt: skip
