"""The figures of gain sweeps compare two routes that agree, name what one of them lacks, and show
what a study recommends."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

pytest.importorskip("pyarrow", reason="needs the optional package pyarrow")

from gain_sweep_cases import kernels, row, study

from workbench.bench import gain_choice, gain_sweep_figures
from workbench.bench.gain_sweep_baseline import LACKS, baseline
from workbench.bench.into_document import markdown, put_between
from workbench.errors import InputError
from workbench.simulation.gain_sweep.figures import FIGURES
from workbench.simulation.gain_sweep.gains import own_gains
from workbench.simulation.gain_sweep.plan import load_plan
from workbench.simulation.gain_sweep.store import SweepStore


def test_both_routes_agree_in_what_both_have(tmp_path: Path) -> None:
    plan = load_plan(gain_sweep_figures.study(tmp_path, 2))
    ours, theirs, wrong = gain_sweep_figures.compared(kernels(), plan)
    assert wrong == []
    assert 0.0 < ours < theirs
    known = baseline(kernels().vehicle)(own_gains(kernels().vehicle), plan.cases[0])
    assert len(known) + len(LACKS) == len(FIGURES)
    assert set(known) | {n for n, f in FIGURES.items() if f.label in LACKS} == set(FIGURES)


def test_differences_are_told() -> None:
    mine = {"phase_deg": 50.0, "settling_s": 4.0, "rest_m": math.nan, "disk": math.inf}
    assert gain_sweep_figures.differences(mine, dict(mine)) == []
    assert gain_sweep_figures.differences(mine, mine | {"settling_s": 4.05}) == []
    for name, value in (("phase_deg", 50.1), ("settling_s", 4.2), ("rest_m", 0.1)):
        (said,) = gain_sweep_figures.differences(mine, mine | {name: value})
        assert said.startswith(name)


def _store(folder: Path, *rows: dict[str, object]) -> SweepStore:
    store = SweepStore(folder / "sweep")
    store.begin(study(folder, "points = 3", "points = 2"))
    store.write(range(3), [{**each, "phase_deg": 45.0} for each in rows])
    return store


def test_the_table_shows_present_and_recommended(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = _store(tmp_path, row(0), row(1, lateral_3s_m=0.25), row(2, lateral_3s_m=0.5))
    document = tmp_path / "page.md"
    begin, end = gain_choice.MARKS
    document.write_text(f"before\n{begin}\nold\n{end}\nafter\n", encoding="utf-8")
    assert gain_choice.main([str(store.folder), "--into", str(document)]) == 0
    text = document.read_text(encoding="utf-8")
    assert "| lateral half width at 3 s (m) | 1 | 0.25 |" in text
    assert "| kp | 0 | 0.1 |" in text
    assert "Nobody drove." in text
    assert "old" not in text
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "| kp | 0 | 0.1 |" in capsys.readouterr().out


def test_no_recommendation_fails(tmp_path: Path) -> None:
    lost = [row(k, stable=False) for k in range(3)]
    assert gain_choice.main([str(_store(tmp_path, *lost).folder)]) == 1


def test_a_document_without_the_marks_is_left_as_it_is(tmp_path: Path) -> None:
    document = tmp_path / "page.md"
    document.write_text("<!-- a -->", encoding="utf-8")
    with pytest.raises(InputError, match="once each"):
        put_between(document, ("<!-- a -->", "<!-- b -->"), "text")
    assert document.read_text(encoding="utf-8") == "<!-- a -->"
    assert markdown(["a", "b"], [["1", "2"]]) == "| a | b |\n|---|---|\n| 1 | 2 |"
