"""A log read back says what was decided, and a log is never half written."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from tests.replay_fixture import LIMITS, Scripted, drive, standing
from workbench.errors import InputError
from workbench.simulation.clock import SetClock
from workbench.simulation.measures import Measures
from workbench.simulation.replay import ReplaySettings, replay
from workbench.simulation.runlog import Entry, plain, read_log, write_log

SETTINGS = ReplaySettings.instrumented_car(LIMITS)


@pytest.fixture(scope="module")
def entries() -> tuple[Entry, ...]:
    recording = drive(people=(standing("p", 8.0, -3.0, first_s=1.0),))
    monitor = Scripted(lambda o: o.x[0] > 6.0)
    return replay(recording, monitor, clock=SetClock(), settings=SETTINGS).entries


def test_round_trip(tmp_path: Path, entries: tuple[Entry, ...]) -> None:
    path = write_log(
        tmp_path / "new" / "log.jsonl", {"settings": SETTINGS, "recording": "made"}, entries
    )
    log = read_log(path)
    assert log.header["recording"] == "made"
    assert log.header["settings"]["errors"]["position_m"] == 0.1
    assert log.header["created_by"].startswith("workbench ")
    assert len(log.entries) == len(entries)
    for found, made in zip(log.entries, entries, strict=True):
        assert found.frame.verdict is made.frame.verdict
        assert (found.frame.action, found.frame.reason) == (made.frame.action, made.frame.reason)
        assert found.frame.x_m == pytest.approx(made.frame.x_m, abs=1e-6)
        assert found.frame.clearance_m == made.frame.clearance_m
        for point, corner in zip(found.frame.path, made.frame.path, strict=True):
            assert point == pytest.approx(corner, abs=1e-6)
        assert found.frame.occupancy == ((1.0, 2.0, 0.1, 2.4, 0.912),)
        assert [p.name for p in found.frame.people] == [p.name for p in made.frame.people]
        assert found.assumptions == made.assumptions == ("told",)
        assert found.stamp_s == pytest.approx(made.stamp_s, abs=1e-6)
        assert made.brake_from_s == made.stamp_s + 0.15
        assert (found.nearest, found.rigor) == (made.nearest, "NUMERICAL")
        assert (found.brake_from_s, found.deciding_level) == (
            pytest.approx(made.brake_from_s),
            "whole",
        )
    measured, made_before = Measures.of(log.entries), Measures.of(entries)
    assert measured.verdicts == made_before.verdicts
    assert measured.safe_shares == made_before.safe_shares
    assert (measured.violations, measured.alerts) == (made_before.violations, made_before.alerts)
    assert list(path.parent.iterdir()) == [path]


def test_both_policies_every_set_and_all_that_was_named_are_read_back(
    tmp_path: Path, entries: tuple[Entry, ...]
) -> None:
    log = read_log(write_log(tmp_path / "log.jsonl", {}, entries))
    for found, made in zip(log.entries, entries, strict=True):
        frame, before = found.frame, made.frame
        assert frame.policies == before.policies
        assert frame.levels == before.levels
        assert (frame.violations, frame.alert) == (before.violations, before.alert)
        assert frame.sent == before.sent
        assert frame.stop_occupancy == ((1.5, 2.5, 0.2, 2.5, 0.988),)
        for person, seen in zip(frame.people, before.people, strict=True):
            assert len(person.guarded) == len(seen.guarded) == 5
            assert person.guarded[-1] == pytest.approx(seen.guarded[-1], abs=1e-3)
    last = log.entries[-1].frame
    assert [(a.policy, a.verdict.value) for a in last.policies] == [
        ("LookAhead", "UNPROVED"),
        ("FailSafe", "SAFE"),
    ]
    assert last.violations == ("PEOPLE: p left the guard",)
    assert last.alert == "p: not even braking helps"


def test_a_log_of_an_older_format_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "old").write_text('{"format": 1, "path": []}\n')
    with pytest.raises(InputError, match=r"expected .* format 2, got format 1; make the log again"):
        read_log(tmp_path / "old")


def test_every_line_is_json_without_nan(tmp_path: Path, entries: tuple[Entry, ...]) -> None:
    path = write_log(tmp_path / "log.jsonl", {"nothing": float("nan")}, entries)

    def refuse(text: str) -> float:
        raise AssertionError(text)

    lines = [json.loads(s, parse_constant=refuse) for s in path.read_text().splitlines()]
    assert lines[0]["nothing"] is None
    assert lines[1]["t_s"] == 0.0
    assert lines[1]["verdict"] == "SAFE"


def test_a_failed_write_leaves_the_old_log(
    tmp_path: Path, entries: tuple[Entry, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_log(tmp_path / "log.jsonl", {}, entries)
    before = path.read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="got No space left on device; choose another"):
        write_log(path, {"other": 1}, entries[:1])
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_written_is_refused(
    tmp_path: Path, entries: tuple[Entry, ...]
) -> None:
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(InputError, match="expected a folder that can be written"):
        write_log(tmp_path / "taken" / "log.jsonl", {}, entries)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "got an empty file"),
        ('{"format": 99}\n', "got format 99"),
        ('{"format": 2}\n{"t_s": 1.0}\n', "line 2: expected a decision"),
        ('{"format": 2}\nnot json\n', "line 2: expected JSON"),
        ('{"format": 2}\n[1]\n', "line 2: expected a JSON object"),
    ],
)
def test_what_is_not_a_log_is_refused_by_line(tmp_path: Path, text: str, part: str) -> None:
    (tmp_path / "log").write_text(text)
    with pytest.raises(InputError, match=part):
        read_log(tmp_path / "log")
    with pytest.raises(InputError, match="expected a log of a run"):
        read_log(tmp_path / "none")


def test_plain_values() -> None:
    assert plain({"a": (1.23456789, float("inf"), None, True, "x", 3)}) == {
        "a": [1.234568, None, None, True, "x", 3]
    }
