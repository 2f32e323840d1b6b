"""Each analysis command tells the truth in its exit status, its JSON and its files."""

from __future__ import annotations

import csv
import html
import itertools
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from cli_fixture import SHORT, changed_vehicle, invoke

from workbench.cli.analysis_options import SYSTEMS, shown_instants
from workbench.cli.derive import METHODS
from workbench.cli.main import load_command
from workbench.cli.methods import LOCAL, REGION, TUBES
from workbench.models import PathFrame
from workbench.models.benchmarks import all_benchmarks, b1, b1_small
from workbench.models.vehicle import gem_e2, gem_e2_drive_path, load_vehicle
from workbench.sensitivity.sampling import rollout, sample_initial_states
from workbench.sensitivity.scenario import pairs_needed

ROOT = Path(__file__).parent.parent


def table_of(file: Path, kind: str, end: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    rows = [row for row in csv.DictReader(file.open()) if row["kind"] == kind]
    columns = [name for name in rows[0] if name.endswith(f"_{end}")]
    return np.array([[float(row[name]) for name in columns] for row in rows])


def test_every_benchmark_loop_can_be_chosen() -> None:
    assert tuple(each.name.lower() for each in all_benchmarks()) == SYSTEMS


def test_the_shown_instants_end_at_the_horizon() -> None:
    assert shown_instants(3.0) == (1.0, 2.0, 3.0)
    assert shown_instants(1.5) == (1.0, 1.5)
    assert shown_instants(0.2) == (0.2,)


def test_reach_writes_a_tube_that_holds_sampled_runs_of_the_shipped_vehicle(tmp_path: Path) -> None:
    target, page = tmp_path / "new" / "tube.csv", tmp_path / "tube.html"
    words = ["--curvature", "-0.01", "0.01", "--csv", target, "--plot", page, "--json"]
    found = invoke("reach", *words)
    assert (found.status, found.data["status"], found.data["rigor"]) == (0, "COMPLETE", "ENCLOSED")
    assert found.data["instants_s"] == [0.0, 1.0, 2.0, 3.0]
    vehicle = gem_e2()
    loop = vehicle.closed_loop(vehicle.track(), PathFrame(-0.01, 0.01))
    states = sample_initial_states(vehicle.initial_set, count=400, seed=3)
    lower, upper = table_of(target, "instant", "lower"), table_of(target, "instant", "upper")
    first, last = table_of(target, "step", "lower"), table_of(target, "step", "upper")
    for curvature in (-0.01, 0.0, 0.01):
        runs = rollout(loop, states, horizon_s=3.0, step_s=0.05 / 4, disturbances=[curvature])[
            :, ::4
        ]
        assert np.all((runs >= lower - 1e-7) & (runs <= upper + 1e-7))
        for ends in (runs[:, :-1], runs[:, 1:]):
            assert np.all((ends >= first - 1e-7) & (ends <= last + 1e-7))
    assert found.data["half_widths"][3] == pytest.approx((upper[-1] - lower[-1]) / 2)
    assert "Reach tube of GEM e2" in page.read_text(encoding="utf-8")


def test_unsure_puts_what_the_vehicle_file_is_unsure_of_into_the_tube(tmp_path: Path) -> None:
    words = ["--vehicle", gem_e2_drive_path(), "--horizon", "1", "--step", "0.05"]
    target = tmp_path / "tube.csv"
    sure = invoke("reach", *words, "--json")
    found = invoke("reach", *words, "--unsure", "--csv", target, "--json")
    assert (found.status, found.data["rigor"]) == (0, "ENCLOSED")
    assert "--unsure puts it in" in sure.err
    assert "--unsure" not in found.err
    vehicle = load_vehicle(gem_e2_drive_path())
    loop = vehicle.uncertain_loop(vehicle.track(), PathFrame(0.0, 0.0))
    ends = [(each.lower, each.upper) for each in loop.ode.disturbances]
    corners = np.array(list(itertools.product(*ends)))
    states = sample_initial_states(vehicle.initial_set, count=len(corners) * 10, seed=3)
    runs = rollout(
        loop, states, horizon_s=1.0, step_s=0.0125, disturbances=np.tile(corners, (10, 1))
    )[:, ::4]
    lower, upper = table_of(target, "instant", "lower"), table_of(target, "instant", "upper")
    assert np.all((runs >= lower - 1e-7) & (runs <= upper + 1e-7))
    # The tube without them does not hold these runs: the widths are not merely padded.
    narrow, wide = (np.array(each.data["half_widths"][-1]) for each in (sure, found))
    reached = (runs[:, -1].max(0) - runs[:, -1].min(0)) / 2.0
    assert np.all(reached <= wide * (1.0 + 1e-9))
    assert np.any(reached > 1.1 * narrow)


def test_parts_never_widen_the_tube() -> None:
    words = ("reach", "--system", "b1", "--horizon", "1", "--step", "0.05", "--json")
    whole, split = invoke(*words), invoke(*words, "--parts", "y=2, speed=1")
    wide, narrow = (np.array(each.data["half_widths"][-1]) for each in (whole, split))
    assert np.all(narrow <= wide * (1 + 1e-9))
    assert narrow[1] < 0.997 * wide[1]
    assert "tube of 2 cells: 100%" in split.err


def test_a_tube_that_ends_early_fails_the_claim(tmp_path: Path) -> None:
    page = tmp_path / "tube.html"
    # Curves of 0.5 m radius have their centre, a pole of path coordinates, in the initial set.
    found = invoke("reach", "--curvature", "-2", "2", "--plot", page, "--json")
    assert found.status == 1
    assert found.data["status"] == "SINGULAR"
    assert found.data["proved_until_s"] == 0.0
    assert found.data["half_widths"][-1] == [None] * 7
    assert "The proof ends early" in page.read_text(encoding="utf-8")


def test_derived_bounds_hold_for_sampled_runs(tmp_path: Path) -> None:
    page = tmp_path / "growth.html"
    found = invoke("derive", *SHORT, "--cells", "4", "--plot", page, "--json")
    assert found.status == 0
    assert found.data["condition_shown"] is True
    loop, box = b1_small().system, b1_small().initial_set
    states = np.vstack([[box.center], sample_initial_states(box, count=400, seed=5)])
    runs = rollout(loop, states, horizon_s=0.5, step_s=0.01)[:, -1]
    reached = np.abs(runs[1:] - runs[0]).max(axis=0)
    methods = {each["method"]: each for each in found.data["bounds"]}
    assert tuple(methods) == METHODS
    for name, each in methods.items():
        assert each["rigor"] == "ENCLOSED"
        assert np.all(np.array(each["half_widths"][-1]) >= reached - 1e-9), name
        assert each["cost_s"] > 0.0
        assert each["proved_until_s"] == 0.5
        assert each["mean_ratio"] >= 1.0
        ratios = np.array(each["half_widths"][-1]) / np.array(found.data["sampled"][-1])
        assert each["ratios"][-1] == pytest.approx(ratios.tolist())
    assert np.all(np.array(found.data["tube"]["half_widths"][-1]) < 1.01 * reached + 1e-6)
    assert found.err.count("methods: 100%") >= 1
    text = page.read_text(encoding="utf-8")
    assert all(name in text for name in METHODS)
    command = html.unescape(re.findall(r"<pre>(workbench .*?)</pre>", text)[0])
    again = load_command("derive").parser().parse_args(shlex.split(command)[2:])
    assert (again.system, again.horizon, again.step, again.plot) == ("b1-small", 0.5, 0.05, page)
    assert tuple(again.method) == METHODS


def test_the_recommendation_follows_from_the_figures() -> None:
    words = ("--method", "growth-matrix", "local-growth", "sensitivity-linear")
    found = invoke("derive", "--system", "b1-small", "--horizon", "0.5", *words, "--json").data
    by_name = {each["method"]: each for each in found["bounds"]}
    assert tuple(by_name) == words[1:]
    chosen = by_name[found["recommended"]["method"]]
    proved = [each for each in by_name.values() if each["rigor"] == "ENCLOSED"]
    least = min(each["mean_ratio"] for each in proved)
    assert chosen["mean_ratio"] <= 1.1 * least
    tightest = next(each for each in proved if each["mean_ratio"] == least)
    as_good = [each for each in proved if each["mean_ratio"] <= 1.1 * least]
    cheaper = [each for each in as_good if each["cost_s"] <= 0.5 * tightest["cost_s"]]
    assert chosen["cost_s"] == min(each["cost_s"] for each in cheaper or [tightest])
    assert f"{chosen['mean_ratio']:.4g}" in found["recommended"]["reason"]
    assert found["recommended_formula"]["method"] == "growth-matrix"


def test_the_methods_of_the_help_are_those_there_are() -> None:
    assert (*REGION, *LOCAL, *TUBES) == METHODS


def test_derive_says_when_the_tube_leaves_the_region(tmp_path: Path) -> None:
    file = changed_vehicle(tmp_path, "offset_m = [-1.5, 1.5]", "offset_m = [0.09, 0.51]")
    words = ("--horizon", "0.5", "--cells", "16", "--method", "growth-matrix")
    found = invoke("derive", "--vehicle", file, *words)
    assert found.status == 1
    assert "not shown for this initial set: offset may leave [0.09, 0.51] from 0." in found.out
    assert "recommended: none, no ENCLOSED method reaches the horizon" in found.out


def test_a_bound_that_explodes_is_shown_as_infinite() -> None:
    words = ("--system", "b1", "--horizon", "1", "--method", "local-norm-max")
    found = invoke("derive", *words, "--json")
    assert found.status == 0
    bound = found.data["bounds"][0]
    assert bound["proved_until_s"] < 1.0
    assert bound["mean_ratio"] is None
    assert found.data["recommended"]["method"] is None
    assert "∞" in invoke("derive", *words).out


def test_derive_writes_a_certificate_that_the_checker_accepts(tmp_path: Path) -> None:
    file = tmp_path / "bound.json"
    words = (*SHORT, "--method", "growth-matrix", "norm-max", "--certificate", file)
    found = invoke("derive", *words)
    assert found.status == 0
    assert f"wrote {file}: growth-matrix" in found.out
    assert invoke("check", file).status == 0
    refused = invoke("derive", *SHORT, "--method", "local-growth", "--certificate", file)
    assert refused.status == 2
    assert "expected one of the methods over the region" in refused.err


def test_learning_depends_on_the_seed_alone() -> None:
    words = ("learn", *SHORT, "--pairs", "50", "--json", "--seed")
    first, again, other = (invoke(*words, seed).data for seed in (4, 4, 5))
    assert first == again
    assert first["amplitude"] != other["amplitude"]
    assert first["rigor"] == "SAMPLED"
    assert first["statement"]["pairs"] == 50


def test_epsilon_sets_the_number_of_pairs() -> None:
    found = invoke("learn", *SHORT, "--epsilon", "0.05", "--delta", "1e-3", "--json").data
    assert found["statement"]["pairs"] == pairs_needed(0.05, delta=1e-3, parameters=14)
    assert found["statement"]["epsilon"] <= 0.05


def test_a_refuted_bound_leaves_a_witness_that_replays(tmp_path: Path) -> None:
    saved, out = tmp_path / "learned.json", tmp_path / "examine"
    learnt = invoke("learn", *SHORT, "--pairs", "20", "--save", saved, "--json").data
    words = ("examine", *SHORT, "--samples", "100", "--rounds", "3", "--out", out, "--json")
    found = invoke(*words, "--learned", saved)
    assert (found.status, found.data["verdict"]) == (1, "REFUTED")
    witness = found.data["witness"]
    assert witness["distance"] - witness["integration_error"] > witness["bound"]
    assert "refuted" in (out / "examine.html").read_text(encoding="utf-8")

    same = invoke(*words, "--pairs", "20").data["witness"]
    assert same["bound"] == witness["bound"], "a saved bound is read back without loss"
    assert json.loads(saved.read_text())["amplitude"] == learnt["amplitude"]

    file = out / "witness.json"
    replayed = invoke("examine", "--replay", file, "--system", "b1-small", "--json")
    assert (replayed.status, replayed.data["refutes"]) == (1, True)
    assert replayed.data["replayed_distance"] == witness["distance"]
    stored = json.loads(file.read_text())
    stored["witness"]["bound"] = 2.0 * witness["distance"]
    file.write_text(json.dumps(stored))
    assert invoke("examine", "--replay", file, "--system", "b1-small").status == 0
    other = invoke("examine", "--replay", file, "--system", "b1-brake")
    assert other.status == 2
    assert "pass the same --vehicle, --system and --curvature as then" in other.err


@pytest.mark.parametrize(("wider", "verdict"), [(2.0, "CONSISTENT"), (1e3, "IMPLIED_BY_PROOF")])
def test_a_learned_bound_is_implied_only_above_proved_ones(
    tmp_path: Path, wider: float, verdict: str
) -> None:
    saved, out = tmp_path / "learned.json", tmp_path / "examine"
    invoke("learn", *SHORT, "--pairs", "20", "--save", saved)
    learned = json.loads(saved.read_text())
    learned["amplitude"] = [wider * value for value in learned["amplitude"]]
    saved.write_text(json.dumps(learned))
    words = ("--samples", "50", "--rounds", "2", "--learned", saved, "--out", out, "--any-centre")
    found = invoke("examine", *SHORT, *words, "--json")
    assert (found.status, found.data["verdict"]) == (0, verdict)
    assert found.data["witness"] is None
    assert {each["method"] for each in found.data["proved"]} >= {"growth-matrix", "validated tube"}
    replayed = invoke("examine", "--replay", out / "witness.json", "--system", "b1-small")
    assert replayed.status == 2
    assert "there is nothing to replay" in replayed.err


@pytest.mark.parametrize(("error", "warned"), [(None, False), (-1e-3, True)])
def test_runs_beyond_a_proved_bound_are_warned_about_beyond_their_own_error(
    error: float | None, warned: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if error is not None:
        monkeypatch.setattr(
            "workbench.cli.analysis_results.integration_error", lambda *_args, **_rest: error
        )
        monkeypatch.setattr("workbench.cli.examine._write_page", lambda *_args: None)
    words = ("--pairs", "20", "--samples", "100", "--rounds", "5", "--out", tmp_path / "examine")
    found = invoke("examine", *SHORT, *words)
    assert ("beyond the proved bound validated tube" in found.err) is warned


def test_unstable_gains_warn_with_their_poles(tmp_path: Path) -> None:
    file = changed_vehicle(tmp_path, "look_ahead_m = 2.0", "look_ahead_m = 0.0")
    found = invoke("gains", "--quick", "--vehicle", file, "--horizon", "0.2", "--json")
    assert found.status == 0
    assert found.data["stable"] is False
    poles = found.data["poles_not_stable"]
    assert poles
    assert all(pole["real"] > 0.0 for pole in poles)
    for pole in poles:
        assert f"{pole['real']:+.4g}{pole['imaginary']:+.4g}j" in found.err
    assert found.err.count("warning: ") >= 2


def test_stable_gains_warn_of_nothing_and_quick_is_the_default() -> None:
    found = invoke("gains", "--horizon", "0.2")
    assert found.status == 0
    assert "asymptotically stable" in found.out
    assert "warning" not in found.err
    parser = load_command("gains").parser()
    assert parser.parse_args([]) == parser.parse_args(["--quick"])


def test_json_and_progress_keep_to_their_own_streams() -> None:
    words = ["reach", "--system", "b1", "--horizon", "0.2", "--json"]
    ran = subprocess.run(
        [sys.executable, "-m", "workbench.cli.main", *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert ran.returncode == 0
    assert json.loads(ran.stdout)["name"] == b1().name
    assert ran.stderr.startswith("tube: 100%")
