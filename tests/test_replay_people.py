"""`workbench replay --people intents` replays with estimated people and says so; options that do
not fit each other are refused in one sentence."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

from decision_fixture import write_real_bundle
from recordings_fixture import write_recordings

from workbench.cli.main import main

GOALS = "scene,goal,x,y\nyard,gate,6.0,9.0\nyard,door,-9.0,-3.0\nroof,hatch,0.0,0.0\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_recordings(tmp_path / "recordings")
    (tmp_path / "goals.csv").write_text(GOALS)
    return tmp_path


def words(folder: Path, *more: str, recording: str = "peopled") -> list[str]:
    subject = [str(folder / "recordings"), "--recording", recording]
    return ["replay", *subject, "--out", str(folder / "out"), *more]


@pytest.mark.parametrize(
    ("options", "noted", "tubes"),
    [
        ([], "no known goals: LookAhead is told of every intent of at least 0.26", 7),
        (["--most-likely", "--radius", "0.7", "--guard", "fitted"], "likeliest intent, within", 7),
        (["--intent-level", "0.99", "--intent-threshold", "0.3"], "that held 0.99 of", 7),
    ],
)
def test_a_replay_with_estimated_people_says_what_was_told(
    folder: Path, options: list[str], noted: str, tubes: int
) -> None:
    bundle = write_real_bundle(folder / "bundle")
    assert main(words(folder, "--bundle", str(bundle), "--people", "intents", *options)) == 0
    page = (folder / "out" / "report.html").read_text()
    assert noted in page
    assert "what people want" in page
    lines = [json.loads(line) for line in (folder / "out" / "replay.jsonl").read_text().split("\n")
             if line]  # fmt: skip
    assert "--people intents" in page
    assert noted.partition(" of ")[0] in lines[0]["settings"]["people"]
    fitted = "as those recorded in Crowds by Example" in lines[0]["settings"]["guard"]
    assert fitted == ("fitted" in options)
    for line in lines[1:]:
        (person,) = line["people"]
        assert person["wanted"] == [["unknown", 1.0]]
        # One tube: a disc every half second up to 3 s.
        assert len(person["predicted"]) == tubes
        assert not any("LIMITS" in text for text in line["violations"])


def test_goals_give_each_person_their_probabilities(folder: Path) -> None:
    bundle, goals = write_real_bundle(folder / "bundle"), folder / "goals.csv"
    more = ["--people", "intents", "--goals", str(goals), "--scene", "yard"]
    assert main(words(folder, "--bundle", str(bundle), *more)) == 0
    text = (folder / "out" / "replay.jsonl").read_text().splitlines()[-1]
    (person,) = json.loads(text)["people"]
    assert {goal for goal, _ in person["wanted"]} == {"gate", "door", "unknown"}
    assert '"gate"' in (folder / "out" / "report.html").read_text()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--guard", "fitted"], "--guard: expected beside --people intents"),
        (["--people", "intents", "--radius", "1"], "--radius: expected --most-likely"),
        (["--people", "intents", "--most-likely", "--intent-level", "0.9"], "leave one of the two"),
        (["--people", "intents", "--scene", "yard"], "--scene: expected --goals"),
    ],
)
def test_options_that_do_not_fit_are_refused_before_any_work(
    folder: Path, capsys: pytest.CaptureFixture[str], more: list[str], said: str
) -> None:
    assert main(words(folder, *more)) == 2
    assert said in capsys.readouterr().err
    assert not (folder / "out").exists()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--intent-threshold", "0.25"], "expected a threshold above 0.25"),
        (["--intent-level", "0.8"], "expected one of 0.5, 0.9, 0.99"),
        (["--most-likely", "--radius", "-1"], "expected a radius of 0 m or more"),
        (["--goals", "goals.csv"], "--scene: expected one of yard, roof"),
    ],
)
def test_numbers_and_scenes_that_cannot_be_are_refused_and_leave_nothing(
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    more: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(folder)
    bundle = write_real_bundle(folder / "bundle")
    assert main(words(folder, "--bundle", str(bundle), "--people", "intents", *more)) == 2
    assert said in capsys.readouterr().err
    assert not (folder / "out").exists()


def test_a_log_takes_no_such_options(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "drive.mcap").write_bytes(b"")
    command = ["replay", str(folder / "drive.mcap"), "--people", "intents", "--guard", "fitted"]
    assert main(command) == 2
    assert "--people, --guard: expected beside a folder" in capsys.readouterr().err
