"""`workbench examine` tells the truth about every form and simulator, and its files replay."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from cli_fixture import SHORT, invoke

from workbench.cli.analysis_options import Subject
from workbench.cli.derive import METHODS
from workbench.cli.examine import ALL, _methods
from workbench.cli.examine_bounds import proved_beside
from workbench.models.benchmarks import b1_small
from workbench.reach.inner.distance import proved_distance

FAST = ("--samples", "60", "--rounds", "2", "--starts", "1")
SLIDE = """\
def slide(state, times, seed):
    place, speed = map(float, state)
    return [(place + speed * t, speed) for t in times]
"""
START = ("--start", "place", "-1", "1", "--start", "speed", "-2", "2")
GRID = ("--horizon", "1", "--step", "0.25")


def _function(folder: Path) -> tuple[str, ...]:
    file = folder / "slides.py"
    file.write_text(SLIDE)
    return ("--from", f"{file}:slide", *START, *GRID)


def _scaled(file: Path, factor: float) -> None:
    """Every amplitude of a learned file of the form `set`, times `factor`."""
    stored = json.loads(file.read_text())
    stored["amplitude"] = [factor * value for value in stored["amplitude"]]
    file.write_text(json.dumps(stored))


@pytest.mark.parametrize(
    "form",
    [("--form", "set"), ("--form", "piecewise"), ("--form", "matrix"), ("--published",)],
)
def test_every_form_is_examined_and_its_witness_is_proved(
    form: tuple[str, ...], tmp_path: Path
) -> None:
    out = tmp_path / "examine"
    pairs = () if form[0] == "--published" else ("--pairs", "20")
    found = invoke("examine", *SHORT, *form, *pairs, *FAST, "--out", out, "--json")
    assert found.data["verdict"] == "REFUTED"
    assert found.status == 1
    low, high = found.data["witness_proved_between"]
    witness = found.data["witness"]
    error = witness["integration_error"] + 1e-15
    assert witness["bound"] < low
    assert low - error <= witness["distance"] <= high + error
    model = b1_small().system
    again = proved_distance(
        model,
        (witness["first"], witness["second"]),
        parameters=witness["parameters"],
        time_s=witness["time_s"],
        state=witness["coordinate"],
    )
    assert again == pytest.approx((low, high), abs=1e-12)


def test_proved_methods_of_every_family_stand_beside_with_their_tightness(tmp_path: Path) -> None:
    out = tmp_path / "examine"
    chosen = ("growth-matrix", "local-growth", "sensitivity-linear")
    words = ("--pairs", "20", *FAST, "--out", out, "--json", "--method", *chosen)
    found = invoke("examine", *SHORT, *words)
    proved: dict[str, Any] = {each["method"]: each for each in found.data["proved"]}
    assert list(proved) == [*chosen, "validated tube"]
    assert found.data["refusals"] == {}
    tube = proved["validated tube"]
    assert tube["rigor"] == "ENCLOSED"
    assert all(1.0 - 1e-6 <= value < 1.05 for value in tube["tightness"].values())
    for each in proved.values():
        assert each["worst"] <= 1.0 + 1e-6
    page = (out / "examine.html").read_text(encoding="utf-8")
    for words_on_page in ("reached for certain", "sampled and searched", "Tightness", "learned"):
        assert words_on_page in page


def test_what_is_reached_for_certain_lies_below_what_is_proved() -> None:
    model = b1_small()
    subject = Subject(model.name, model.system, model.initial_set, None)
    beside = proved_beside(subject, horizon_s=0.2, step_s=0.05, methods=["growth-matrix"])
    assert beside.inner is not None
    times, reached = beside.inner
    tube = beside.bounds["validated tube"]
    half_widths = tube.half_widths  # type: ignore[union-attr]
    for t, row in zip(times.tolist(), reached.tolist(), strict=True):
        for least, most in zip(row, half_widths(t), strict=True):
            assert least <= most <= 1.1 * least + 1e-6


def test_a_function_is_examined_by_samples_and_says_so(tmp_path: Path) -> None:
    words, saved, out = _function(tmp_path), tmp_path / "learned.json", tmp_path / "out"
    assert invoke("learn", *words, "--pairs", "30", "--save", saved).status == 0
    _scaled(saved, 0.9)
    tried = ("--samples", "30", "--out", out, "--json")
    found = invoke("examine", *words, "--learned", saved, *tried)
    assert (found.status, found.data["verdict"]) == (1, "REFUTED")
    assert "without gradients; nothing is proved" in found.data["search"]
    assert found.data["proved"] == []
    file = out / "witness.json"
    replayed = invoke("examine", *words, "--replay", file, "--json")
    assert (replayed.status, replayed.data["refutes"]) == (1, True)
    assert replayed.data["replayed_distance"] == found.data["witness"]["distance"]
    other = invoke("examine", *words[:-1], "0.5", "--replay", file)
    assert other.status == 2
    assert "times_s differs" in other.err
    _scaled(saved, 2.0)
    loose = invoke("examine", *words, "--learned", saved, "--rounds", "1", *tried)
    assert (loose.status, loose.data["verdict"]) == (0, "CONSISTENT")
    assert "finite differences" in loose.data["search"]
    assert "nothing to replay" in invoke("examine", *words, "--replay", file).err


def test_a_function_that_ends_its_process_does_not_end_the_trial_in_silence(
    tmp_path: Path,
) -> None:
    file, mode = tmp_path / "leaves.py", tmp_path / "mode"
    mode.write_text("stay")
    file.write_text(
        "import os\nimport pathlib\n\n\n"
        "def run(state, times, seed):\n"
        "    if (pathlib.Path(__file__).parent / 'mode').read_text() == 'leave':\n"
        "        os._exit(0)\n"
        "    return [[state[0] * (1.0 + t)] for t in times]\n"
    )
    start = ("--start", "a", "0.5", "1", *GRID)
    words, saved = ("--from", f"{file}:run", *start), tmp_path / "learned.json"
    assert invoke("learn", *words, "--pairs", "20", "--save", saved).status == 0
    mode.write_text("leave")
    out = tmp_path / "out"
    left = invoke("examine", *words, "--learned", saved, "--samples", "20", "--out", out)
    assert left.status == 2
    assert "what it ran ended it" in left.err
    assert not out.exists() or not any(out.iterdir())


def test_a_spoilt_witness_of_a_function_is_refused(tmp_path: Path) -> None:
    words, out = _function(tmp_path), tmp_path / "out"
    invoke("examine", *words, "--pairs", "20", "--samples", "20", "--out", out)
    file = out / "witness.json"
    stored = json.loads(file.read_text())
    for change, message in (
        ({"witness": {**stored["witness"], "first": [0.0]}}, "one number per state"),
        ({"witness": {**stored["witness"], "coordinate": "z"}}, "a state's name"),
        ({"witness": {**stored["witness"], "seed": -1}}, "64 bits"),
        ({"format": "witness 1"}, "expected a witness, written by"),
    ):
        file.write_text(json.dumps({**stored, **change}))
        refused = invoke("examine", *words, "--replay", file)
        assert refused.status == 2
        assert message in refused.err


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    refused = invoke("examine", "--from", tmp_path, "--out", tmp_path / "out")
    assert refused.status == 2


def test_all_methods_are_those_of_derive_without_the_tube_that_is_there() -> None:
    everything = _methods(argparse.Namespace(method=[ALL]))
    assert [*everything, "sensitivity-quadratic"] == list(METHODS)
    assert _methods(argparse.Namespace(method=["blocks", "norm-max"])) == ["norm-max", "blocks"]
