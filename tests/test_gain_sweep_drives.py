"""The present gains and the best of the front drive, each with its own bundle; who did not drive
has no value and is not recommended."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pyarrow", reason="needs the optional package pyarrow")

from cli_fixture import invoke
from gain_sweep_cases import DRIVES, row, study, with_drives
from hypothesis import given
from hypothesis import strategies as st
from survey_cases import row as drive_row

from workbench.errors import InputError
from workbench.models.vehicle import gem_e2_path
from workbench.simulation.campaign.rows import Row
from workbench.simulation.campaign.workers import InProcess
from workbench.simulation.gain_sweep import driving
from workbench.simulation.gain_sweep.deciding import cost_rows, finalists, verdict
from workbench.simulation.gain_sweep.drives_section import Drives, drives_section
from workbench.simulation.gain_sweep.figures import DRIVEN
from workbench.simulation.gain_sweep.gains import GAINS, own_gains
from workbench.simulation.gain_sweep.plan import Decision, load_plan
from workbench.simulation.gain_sweep.store import SweepStore
from workbench.simulation.scenarios.shipped import library

PLAIN = Decision({}, {}, ("lateral_3s_m", "settling_s"), "lateral_3s_m")
BOUNDED = dataclasses.replace(PLAIN, at_most={"needless_per_km": 1.0})
WIDTHS = st.lists(st.floats(0.1, 9.0), min_size=1, max_size=8)


def _rows(widths: list[float]) -> list[dict[str, Any]]:
    return [row(k, lateral_3s_m=w, settling_s=1.0 / w) for k, w in enumerate(widths)]


def _figures(**changed: float) -> dict[str, float]:
    return {**dict.fromkeys(DRIVEN, 0.0), **changed}


@given(WIDTHS)
def test_the_present_gains_and_the_best_of_the_front_drive(widths: list[float]) -> None:
    plan = dataclasses.replace(PLAN, decision=BOUNDED)
    found = finalists(_rows(widths), plan)
    assert found[0] == 0
    assert len(set(found)) == len(found) <= 3
    others = sorted({widths[k] for k in found[1:]})
    assert all(w >= max(others, default=0.0) for k, w in enumerate(widths) if k not in found)
    assert finalists(_rows(widths), dataclasses.replace(plan, drives=None)) == ()


@given(WIDTHS, st.sets(st.integers(0, 7)))
def test_who_did_not_drive_is_not_recommended(widths: list[float], drove: set[int]) -> None:
    driven = {k: _figures() for k in {0, *drove} if k < len(widths)}
    found = verdict(_rows(widths), PLAIN, driven)
    if found.best is not None:
        assert found.best.index in driven
    for point in found.points:
        assert math.isnan(point.figures["contacts"]) == (point.index not in driven)


def test_bounds_on_drives_count() -> None:
    rows = _rows([3.0, 1.0, 2.0, 0.5])
    driven = {0: _figures(needless_per_km=2.0), 1: _figures(needless_per_km=1.5), 2: _figures()}
    found = verdict(rows, BOUNDED, driven)
    assert found.best is found.points[2]
    assert "needless stops per km (1/km) 1.5 > 1" in found.points[1].fails
    assert not found.points[3].keeps
    words = {figure.name: word for figure, _, _, word in cost_rows(found)}
    assert words["needless_per_km"] == "better"
    assert "contacts" not in {f.name for f, *_ in cost_rows(verdict(rows, PLAIN))}


def test_rates_are_those_of_all_drives_together() -> None:
    rows = [
        drive_row(0, way_m=400.0, time_s=100.0, needless_stops=1, waited_s=5.0, stood_s=5.0),
        drive_row(1, way_m=100.0, time_s=150.0, needless_stops=2, waited_s=0.0, stood_s=40.0,
                  contact=True),
    ]  # fmt: skip
    found = driving.summed(rows)
    assert found == {
        "needless_per_km": 6.0, "standing": 0.2, "contacts": 1.0, "avoidable": 0.0,
        "driven_mps": 2.0, "driven_km": 0.5,
    }  # fmt: skip
    still = driving.summed([drive_row(0, way_m=0.0)])
    assert math.isnan(still["needless_per_km"])


def _stood_in(task: driving.DriveTask) -> list[Row]:
    """More needless stops with a larger kp; no drive takes place."""
    kp = task.gains[list(GAINS).index("kp")]
    return [drive_row(k, needless_stops=round(1000 * kp)) for k in task.numbers]


@pytest.fixture
def swept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A sweep whose drives are stood in for."""
    monkeypatch.setattr(driving, "build_point", lambda _task: None)
    monkeypatch.setattr(driving, "drive_part", _stood_in)
    file = with_drives(tmp_path)
    found = invoke("gains", "sweep", file, "--out", tmp_path / "out", "--json")
    assert found.status == 0, found.err
    assert found.data["drives"] == 12
    return tmp_path


def test_what_drove_is_stored_and_shown(swept: Path) -> None:
    out = swept / "out"
    again = invoke("gains", "sweep", swept / "study.toml", "--out", out, "--json")
    assert (again.data["new"], again.data["drives"]) == (0, 0)
    found = invoke("gains", "recommend", "--out", out, "--json")
    assert found.status == 0, found.err
    best = found.data["recommended"]
    assert best["needless_per_km"] == pytest.approx(round(1000 * best["kp"]) / 0.026)
    assert "4 drives" not in found.data["why"]
    assert "drove each 2 scenarios with 2 seeds" in found.data["why"]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("needless stops per km") >= 3
    header = (out / "points.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "needless_per_km" in header
    part = next((out / "drives").glob("*/*.parquet"))
    part.unlink()
    lacking = invoke("gains", "recommend", "--out", out)
    assert (lacking.status, "4 drives too few" in lacking.err) == (2, True)
    assert (
        invoke("gains", "sweep", swept / "study.toml", "--out", out, "--json").data["drives"] == 4
    )
    assert part.exists()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("nobody_s_bend", "nobody_s_bent", "did you mean nobody_s_bend"),
        ('["nobody_s_bend", "standing_far_beside"]', "[]", "list of names"),
        ("seeds = [1, 2]", "seeds = [1, 1]", "each once"),
        ("seeds = [1, 2]", "seeds = [1.5]", "whole numbers"),
        ("finalists = 2", "finalists = 0", "whole numbers >= 1"),
        ("finalists = 2", 'finalists = 2\nplant = "boat"', "one of bicycle"),
        ("finalists = 2", 'finalists = 2\npolicy = "best"', "one of LookAhead"),
    ],
)
def test_drives_that_cannot_be_are_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert DRIVES.count(old) == 1
    with pytest.raises(InputError, match=said):
        load_plan(with_drives(tmp_path, DRIVES.replace(old, new)))


def test_figures_of_drives_need_drives(tmp_path: Path) -> None:
    bound = "\n[decide.at_most]\nneedless_per_km = 1\n"
    with pytest.raises(InputError, match=r"section \[drives\] too"):
        load_plan(with_drives(tmp_path, bound))
    assert load_plan(with_drives(tmp_path, bound + DRIVES)).decision.at_most
    alone = study(tmp_path, 'trade = ["lateral_3s_m", "settling_s"]\nchoose = "lateral_3s_m"',
                  'trade = ["standing"]\nchoose = "standing"')  # fmt: skip
    alone.write_text(alone.read_text(encoding="utf-8") + DRIVES, encoding="utf-8")
    with pytest.raises(InputError, match="that every point has"):
        load_plan(alone)


def test_a_car_without_drive_by_wire_does_not_drive(tmp_path: Path) -> None:
    file = with_drives(tmp_path)
    text = file.read_text(encoding="utf-8")
    named = text.replace("[gains]", f'vehicle = "{gem_e2_path()}"\n\n[gains]', 1)
    file.write_text(named, encoding="utf-8")
    with pytest.raises(InputError, match=r"\[drive_by_wire\]"):
        SweepStore(tmp_path / "out").begin(file)
    assert not (tmp_path / "out").exists()


def test_a_point_drives_with_its_own_gains(tmp_path: Path) -> None:
    store = SweepStore(tmp_path / "out")
    plan = store.begin(with_drives(tmp_path))
    assert plan.drives is not None
    gains = {**own_gains(store.vehicle()), "kp": 0.01, "speed-kp": 0.5}
    task = driving.DriveTask(
        str(store.folder), 3, tuple(gains[name] for name in GAINS), plan.drives, 0, 0
    )
    driving.build_point(task)
    ((_, found),) = InProcess().done(driving.drive_part, [task])
    assert [(each.index, each.plant, each.contender) for each in found] == [(0, "bicycle", "both")]
    assert found[0].passed
    assert found[0].way_m > 20.0
    rig = driving._rig(task)
    known = {p.name: p.nominal for p in rig.bundle.manifest.parameters}
    assert known["steering_gain_proportional"] == 0.01
    assert known["speed_gain_proportional"] == 0.5
    assert driving.drive_part(task) == found


def test_a_study_may_drive_the_whole_library() -> None:
    found = drives_section({"scenarios": "library", "finalists": 1})
    # All but the story in which nobody could prevent the contact.
    assert set(library()) - set(found.scenarios) == {"wall_child_unseen"}
    assert found.count == len(library()) - 1 > 50
    several = Drives(("a", "b"), "bicycle", "both", (1, 2, 3), 1)
    assert [several.drive(k) for k in (0, 2, 3, 5)] == [("a", 1), ("a", 3), ("b", 1), ("b", 3)]


PLAN = load_plan(Path(__file__).parents[1] / "studies" / "steering_gains.toml")
PLAN = dataclasses.replace(PLAN, drives=Drives(("nobody_s_bend",), "bicycle", "both", (1,), 2))
