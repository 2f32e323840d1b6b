"""`workbench intent --score` prints the tables of the functions that make them, nothing beside."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from cli_fixture import invoke
from guard_walkers import crowd
from motion_cases import write_peds

from workbench.estimation.guard_scores import guard_lines, guard_table
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
