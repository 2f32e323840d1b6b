"""`workbench reach --learned` shows the paper's tube for what it is; `build` refuses options that
it cannot use."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from workbench.cli.main import main

LEARN = ["learn", "--system", "b1", "--pairs", "300", "--step", "0.05"]
REACH = ["reach", "--system", "b1", "--horizon", "3"]


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("learned") / "b1.json"
    assert main([*LEARN, "--save", str(file)]) == 0
    return file


def test_it_says_sampled_and_counts_the_runs_that_leave(
    saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, table = tmp_path / "tube.html", tmp_path / "tube.csv"
    more = ["--learned", str(saved), "--plot", str(page), "--csv", str(table)]
    assert main([*REACH, *more, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["rigor"], found["status"]) == ("SAMPLED", "COMPLETE")
    assert "proved_until_s" not in found
    assert found["reaches_s"] == 3.0
    assert 0 < found["runs_outside"] < found["runs"]
    text = page.read_text()
    assert "Nothing more is claimed" in text
    assert "may leave the shaded band" in text
    assert "Every trajectory" not in text
    assert len(table.read_text().splitlines()) > 60


def test_more_regions_make_another_tube(saved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    widths = []
    for parts in ([], ["--parts", "x=2,y=2,steering=2,speed=2,heading=2"]):
        assert main([*REACH, "--learned", str(saved), *parts, "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        widths.append(found["half_widths"][-1][found["states"].index("x")])
    assert widths[1] < widths[0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--switch-at", "1", "2"], "--switch-at"),
        (["--sampled"], "--sampled"),
        (["--horizon", "4"], "at most 3 s"),
        (["--step", "0.07"], "whole steps"),
        (["--system", "b2"], "made with the loop of B2"),
    ],
)
def test_what_a_learned_bound_does_not_fit_is_refused(
    saved: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main([*REACH, "--learned", str(saved), *words]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--pairs", "9"], "--pairs: expected --learned"),
        (["--seed", "9"], "--seed: expected --learned"),
        (["--regions", "2"], "--regions: expected --learned"),
        (["--learned", "--regions", "3"], "243"),
    ],
)
def test_build_refuses_what_makes_no_sense(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main(["build", "--out", str(tmp_path / "bundle"), *words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "bundle").exists()
