"""`workbench intent --score` prints the tables of the functions that make them, nothing beside."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from cli_fixture import invoke
from guard_walkers import crowd
from motion_cases import write_peds

from workbench.estimation.guard_scores import fit_folder, guard_lines, guard_table
from workbench.estimation.guard_shipped import shipped_guards
from workbench.estimation.guard_violations import violation_lines, violation_table
from workbench.estimation.motion_parameters import shipped_motion
from workbench.estimation.prediction_scores import score_motion
from workbench.runtime.person_guard import MotionLimits


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_peds(tmp_path, crowd(3, 2, 4, MotionLimits(2.0, 1.0)))
    return tmp_path


@pytest.mark.parametrize("choice", ["guard", "guard-shipped"])
def test_the_guard_is_scored(folder: Path, choice: str) -> None:
    fit = shipped_guards() if choice == "guard-shipped" else None
    found = invoke("intent", folder, "--score", choice)
    assert (found.status, found.out) == (
        0, "\n".join(guard_lines(guard_table(folder, fit=fit))) + "\n"
    )  # fmt: skip


def test_a_guard_fitted_at_one_place_is_judged_at_another(tmp_path: Path) -> None:
    people = crowd(3, 2, 4, MotionLimits(2.0, 1.0))
    first = people[0].recording
    parts = {
        "all": people,
        "first": [each for each in people if each.recording == first],
        "others": [each for each in people if each.recording != first],
    }
    for name, part in parts.items():
        (tmp_path / name).mkdir()
        write_peds(tmp_path / name, part)
    found = invoke("intent", tmp_path / "all", "--score", "guard", "--fit-on", first)
    table = guard_table(tmp_path / "others", fit=fit_folder(tmp_path / "first"))
    assert (found.status, found.out) == (0, "\n".join(guard_lines(table)) + "\n")


@pytest.mark.parametrize("options", [("guard", "no*"), ("guard", "*"), ("motion", "*")])
def test_recordings_to_fit_on_leave_others_to_judge(folder: Path, options: tuple[str, str]) -> None:
    found = invoke("intent", folder, "--score", options[0], "--fit-on", options[1])
    assert (found.status, "expected" in found.err) == (2, True)


def test_contradictions_are_counted(folder: Path) -> None:
    found = invoke("intent", folder, "--score", "guard-violations")
    lines = "\n".join(violation_lines(violation_table(folder)))
    assert (found.status, found.out) == (0, lines + "\n")


def test_the_motion_is_scored(folder: Path) -> None:
    found = invoke("intent", folder, "--score", "motion")
    assert found.status == 0
    assert found.out.strip() == score_motion(folder, shipped_motion()).text().strip()


def test_one_thing_at_a_time(folder: Path) -> None:
    found = invoke("intent", folder, "--score", "guard", "--plot", folder / "x.html")
    assert found.status == 2
    assert "expected one of --plot, --score guard at a time" in found.err
    assert not (folder / "x.html").exists()
