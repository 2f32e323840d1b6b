"""`workbench reach --sampled` shows the sampled tube, the continuous one and their difference."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cli_fixture import invoke

BRIEF = ("--system", "b1-small", "--horizon", "0.3")


def test_both_tubes_and_their_difference_are_shown(tmp_path: Path) -> None:
    table, page = tmp_path / "tube.csv", tmp_path / "tube.html"
    words = ("--sampled", "--rate", "20", "--jitter", "0.001", "--csv", table, "--plot", page)
    found = invoke("reach", *BRIEF, *words, "--json")
    assert found.status == 0, found.err
    data = found.data
    assert (data["rigor"], data["continuous"]["rigor"]) == ("ENCLOSED", "ENCLOSED")
    assert data["sampling"]["period_s"] == 0.05
    assert (data["sampling"]["jitter"], data["sampling"]["integral_step"]) == ("CLOCK", "NOMINAL")
    wide, narrow = (np.array(each["half_widths"]) for each in (data, data["continuous"]))
    assert np.array(data["difference"]) == pytest.approx(wide - narrow)
    text = page.read_text(encoding="utf-8")
    assert "Widths side by side" in text
    assert "sampled at 20 Hz, samples sit on a clock within +-0.001 s" in text
    rows = table.read_text(encoding="utf-8").splitlines()
    assert sum(row.startswith("step,") for row in rows) == 6
    shown = invoke("reach", *BRIEF, "--sampled", "--drift", "--jitter", "0.001")
    assert "samples drift within +-0.001 s" in shown.out
    assert "difference" in shown.out


@pytest.mark.parametrize(
    "words",
    [
        ("--sampled",),
        ("--sampled", "--drift", "--jitter", "0.001"),
        ("--sampled", "--parts", "y=2"),
        ("--switch-at", "0.1", "0.1"),
        ("--switch-at", "0.1", "0.2", "--step", "0.05"),
        ("--switch-at", "0", "0.3", "--parts", "y=2"),
    ],
    ids=" ".join,
)
def test_progress_goes_on_by_rows(words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("workbench.cli.output._SECONDS_BETWEEN_LINES", 0.0)
    shown = invoke("reach", *BRIEF, *words).err.splitlines()
    shares = [int(line.split("%")[0].split()[-1]) for line in shown]
    rows = shares[: shares.index(100)]
    assert rows == sorted(set(rows))
    assert len(rows) >= 5
    # Full with the last row, and not before; the line after it says that all is done.
    assert shares[len(rows) + 1] == 100


def test_equal_widths_differ_by_nothing() -> None:
    shown = invoke("reach", *BRIEF, "--sampled").out.splitlines()
    differences = [line.split()[1] for line in shown if line.split()[0] == "difference"]
    assert differences[:5] == ["0"] * 5


def test_commands_sent_before_the_start_count() -> None:
    words = (*BRIEF, "--sampled", "--actuation-delay", "0.1", "0.1", "--json")
    turning = invoke("reach", *words, "--sent", "0.2", "0").data
    assert [each["steering_rate_radps"] for each in turning["sent"]] == [[0.2, 0.2]] * 3
    resting = invoke("reach", *words).data
    assert resting["sent"] != turning["sent"]
    assert resting["half_widths"] != turning["half_widths"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--rate", "30"), "--sampled"),
        (("--drift",), "--sampled"),
        (("--sampled", "--rate", "0"), "> 0"),
        (("--sampled", "--jitter", "0.5"), "half the period"),
        (("--sampled", "--jitter", "-0.1"), "--jitter: expected 0 or more"),
        (("--sampled", "--drift"), "expected --jitter beside it"),
        (("--sampled", "--rate", "1e9"), "at most 20000 periods in the horizon"),
        (("--sampled", "--rate", "1e-9"), "a period of at most 60 s"),
        (("--sampled", "--actuation-delay", "1e9", "1e9"), "at most 200 periods in both delays"),
        (("--sampled", "--actuation-delay", "0.1", "0"), "0 <= LOW <= HIGH"),
        (("--sampled", "--actuation-delay", "0", "0.1"), "out of order"),
        (("--system", "b2", "--sampled", "--sent", "100", "0"), "limits, -0.2 to 0.2 rad/s, got"),
        (("--system", "b2", "--sampled", "--sent", "0", "1.1"), "limits, -2 to 1 m/s^2, got 1.1"),
        (("--system", "b2", "--sampled", "--sent", "0", "-2.1"), "ACCELERATION within the act"),
    ],
)
def test_misuse_is_refused(words: tuple[str, ...], message: str) -> None:
    found = invoke("reach", *BRIEF, *words)
    assert found.status == 2
    assert message in found.err
