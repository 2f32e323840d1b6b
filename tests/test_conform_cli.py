"""Claim: `workbench conform` writes a vehicle file that other commands take, or says why not."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from conformance_runs import planted_run

from workbench.cli.main import main
from workbench.models.vehicle import gem_e2_path, load_vehicle
from workbench.models.vehicle_sections import Uncertainty
from workbench.simulation.conformance.driven_runs import DrivenRun, load_runs, runs_tables

PLANTED = Uncertainty(acceleration_mps2=0.15, steering_rate_radps=0.02)
SMALLER = Uncertainty(acceleration_mps2=0.075, steering_rate_radps=0.01)
LARGER = Uncertainty(acceleration_mps2=0.5, steering_rate_radps=0.02)
SOFT = (
    ("proportional_radps_per_m = 0.6", "proportional_radps_per_m = 0.05"),
    ("integral_radps_per_ms = 0.05", "integral_radps_per_ms = 0.0"),
    ("derivative_rad_per_m = 1.0", "derivative_rad_per_m = 0.5"),
    ("look_ahead_m = 2.0", "look_ahead_m = 4.0"),
)


def write_runs(folder: Path, runs: list[DrivenRun]) -> Path:
    folder.mkdir()
    for name, text in runs_tables(runs).items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def vehicle_file(tmp_path: Path) -> Path:
    text = gem_e2_path().read_text(encoding="utf-8")
    for old, new in SOFT:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "soft.toml"
    file.write_text(text, encoding="utf-8")
    return file


def conform(source: Path, vehicle: Path, out: Path, *more: str) -> int:
    return main([
        "conform", str(source), "--vehicle", str(vehicle), "--out", str(out), "--window", "2",
        "--step", "0.2", *more,
    ])  # fmt: skip


def test_the_fitted_file_is_taken_by_reach(
    tmp_path: Path, vehicle_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = [planted_run(f"run {k}", PLANTED, seed=k, duration_s=4.0) for k in range(4)]
    source = write_runs(tmp_path / "runs", runs)
    assert conform(source, vehicle_file, tmp_path / "out", "--plot") == 0
    said, progress = capsys.readouterr()
    assert "every other recording by name" in said
    assert "fit: 100%" in progress
    file = tmp_path / "out" / "vehicle.toml"
    found = load_vehicle(file).uncertainty
    assert 0.0 < found.acceleration_mps2 <= 1.05 * 0.15
    assert not found.includes_drive_by_wire
    assert "2 recordings" in found.provenance
    assert "workbench conform" in found.provenance
    assert main(["reach", "--vehicle", str(file), "--unsure", "--horizon", "1"]) == 0
    data = json.loads((tmp_path / "out" / "conformance.json").read_text(encoding="utf-8"))
    assert data["split"]["training"] == ["run 0", "run 2"]
    assert data["held_out"]["windows"]["of"] == 4
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "acceleration_mps2" in page


def test_a_larger_disturbance_held_out_is_reported_as_escape(
    tmp_path: Path, vehicle_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = [planted_run("a", PLANTED, seed=1, duration_s=4.0),
            planted_run("b", LARGER, seed=2, duration_s=4.0)]  # fmt: skip
    source = write_runs(tmp_path / "runs", runs)
    assert conform(source, vehicle_file, tmp_path / "out") == 1
    assert "less than asked" in capsys.readouterr().out
    data = json.loads((tmp_path / "out" / "conformance.json").read_text(encoding="utf-8"))
    assert data["contained"] is True
    assert data["held_out"]["windows"]["inside"] < data["held_out"]["windows"]["of"]


def test_another_folder_is_tested_on_whole_and_fitted_to_not_at_all(
    tmp_path: Path, vehicle_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = write_runs(
        tmp_path / "runs",
        [planted_run(f"run {k}", PLANTED, seed=k, duration_s=4.0) for k in range(2)],
    )
    alike = write_runs(tmp_path / "alike", [planted_run("run 0", SMALLER, seed=7, duration_s=4.0)])
    harder = write_runs(tmp_path / "harder", [planted_run("run 1", LARGER, seed=2, duration_s=4.0)])
    alone, out = tmp_path / "alone", tmp_path / "out"
    assert conform(source, vehicle_file, alone) == 0
    assert conform(source, vehicle_file, out, "--test-on", str(alike), "--plot") == 0
    assert f"tubes, all of {alike}" in capsys.readouterr().out
    assert load_vehicle(out / "vehicle.toml").uncertainty.acceleration_mps2 == (
        load_vehicle(alone / "vehicle.toml").uncertainty.acceleration_mps2
    )
    both = ("--test-on", str(alike), str(harder), "--json")
    assert conform(source, vehicle_file, out, *both) == 1
    found = json.loads(capsys.readouterr().out)
    of = {name: each["windows"] for name, each in found["elsewhere"].items()}
    # Half of the disturbance that was fitted to is held; a larger one is found out.
    assert of[str(alike)]["inside"] == of[str(alike)]["of"] == 2
    assert of[str(harder)]["inside"] < of[str(harder)]["of"] == 2
    assert found["split"]["held_out"] == ["run 1"]


def test_folders_to_test_on_that_cannot_be_are_refused(
    tmp_path: Path, vehicle_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = [planted_run(f"run {k}", PLANTED, seed=k, duration_s=4.0) for k in range(2)]
    source = write_runs(tmp_path / "runs", runs)
    short = write_runs(tmp_path / "short", [planted_run("a", PLANTED, seed=1, duration_s=1.0)])
    other = write_runs(tmp_path / "other", runs)
    (other / "vehicle.toml").write_text(gem_e2_path().read_text(encoding="utf-8"), encoding="utf-8")
    again = write_runs(tmp_path / "again", [dataclasses.replace(runs[0], name="copy")])
    for folder, said in (
        (again, "as run 0 in"), (source, "other than SOURCE"),
        (tmp_path / "none", "expected a folder with runs.csv"),
        (short, "expected windows of 2 s"), (other, "drive them with the same vehicle"),
    ):  # fmt: skip
        assert conform(source, vehicle_file, tmp_path / "out", "--test-on", str(folder)) == 2
        assert said in capsys.readouterr().err
        assert not (tmp_path / "out").exists()
    distinct = write_runs(
        tmp_path / "distinct", [planted_run("c", PLANTED, seed=9, duration_s=4.0)]
    )
    (distinct / "vehicle.toml").write_bytes(vehicle_file.read_bytes())
    assert conform(source, vehicle_file, distinct, "--test-on", str(distinct)) == 2
    assert "those of --test-on" in capsys.readouterr().err
    assert (distinct / "vehicle.toml").read_bytes() == vehicle_file.read_bytes()


def test_motion_beyond_what_the_vehicle_can_take_gives_no_file(
    tmp_path: Path, vehicle_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    jumps = planted_run("a", PLANTED, seed=1, duration_s=4.0)
    table = jumps.table.copy()
    table[20:, 5] += 5.0
    runs = [dataclasses.replace(jumps, table=table), dataclasses.replace(jumps, name="b")]
    source = write_runs(tmp_path / "runs", runs)
    assert conform(source, vehicle_file, tmp_path / "out") == 1
    assert "acceleration_mps2 <= 2" in capsys.readouterr().out
    assert not (tmp_path / "out").exists()
    earlier = tmp_path / "earlier"
    earlier.mkdir()
    for name in ("vehicle.toml", "conformance.json", "report.html", "notes.txt"):
        (earlier / name).write_text("of an earlier call", encoding="utf-8")
    assert conform(source, vehicle_file, earlier) == 1
    assert [file.name for file in earlier.iterdir()] == ["notes.txt"]


def test_runs_come_back_as_they_were_written(tmp_path: Path) -> None:
    run = planted_run("run 0", PLANTED, seed=0, duration_s=1.0)
    braked = dataclasses.replace(run, tracking=np.arange(len(run.table)) < 5)
    (back,) = load_runs(write_runs(tmp_path / "runs", [braked]))
    assert back.name == run.name
    assert np.array_equal(back.table, run.table)
    assert np.array_equal(back.tracking, braked.tracking)
    assert np.array_equal(back.waypoints, run.waypoints)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--train", "nobody"), "--train: expected recordings with whole windows"),
        (("--train", "a", "b"), "--train: expected to leave recordings"),
        (("--outliers", "99"), "--outliers: expected a whole number from 0 to 0, fewer than"),
        (("--outliers", "-1"), "--outliers: expected a whole number from 0 to 0"),
        (("--require", "-1"), "--require: expected a share from 0 to 1, got -1"),
        (("--require", "2"), "--require: expected a share from 0 to 1, got 2"),
        (("--step", "0.0001"), "expected at most 1000 steps in a window"),
        (("--step", "1e-320"), "expected at most 1000 steps in a window"),
        (("--window", "2.1"), "whole steps"),
    ],
)
def test_wrong_use_is_told(
    more: tuple[str, ...],
    said: str,
    tmp_path: Path,
    vehicle_file: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    run = planted_run("a", PLANTED, seed=1, duration_s=2.5)
    source = write_runs(tmp_path / "runs", [run, dataclasses.replace(run, name="b")])
    assert conform(source, vehicle_file, tmp_path / "out", *more) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_told_before_the_fit(
    tmp_path: Path, vehicle_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = planted_run("a", PLANTED, seed=1, duration_s=2.5)
    source = write_runs(tmp_path / "runs", [run, dataclasses.replace(run, name="b")])
    assert conform(source, vehicle_file, vehicle_file) == 2
    said = capsys.readouterr().err
    assert "expected an output folder" in said
    assert "fit:" not in said


def test_folders_that_hold_nothing_to_fit_to_are_refused(
    tmp_path: Path, vehicle_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert conform(tmp_path / "none", vehicle_file, tmp_path / "out") == 2
    assert conform(tmp_path, vehicle_file, tmp_path / "out") == 2
    assert "runs.csv" in capsys.readouterr().err


def test_the_given_vehicle_file_is_never_replaced(
    tmp_path: Path, vehicle_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = planted_run("a", PLANTED, seed=1, duration_s=2.5)
    source = write_runs(tmp_path / "runs", [run, dataclasses.replace(run, name="b")])
    own = vehicle_file.rename(tmp_path / "vehicle.toml")
    before = own.read_bytes()
    assert conform(source, own, tmp_path) == 2
    assert "would be replaced" in capsys.readouterr().err
    assert own.read_bytes() == before
    beside = source / "vehicle.toml"
    beside.write_bytes(before)
    assert conform(source, own, source) == 2
    assert beside.read_bytes() == before
