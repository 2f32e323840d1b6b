"""Goals known by probability bend the prediction, and only as far as the past knows them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from intent_cases import SQUARE, square

from workbench.estimation.likely_goals import (
    SHARE,
    TowardLikelyGoals,
    between,
    likely_goal_errors,
    likely_goals,
)
from workbench.estimation.motion_parameters import shipped_motion
from workbench.estimation.motion_queries import (
    HORIZONS_S,
    Queries,
    ask,
    known_by_then,
    preferred_velocity,
)
from workbench.estimation.people_data import PersonTrack, load_measured, load_tracks

MOTION = shipped_motion()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return square(tmp_path_factory.mktemp("likely") / "square", people=4)


@pytest.fixture(scope="module")
def queries(folder: Path) -> Queries:
    return ask(load_tracks(folder), load_measured(folder))


def test_all_questions_at_once_are_answered_as_one_by_one(folder: Path, queries: Queries) -> None:
    likely = likely_goals(folder, queries)
    assert likely is not None
    np.testing.assert_allclose(likely.probability.sum(axis=1), 1.0, rtol=1e-12)
    known = known_by_then(queries, MOTION.numbers)
    straight, _ = preferred_velocity(queries, known, MOTION.numbers, HORIZONS_S)
    asked = np.arange(0, len(known), 9)
    errors = likely_goal_errors(queries, known, straight, MOTION, likely, asked)
    alone = TowardLikelyGoals(MOTION)
    for row, k in zip(errors, asked.tolist(), strict=True):
        person, at_s = queries.measured[queries.who[k]], float(queries.at_s[k])
        places = alone.places_m(
            person.until(at_s), at_s, HORIZONS_S, goals=SQUARE, probability=likely.probability[k]
        )
        off = np.hypot(*(places - queries.truth_m[k]).T)
        np.testing.assert_allclose(row, off, atol=1e-6)


def test_what_is_measured_later_changes_no_probability(folder: Path, queries: Queries) -> None:
    first = likely_goals(folder, queries)
    assert first is not None
    who, cut = int(queries.who[0]), 3
    tracks = list(queries.measured)
    moved = tracks[who].xy_m.copy()
    moved[cut:] *= -1.0
    old = tracks[who]
    tracks[who] = PersonTrack(old.recording, old.agent, old.kind, old.t_s, moved)
    again = likely_goals(folder, dataclasses.replace(queries, measured=tuple(tracks)))
    assert again is not None
    before = (queries.who == who) & (queries.last < cut)
    np.testing.assert_array_equal(again.probability[before], first.probability[before])
    later = (queries.who == who) & (queries.last >= cut)
    assert np.abs(again.probability[later] - first.probability[later]).max() > 0.05


def test_half_of_the_way_is_the_goals_and_less_with_age() -> None:
    straight, ways = np.zeros((1, 1, 2)), np.array([[[[4.0, 0.0]], [[0.0, 8.0]]]])
    likely, age = np.array([[0.75, 0.25]]), np.array([0.0])
    found = between(straight, ways, likely, age, MOTION.numbers)
    np.testing.assert_allclose(found, SHARE * np.array([[[3.0, 2.0]]]))
    old = between(straight, ways, likely, age + MOTION.numbers.trusted_s, MOTION.numbers)
    np.testing.assert_allclose(old, 0.5 * found)


def test_a_folder_without_goals_has_none(folder: Path, queries: Queries, tmp_path: Path) -> None:
    (tmp_path / "peds.csv").write_text((folder / "peds.csv").read_text())
    assert likely_goals(tmp_path, queries) is None
    track = queries.measured[0]
    places = TowardLikelyGoals(MOTION).places_m(
        track, float(track.t_s[-1]), (1.0,), goals=(), probability=()
    )
    assert places.shape == (1, 2)
