"""`build`, `replay` and `demo` leave whole results that open anywhere."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

from decision_fixture import real_files, write_real_bundle
from recordings_fixture import write_recordings

from workbench.cli import demo
from workbench.cli.main import main
from workbench.runtime import load_bundle

_QUICK = ["--horizon", "3", "--step", "0.05"]
_MOST_BYTES = 5_000_000


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    return write_recordings(tmp_path / "recordings")


def _is_offline_report(path: Path) -> None:
    html = path.read_text()
    assert path.stat().st_size < _MOST_BYTES
    assert "<svg" in html or "data:image" in html
    for fetching in ('src="http', "src='http", 'href="http', "@import", "url(http"):
        assert fetching not in html


def _names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_build_leaves_a_bundle_that_loads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bundle"
    assert main(["build", *_QUICK, "--out", str(out), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert (data["folder"], data["steps"], data["rigor"]) == (str(out), 60, "ENCLOSED")
    assert (data["deciding"], data["deciding_level"]) == ("both", "whole")
    assert list(data["levels"]) == ["whole", "two thirds", "one third"]
    assert (data["budget"], data["tubes"]) == (3000, "local, linear")
    assert {path.name: path.read_bytes() for path in out.iterdir()} == real_files()
    assert _names(tmp_path) == {"bundle"}
    assert load_bundle(out).manifest.name == "GEM e2"


def test_build_names_policy_set_budget_and_tubes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bundle"
    chosen = ["--deciding", "FailSafe", "--deciding-level", "two thirds", "--budget", "225"]
    chosen += ["--kernel", "enclosed", "--form", "quadratic"]
    assert main(["build", "--horizon", "0.1", "--step", "0.05", *chosen, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "deciding: FailSafe, for the level 'two thirds', tubes: enclosed, quadratic" in said
    manifest = load_bundle(out).manifest
    assert (manifest.deciding, manifest.deciding_level) == ("FailSafe", "two thirds")
    assert (manifest.budget, manifest.tubes) == (225, "enclosed, quadratic")
    text = (out / "kernel.c").read_text()
    assert re.search(r"^#define WB_ENCLOSED 1$", text, re.M)
    assert re.search(r"^#define WB_M [1-9]", text, re.M)
    rounding = next(each for each in manifest.assumptions if each.name == "rounding")
    assert "outward throughout the tube" in rounding.evidence


def test_replay_writes_log_and_report_and_one_summary_line(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle, out = write_real_bundle(tmp_path / "bundle"), tmp_path / "out"
    words = ["replay", recordings, "--recording", "peopled", "--bundle", bundle, "--out", out]
    assert main([str(word) for word in words]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("peopled: 31 queries (")
    for figure in ("braked", "smallest separation", "(p1 at", "median", "p99", "open-loop"):
        assert figure in lines[0]
    for said in ("LookAhead SAFE", "FailSafe SAFE", "violations none", "alerts "):
        assert said in lines[0]
    assert lines[-1].endswith(f"report {out / 'report.html'}")
    assert _names(out) == {"replay.jsonl", "report.html"}
    _is_offline_report(out / "report.html")
    assert f"workbench replay {recordings} --" in (out / "report.html").read_text()
    assert f"--bundle {bundle}" in (out / "report.html").read_text()
    logged = [json.loads(line) for line in (out / "replay.jsonl").read_text().splitlines()]
    assert len(logged) == 32
    assert [entry["t_s"] for entry in logged[1:]] == sorted(entry["t_s"] for entry in logged[1:])
    assert {entry["rigor"] for entry in logged[1:]} == {"NUMERICAL"}
    assert logged[0]["format"] == 2
    assert list(logged[0]["levels"]) == ["whole", "two thirds", "one third"]
    for entry in logged[1:]:
        # LookAhead decides, though the bundle names both.
        ahead, safe = entry["policies"]
        assert (ahead["policy"], safe["policy"]) == ("LookAhead", "FailSafe")
        assert (entry["verdict"], entry["action"]) == (ahead["verdict"], ahead["action"])
        assert [level["tube"] for level in entry["levels"]] == ["track", "stop", "brake"]


def test_replaying_twice_gives_the_same_log_but_for_the_time_it_took(
    recordings: Path, tmp_path: Path
) -> None:
    bundle, logs = write_real_bundle(tmp_path / "bundle"), []
    for name in ("once", "again"):
        words = ["replay", recordings, "--recording", "peopled", "--bundle", bundle]
        assert main([str(word) for word in (*words, "--out", tmp_path / name)]) == 0
        lines = (tmp_path / name / "replay.jsonl").read_text().splitlines()
        logs.append([json.loads(line) | {"elapsed_s": 0.0} for line in lines])
    assert logs[0] == logs[1]


def test_replay_without_people_or_bundle_builds_one_and_says_so(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    words = [
        "replay",
        str(recordings),
        "--recording",
        "empty",
        *_QUICK,
        "--out",
        str(out),
        "--json",
    ]
    assert main(words) == 0
    data = json.loads(capsys.readouterr().out)
    assert (data["recording"], data["queries"]) == ("empty", 31)
    assert data["smallest_separation_m"] is None
    assert data["verdicts"]["INVALID"] == 0
    assert sum(data["verdicts"].values()) == 31
    assert data["report"] == str(out / "report.html")
    assert "no people" in (out / "report.html").read_text()


def test_demo_runs_the_whole_chain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo, "_PAIRS", 60)
    monkeypatch.setattr(demo, "_SAMPLES", 200)
    out = tmp_path / "demo"
    assert main(["demo", "--out", str(out)]) == 0
    shown = capsys.readouterr()
    assert shown.out.splitlines()[-1] == f"report: {out / 'report.html'}"
    assert "demo: 100%" in shown.err
    story = shown.out.splitlines()[-2]
    assert story.startswith("Crossing: 300 queries (")
    for part in ("violations none", "the car set off at 0.4 s, braked", "tracking for good"):
        assert part in story
    assert _names(out) == {"bundle", "report.html"}
    _is_offline_report(out / "report.html")
    load_bundle(out / "bundle")
    page = (out / "report.html").read_text(encoding="utf-8")
    (claim,) = re.findall(r"<li>(?:(?!<li>).)*?Monitor decisions, under", page)
    assert "Deciding: both." in page
    # The bundle's tube is proved; the coordinates it is asked in are not, to the last bit.
    assert "NUMERICAL" in claim
    assert "ENCLOSED" not in claim
