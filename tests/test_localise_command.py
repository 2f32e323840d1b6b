"""A drive is followed message by message: the sets hold the truth, bad tables are refused."""

from __future__ import annotations

import csv
import dataclasses
import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from workbench.cli.main import CLAIM_FAILS, DONE, WRONG_USE, main
from workbench.errors import InputError
from workbench.estimation.localisation import Localiser, Status
from workbench.estimation.localisation_filter import filter_functions
from workbench.estimation.localisation_sets import LEVELS, EllipsoidHull
from workbench.estimation.localisation_site import hall_path, load_site
from workbench.estimation.recorded_drives import load_drive, located

SITE = load_site(hall_path())
SIDES = ("x", "y", "heading")


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("generated") / "drive"
    assert main(["localise", "--generate", str(folder), "--seed", "5"]) == DONE
    return folder


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_every_written_set_holds_the_truth(drive: Path, tmp_path: Path) -> None:
    out, page = tmp_path / "poses.csv", tmp_path / "page.html"
    assert main(["localise", str(drive), "--out", str(out), "--plot", str(page)]) == DONE
    found, truth = rows(out), rows(drive / "truth.csv")
    assert len(found) == len(truth)
    valid = [(f, t) for f, t in zip(found, truth, strict=True) if f["status"] == "VALID"]
    assert len(valid) > 0.75 * len(found)  # it stands 5 of 43 s, and has no heading until it drives
    held = [
        all(abs(float(f[name]) - float(t[name])) <= float(f[f"{name}_radius"]) for name in SIDES)
        for f, t in valid
    ]
    # 99.9 % jointly, hull of the ellipsoid: of one car's dependent instants hardly any is outside.
    assert np.mean(held) > 0.99
    assert max(float(f["x_radius"]) for f, _ in valid) < 1.0
    assert all(f["x"] == "" for f in found if f["status"] != "VALID")
    assert "half-width" in page.read_text()


def test_what_comes_later_changes_no_answer(drive: Path) -> None:
    recorded = load_drive(drive, SITE)
    localiser = Localiser.of(SITE, filter_functions(SITE, wheelbase_m=1.75))
    log, cut = recorded.log, 20.0
    ranges = log.ranges_m.copy()
    ranges[log.range_times_s > cut] += 5.0
    altered = dataclasses.replace(recorded, log=dataclasses.replace(log, ranges_m=ranges))

    def until(which: object) -> list[object]:
        every = located(localiser, which, levels=LEVELS, shape=EllipsoidHull())  # type: ignore[arg-type]
        return [moment for moment in every if moment.t_s <= cut]

    assert until(recorded) == until(altered)
    after = [m.status for m in located(localiser, altered, levels=LEVELS, shape=EllipsoidHull())]
    assert Status.LOST in after  # ranges that are 5 m too long are no small thing


def test_commissioning_tells_zero_and_scale(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shifted = tmp_path / "shifted"
    shifted.mkdir()
    (shifted / "ranges.csv").write_text((drive / "ranges.csv").read_text())

    def told(folder: Path) -> dict[str, dict[str, float]]:
        capsys.readouterr()
        assert main(["commission", str(folder), "--wheelbase-error", "0.005", "--json"]) == DONE
        found: dict[str, dict[str, float]] = json.loads(capsys.readouterr().out)["estimates"]
        return found

    with (shifted / "reports.csv").open("w", newline="") as file:
        reports = rows(drive / "reports.csv")
        writer = csv.DictWriter(file, reports[0])
        writer.writeheader()
        writer.writerows(
            row | {"steering": float(row["steering"]) + 0.02, "speed": 1.03 * float(row["speed"])}
            for row in reports
        )
    before, after = told(drive), told(shifted)
    assert after["steering_zero"]["value"] - before["steering_zero"]["value"] == pytest.approx(
        0.02, abs=0.002
    )
    ratio = (1.0 + after["speed_scale"]["value"]) / (1.0 + before["speed_scale"]["value"])
    assert ratio == pytest.approx(1.03, abs=0.003)


def test_beacons_in_the_wrong_place_fail_the_commissioning(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site = tmp_path / "site.toml"
    site.write_text(hall_path().read_text().replace("x_m = 20.0", "x_m = 22.0"))
    assert main(["commission", str(drive), "--site", str(site)]) == CLAIM_FAILS
    assert "measure them again" in capsys.readouterr().out


def test_a_car_that_never_drives_has_no_set(drive: Path, tmp_path: Path) -> None:
    for name in ("reports", "ranges"):
        lines = (drive / f"{name}.csv").read_text().splitlines()
        kept = [lines[0], *(line for line in lines[1:] if float(line.split(",")[0]) < 4.5)]
        with gzip.open(tmp_path / f"{name}.csv.gz", "wt") as file:
            file.write("\n".join(kept) + "\n")
    assert main(["localise", str(tmp_path)]) == CLAIM_FAILS


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("ranges.csv", "south-west", "nowhere", "expected one of south-west"),
        ("ranges.csv", "t,beacon", "t,place", "missing column"),
        ("reports.csv", "0.1000,", "0.0100,", "expected a report after the one before it"),
        ("reports.csv", "0.1000,", "nan,", "expected a finite number"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused(
    drive: Path, tmp_path: Path, name: str, old: str, new: str, said: str
) -> None:
    for each in ("reports.csv", "ranges.csv"):
        text = (drive / each).read_text()
        (tmp_path / each).write_text(text.replace(old, new, 1) if each == name else text)
    with pytest.raises(InputError, match=said):
        load_drive(tmp_path, SITE)


@pytest.mark.parametrize(
    "given", [[], ["there", "--generate", "here"], ["missing"], ["--generate", "x", "--out", "y"]]
)
def test_wrong_use_leaves_nothing(
    given: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["localise", *given]) == WRONG_USE
    assert not list(tmp_path.iterdir())
