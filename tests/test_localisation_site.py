"""A site file is read whole or refused with its place, what was expected and how to mend it."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.estimation.localisation_site import hall_path, load_site

TEXT = hall_path().read_text(encoding="utf-8")


def test_the_shipped_site_is_read() -> None:
    site = load_site(hall_path())
    assert [beacon.name for beacon in site.beacons][:2] == ["south-west", "south"]
    assert site.ranges.deviation_m == 0.1


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("deviation_m = 0.1 ", "deviation_m = 0.0 ", r"\[ranges\] deviation_m: expected a number"),
        ("accepted = 0.999 ", "accepted = 1.0 ", r"\[ranges\] accepted, stray_share"),
        ("still_m = 0.02 ", "still_m = -1.0 ", r"\[limits\] still_m"),
        ("forward_m = 0.9", "forwards_m = 0.9", "unknown key 'forwards_m'"),
        ("[motion]", "[movement]", "unknown section 'movement'"),
        ('name = "south"', 'name = "north"', "distinct names"),
        ("x_m = 20.0\ny_m = 26.0", 'x_m = 20.0\ny_m = "26"', "y_m: expected a finite number"),
        ("lost_after = 12 ", "lost_after = 'x' ", "expected a finite number"),
        ("[antenna]", "[antenna", "expected a TOML file"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert TEXT.count(old) == 1
    path = tmp_path / "site.toml"
    path.write_text(TEXT.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        load_site(path)
    assert str(path) in str(caught.value)


def test_beacons_on_one_line_and_too_few_are_refused() -> None:
    site = load_site(hall_path())
    flat = tuple(dataclasses.replace(b, y_m=0.5 * b.x_m) for b in site.beacons)
    with pytest.raises(InputError, match="off the line"):
        dataclasses.replace(site, beacons=flat)
    with pytest.raises(InputError, match="at least 3"):
        dataclasses.replace(site, beacons=site.beacons[:2])


def test_a_missing_file_and_a_beacon_that_is_no_list_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such site file"):
        load_site(tmp_path / "none.toml")
    path = tmp_path / "site.toml"
    path.write_text("beacon = 3\n" + re.sub(r"\[\[beacon\]\][^\[]*", "", TEXT), encoding="utf-8")
    with pytest.raises(InputError, match=r"expected \[\[beacon\]\] sections"):
        load_site(path)
