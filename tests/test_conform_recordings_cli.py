"""Claim: on recordings `workbench conform` says no more than its fit supports."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest

from workbench.cli.main import main

Row = tuple[float, ...]


def drive(
    duration_s: float, speed_mps: float, *, seed: int,
    pushed: Callable[[float], float] = lambda t: 0.0,
) -> list[Row]:  # fmt: skip
    """t, x, y, heading, v, a, yaw rate at 10 Hz, straight ahead, places 1 cm off at most."""
    noise, x, rows = random.Random(seed), 0.0, []
    for k in range(round(10 * duration_s)):
        push = pushed(0.1 * k)
        rows.append((0.1 * k, x + noise.uniform(-0.01, 0.01), 0.0, 0.0, speed_mps, push, 0.0))
        x += 0.1 * speed_mps
        speed_mps = max(speed_mps + 0.1 * push, 0.0)
    return rows


def swaying(phase: int) -> list[Row]:
    return drive(7.0, 3.0 + 0.5 * phase, seed=phase, pushed=lambda t: 0.3 * math.sin(t + phase))


def sliding_back() -> list[Row]:
    """A standing car whose place goes back at 0.11 m/s: no bicycle does."""
    return [(row[0], -0.11 * row[0], *row[2:]) for row in drive(4.0, 0.0, seed=0)]


def write(folder: Path, recordings: Mapping[str, Sequence[Row]]) -> Path:
    vehicles = ["recording,agent,kind,t,x,y,heading,v,a,yaw_rate"]
    shapes = ["recording,agent,front,rear,half_width,wheelbase"]
    for name, rows in recordings.items():
        vehicles += [f"{name},car,car," + ",".join(map(repr, row)) for row in rows]
        shapes.append(f"{name},car,3.5,1.0,0.9,2.7")
    folder.mkdir()
    for file, lines in (("vehicles", vehicles), ("shapes", shapes)):
        (folder / f"{file}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "peds.csv").write_text("recording,agent,kind,t,x,y\n", encoding="utf-8")
    return folder


def conform(source: Path, out: Path, *more: str) -> int:
    return main(["conform", str(source), "--out", str(out), "--step", "0.2", "--window", "3",
                 *more])  # fmt: skip


def data(out: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((out / "conformance.json").read_text(encoding="utf-8"))
    return found


def test_a_fit_that_failed_states_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recordings = {"r0": drive(4.0, 0.0, seed=0)}
    for k in range(1, 8):
        recordings[f"r{k}"] = drive(4.0, 4.0, seed=k) if k % 2 else sliding_back()
    assert conform(write(tmp_path / "back", recordings), tmp_path / "out") == 1
    said = capsys.readouterr().out
    assert "with confidence" not in said
    assert "nothing is stated of further recordings" in said
    assert "3 of 4 recordings leave theirs" in said
    assert said.splitlines()[-1].startswith("the tubes do not contain what they were fitted to")
    assert data(tmp_path / "out")["statement"] is None


def test_nothing_is_known_before_a_fit_that_may_leave_windows_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The window that is left out is of the first recording, which the cost is made of."""
    recordings = {name: swaying(k) for k, name in enumerate("abcd")}
    rows = recordings["a"]
    recordings["a"] = [*rows[:35], *((row[0] + 3.5, *row[1:]) for row in rows)]
    source = write(tmp_path / "jump", recordings)
    assert conform(source, tmp_path / "out", "--outliers", "1") == 1
    said = capsys.readouterr().out
    assert "Windows left out: a from 3 s" in said
    assert "nothing was known before the fit" in said
