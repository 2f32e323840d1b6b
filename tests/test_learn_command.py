"""`workbench learn` fits every form to every source, and its files are read back without loss."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from cli_fixture import SHORT, invoke

from workbench.cli.analysis_options import Subject
from workbench.cli.learned_file import load_learned
from workbench.errors import InputError
from workbench.models.benchmarks import all_benchmarks
from workbench.sensitivity.scenario import judged_bound, pairs_needed, violation_bound

PENDULUM = """\
import math
def swing(state, times, seed):
    angle, rate = map(float, state)
    rows, now = [], 0.0
    for t in times:
        while now < t - 1e-9:
            step = min(0.01, t - now)
            angle, rate = angle + step * rate, rate - step * math.sin(angle)
            now += step
        rows.append((angle, rate))
    return rows
"""
START = ("--start", "angle", "0.2", "0.6", "--start", "rate", "-0.1", "0.1")


def _subject() -> Subject:
    bench = next(each for each in all_benchmarks() if each.name.lower() == "b1-small")
    return Subject(bench.name, bench.system, bench.initial_set, None)


def _function(folder: Path) -> str:
    file = folder / "pendulum.py"
    file.write_text(PENDULUM)
    return f"{file}:swing"


@pytest.mark.parametrize(
    "words",
    [("--form", "set"), ("--form", "piecewise", "--pieces", "3"), ("--form", "matrix"),
     ("--published",), ("--from", "compiled")],
    ids=" ".join,
)  # fmt: skip
def test_a_file_is_read_back_without_loss(words: tuple[str, ...], tmp_path: Path) -> None:
    saved = tmp_path / "learned.json"
    size = () if words == ("--published",) else ("--pairs", "60")
    found = invoke("learn", *SHORT, *words, *size, "--save", saved, "--json")
    assert found.status == 0, found.err
    subject = _subject()
    bound = load_learned(saved, subject)
    start = subject.initial_set.reordered(bound.names).radius
    for t, shown in zip(found.data["instants_s"], found.data["half_widths"], strict=True):
        assert list(bound.radius(start, t)) == shown
    assert [each.epsilon for each in bound.statements] == [
        each["epsilon"] for each in found.data["statements"]
    ]
    assert bound.horizon_s == 0.5
    assert bound.rigor.name == "SAMPLED"
    assert bound.region is not None


def test_the_per_state_form_is_read_back_too(tmp_path: Path) -> None:
    saved, source = tmp_path / "learned.json", _function(tmp_path)
    words = ("learn", "--from", source, *START, "--horizon", "1", "--step", "0.5")
    found = invoke(*words, "--form", "exponential", "--pairs", "40", "--save", saved, "--json")
    assert found.status == 0, found.err
    document = json.loads(saved.read_text())
    assert document["form"] == "exponential"
    assert document["factor"] == found.data["factor"]
    with pytest.raises(InputError, match=r"learned from model, got one learned from .*swing; pass"):
        load_learned(saved, _subject())


def test_a_function_s_bound_holds_its_own_fresh_runs_as_often_as_stated(tmp_path: Path) -> None:
    words = ("learn", "--from", _function(tmp_path), *START, "--horizon", "1", "--step", "0.25")
    found = invoke(*words, "--epsilon", "0.1", "--delta", "1e-3", "--hold-out", "300", "--json")
    assert found.status == 0, found.err
    judged, held = found.data["statements"]
    assert judged["pairs"] == pairs_needed(0.1, delta=1e-3, parameters=4)
    assert held["argument"] == "HOLD_OUT"
    assert held["counted"] <= 0.1 * 300
    assert found.data["states"] == ["angle", "rate"]
    assert f"{judged['pairs']} pairs and 300 fresh ones" in found.err


def test_the_number_of_processes_changes_nothing(tmp_path: Path) -> None:
    words = ("learn", "--from", _function(tmp_path), *START, "--horizon", "1", "--step", "0.5")
    one, two = (invoke(*words, "--pairs", "70", "--jobs", jobs, "--json") for jobs in (1, 2))
    assert one.status == 0, one.err
    assert one.out == two.out


def test_a_folder_of_pairs_is_gone_on_with_and_changes_nothing(tmp_path: Path) -> None:
    words = ("learn", *SHORT, "--seed", "4", "--json")
    plain = invoke(*words, "--pairs", "60")
    first = invoke(*words, "--pairs", "20", "--resume", tmp_path / "pairs")
    more = invoke(*words, "--pairs", "60", "--resume", tmp_path / "pairs")
    assert plain.out == more.out != first.out
    other = invoke("learn", *SHORT, "--seed", "5", "--pairs", "20", "--resume", tmp_path / "pairs")
    assert other.status == 2
    assert "expected pairs of the same seed, 5, got those of 4" in other.err


def test_the_order_of_a_function_s_states_is_part_of_what_its_pairs_are(tmp_path: Path) -> None:
    words = ("learn", "--from", _function(tmp_path), "--horizon", "1", "--step", "0.5", "--pairs",
             "20")  # fmt: skip
    pairs, saved = tmp_path / "pairs", tmp_path / "learned.json"
    assert invoke(*words, *START, "--resume", pairs, "--save", saved).status == 0
    swapped = (*START[len(START) // 2 :], *START[: len(START) // 2])
    mixed = invoke(*words, *swapped, "--resume", pairs)
    assert mixed.status == 2
    assert "pairs must not be mixed" in mixed.err
    tried = invoke("examine", *words[1:-2], *swapped, "--learned", saved, "--samples", "5",
                   "--out", tmp_path / "out")  # fmt: skip
    assert tried.status == 2
    assert "states: ['rate', 'angle'] here" in tried.err


def test_waiting_and_judging_states_what_the_carrying_pairs_support() -> None:
    words = ("learn", *SHORT, "--pairs", "300", "--delta", "1e-3", "--json")
    before = invoke(*words).data["statement"]
    after = invoke(*words, "--wait-and-judge").data["statement"]
    assert before["epsilon"] == violation_bound(300, delta=1e-3, parameters=14)
    assert after["argument"] == "WAIT_AND_JUDGE"
    assert after["epsilon"] == judged_bound(300, delta=1e-3, support=after["counted"])
    assert after["counted"] < 14
    assert "pairs that carry the fit" in invoke(*words[:-1], "--wait-and-judge").out


def test_the_published_behaviour_states_nothing_and_says_so() -> None:
    found = invoke("learn", *SHORT, "--published")
    assert found.status == 0
    assert "no probability is claimed for further runs" in found.out
    data = invoke("learn", *SHORT, "--published", "--json").data
    assert data["statement"]["epsilon"] == 1.0
    assert data["factor"][5:] == [1.0, 1.0], "states that start alike are taken as never moving"
    assert not np.any(np.array(data["half_widths"])[:, 5:])


def test_a_bound_of_a_plant_is_not_one_of_the_model(tmp_path: Path) -> None:
    saved = tmp_path / "learned.json"
    words = ("--from", "bicycle", "--horizon", "0.2", "--step", "0.1", "--pairs", "20")
    assert invoke("learn", *words, "--save", saved).status == 0
    refused = invoke("examine", "--system", "b1", "--horizon", "0.2", "--learned", saved,
                     "--out", tmp_path / "out")  # fmt: skip
    assert refused.status == 2
    assert "got one learned from bicycle" in refused.err


def test_a_failing_function_is_wrong_use_and_leaves_no_file(tmp_path: Path) -> None:
    file = tmp_path / "broken.py"
    file.write_text("def swing(state, times, seed):\n    return [state]\n")
    saved = tmp_path / "learned.json"
    found = invoke("learn", "--from", f"{file}:swing", *START, "--horizon", "1", "--step", "0.5",
                   "--save", saved)  # fmt: skip
    assert found.status == 2
    assert "broken.py:swing: expected shape (3, 2)" in found.err
    assert "got (1, 2)" in found.err
    assert not saved.exists()
