"""`workbench demo` drives with shipped gains that keep the bounds of their study, have half the
tube area of the benchmark's, and are all that its vehicle file changes."""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

import pytest

from studies import demo_gains
from workbench.cli import demo
from workbench.models.vehicle import gem_e2, gem_e2_path, gem_e2_recommended_path, load_vehicle
from workbench.simulation.gain_sweep.gains import own_gains


def test_the_file_differs_from_the_benchmarks_in_steering_gains_alone() -> None:
    old, new = (
        tomllib.loads(path.read_text(encoding="utf-8"))
        for path in (gem_e2_path(), gem_e2_recommended_path())
    )
    before, after = old.pop("steering_pid"), new.pop("steering_pid")
    assert old == new
    assert all(before[key] != after[key] for key in before)
    assert "demo's GEM e2" in after["provenance"]


def test_the_shipped_gains_keep_the_studys_bounds(tmp_path: Path) -> None:
    present, shipped = demo_gains.check_shipped(demo_gains.begun(tmp_path / "sweep"))
    assert shipped.figures["lateral_3s_m"] < 0.5 * present.figures["lateral_3s_m"]
    assert not present.keeps


@pytest.mark.parametrize(
    ("named", "expected"),
    [(None, gem_e2_recommended_path()), (Path("gem_e2"), gem_e2_path())],
)
def test_the_demo_drives_with_them_unless_told(
    named: Path | None, expected: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = demo._vehicle(argparse.Namespace(vehicle=named))
    assert own_gains(found) == own_gains(load_vehicle(expected))
    assert (own_gains(found) == own_gains(gem_e2())) == (named is not None)
