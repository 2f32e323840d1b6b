"""Claim: on recordings `workbench conform` says no more than its fit supports."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

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


def data(out: Path) -> Any:
    return json.loads((out / "conformance.json").read_text(encoding="utf-8"))


def test_a_fit_that_failed_states_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recordings = {"r0": drive(4.0, 0.0, seed=0)}
    for k in range(1, 8):
        recordings[f"r{k}"] = drive(4.0, 4.0, seed=k) if k % 2 else sliding_back()
    assert conform(write(tmp_path / "back", recordings), tmp_path / "out", "--plot") == 1
    said = capsys.readouterr().out
    assert "with confidence" not in said
    assert "nothing is stated of further recordings" in said
    assert "3 of 4 recordings leave theirs" in said
    assert said.splitlines()[-1].startswith("the tubes do not contain what they were fitted to")
    assert data(tmp_path / "out")["statement"] is None
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "The tubes do not contain what they were fitted to" in page
    assert not (tmp_path / "out" / "vehicle.toml").exists()


def test_a_window_left_out_that_is_inside_after_all_is_said_to_be(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """To first order a standing car does not come aside, whatever pushes it; a real tube does."""
    recordings = {
        name: drive(7.0, 3.0, seed=k, pushed=lambda t: 1.2 * math.sin(t))
        for k, name in enumerate("abd")
    }
    standing = drive(4.0, 0.0, seed=3)
    recordings["c"] = [(*row[:2], 0.3 if row[0] > 2.5 else 0.0, *row[3:]) for row in standing]
    source = write(tmp_path / "aside", recordings)
    assert conform(source, tmp_path / "out") == 1
    said = capsys.readouterr().out
    assert said.startswith("to first order no bounds contain the training windows")
    conform(source, tmp_path / "out", "--outliers", "1")
    assert "c from 0 s (inside its tube after all)" in capsys.readouterr().out
    (left_out,) = data(tmp_path / "out")["windows_left_out"]
    assert left_out == {"recording": "c", "start_s": 0.0, "inside": True}


def test_what_was_left_out_counts_in_no_figure_of_the_training_windows(tmp_path: Path) -> None:
    """A jump of 5 m would make the containing disc and the pointwise bounds useless."""
    recordings = {name: swaying(k) for k, name in enumerate("abcd")}
    rows = [list(row) for row in swaying(2)]
    for row in rows[35:]:
        row[1] += 5.0
    rows[40][5] = 50.0
    recordings["c"] = [tuple(row) for row in rows]
    source = write(tmp_path / "jump", recordings)
    conform(source, tmp_path / "out", "--outliers", "1")
    found = data(tmp_path / "out")
    assert [each["recording"] for each in found["windows_left_out"]] == ["c"]
    assert found["pointwise"]["acceleration_mps2"] < 1.0
    areas = [each["mean_area_m2"] for each in found["discs"]]
    assert max(areas) < 20.0


def test_where_all_cars_stand_no_disc_has_the_tubes_area(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = write(tmp_path / "standing", {n: drive(4.0, 0.0, seed=k) for k, n in enumerate("ab")})
    assert conform(source, tmp_path / "out", "--plot") == 0
    assert "no disc has the tubes' mean area" in capsys.readouterr().out
    found = data(tmp_path / "out")
    assert {each["kind"] for each in found["discs"]} == {"that contains the windows fitted to"}
    assert "0.251 m^2" in found["discs_lacking"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "No disc has the tubes" in page


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
    assert "Windows left out: a from 3 s." in said
    assert "nothing was known before the fit" in said
