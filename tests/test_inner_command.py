"""`workbench inner` shows what was computed, writes its page, and fails when a proof ends early."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_fixture import SHORT, invoke

from workbench.models.benchmarks import b1_small
from workbench.reach import TubeStatus
from workbench.reach.inner.hull import InnerHull, inner_hull


def test_it_reports_both_sides_and_their_witnesses(tmp_path: Path) -> None:
    page = tmp_path / "inner.html"
    found = invoke("inner", *SHORT, "--plot", page, "--json")
    assert (found.status, found.data["status"], found.data["inner_status"]) == (
        0,
        "COMPLETE",
        "COMPLETE",
    )
    assert found.data["rigor"] == found.data["inner_rigor"] == "ENCLOSED"
    data = {key: np.array(found.data[key]) for key in ("inner_lower", "inner_upper")}
    assert np.all(data["inner_lower"][1:] >= np.array(found.data["tube_lower"])[1:])
    assert np.all(data["inner_upper"][1:] <= np.array(found.data["tube_upper"])[1:])
    assert all(1.0 <= ratio <= 1.1 for ratio in found.data["mean_ratio"])
    for lower, upper in found.data["witnesses"].values():
        assert b1_small().initial_set.contains(lower["initial_state"])
        assert lower["initial_state"] != upper["initial_state"]
    assert "from both sides" in page.read_text(encoding="utf-8")
    assert "certainly reached" in page.read_text(encoding="utf-8")
    assert "mean ratio" in page.read_text(encoding="utf-8")


def test_the_table_has_a_ratio_per_instant_and_state() -> None:
    found = invoke("inner", *SHORT, "--rounds", "1", "--starts", "4")
    assert found.status == 0
    assert "0.5 s tube" in found.out
    assert "offset_integral" in found.out
    assert "validated trajectories up to 0.500 s" in found.out


def test_a_proof_that_ends_early_fails_the_claim(monkeypatch: pytest.MonkeyPatch) -> None:
    def ended(*args: Any, **rest: Any) -> InnerHull:
        found = inner_hull(*args, **rest)
        return dataclasses.replace(
            found,
            times=found.times[:5],
            lower_at=found.lower_at[:5],
            upper_at=found.upper_at[:5],
            status=TubeStatus.SINGULAR,
            message="a pole",
        )

    monkeypatch.setattr("workbench.reach.inner.hull.inner_hull", ended)
    found = invoke("inner", *SHORT, "--rounds", "1", "--starts", "4")
    assert found.status == 1
    assert "SINGULAR, ENCLOSED" in found.out
    assert "up to 0.200 s only (a pole)" in found.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--rounds", "0"), "a whole number >= 1"),
        (("--starts", "100000000000"), "--starts: expected at most 100000"),
        (("--step", "0.0001"), "expected at most 1000 steps"),
        (("--plot", "/dev/null/x.html"), "--plot: expected a file that can be written"),
    ],
)
def test_wrong_use_is_answered(words: tuple[str, ...], message: str) -> None:
    found = invoke("inner", *words)
    assert found.status == 2
    assert message in found.err
