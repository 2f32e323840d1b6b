"""`workbench reproduce paper` repeats itself to the last digit, writes what it says, and answers by
its exit status whether the tubes contain what was asked."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from workbench.bench.paper_times import (
    PaperTimes,
    TimedKernels,
    TimeRow,
    paper_times,
    processor_name,
)
from workbench.cli import reproduce_work
from workbench.cli.main import main
from workbench.cli.reproduce import BEGIN, END, INTENT, RESULTS
from workbench.cli.reproduce_tables import (
    accuracy_csv,
    accuracy_tables,
    markdown,
    time_table,
    times_csv,
)
from workbench.cli.reproduce_work import (
    FITTED,
    HELD,
    LEARNED,
    PLAIN,
    SCENARIOS,
    Found,
    timed_starts,
)
from workbench.codegen.bundle import bundle_files
from workbench.models.vehicle import gem_e2_path, load_vehicle
from workbench.runtime import Bundle
from workbench.simulation.paper.accuracy import HORIZONS_S, accuracy_rows
from workbench.simulation.paper.confidences import THIRDS
from workbench.simulation.paper.learned import learned_spec
from workbench.simulation.paper.panels import panel
from workbench.simulation.paper.replayed import ReplayedRun, replay
from workbench.simulation.paper.tubes import (
    KernelTubes,
    certain,
    loaded,
    paper_spec,
)
from workbench.simulation.rig import Rig, Trial
from workbench.simulation.scenarios.shipped import named
from workbench.simulation.simulated import build_rig, simulated_path

TRIAL = Trial(
    dataclasses.replace(named("paper_alongside_vehicle"), duration_s=8.0), "bicycle", 1000
)
VEHICLE = load_vehicle(simulated_path())
SPEC = paper_spec(VEHICLE, 5.0)


@pytest.fixture(scope="module")
def rig() -> Rig:
    return build_rig()


@pytest.fixture(scope="module")
def files() -> dict[str, bytes]:
    return bundle_files(SPEC)


@pytest.fixture(scope="module")
def bundle(files: dict[str, bytes]) -> Bundle:
    return loaded(files)


@pytest.fixture(scope="module")
def run(rig: Rig) -> ReplayedRun:
    return replay(rig, TRIAL, shares=THIRDS)


@pytest.fixture(scope="module")
def learned_files() -> dict[str, bytes]:
    return bundle_files(learned_spec(VEHICLE, horizon_s=5.0, pairs=200))


@pytest.fixture(scope="module")
def tubes(bundle: Bundle, learned_files: dict[str, bytes]) -> tuple[KernelTubes, ...]:
    return (
        KernelTubes(bundle, VEHICLE, unsure=False, title=PLAIN),
        KernelTubes(bundle, VEHICLE, unsure=True, title=FITTED),
        KernelTubes(bundle, VEHICLE, unsure=True, title=HELD),
        KernelTubes(loaded(learned_files), VEHICLE, unsure=False, title=LEARNED),
    )


@pytest.fixture(scope="module")
def found(rig: Rig, run: ReplayedRun, tubes: tuple[KernelTubes, ...]) -> Found:
    times = PaperTimes(
        (TimeRow("tubes", HORIZONS_S, (0.1, 0.2, 0.2, 0.2, 0.2), (0.3,) * 5, 4, (0, 0, 0, 0, 2)),),
        "a processor",
    )
    drawn = panel(
        rig, Trial(named("paper_alongside_vehicle"), "bicycle", 1000), tubes[1], horizon_s=3.0
    )
    short = dataclasses.replace(run, asked=run.asked[30::20])
    return Found(
        times, accuracy_rows([short], tubes), (drawn,) * 4, (short,), (1000,), ("alongside",),
        ("bicycle",), THIRDS, "a hundred pairs",
    )  # fmt: skip


def test_the_same_run_gives_the_same_table_twice(
    rig: Rig, found: Found, tubes: tuple[KernelTubes, ...]
) -> None:
    again = replay(rig, TRIAL, shares=THIRDS)
    short = dataclasses.replace(again, asked=again.asked[30::20])
    repeated = dataclasses.replace(found, accuracy=accuracy_rows([short], tubes))
    assert accuracy_csv(repeated) == accuracy_csv(found)
    assert accuracy_csv(found).count("\n") > len(HORIZONS_S)


def test_n_and_w_widen_the_tubes_and_smaller_sets_have_tubes_within(
    run: ReplayedRun, tubes: tuple[KernelTubes, ...]
) -> None:
    """But for a centimetre, by which coarse steps bound looser than the fine ones that a wide set
    may need."""
    asked = run.asked[-1]
    plain, unsure = (each.rows(run.path, asked, 0) for each in tubes[:2])
    inner = tubes[1].rows(run.path, asked, 2)
    for smaller in (plain, inner):
        rows = min(len(smaller.lower), len(unsure.lower))
        assert rows >= 50
        assert (unsure.lower[:rows] <= smaller.lower[:rows] + 0.01).all()
        assert (unsure.upper[:rows] >= smaller.upper[:rows] - 0.01).all()
        wider = np.prod(unsure.upper[:rows] - unsure.lower[:rows], axis=1)
        assert wider.sum() > 1.3 * np.prod(smaller.upper - smaller.lower, axis=1)[:rows].sum()
    assert len(unsure.ground) == len(unsure.lower)


def test_no_two_scenarios_are_driven_with_one_seed_nor_is_one_fitted_to() -> None:
    args = argparse.Namespace(plant=[], quick=False, scenario=[], seeds=3)
    firsts = reproduce_work.FIRST_SEED, reproduce_work.FIT_SEED
    judged, fitted = (reproduce_work._trials(args, first) for first in firsts)
    for plant in reproduce_work.PLANTS:
        mine = [trial for trial in judged if trial.plant == plant]
        assert len({trial.seed for trial in mine}) == len(mine) == 3 * len(SCENARIOS)
    assert not {trial.seed for trial in judged} & {trial.seed for trial in fitted}


def test_three_sets_take_longer_the_farther_they_reach(
    bundle: Bundle, run: ReplayedRun, tubes: tuple[KernelTubes, ...],
    files: dict[str, bytes], learned_files: dict[str, bytes],
) -> None:  # fmt: skip
    starts = timed_starts((run,), tubes[1], count=3)
    times = paper_times(
        TimedKernels(SPEC, files, learned_files), starts, horizons_s=(2.0, 3.0),
        certain=certain(bundle, VEHICLE), validated=0,
    )  # fmt: skip
    alone, unsure, decisions, learned = times.rows
    assert learned.incomplete == (0, 0)
    assert alone.growth > 1.2
    assert unsure.growth > 1.2
    assert all(np.isfinite(row.median_s).all() for row in times.rows)
    assert min(decisions.median_s) > min(alone.median_s)
    assert processor_name()


@pytest.mark.parametrize(("require", "status"), [(0.0, 0), (1.0, 1)])
def test_the_exit_status_says_whether_enough_is_contained(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, found: Found, require: float, status: int
) -> None:
    """With a plant of which nothing was counted the least share is 0."""
    kept = found if status == 0 else dataclasses.replace(found, accuracy=())
    monkeypatch.setattr(reproduce_work, "measured", lambda _args: kept)
    document = tmp_path / "docs.md"
    document.write_text(f"before\n{BEGIN}\nstale figures\n{END}\nafter\n")
    out = tmp_path / "out"
    words = ["reproduce", "paper", "--out", str(out), "--require", str(require), "--into"]
    assert main([*words, str(document)]) == status
    names = {"report.html", "table-1.csv", "table-2.csv", RESULTS, INTENT}
    assert {path.name for path in out.iterdir()} == names
    text = document.read_text()
    assert text.startswith("before\n")
    assert text.endswith(f"{END}\nafter\n")
    assert "stale figures" not in text
    assert "a processor" not in text
    assert str(tmp_path) not in text
    assert "a processor" in (out / "report.html").read_text()
    assert {path.name for path in (tmp_path / "pictures").iterdir()} == {RESULTS, INTENT}


def test_tables_hold_ours_and_the_papers_numbers(found: Found) -> None:
    times = markdown(time_table(found.times))
    assert "| tubes, median | 100 | 200 | 200 | 200 | 200 | 2 |" in times
    assert "| the paper | 96 |" in times
    assert "| tubes, left out of 4 because a tube ended early | 0 | 0 | 0 | 0 | 2 | – |" in times
    assert times_csv(found.times).splitlines()[-1].endswith(",4,2")
    steps = markdown(accuracy_tables(found, starts="at speed")[0])
    assert "| the paper | learned beta | Low | 95.825 |" in steps
    assert "of the rows" not in steps
    assert steps.count(FITTED) == steps.count(LEARNED) == 3


def test_an_area_says_of_how_many_rows_it_is(found: Found) -> None:
    """Rounded down, so that what ended early never looks complete."""
    (row, *others) = found.accuracy
    cells = [
        None if each is None else dataclasses.replace(each, area_rows=share)
        for each, share in zip(row.cells, (1.0, 0.99996, 0.5, 1.0, 1.0), strict=True)
    ]
    changed = dataclasses.replace(row, cells=tuple(cells))
    short = dataclasses.replace(found, accuracy=(changed, *others))
    line = markdown(accuracy_tables(short, starts="at speed")[2]).splitlines()[4].split("|")
    assert "rows" not in line[4]
    assert line[5].endswith("(of 99.9 % of the rows) ")
    assert line[6].endswith("(of 50.0 % of the rows) ")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["other"], "paper"),
        (["paper", "--into", "nowhere.md"], "--into"),
        (["paper", "--require", "2"], "--require"),
        (["paper", "--quick", "--seeds", "2"], "--seeds: expected without --quick"),
        (["paper", "--vehicle", str(gem_e2_path())], "[drive_by_wire]"),
    ],
)
def test_wrong_use_is_told(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    words: list[str], said: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", *words]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
