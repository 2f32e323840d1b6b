"""`workbench simulate` drives a scenario, says truthfully what came of it, and leaves its files."""

from __future__ import annotations

import csv
import itertools
import math
import multiprocessing
import time
from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the extra analysis")

from cli_fixture import Result, invoke

from workbench.cli import simulate, simulate_drive, simulate_page, simulate_table
from workbench.models.vehicle import gem_e2
from workbench.simulation import scene
from workbench.simulation.campaign.survey_drive import CLEAR_M
from workbench.simulation.plants.make import PLANTS
from workbench.simulation.runlog import read_log
from workbench.simulation.scenarios.scenario_file import POLICIES
from workbench.simulation.scenarios.shipped import library
from workbench.simulation.simulated import build_rig, simulated_path

SCENARIO = """
title = "A test"
story = "Somebody stands."
waypoints = [[0, 0], [10, 0], [20, 0], [30, 0], [40, 0]]
duration_s = {duration}
passed_m = {passed}
[expected]
LookAhead = "{expected}"
FailSafe = "{expected}"
both = "{expected}"
[[people]]
walker = "standing"
name = "stands"
begin = [{station}, {lateral}]
{more}
"""
GOALS = """
[[goals]]
name = "door"
x_m = 20.0
y_m = 12.0
spread_m = 1.5
"""


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built") / "bundle"
    build_rig(folder)
    return folder


def written(folder: Path, expected: str, *, name: str = "stands", **changed: object) -> Path:
    values = {"station": 12.0, "lateral": 9.0, "passed": 6.0, "duration": 9.0, "more": ""}
    assert changed.keys() <= values.keys()
    values |= changed
    file = folder / f"{name}.toml"
    file.write_text(SCENARIO.format(expected=expected, **values), encoding="utf-8")
    return file


def turns(folder: Path) -> list[dict[str, str]]:
    with (folder / "turns.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_the_words_of_the_options_are_those_of_the_library() -> None:
    assert simulate.PLANTS == PLANTS
    assert simulate.POLICIES == POLICIES


def test_the_list_has_every_scenario_and_what_is_expected() -> None:
    shown = invoke("simulate", "--list", "--json")
    assert [each["name"] for each in shown.data] == list(library())
    assert all(set(each["expected"]) == set(POLICIES) for each in shown.data)
    listed = invoke("simulate", "--list").out
    assert all(name in listed for name in library())


def test_a_drive_leaves_a_page_a_log_and_a_table_that_agree(bundle: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("simulate", written(tmp_path, "passes"), "--bundle", bundle, "--out", out, "--json")
    found = invoke(*words)
    assert found.status == 0, found.err
    assert (found.data["as_expected"], found.data["needless_brakes"]) == (True, 0)
    assert sorted(file.name for file in out.iterdir()) == ["report.html", "run.jsonl", "turns.csv"]
    rows, log = turns(out), read_log(out / "run.jsonl")
    outcome = found.data["outcome"]
    assert outcome["way_m"] == pytest.approx(float(rows[-1]["station_m"]), abs=1e-4)
    assert outcome["fastest_mps"] == pytest.approx(max(float(r["speed_mps"]) for r in rows))
    first = next(float(row["time_s"]) for row in rows if row["mode"] == "TRACKING")
    assert outcome["set_off_s"] == pytest.approx(first, abs=1e-5)
    assert {row["nearest_person"] for row in rows} == {"stands"}
    # The driven car's left side is half its width from the path, the person's disc 0.3 m around.
    passing = [row for row in rows if abs(float(row["x_m"]) - 12.0) < 0.4]
    for row in passing:
        left_m = float(row["y_m"]) + gem_e2().geometry.half_width_m
        assert float(row["nearest_m"]) == pytest.approx(9.0 - 0.3 - left_m, abs=0.15)
    assert log.header["scenario"] == "stands"
    assert len(log.entries) == pytest.approx(9.0 * 10.0, abs=5)
    assert found.data["times_faster_than_real_time"] == pytest.approx(
        found.data["duration_s"] / found.data["took_s"]
    )


def test_who_stands_on_the_path_makes_the_car_brake_and_that_is_not_needless(
    bundle: Path, tmp_path: Path
) -> None:
    words = ("--bundle", bundle, "--out", tmp_path / "out")
    on_path = {"station": 14.0, "lateral": 0.0, "passed": 30.0}
    file = written(tmp_path, "passes", **on_path)
    found = invoke("simulate", file, *words, "--json")
    assert found.status == 1
    assert found.data["never_braking_nearest_m"] < CLEAR_M
    assert len(found.data["outcome"]["brakes"]) >= 1
    assert found.data["needless_brakes"] == 0
    again = invoke("simulate", written(tmp_path, "brakes", **on_path), *words, "--desk")
    assert again.status == 0, again.out + again.err
    assert "as expected" in again.out
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<td>needed</td>" in page
    assert "<td>needless</td>" not in page
    assert "expected of both: passes" in page


def test_braking_for_who_stands_beside_the_way_is_needless(bundle: Path, tmp_path: Path) -> None:
    file = written(tmp_path, "any", station=14.0, lateral=1.9, passed=30.0)
    words = ("--bundle", bundle, "--out", tmp_path / "out", "--json")
    found = invoke("simulate", file, *words)
    assert found.data["never_braking_nearest_m"] >= CLEAR_M
    assert found.data["needless_brakes"] == len(found.data["outcome"]["brakes"]) >= 1
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<td>needless</td>" in page
    assert "<td>needed</td>" not in page


def test_a_fault_without_decisions_is_on_the_page_and_in_the_log(
    bundle: Path, tmp_path: Path
) -> None:
    lost = '[[sensing.dropouts]]\nwhat = "localisation"\nfrom_s = 4.0\nuntil_s = 6.0'
    file = written(tmp_path, "any", passed=30.0, more=lost)
    out = tmp_path / "out"
    found = invoke("simulate", file, "--bundle", bundle, "--out", out, "--json")
    assert len(found.data["outcome"]["brakes"]) == 1
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "nothing failed" not in page
    assert "<td>LOCALISATION_LOST</td>" in page
    # The reason of the braking, which no decision gives.
    assert "<td>LOCALISATION_LOST: " in page
    log = read_log(out / "run.jsonl")
    silent = log.header["undecided"]
    assert {each["sent"] for each in silent} == {"BRAKE"}
    named = [text.partition(":")[0] for each in silent for text in each["violations"]]
    assert set(named) == {"LOCALISATION_LOST"}
    times = [entry.frame.t_s for entry in log.entries]
    gap = max(itertools.pairwise(times), key=lambda pair: pair[1] - pair[0])
    assert gap[1] - gap[0] > 0.8
    assert sum(gap[0] < each["t_s"] < gap[1] for each in silent) > 8


def test_braking_after_the_car_has_passed_is_not_judged(bundle: Path, tmp_path: Path) -> None:
    file = written(tmp_path, "passes", station=14.0, lateral=0.0, passed=1.0)
    out = tmp_path / "out"
    found = invoke("simulate", file, "--bundle", bundle, "--out", out, "--json")
    assert found.status == 0, found.err
    assert found.data["outcome"]["brakes"] == []
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<td>not judged: after it had passed</td>" in page
    assert "<td>needed</td>" not in page
    assert f"workbench simulate {file} --bundle {bundle}" in page
    assert "--plant single-track" in page


def test_estimated_intents_reach_the_log(bundle: Path, tmp_path: Path) -> None:
    file = written(tmp_path, "any", duration=4.0, more=GOALS)
    out = tmp_path / "out"
    found = invoke("simulate", file, "--bundle", bundle, "--out", out, "--intents", "--seed", 3)
    assert found.status == 0, found.err
    last = read_log(out / "run.jsonl").entries[-1].frame.people[0]
    assert {goal for goal, _ in last.wanted} == {"door", "unknown"}
    assert sum(share for _, share in last.wanted) == pytest.approx(1.0, abs=1e-5)


def test_several_scenarios_make_a_table_that_no_number_of_processes_changes(
    bundle: Path, tmp_path: Path
) -> None:
    files = [
        written(tmp_path, "passes", name="first", duration=8.0),
        written(tmp_path, "collides", name="second", duration=3.0),
    ]
    words = ("simulate", *files, "--bundle", bundle, "--desk", "--json")
    alone, shared = invoke(*words), invoke(*words, "--jobs", 2)
    assert (alone.status, shared.status) == (1, 1)
    assert [row["as_expected"] for row in alone.data["rows"]] == [True, False]
    assert alone.data["as_expected"] == 1
    for one, other in zip(alone.data["rows"], shared.data["rows"], strict=True):
        assert {**one, "faster": 0} == {**other, "faster": 0}


def test_what_is_still_driven_ends_with_the_table(bundle: Path, tmp_path: Path) -> None:
    files = [
        written(tmp_path, "any", name="long", duration=3000.0),
        written(tmp_path, "any", name="short", duration=2.0),
    ]
    tasks = [
        simulate_table.Task(bundle, simulated_path(), None, str(file), "bicycle", "both", 0, True)
        for file in files
    ]
    coming = simulate_table._rows(tasks, 2)
    assert next(coming).scenario == str(files[1])
    since_s = time.monotonic()
    coming.close()
    assert time.monotonic() - since_s < 5.0
    for each in multiprocessing.active_children():
        each.join(5.0)
    assert multiprocessing.active_children() == []


def test_every_plant_and_policy_is_driven_in_order(bundle: Path, tmp_path: Path) -> None:
    file = written(tmp_path, "any", duration=2.0)
    words = ("--bundle", bundle, "--desk", "--plant", "every", "--policy", "every", "--json")
    found = invoke("simulate", file, *words)
    assert found.status == 0, found.err
    driven = [(row["plant"], row["policy"]) for row in found.data["rows"]]
    assert driven == list(itertools.product(PLANTS, POLICIES))


def test_the_whole_library_goes_on_all_plants(
    bundle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[simulate_table.Task] = []

    def driven(task: simulate_table.Task) -> simulate_table.Row:
        asked.append(task)
        return simulate_table.Row(
            task.scenario, task.plant, task.policy, "any", "", task.plant != "bicycle", 2.0
        )

    monkeypatch.setattr(simulate_table, "row_of", driven)
    found = invoke("simulate", "--all", "--bundle", bundle, "--policy", "FailSafe")
    assert found.status == 1
    assert {(t.scenario, t.plant) for t in asked} == set(itertools.product(library(), PLANTS))
    assert {task.policy for task in asked} == {"FailSafe"}
    share = f"{2 * len(library())} of {3 * len(library())} drives are as expected"
    assert share in found.out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "expected one of SCENARIO"),
        (("--all", "--list"), "expected one of SCENARIO"),
        (("nobody_s_bend", "--all"), "expected one of SCENARIO"),
        (("nobody_s_bent",), "did you mean nobody_s_bend"),
        (("no.toml",), "no.toml"),
        (("no.xml",), "no.xml"),
        (("nobody_s_bend", "--desk", "--real-time"), "expected one of --desk"),
        (("nobody_s_bend", "nobody_tight_bend", "--intents"), "expected one SCENARIO"),
        (("nobody_s_bend", "--real-time", "--plant", "every"), "expected one SCENARIO"),
        (("nobody_s_bend", "--intents"), "without; add where people may want to go"),
        (("nobody_s_bend", "--bundle", "b", "--horizon", "2"), "expected without --horizon"),
        (("nobody_s_bend", "--bundle", "b", "--real-time"), "leave --bundle out"),
        (("nobody_s_bend", "--sensors", "none.toml"), "--sensors: expected a file"),
        (("nobody_s_bend", "--bundle", "no-bundle"), "no-bundle"),
        (("Nobody_S_Bent",), "did you mean nobody_s_bend"),
        (("nobody_s_bend", "--out", ""), "expected the name of a folder, got ''"),
        (("nobody_s_bend", "--vehicle", "."), ".: expected a vehicle file that can be read"),
        (("nobody_s_bend", "--horizon", "1e9"), "--horizon: expected 0.05 to 17.5 s in whole st"),
        (("nobody_s_bend", "--horizon", "0.001"), "--horizon: expected 0.05 to 17.5 s"),
        (("nobody_s_bend", "--horizon", "0.77"), "whole steps of 0.05 s, got 0.77; 3 is usual"),
        (("nobody_s_bend", "--localiser", "--site", "none.toml"), "no such site file"),
        (("nobody_s_bend", "--jobs", "2"), "--jobs: expected with a table"),
        (("--list", "--desk"), "--list: expected alone, got --desk"),
    ],
)
def test_wrong_use_is_told_and_leaves_nothing(
    words: tuple[str, ...], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = invoke("simulate", *words)
    assert (found.status, found.out) == (2, ""), found
    assert told in found.err
    assert list(tmp_path.iterdir()) == []


def test_a_path_that_the_car_cannot_steer_is_refused_before_any_work(tmp_path: Path) -> None:
    file = written(tmp_path, "any")
    bent = "[[0, 0], [8, 0], [8.5, 0.2], [8.5, 8], [8, 8.5], [0, 8]]"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("[[0, 0], [10, 0], [20, 0], [30, 0], [40, 0]]", bent))
    for words in ((), ("--plant", "every", "--desk")):
        found = invoke("simulate", file, *words)
        assert found.status == 2
        # tan(0.6 rad) over 1.75 m.
        assert "expected a path with a curvature of at most 0.391 1/m" in found.err
        assert "at station" in found.err


def test_a_file_for_a_folder_is_named_as_one(bundle: Path, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    for out in ("taken", "taken/more"):
        found = invoke("simulate", "nobody_s_bend", "--bundle", bundle, "--out", tmp_path / out)
        assert found.status == 2
        assert "it is a file, or lies in one" in found.err


def test_what_is_too_far_for_a_distance_is_said_in_metres() -> None:
    assert f" {scene._FAR_M:g} m " in simulate_drive.FAR_WORDS


def test_a_bundle_of_another_car_is_refused(bundle: Path, tmp_path: Path) -> None:
    from workbench.simulation.simulated import simulated_path

    old = simulated_path().read_text(encoding="utf-8")
    file = tmp_path / "wide.toml"
    file.write_text(old.replace("half_width_m = 0.8825", "half_width_m = 0.95"), encoding="utf-8")
    found: Result = invoke("simulate", "nobody_s_bend", "--bundle", bundle, "--vehicle", file)
    assert found.status == 2
    assert "half_width_m = 0.95" in found.err


def test_way_to_standstill_is_that_of_constant_deceleration() -> None:
    brake = gem_e2().brake
    least, greatest = simulate_page.stopping_m(brake, 2.0)
    assert least == pytest.approx(2.0 * brake.delay_s + 2.0 / brake.deceleration_max_mps2)
    slow_s = brake.delay_s + brake.build_up_s
    assert greatest == pytest.approx(2.0 * slow_s + 2.0 / brake.deceleration_min_mps2)
    assert simulate_page.stopping_m(brake, -0.1) == (0.0, 0.0)
    assert math.isfinite(greatest)
