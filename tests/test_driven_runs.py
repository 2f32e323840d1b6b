"""A drive becomes the run that `conform` reads: the truth from a simulation, what was told from a
log."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from simulated_worlds import rig, scenario

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.cli.main import main
from workbench.errors import InputError
from workbench.runtime import Deciding
from workbench.runtime.onboard.core import Core
from workbench.runtime.onboard.playback_settings import log_header
from workbench.runtime.onboard.recorder import RecordedCore, Recorder, RecorderSettings
from workbench.runtime.onboard.states import Mode, State
from workbench.simulation.bus_drive import BusDrive, BusLoop, Recorded, drive
from workbench.simulation.bus_world import BusSetting, BusWorld
from workbench.simulation.conformance.bus_runs import driven_run
from workbench.simulation.conformance.driven_runs import load_runs, runs_tables
from workbench.simulation.conformance.log_runs import run_from_log
from workbench.simulation.rig import Rig, Trial
from workbench.simulation.simulated import simulated_path

EMPTY_ROAD = """
title = "Nobody"
story = "Nobody."
waypoints = [[0, 0], [11, 0], [22, 0], [33, 0]]
duration_s = 6.0
passed_m = 3.0
[expected]
LookAhead = "any"
FailSafe = "any"
both = "any"
"""
_TRIAL = Trial(scenario(duration_s=11.0), "bicycle", 1)


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, BusDrive]:
    """A drive with a recorder beside it, and the drive itself."""
    folder = tmp_path_factory.mktemp("log") / "log"
    made, scene = rig(), rig().scene(_TRIAL)
    bundle, settings = made.bundle.with_deciding(Deciding.FAIL_SAFE), made.settings
    header = log_header(
        bundle, scene.setting.path, settings, mode=Mode.DRIVE,
        manifest_sha256=bundle.manifest_sha256, started_unix_us=0,
    )  # fmt: skip
    recorder = Recorder.start(header, RecorderSettings(folder, ".log"))
    core = RecordedCore(Core(bundle, scene.setting.path, settings, mode=Mode.DRIVE), recorder)
    world = BusWorld(scene, BusSetting(settings.maker), seed=1)
    loop = BusLoop(core, world, seed=1)  # type: ignore[arg-type]
    driven = drive(loop, world, Recorded(pages=False))
    assert recorder.close().in_order
    return folder / "monitor.mcap", driven


def test_a_run_of_a_simulation_is_the_truth_at_its_decisions(
    logged: tuple[Path, BusDrive],
) -> None:
    _, driven = logged
    run = driven_run("r", driven, _TRIAL.scenario, reference_speed_mps=2.0)
    decided = [i for i in driven.instants if i.observation is not None]
    on_path = [i for i in decided if 0.5 <= i.station_m <= 39.5]
    assert 20 < len(on_path) == len(run.table) < len(decided)
    assert run.column("x").tolist() == [i.motion.x_m for i in on_path]
    assert run.column("speed_integral")[5] == on_path[5].observation.speed_integral[0]  # type: ignore[union-attr]
    tracks = [i.tracks for i in on_path]
    assert all(tracks)
    # While the reference still rises, the loop is another one at every decision.
    assert not run.tracking[0]
    slow = run.column("speed") < 1.2
    assert not run.tracking[slow].any()


def test_a_run_of_a_log_is_what_its_decisions_were_told(logged: tuple[Path, BusDrive]) -> None:
    file, driven = logged
    made = rig().bundle.with_deciding(Deciding.FAIL_SAFE)
    run = run_from_log(file, made)
    told = [i for i in driven.instants if i.observation is not None]
    late = run.table[-len(told) :]
    for row, instant in zip(late, told, strict=True):
        seen = instant.observation
        assert seen is not None
        assert row[1] == pytest.approx(0.5 * (seen.x[0] + seen.x[1]), abs=1e-12)
        assert row[5] == pytest.approx(0.5 * (seen.speed[0] + seen.speed[1]), abs=1e-12)
        assert row[6] == seen.speed_integral[0]
    assert np.diff(run.table[:, 0]).min() > 0.0
    assert run.waypoints[0][0] == pytest.approx(-10.0)
    assert run.waypoints[-1][0] == pytest.approx(80.0)
    tracking = [i.state is State.TRACKING for i in told]
    assert run.tracking.sum() <= sum(tracking)


def test_tables_give_the_same_run_back(logged: tuple[Path, BusDrive], tmp_path: Path) -> None:
    run = driven_run("r", logged[1], _TRIAL.scenario, reference_speed_mps=2.0)
    for name, text in runs_tables([run]).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (again,) = load_runs(tmp_path)
    assert (again.table == run.table).all()
    assert (again.tracking == run.tracking).all()


def test_the_wrong_bundle_and_no_decision_are_refused(logged: tuple[Path, BusDrive]) -> None:
    made = rig().bundle
    other = type(made)(made.manifest, made._kernel, "0" * 64)
    with pytest.raises(InputError, match="name the one that the log was made with"):
        run_from_log(logged[0], other)
    nothing = dataclasses.replace(logged[1], instants=())
    with pytest.raises(InputError, match="expected a drive with decisions"):
        driven_run("r", nothing, _TRIAL.scenario, reference_speed_mps=2.0)


def test_a_file_is_driven_by_a_vehicle_and_a_bundle_that_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The options are those of `simulate`; what was driven stands beside the runs."""
    vehicle = tmp_path / "own.toml"
    text = simulated_path().read_text(encoding="utf-8") + "\n# of its own\n"
    vehicle.write_text(text, encoding="utf-8")
    scene = tmp_path / "empty_road.toml"
    scene.write_text(EMPTY_ROAD, encoding="utf-8")
    asked: list[argparse.Namespace] = []

    def chosen(args: argparse.Namespace) -> Rig:
        asked.append(args)
        return rig()

    monkeypatch.setattr("workbench.cli.drives.chosen_rig", chosen)
    words = ["drives", str(scene), "--vehicle", str(vehicle), "--sensors", "s.toml", "--seeds"]
    out = tmp_path / "out"
    assert main([*words, "1", "1", "--plant", "bicycle", "--out", str(out)]) == 0
    ((vehicle_file, sensors, horizon),) = [(a.vehicle, a.sensors, a.horizon) for a in asked]
    assert (vehicle_file, sensors, horizon) == (vehicle, Path("s.toml"), None)
    assert (out / "vehicle.toml").read_text(encoding="utf-8") == text
    (run,) = load_runs(out)
    assert run.name == "empty_road bicycle 1"
    assert run.waypoints[-1][0] == 33.0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["nobody_s_bend", "--seeds", "3", "1"], "expected 0 <= FIRST <= LAST"),
        (["drive.mcap"], "--bundle: expected the bundle that made drive.mcap"),
        (["no_such_scene"], "no_such_scene"),
        (["no_such_file.toml"], "no_such_file.toml"),
        (["nobody_s_bend", "--vehicle", "none.toml"], "none.toml"),
        (["nobody_s_bend", "--sensors", "none.toml"], "--sensors: expected a file"),
        (["nobody_s_bend", "--bundle", "b", "--horizon", "2"], "expected without --horizon"),
        (["nobody_s_bend", "--bundle", "no-bundle"], "no-bundle"),
    ],
)
def test_wrong_use_is_answered(
    given: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["drives", *given, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
