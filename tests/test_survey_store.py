"""A survey goes on where it was left, with the same results, and mixes nothing."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ks_2samp

from tests.survey_cases import rig, row
from workbench.cli.main import main
from workbench.errors import InputError
from workbench.simulation.campaign.contenders import CONTENDERS, Field, judged_half
from workbench.simulation.campaign.hunting import load_catches
from workbench.simulation.campaign.parts import PART
from workbench.simulation.campaign.rows import drive_all, trial_of
from workbench.simulation.campaign.sampled import sampled
from workbench.simulation.campaign.store import Store
from workbench.simulation.campaign.surveying import training_half
from workbench.simulation.campaign.workers import workers

pytest.importorskip("pyarrow")
WHO = ("FailSafe", "never brakes")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    found = Store(tmp_path / "survey")
    found.begin(seed=1, contenders=WHO, long_looks=10)
    return found


def survey(folder: Path, count: int, *more: str) -> int:
    return main(
        ["survey", "--out", str(folder), "--scenarios", str(count), "--contenders", *WHO, *more]
    )


@pytest.fixture(scope="module")
def surveyed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("survey") / "out"
    assert survey(folder, 3, "--plot") == 0
    return folder


def begun_as(surveyed: Path, folder: Path) -> Path:
    """A copy without results, so that nothing has to be built again."""
    shutil.copytree(surveyed, folder, ignore=shutil.ignore_patterns("parts", "hunts"))
    return folder


def test_what_is_written_is_read(store: Store) -> None:
    rows = [row(k, nearest_m=float("inf") if k else 1.5) for k in range(3)]
    store.write("bicycle", range(3), rows)
    assert store.rows() == rows


def test_only_what_is_missing_is_driven(store: Store) -> None:
    assert [len(part) for part in store.missing("bicycle", 2 * PART + 3)] == [PART, PART, 3]
    store.write("bicycle", range(4, 9), [row(k) for k in range(4, 9)])
    left = store.missing("bicycle", PART + 2)
    assert [k for part in left for k in part] == [0, 1, 2, 3, *range(9, PART + 2)]
    assert store.missing("single-track", 1) == [range(1)]


def test_baselines_drive_what_they_are_judged_on_and_long_looks_the_first_ones(
    tmp_path: Path,
) -> None:
    manifest = Store(tmp_path).begin(seed=1, contenders=CONTENDERS, long_looks=2)
    baselines = {"fixed distance", "time to collision", "constant-velocity disc"}
    judged, other = (
        next(k for k in range(2, 99) if judged_half(k) is each) for each in (True, False)
    )
    assert set(manifest.drives(0)) == set(CONTENDERS)
    assert set(manifest.drives(judged)) == set(CONTENDERS) - {"LookAhead 5 s"}
    assert set(manifest.drives(other)) == set(CONTENDERS) - baselines - {"LookAhead 5 s"}


def test_both_halves_have_the_same_scenarios() -> None:
    """In every coordinate of the cube; odd and even indices are of disjoint ranges in one."""
    points = np.array([each.point for each in sampled(range(4096), 1)])
    half = np.array([judged_half(k) for k in range(4096)])
    assert abs(half.mean() - 0.5) < 0.03
    apart = [ks_2samp(each[half], each[~half], method="asymp").statistic for each in points.T]
    parity = [ks_2samp(each[::2], each[1::2], method="asymp").statistic for each in points.T]
    assert max(apart) < 0.06
    assert max(parity) > 0.9


def test_tuning_takes_one_scenario_at_least_and_none_that_is_judged() -> None:
    assert len(training_half(1, 5)) == 1
    assert len(training_half(1000, 7)) == 7
    assert not any(map(judged_half, training_half(1000, 999)))


def test_what_two_surveys_drove_at_once_counts_once(store: Store) -> None:
    store.write("bicycle", range(1), [row(0)])
    store.write("bicycle", range(2), [row(0), row(1)])
    assert store.rows() == [row(0), row(1)]


def test_a_damaged_part_is_named_and_can_be_deleted(store: Store) -> None:
    store.write("bicycle", range(2), [row(0), row(1)])
    (part,) = (store.folder / "parts" / "bicycle").iterdir()
    part.write_bytes(part.read_bytes()[:50])
    with pytest.raises(InputError, match=r"0000000-0000001\.parquet.*delete it"):
        store.rows()
    part.unlink()
    assert store.missing("bicycle", 2) == [range(2)]


def test_what_is_driven_may_not_be_changed(store: Store) -> None:
    settings = {"seed": 1, "contenders": WHO, "long_looks": 10}
    file = store.folder / "vehicle.toml"
    file.write_text(file.read_text().replace("0.8825", "0.3"))
    with pytest.raises(InputError, match=r"vehicle\.toml and sensors\.toml as the survey wrote"):
        store.begin(**settings)  # type: ignore[arg-type]


def test_a_start_that_broke_off_before_its_manifest_can_begin_again(store: Store) -> None:
    (store.folder / "manifest.json").unlink()
    assert store.begin(seed=3, contenders=WHO, long_looks=10) == store.manifest()


def test_a_vehicle_that_is_none_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "none.toml").write_text("[vehicle]\n")
    with pytest.raises(InputError, match=r"none\.toml"):
        Store(tmp_path / "out").begin(
            seed=1, contenders=WHO, long_looks=1, vehicle=tmp_path / "none.toml"
        )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("text", ["{", "[]", '{"bicycle": {"time to collision": {"x": 1}}}'])
def test_damaged_parameters_are_said(store: Store, text: str) -> None:
    (store.folder / "baselines.json").write_text(text)
    with pytest.raises(InputError, match=r"baselines\.json: expected what baselines were tuned"):
        store.parameters()


def test_a_survey_drives_as_the_bundle_with_all_its_sets(surveyed: Path) -> None:
    field = Field({3.0: rig()}, {})
    for index, scenario in enumerate(sampled(range(3), 1)):
        trial = trial_of(index, scenario, "bicycle")
        driven = {each for each in Store(surveyed).rows() if each.index == index}
        assert set(drive_all(index, trial, WHO, field)) == driven


def test_half_a_part_is_none(store: Store) -> None:
    store.write("bicycle", range(2), [row(0), row(1)])
    part = store.folder / "parts" / "bicycle" / ".0000002-0000003.parquet.7.part"
    part.write_bytes(b"PAR1")
    assert [k for part in store.missing("bicycle", 4) for k in part] == [2, 3]
    assert len(store.rows()) == 2


@pytest.mark.parametrize(
    ("changed", "named"),
    [({"seed": 2}, "seed"), ({"contenders": CONTENDERS}, "contenders"),
     ({"long_looks": 11}, "long_looks")],
)  # fmt: skip
def test_other_settings_are_refused(store: Store, changed: dict[str, object], named: str) -> None:
    settings = {"seed": 1, "contenders": WHO, "long_looks": 10, **changed}
    with pytest.raises(InputError, match=f"expected the {named} it was begun with"):
        store.begin(**settings)  # type: ignore[arg-type]


def test_another_vehicle_or_version_is_refused(store: Store, tmp_path: Path) -> None:
    vehicle = tmp_path / "other.toml"
    vehicle.write_text((store.folder / "vehicle.toml").read_text() + "\n# changed\n")
    with pytest.raises(InputError, match="vehicle_sha256"):
        store.begin(seed=1, contenders=WHO, long_looks=10, vehicle=vehicle)
    data = json.loads((store.folder / "manifest.json").read_text())
    (store.folder / "manifest.json").write_text(json.dumps({**data, "version": "0"}))
    with pytest.raises(InputError, match="version"):
        store.begin(seed=1, contenders=WHO, long_looks=10)


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("words")
    with pytest.raises(InputError, match="expected a survey's folder or an empty one"):
        Store(tmp_path).begin(seed=1, contenders=WHO, long_looks=1)
    with pytest.raises(InputError, match=r"manifest\.json"):
        Store(tmp_path).manifest()


def test_a_survey_is_the_same_again_and_in_parts(
    surveyed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = Store(surveyed).rows()
    assert [(each.index, each.contender) for each in whole] == [
        (index, name) for index in range(3) for name in WHO
    ]
    parts = begun_as(surveyed, tmp_path / "parts")
    assert survey(parts, 1) == 0
    assert survey(parts, 3) == 0
    assert Store(parts).rows() == whole
    capsys.readouterr()
    assert main(["survey", "--out", str(parts), "--table"]) == 0
    assert capsys.readouterr().out.count("\n") == 2 + len(WHO)


def test_a_killed_survey_goes_on(surveyed: Path, tmp_path: Path) -> None:
    folder = tmp_path / "killed"
    words = ["survey", "--out", str(folder), "--scenarios", "3", "--contenders", *WHO]
    with subprocess.Popen(
        [sys.executable, "-m", "workbench.cli.main", *words],
        stderr=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    ) as killed:  # fmt: skip
        while not (folder / "manifest.json").exists() and killed.poll() is None:
            time.sleep(0.05)
        killed.send_signal(signal.SIGKILL)
    assert survey(folder, 3) == 0
    assert Store(folder).rows() == Store(surveyed).rows()


def test_local_processes_give_the_same(surveyed: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    folder = begun_as(surveyed, tmp_path / "out")
    assert survey(folder, 3, "--jobs", "2") == 0
    assert Store(folder).rows() == Store(surveyed).rows()


def test_one_job_needs_no_cluster() -> None:
    with workers(1, None) as crew:
        assert list(crew.done(abs, [-1, 2])) == [(-1, 1), (2, 2)]


def test_the_page_says_who_drove(surveyed: Path) -> None:
    text = (surveyed / "report.html").read_text(encoding="utf-8")
    assert all(name in text for name in WHO)


def test_a_hunt_goes_on_and_its_worst_can_be_driven_again(
    surveyed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("optuna")
    words = ["survey", "--out", str(surveyed), "--hunt", "collisions", "--contenders", WHO[1]]
    assert main([*words, "--trials", "3"]) == 0
    best = next((surveyed / "hunts").glob("*/best.json"))
    first = load_catches(best)
    assert main([*words, "--trials", "8"]) == 0
    found = load_catches(best)
    assert len(first) == 3
    assert len(found) == 8
    assert all(each in found for each in first)
    assert [each.worth for each in found] == sorted(each.worth for each in found)
    capsys.readouterr()
    main(["survey", "--out", str(surveyed), "--point", str(best), "--json"])
    again = json.loads(capsys.readouterr().out)
    assert again[-1]["nearest_m"] == found[0].row.nearest_m
    assert again[-1]["way_m"] == found[0].row.way_m


def test_an_index_can_be_driven_again(surveyed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["survey", "--out", str(surveyed), "--index", "2", "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert [each["way_m"] for each in again] == [
        each.way_m for each in Store(surveyed).rows() if each.index == 2
    ]


def test_a_hunt_goes_on_after_a_kill_tore_its_last_line(surveyed: Path, tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    folder = begun_as(surveyed, tmp_path / "torn")
    words = ["survey", "--out", str(folder), "--hunt", "collisions", "--contenders", WHO[1]]
    assert main([*words, "--trials", "2"]) == 0
    journal = next((folder / "hunts").glob("*/journal.log"))
    journal.write_bytes(journal.read_bytes() + b'{"op_code": 4, "work')
    assert main([*words, "--trials", "3"]) == 0


def test_a_hunt_takes_whom_the_folder_knows(
    surveyed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["survey", "--out", str(surveyed), "--hunt", "collisions", "--trials", "1"]
    assert main([*words, "--contenders", "LookAhead 5 s"]) == 2
    assert "FailSafe, never brakes, got 'LookAhead 5 s'" in capsys.readouterr().err


def test_an_index_that_the_sequence_does_not_have_is_refused(
    surveyed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["survey", "--out", str(surveyed), "--index", str(2**30)]) == 2
    assert "--index: expected 0 to" in capsys.readouterr().err


def test_a_file_that_is_no_catch_is_refused(tmp_path: Path) -> None:
    for name, text in (("x.json", "[{}]"), ("y.json", "[]"), ("z.json", "{}")):
        (tmp_path / name).write_text(text)
    for name in ("x.json", "y.json", "z.json", "none.json"):
        with pytest.raises(InputError, match=r"expected the best\.json of a hunt"):
            load_catches(tmp_path / name)


def test_results_need_their_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert survey(tmp_path / "out", 1) == 2
    assert "reach-workbench[study]" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_wrong_use_is_explained(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["survey", "--out", str(tmp_path / "none")]
    for words, said in (
        (["--contenders", "luck"], "--contenders: expected some of"),
        (["--table"], "manifest.json"),
        (["--index", "1"], "manifest.json"),
        (["--index", "1", "--table"], "expected one of --point, --index, --hunt, --table"),
        (["--index", "1", "--plot"], "--plot: expected without --index"),
        (["--seed", str(2**40)], "--seed: expected at most"),
    ):
        assert main([*out, *words]) == 2
        assert said in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
