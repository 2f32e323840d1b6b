"""Goals are read as written or found where tracks end; priors count other recordings only."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from intent_cases import SQUARE, square

from workbench.errors import InputError
from workbench.estimation.goals import (
    Goal,
    MeanShift,
    centres_m,
    goals_csv,
    learn_goals,
    load_goals,
)
from workbench.estimation.intent_labels import (
    Label,
    Prior,
    learned_prior,
    load_labels,
    scenes_of,
)
from workbench.estimation.people_data import PersonTrack, load_tracks

HEADER = "scene,goal,x,y\n"


def test_a_table_of_goals_is_read_and_written_again(tmp_path: Path) -> None:
    text = "scene,goal,x,y,rms_spread,n_develop\na,0,1.000,2.000,1.25,7\nb,x,-3.000,0.500,0.40,0\n"
    (tmp_path / "map.csv").write_text(text)
    scenes = load_goals(tmp_path / "map.csv")
    first, second = Goal("0", 1.0, 2.0, 1.25, 7.0), Goal("x", -3.0, 0.5, 0.4, 0.0)
    assert scenes == {"a": (first,), "b": (second,)}
    assert goals_csv(scenes) == text
    (tmp_path / "packed.csv.gz").write_bytes(gzip.compress(text.encode()))
    assert load_goals(tmp_path / "packed.csv.gz") == scenes


def test_spread_and_counts_may_be_missing(tmp_path: Path) -> None:
    (tmp_path / "map.csv").write_text(HEADER + "a,0,1,2\n")
    assert load_goals(tmp_path / "map.csv")["a"] == (Goal("0", 1.0, 2.0, 1.5, None),)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER, "no rows"),
        ("scene,goal,x\na,0,1\n", "missing column y"),
        (HEADER + "a,0,1,east\n", r"line 2, column 'y'.*finite number.*'east'"),
        (HEADER + "a,0,1,2\na,0,3,4\n", r"line 3, column 'goal'.*stands twice"),
        ("scene,goal,x,y,rms_spread\na,0,1,2,0\n", r"'rms_spread'.*above zero"),
        ("scene,goal,x,y,n_develop\na,0,1,2,-1\n", r"'n_develop'.*count"),
    ],
)
def test_bad_tables_are_refused_by_place(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "map.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        load_goals(tmp_path / "map.csv")


def test_a_table_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found nothing"):
        load_goals(tmp_path / "map.csv")
    with pytest.raises(InputError, match="found a folder"):
        load_goals(tmp_path)


def test_goals_are_found_where_people_come_from_and_go_to(tmp_path: Path) -> None:
    tracks = load_tracks(square(tmp_path, people=60, recordings=1))
    found = learn_goals(tracks, MeanShift.people())
    assert len(found) == 3
    for goal in SQUARE:
        away = np.hypot(*(centres_m(found) - (goal.x_m, goal.y_m)).T)
        assert away.min() < 0.5
    assert sum(goal.ends or 0.0 for goal in found) > 50
    again = learn_goals(tracks[::-1], MeanShift.people())
    np.testing.assert_allclose(centres_m(again), centres_m(found), atol=0.01)


def test_people_who_stand_or_are_cut_make_no_goals() -> None:
    t_s = np.arange(0.0, 10.0, 0.2)
    still = PersonTrack("r", "still", "ped", t_s, np.zeros((len(t_s), 2)))
    cut = PersonTrack("r", "cut", "ped", t_s, np.stack([t_s, 0 * t_s], axis=1))
    with pytest.raises(InputError, match="got none"):
        learn_goals([still, cut], MeanShift.people())


def labels(*rows: tuple[str, str]) -> list[Label]:
    return [Label(recording, f"p{k}", "s", goal, True) for k, (recording, goal) in enumerate(rows)]


def test_priors_leave_the_judged_recording_out() -> None:
    known = labels(("one", "west"), ("one", "west"), ("two", "north"))
    without = learned_prior(SQUARE, known, scene="s", without=frozenset({"one"}))
    np.testing.assert_allclose(without.probability, [1 / 4, 1 / 4, 2 / 4])
    assert without.source == "labels of other recordings"
    alone = learned_prior(SQUARE, known, scene="s", without=frozenset({"one", "two"}))
    assert alone.source == "equal"
    np.testing.assert_allclose(alone.probability, Prior.equal(SQUARE).probability)


def test_counts_that_are_the_sum_of_the_labels_are_not_used() -> None:
    known = labels(("one", "west"), ("one", "west"), ("two", "north"))
    counted = tuple(
        Goal(goal.name, goal.x_m, goal.y_m, 1.0, ends)
        for goal, ends in zip(SQUARE, (2.0, 0.0, 1.0), strict=True)
    )
    assert learned_prior(counted, known, scene="s", without=frozenset({"one"})).source == (
        "labels of other recordings"
    )
    apart = learned_prior(counted, [], scene="s", without=frozenset({"one"}))
    np.testing.assert_allclose(apart.probability, [3 / 6, 1 / 6, 2 / 6])
    assert apart.source == "counts in the table of goals"


def test_labels_are_read_and_refused_by_place(tmp_path: Path) -> None:
    assert load_labels(tmp_path) == ()
    header = "recording,agent,scene,goal,usable\n"
    (tmp_path / "goal_labels.csv").write_text(header + "r,a,s,-1,0\nr,b,s,2,1\n")
    assert [label.usable for label in load_labels(tmp_path)] == [False, True]
    (tmp_path / "goal_labels.csv").write_text(header + "r,a,s,2,yes\n")
    with pytest.raises(InputError, match=r"line 2, column 'usable'"):
        load_labels(tmp_path)
    (tmp_path / "goal_labels.csv").write_text(header + "r,a,s,-1,1\n")
    with pytest.raises(InputError, match=r"line 2, column 'goal'"):
        load_labels(tmp_path)
    with pytest.raises(InputError, match="has goal 'south'"):
        learned_prior(SQUARE, labels(("r", "south")), scene="s", without=frozenset())


def test_scenes_are_told_by_tables_then_by_names(tmp_path: Path) -> None:
    assert scenes_of(tmp_path, ["zara_01"], ["zara", "square"]) == {"zara_01": "zara"}
    assert scenes_of(tmp_path, ["other"], ["square"]) == {"other": "square"}
    with pytest.raises(InputError, match="which scene it shows"):
        scenes_of(tmp_path, ["other"], ["zara", "square"])
    with pytest.raises(InputError, match="no scene 'moon'"):
        scenes_of(tmp_path, ["other"], ["zara", "square"], given="moon")
    (tmp_path / "recordings.csv").write_text("recording,scene\nother,square\n")
    assert scenes_of(tmp_path, ["other"], ["zara", "square"]) == {"other": "square"}
    assert scenes_of(tmp_path, ["other"], ["zara", "square"], given="zara") == {"other": "zara"}
