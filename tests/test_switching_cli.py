"""`workbench reach --switch-at` shows one tube over the switch, and refuses what cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cli_fixture import invoke

BRIEF = ("--system", "b1-small", "--horizon", "0.4", "--step", "0.1")


def test_the_tube_over_a_switch_is_written_and_drawn(tmp_path: Path) -> None:
    table, page = tmp_path / "tube.csv", tmp_path / "tube.html"
    words = (*BRIEF, "--switch-at", "0.1", "0.2", "--brake", "reference-zero")
    found = invoke("reach", *words, "--csv", table, "--plot", page, "--json")
    assert found.status == 0, found.err
    assert (found.data["rigor"], found.data["status"]) == ("ENCLOSED", "COMPLETE")
    assert found.data["switch_between_s"] == [0.1, 0.2]
    assert "from TRACK to BRAKE at any time from 0.1 to 0.2 s" in page.read_text(encoding="utf-8")
    assert table.read_text(encoding="utf-8").startswith("kind,from_s,to_s,x_lower")
    track = invoke("reach", *BRIEF, "--json")
    speed = found.data["states"].index("speed")
    ends = [np.array(each.data["half_widths"])[-1, speed] for each in (found, track)]
    assert ends[0] > ends[1]


def test_the_raw_speed_of_a_standing_car_is_no_exit_from_the_region(tmp_path: Path) -> None:
    page = tmp_path / "tube.html"
    words = ("--horizon", "1.4", "--step", "0.1", "--plot", page, "--json")
    found = invoke("reach", "--switch-at", "0", "0", *words)
    assert found.status == 0, found.err
    low = found.data["leaves_operating_region"] or ""
    assert "speed" not in low
    assert "the car stands where it is 0 or below" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--switch-at", "0.3", "0.1"), "FROM <= TO"),
        (("--switch-at", "0.3", "0.5"), "--horizon"),
        (("--switch-at", "0.1", "0.2", "--sampled"), "leave one of them out"),
        (("--brake", "vehicle"), "--switch-at"),
    ],
)
def test_misuse_is_refused(words: tuple[str, ...], message: str) -> None:
    found = invoke("reach", *BRIEF, *words)
    assert found.status == 2
    assert message in found.err


def test_a_loop_that_brakes_cannot_switch_to_braking() -> None:
    found = invoke("reach", "--system", "b1-brake", "--switch-at", "0.1", "0.2")
    assert found.status == 2
    assert "TRACK" in found.err
