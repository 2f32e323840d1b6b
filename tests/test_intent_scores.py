"""Scores have their closed forms; on recorded people the filter beats the bearing."""

from __future__ import annotations

import dataclasses
import math
import os
from pathlib import Path

import numpy as np
import pytest
from intent_cases import SQUARE, square

from workbench.estimation.goals import load_goals
from workbench.estimation.intent_baselines import bearing_answer, cosines, fitted_concentration
from workbench.estimation.intent_choice import CHOSEN_ELSEWHERE, VARIED, variants, varied
from workbench.estimation.intent_cloud import FilterSettings, NumpyUpdate
from workbench.estimation.intent_labels import load_labels
from workbench.estimation.intent_scores import (
    BEARING_PRIOR,
    BEARING_ROOT,
    FILTER,
    METHODS,
    POINTS,
    PRIOR,
    Answered,
    Score,
    calibration,
    cross_validated,
    scored,
    walks,
)
from workbench.estimation.people_data import PersonTrack, load_measured, load_tracks


def judged(folder: Path) -> tuple[Answered, ...]:
    known = load_labels(folder)
    people = walks(
        load_tracks(folder), load_measured(folder), known, load_goals(folder / "goals.csv")
    )
    return tuple(
        each
        for held in sorted({walk.measured.recording for walk in people})
        for each in cross_validated(
            people, known, held=held, settings=FilterSettings.chosen(), update=NumpyUpdate(), seed=1
        )
    )


def losses(scores: tuple[Score, ...], method: str) -> list[float]:
    return [each.log_loss for each in scores if each.method == method]


def test_scores_have_their_closed_forms() -> None:
    answers = [
        Answered(PRIOR, "1 s", "r", np.array([0.5, 0.25, 0.25]), 0),
        Answered(PRIOR, "1 s", "r", np.array([0.1, 0.8, 0.1]), 2),
    ]
    (row,) = scored(answers)
    assert (row.count, row.accuracy) == (2, 0.5)
    assert math.isclose(row.log_loss, (math.log(2.0) + math.log(10.0)) / 2)
    assert math.isclose(row.brier, (0.25 + 0.125 + 0.01 + 0.64 + 0.81) / 2)
    sure = scored([Answered(PRIOR, "1 s", "r", np.array([0.0, 1.0]), 0)])
    assert math.isfinite(sure[0].log_loss)


def test_calibration_counts_every_goal_of_every_answer() -> None:
    answers = [Answered(PRIOR, "1 s", "r", np.array([0.75, 0.25]), k % 4 == 3) for k in range(400)]
    low, high = calibration(answers, PRIOR)
    assert (low.count, high.count) == (400, 400)
    assert math.isclose(low.stated, low.reached)
    assert math.isclose(high.stated, high.reached)
    assert calibration([], PRIOR) == []


def test_bearing_looks_from_the_last_place_along_the_last_way() -> None:
    track = PersonTrack("r", "a", "ped", np.array([0.0, 1.0, 1.2]),
                        np.array([[0.0, -2.0], [0.0, -1.0], [0.0, 0.0]]))  # fmt: skip
    np.testing.assert_allclose(cosines(track, SQUARE), [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_array_equal(cosines(track.until(0.5), SQUARE), np.zeros(3))
    np.testing.assert_array_equal(cosines(track.until(-1.0), SQUARE), np.zeros(3))
    even = bearing_answer(np.array([1.0, -1.0]), 0.5 * math.log(3.0), np.array([0.5, 0.5]))
    np.testing.assert_allclose(even, [0.75, 0.25])


def test_the_concentration_is_the_one_that_made_the_goals() -> None:
    rng = np.random.default_rng(1)
    even, cases = np.full(3, 1 / 3), []
    for _ in range(3000):
        cosine = rng.uniform(-1.0, 1.0, 3)
        cases.append((cosine, even, int(rng.choice(3, p=bearing_answer(cosine, 2.5, even)))))
    assert abs(fitted_concentration(cases) - 2.5) < 0.3


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return square(tmp_path_factory.mktemp("recordings") / "square", people=30)


def test_points_are_times_of_the_recorded_track(generated: Path) -> None:
    people = walks(load_tracks(generated), load_measured(generated), load_labels(generated),
                   load_goals(generated / "goals.csv"))  # fmt: skip
    assert len(people) == 60
    for walk in people:
        times = walk.times_s()
        assert set(times) <= set(POINTS)
        assert all(walk.begin_s < t_s <= walk.end_s for t_s in times.values())
        assert math.isclose(times["1 s"], walk.begin_s + 1.0)
        assert math.isclose(times["50 %"], 0.5 * (walk.begin_s + walk.end_s))


def test_on_people_who_go_straight_the_filter_is_sure_and_knows_entrances(generated: Path) -> None:
    scores = scored(judged(generated))
    assert {each.method for each in scores} == set(METHODS)
    ours, theirs = losses(scores, FILTER), losses(scores, BEARING_PRIOR)
    assert len(ours) == len(POINTS)
    # After 1 s there is one measurement and no bearing yet.
    assert ours[0] < 0.8 * theirs[0]
    assert max(ours[1:]) < 0.1


def test_a_recording_has_no_say_in_how_it_is_judged(generated: Path) -> None:
    known = load_labels(generated)
    people = walks(load_tracks(generated), load_measured(generated), known,
                   load_goals(generated / "goals.csv"))[::6]  # fmt: skip
    few = dataclasses.replace(FilterSettings.chosen(), particles=30)
    choices = {"vague": dataclasses.replace(few, deviation_m=9.0), "shipped": few}
    steps: list[int] = []
    rows = varied(people, known, choices, update=NumpyUpdate(), seed=1,
                  progress=lambda: steps.append(1))  # fmt: skip
    assert [row.change for row in rows] == ["vague", "shipped", CHOSEN_ELSEWHERE]
    assert len(steps) == 2
    # Both recordings prefer the shipped numbers, so that each is judged with them.
    assert rows[2].scores == rows[1].scores
    assert rows[1].scores[2].log_loss < rows[0].scores[2].log_loss
    halved = variants(few)
    assert halved["kick = 0.225"].kick == 0.225
    assert len(halved) == 1 + 2 * len(VARIED)


@pytest.mark.skipif("WORKBENCH_DATA" not in os.environ, reason="needs the recordings")
def test_the_filter_beats_both_kinds_of_bearing_x_prior_on_ucy() -> None:
    scores = scored(judged(Path(os.environ["WORKBENCH_DATA"]) / "ucy"))
    ours = losses(scores, FILTER)
    for other in (BEARING_PRIOR, BEARING_ROOT):
        assert all(a < 0.95 * b for a, b in zip(ours, losses(scores, other), strict=True))
