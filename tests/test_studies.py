"""Claim: every study in `studies` upholds its own assertion and draws its picture."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

LONG = ("changed_goals", "driven_gains", "planted_lies")
"""These take minutes; test_changed_goals.py, test_gain_sweep_drives.py and test_planted_lies.py
have small versions."""
STUDIES = [
    pytest.param(name, marks=pytest.mark.campaign) if name in LONG else name
    for name in sorted(
        path.stem for path in (Path(__file__).parent.parent / "studies").glob("*.py")
    )
    if name != "__init__"
]


@pytest.mark.parametrize("name", STUDIES)
def test_the_claim_of_a_study_holds(name: str, tmp_path: Path) -> None:
    picture = tmp_path / "study.png"
    claim = importlib.import_module(f"studies.{name}").main(picture)
    assert re.search(r"\d", claim), "a claim says its figures"
    assert picture.is_file()
    assert picture.stat().st_size > 1000
