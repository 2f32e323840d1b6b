"""`workbench gains sweep` goes on where it was left, and `recommend` writes what it decided."""

from __future__ import annotations

import csv
import re
import shutil
from pathlib import Path

import pytest

pytest.importorskip("pyarrow", reason="needs the optional package pyarrow")

from cli_fixture import invoke
from gain_sweep_cases import STUDY, study

from workbench.models.vehicle import load_vehicle
from workbench.simulation.gain_sweep.store import SweepStore


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweep")
    found = invoke("gains", "sweep", study(folder), "--out", folder / "out", "--json")
    assert found.status == 0, found.err
    assert (found.data["points"], found.data["cases"], found.data["new"]) == (4, 2, 4)
    return folder


def test_what_is_there_is_not_done_again(swept: Path) -> None:
    part = next((swept / "out" / "parts").glob("*.parquet"))
    rows, stamp = SweepStore(swept / "out").rows(), part.stat().st_mtime_ns
    assert [(r["point"], r["case"]) for r in rows] == [(k, j) for k in range(4) for j in range(2)]
    again = invoke("gains", "sweep", swept / "study.toml", "--out", swept / "out", "--json")
    assert again.data["new"] == 0
    assert part.stat().st_mtime_ns == stamp


def test_what_is_missing_comes_out_the_same(swept: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(swept / "out", tmp_path / "copy")
    known = SweepStore(copy).rows()
    for part in (copy / "parts").glob("*.parquet"):
        part.unlink()
    refused = invoke("gains", "recommend", "--out", copy)
    assert refused.status == 2
    assert "lacks 4 of 4 points" in refused.err
    assert invoke("gains", "sweep", swept / "study.toml", "--out", copy).status == 0
    assert SweepStore(copy).rows() == known


def test_the_recommendation_is_written(swept: Path) -> None:
    found = invoke("gains", "recommend", "--out", swept / "out", "--json")
    assert found.status == 0, found.err
    best, out = found.data["recommended"], swept / "out"
    gains = load_vehicle(out / "vehicle-recommended.toml").steering_pid
    assert gains.proportional_radps_per_m == best["kp"]
    assert gains.look_ahead_m == best["look-ahead"]
    assert "study 'small'" in gains.provenance
    kept = list(found.data["front"])
    assert best["lateral_3s_m"] == min(p["lateral_3s_m"] for p in kept)
    page = (out / "report.html").read_text(encoding="utf-8")
    for point in kept:
        assert f'id="point-{point["point"]}"' in page
    led = set(re.findall(r'href="#(point-\d+)"', page))
    assert led
    assert all(f'id="{each}"' in page for each in led)
    with (out / "points.csv").open(encoding="utf-8", newline="") as stream:
        table = list(csv.DictReader(stream))
    assert [row["point"] for row in table] == ["0", "1", "2", "3"]
    assert float(table[best["point"]]["lateral_3s_m"]) == best["lateral_3s_m"]
    text = invoke("gains", "recommend", "--out", out).out
    assert "recommended against present gains" in text


def test_bounds_that_nothing_keeps_give_status_1(swept: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(swept / "out", tmp_path / "copy")
    (copy / "vehicle-recommended.toml").unlink(missing_ok=True)
    strict = STUDY.replace("phase_deg = 40", "phase_deg = 89")
    (copy / "study.toml").write_text(strict, encoding="utf-8")
    found = invoke("gains", "recommend", "--out", copy)
    assert found.status == 1
    assert "No gains keep the bounds" in found.out
    assert not (copy / "vehicle-recommended.toml").exists()


def test_wrong_use_is_refused(swept: Path, tmp_path: Path) -> None:
    other = study(tmp_path, "seed = 2", "seed = 3")
    mixed = invoke("gains", "sweep", other, "--out", swept / "out")
    assert (mixed.status, "study_sha256" in mixed.err) == (2, True)
    bent = study(tmp_path, "[0.05, 0.05]", "[0.05, 0.5]")
    refused = invoke("gains", "sweep", bent, "--out", tmp_path / "none")
    assert (refused.status, "at most the vehicle's 0.125" in refused.err) == (2, True)
    assert not (tmp_path / "none").exists()
    assert invoke("gains", "sweep", tmp_path / "no.toml", "--out", tmp_path / "none").status == 2
    assert invoke("gains", "recommend", "--out", tmp_path).status == 2
    idle = invoke("gains", "--kp", "1", "recommend", "--out", swept / "out")
    assert (idle.status, "--kp" in idle.err) == (2, True)
    filled = invoke("gains", "sweep", swept / "study.toml", "--out", tmp_path)
    assert (filled.status, "an empty one" in filled.err) == (2, True)


def test_changed_machine_code_is_not_loaded(swept: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(swept / "out", tmp_path / "copy")
    for part in (copy / "parts").glob("*.parquet"):
        part.unlink()
    code = copy / "kernels" / "tube.so"
    code.write_bytes(code.read_bytes() + b"\0")
    refused = invoke("gains", "sweep", swept / "study.toml", "--out", copy)
    assert (refused.status, "remove the folder" in refused.err) == (2, True)
