"""`workbench simulate --localiser` drives by the localiser's sets and says what they were worth."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the extra analysis")

from cli_fixture import invoke

from workbench.simulation.simulated import build_rig, ranged_sensors, street_path

SCENARIO = """
title = "A test"
story = "Nobody is there."
waypoints = [[0, 0], [10, 0], [20, 0], [30, 0], [40, 0]]
duration_s = {duration_s}
passed_m = 1.0
[expected]
LookAhead = "passes"
FailSafe = "passes"
both = "passes"
"""


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built") / "bundle"
    build_rig(folder, sensors=ranged_sensors())
    return folder


def written(folder: Path, name: str = "alone", duration_s: float = 5.0) -> Path:
    file = folder / f"{name}.toml"
    file.write_text(SCENARIO.format(duration_s=duration_s), encoding="utf-8")
    return file


def test_a_drive_says_how_far_off_the_localiser_was(bundle: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("--bundle", bundle, "--localiser", "--out", out, "--json")
    found = invoke("simulate", written(tmp_path), *words)
    assert found.status == 0, found.out + found.err
    instead, note = found.data["notes"]
    assert "not used" in instead
    assert "100 % of them held the true state" in note
    page = (out / "report.html").read_text(encoding="utf-8")
    assert note in page
    assert "<td>what the vehicle&#x27;s localiser says</td>" in page
    assert page.count("<td>within 12 m of nobody</td>") == 2


def test_a_table_has_it_for_every_drive(bundle: Path, tmp_path: Path) -> None:
    files = [written(tmp_path, name, 2.0) for name in ("one", "two")]
    words = ("--bundle", bundle, "--localiser", "--plant", "bicycle", "--json")
    found = invoke("simulate", *files, *words)
    rows = found.data["rows"]
    assert [row["told"]["holding"] for row in rows] == [1.0, 1.0]
    # The same seed among the same beacons.
    assert rows[0]["told"] == rows[1]["told"]
    assert rows[0]["told"]["radius_m"]["worst"] < 0.25


def test_another_site_is_another_localiser(bundle: Path, tmp_path: Path) -> None:
    """With ranges that err more, less is known than the proof grants: the car does not set off."""
    said = street_path().read_text(encoding="utf-8")
    assert said.count("deviation_m = 0.2 ") == 1
    site = tmp_path / "vague.toml"
    site.write_text(said.replace("deviation_m = 0.2 ", "deviation_m = 0.8 "), encoding="utf-8")
    words = ("--bundle", bundle, "--localiser", "--site", site, "--out", tmp_path / "out")
    found = invoke("simulate", written(tmp_path), *words, "--json")
    assert found.status == 1
    assert found.data["story"] == "did not set off"


def test_a_bundle_for_quicker_sets_is_refused(tmp_path: Path) -> None:
    quick = tmp_path / "bundle"
    build_rig(quick)
    words = ("--bundle", quick, "--localiser", "--out", tmp_path / "out")
    found = invoke("simulate", written(tmp_path), *words)
    assert found.status == 2
    assert "delay_us" in found.err
    assert not (tmp_path / "out" / "report.html").exists()


@pytest.mark.parametrize("words", [("--site", "s.toml"), ("--localiser", "--desk")])
def test_options_that_contradict_each_other_are_refused(
    words: tuple[str, ...], tmp_path: Path
) -> None:
    found = invoke("simulate", written(tmp_path), *words)
    assert found.status == 2
    assert "--localiser" in found.err
