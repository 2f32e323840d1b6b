"""`workbench intent` scores, answers, draws and learns; only the past influences an answer, and
what cannot be used is refused by file, line and column."""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from intent_cases import SQUARE, square, write

from workbench.cli.main import load_command
from workbench.errors import InputError
from workbench.estimation.field_paths import Others, TowardGoal
from workbench.estimation.motion_filter import MotionNumbers, estimate
from workbench.estimation.motion_parameters import MotionParameters, load_motion
from workbench.estimation.people_data import load_measured
from workbench.estimation.potential_field import Field, Repulsion
from workbench.estimation.prediction import PreferredVelocity
from workbench.estimation.quantile_radii import QuantileRadii

COMMAND = load_command("intent")
NUMBERS = MotionNumbers(0.1, 1.2, 20.0, 0.3, 1.0, 0.2, 3.0)


def invoke(*words: object) -> str:
    """Standard output; exit status 0 is required."""
    arguments: argparse.Namespace = COMMAND.parser().parse_args([str(word) for word in words])
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        assert COMMAND.run(arguments) == 0
    return out.getvalue()


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def answered(folder: Path, queries: list[list[Any]], *options: object) -> list[dict[str, str]]:
    write(folder.parent / "queries.csv", queries)
    out = folder.parent / "answers.csv"
    invoke(folder, "--answers", folder.parent / "queries.csv", "--out", out, *options)
    return rows(out)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return square(tmp_path / "square")


@pytest.fixture
def motion(tmp_path: Path) -> Path:
    law = Repulsion(0.3, 0.5)
    radii = QuantileRadii((0.9,), (1.0, 5.0), ((0.5, 2.0),))
    parameters = MotionParameters(NUMBERS, Field(2.0, 1.0, law, law), radii, radii, "made up")
    (tmp_path / "motion.toml").write_text(parameters.toml())
    return tmp_path / "motion.toml"


GOAL_QUERIES: list[list[Any]] = [
    ["recording", "agent", "t"], ["square_1", "p3", 9.0], ["square_0", "p2", 30.0],
    ["square_0", "p2", 7.3], ["square_0", "p3", 9.1], ["square_0", "p2", 4.0],
    ["square_0", "p2", 0.0],
]  # fmt: skip


def test_it_scores_every_method(folder: Path) -> None:
    data = json.loads(invoke(folder, "--json"))
    methods = {row["method"] for row in data["scores"]}
    assert {"prior", "bearing", "bearing x prior", "filter, learned priors"} <= methods
    assert all(0.0 <= row["accuracy"] <= 1.0 for row in data["scores"])
    assert sum(row["count"] for row in data["calibration"]) == 24 * 5 * len(SQUARE)
    assert data["priors"]["square_0"] == "labels of other recordings"
    assert "accuracy / log-loss / Brier" in invoke(folder, "--recording", "square_1")


def test_answers_are_distributions_in_the_order_of_the_questions(folder: Path) -> None:
    found = answered(folder, GOAL_QUERIES)
    asked = [row for row in GOAL_QUERIES[1:] for _ in SQUARE]
    assert [[row["recording"], row["agent"], float(row["t"])] for row in found] == asked
    for first in range(0, len(found), 3):
        three = found[first : first + 3]
        assert [row["goal"] for row in three] == [goal.name for goal in SQUARE]
        assert abs(sum(float(row["p"]) for row in three) - 1.0) < 1e-6


def test_answers_do_not_depend_on_who_else_is_asked_about(folder: Path) -> None:
    together = answered(folder, GOAL_QUERIES)
    alone = answered(folder, [GOAL_QUERIES[0], GOAL_QUERIES[3]])
    assert alone == together[6:9]


@pytest.mark.parametrize("clicked", [True, False])
def test_what_is_measured_later_changes_no_answer(
    tmp_path: Path, motion: Path, clicked: bool
) -> None:
    folder, now_s = square(tmp_path / "square", clicked=clicked), 10.0
    queries: list[list[Any]] = [["recording", "agent", "t", "t0", "h"]]
    for agent in ("p0", "p2", "p4"):
        queries += [["square_0", agent, now_s, "", ""], ["square_0", agent, "", now_s, 3.0]]
    before = answered(folder, queries, "--motion", motion)
    for name in ("peds", "control_points") if clicked else ("peds",):
        table = rows(folder / f"{name}.csv")
        changed = [
            row | {"x": str(-3.0 * float(row["x"]) + 5.0)} if float(row["t"]) > now_s else row
            for row in table
        ]
        assert changed != table
        kept = [row for row in changed if float(row["t"]) < now_s + 4.0]
        write(folder / f"{name}.csv", [list(table[0]), *[[*row.values()] for row in kept]])
    assert answered(folder, queries, "--motion", motion) == before
    later: list[list[Any]] = [queries[0], ["square_0", "p4", now_s + 2.0, "", ""]]
    assert answered(folder, later) != answered(
        square(tmp_path / "as before", clicked=clicked), later
    )


def test_interpolated_samples_that_know_the_next_click_are_not_used(folder: Path) -> None:
    before = answered(folder, GOAL_QUERIES)
    table = rows(folder / "peds.csv")
    clicks = {(r["recording"], r["agent"], r["t"]) for r in rows(folder / "control_points.csv")}
    moved = [
        row if (row["recording"], row["agent"], row["t"]) in clicks else row | {"y": "50.0"}
        for row in table
    ]
    write(folder / "peds.csv", [list(table[0]), *[[*row.values()] for row in moved]])
    assert answered(folder, GOAL_QUERIES) == before


PLACE_QUERIES: list[list[Any]] = [
    ["recording", "agent", "t0", "h"], ["square_0", "p2", 9.0, 2.0], ["square_1", "p0", 3.3, 0.5],
]  # fmt: skip


def test_places_without_goals_lie_straight_on(folder: Path, motion: Path) -> None:
    (folder / "goals.csv").unlink()
    (folder / "goal_labels.csv").unlink()
    found = answered(folder, PLACE_QUERIES, "--motion", motion)
    tracks = {track.key: track for track in load_measured(folder)}
    for row, (recording, agent, t0, h) in zip(found, PLACE_QUERIES[1:], strict=True):
        history = tracks[recording, agent].until(t0)
        (wanted,) = PreferredVelocity(NUMBERS).places_m(history, t0, (h,))
        np.testing.assert_allclose([float(row["x"]), float(row["y"])], wanted, atol=1e-4)
        assert list(row) == ["recording", "agent", "t0", "h", "x", "y"]


def test_places_lie_half_way_between_straight_on_and_the_mean_of_the_likely_goals(
    folder: Path, motion: Path
) -> None:
    asked = ["recording", "agent", "t"], ["square_0", "p2", 9.0]
    likely = [float(row["p"]) for row in answered(folder, [*asked], "--motion", motion)]
    row = answered(folder, PLACE_QUERIES[:2], "--motion", motion)[0]
    history = {track.key: track for track in load_measured(folder)}["square_0", "p2"].until(9.0)
    parameters = load_motion(motion)
    (straight,) = PreferredVelocity(NUMBERS).places_m(history, 9.0, (2.0,))
    known, field = estimate(history, NUMBERS), TowardGoal(parameters.field)
    toward = [
        field.places_m(known, 9.0, (2.0,), goal_m=(goal.x_m, goal.y_m), others=Others.none())[0]
        for goal in SQUARE
    ]
    mean = sum(p * place for p, place in zip(likely, toward, strict=True))
    share = 0.5 / (1.0 + ((9.0 - known.t_s) / NUMBERS.trusted_s) ** 4)
    wanted = (1.0 - share) * straight + share * mean
    np.testing.assert_allclose([float(row["x"]), float(row["y"])], wanted, atol=1e-3)
    assert np.hypot(*(wanted - straight)) > 0.01


def test_places_are_answered_where_nothing_says_which_scene_it_is(
    folder: Path, motion: Path
) -> None:
    write(folder / "goals.csv", [
        ["scene", "goal", "x", "y"],
        *([scene, goal.name, goal.x_m, goal.y_m] for scene in "ab" for goal in SQUARE),
    ])  # fmt: skip
    (folder / "goal_labels.csv").unlink()
    found = answered(folder, PLACE_QUERIES, "--motion", motion)
    (folder / "goals.csv").unlink()
    assert found == answered(folder, PLACE_QUERIES, "--motion", motion)
    with pytest.raises(InputError, match=r"has no goals\.csv"):
        answered(folder, GOAL_QUERIES)


def test_a_table_may_mix_both_kinds(folder: Path, motion: Path) -> None:
    queries: list[list[Any]] = [
        ["recording", "agent", "t", "t0", "h"], ["square_0", "p2", "", 9.0, 2.0],
        ["square_0", "p2", 9.0, "", ""],
    ]  # fmt: skip
    found = answered(folder, queries, "--motion", motion)
    assert [bool(row["x"]) for row in found] == [True, False, False, False]
    assert [bool(row["p"]) for row in found] == [False, True, True, True]


def test_a_folder_without_labels_is_answered_with_the_counts_of_its_goals(folder: Path) -> None:
    (folder / "goal_labels.csv").unlink()
    assert "nothing to score" in invoke(folder)
    (_, _, even) = answered(folder, [["recording", "agent", "t"], ["square_0", "p2", 0.0]])
    assert abs(float(even["p"]) - 1 / 3) < 1e-6
    write(folder / "goals.csv", [
        ["scene", "goal", "x", "y", "n_develop"],
        *(["square", goal.name, goal.x_m, goal.y_m, 9 + 20 * k] for k, goal in enumerate(SQUARE)),
    ])  # fmt: skip
    found = answered(folder, [["recording", "agent", "t"], ["square_0", "p2", 0.0]])
    root = np.sqrt([10.0, 30.0, 50.0])
    np.testing.assert_allclose([float(row["p"]) for row in found], root / root.sum(), rtol=1e-6)
    paper = answered(folder, GOAL_QUERIES, "--priors", "equal", "--filter", "paper")
    assert abs(float(paper[-1]["p"]) - 1 / 3) < 1e-6


def test_goals_can_be_learned_and_used(folder: Path, tmp_path: Path) -> None:
    invoke(folder, "--learn-goals", tmp_path / "learned.csv", "--scene", "yard")
    page = ("--plot", tmp_path / "out" / "page.html", "--agent", "p0")
    # The labels name goals of the folder's own table.
    assert "nothing to score" in invoke(folder, "--goals", tmp_path / "learned.csv", *page)
    assert "p0 of square_0" in (tmp_path / "out" / "page.html").read_text()


def test_the_page_draws_people_and_scores(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    invoke(folder, "--plot", page, "--recording", "square_1", "--agent", "p3")
    text = page.read_text()
    assert "p3 of square_1" in text
    assert "goal north" in text
    assert "Calibration" in text
    assert text.count("<svg viewBox") == 3
    assert "http" not in text.replace("http://www.w3.org", "")


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ([["recording", "agent"]], "recording,agent,t0,h"),
        ([["recording", "t"], ["square_0", 1]], "missing column agent"),
        ([["recording", "agent", "t"], ["moon", "p0", 1]], r"line 2, column 'recording'.*'moon'"),
        ([["recording", "agent", "t"], ["square_0", "p0", 1], ["square_0", "px", 1]],
         r"line 3, column 'agent'.*'px'"),
        ([["recording", "agent", "t"], ["square_0", "p0", "soon"]], r"line 2, column 't'.*'soon'"),
        ([["recording", "agent", "t"], ["square_0", "p0", "nan"]], r"line 2, column 't'.*finite"),
        ([["recording", "agent", "t0", "h"], ["square_0", "p0", 1, -2]], r"column 'h'.*0 to 60 s"),
        ([["recording", "agent", "t0", "h"], ["square_0", "p5", 1, 2]], r"'t0'.*nothing was meas"),
        ([["recording", "agent", "t", "t0", "h"], ["square_0", "p5", 1, 1, 2]], "got both"),
    ],
)  # fmt: skip
def test_bad_questions_are_refused_and_leave_no_answers(
    folder: Path, tmp_path: Path, table: list[list[Any]], words: str
) -> None:
    (tmp_path / "answers.csv").write_text("old")
    with pytest.raises(InputError, match=words):
        answered(folder, table)
    assert (tmp_path / "answers.csv").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "answers.csv", "queries.csv", "square",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--answers", "q.csv"], "--answers FILE and --out FILE together"),
        (["--out", "q.csv"], "--answers FILE and --out FILE together"),
        (["--answers", "q.csv", "--out", "q.csv"], "different files"),
        (["--answers", "q.csv", "--out", "a.csv"], "table of questions"),
        (["--recording", "square_9"], "did you mean 'square_"),
        (["--scene", "moon"], "no scene 'moon'"),
        (["--goals", "q.csv"], "table of goals"),
        (["--plot", "p.html", "--fit", "m.toml"], "one of --fit, --plot at a time"),
        (["--credit", "us"], "expected --fit FILE beside it"),
        (["--plot", "p.html", "--agent", "nobody"], "nobody called 'nobody'"),
    ],
)
def test_options_that_do_not_fit_are_refused(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=words):
        invoke(folder, *options)
    assert [path.name for path in tmp_path.iterdir()] == ["square"]


def test_a_folder_without_goals_says_what_to_do(folder: Path) -> None:
    (folder / "goals.csv").unlink()
    with pytest.raises(InputError, match="--learn-goals FILE"):
        invoke(folder)
