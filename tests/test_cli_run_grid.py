"""Options that a bundle settles are refused beside it, and a level that does not exist by name."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.cli.main import main
from workbench.codegen import MonitorSpec
from workbench.codegen.bundle import _initial_set
from workbench.errors import InputError
from workbench.models.vehicle import gem_e2
from workbench.runtime import Deciding


@pytest.mark.parametrize("option", ["--horizon", "--step"])
def test_a_bundle_brings_its_own_grid(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["replay", str(tmp_path), "--recording", "a", "--bundle", str(tmp_path), option, "3"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    assert "expected neither --horizon nor --step beside it" in capsys.readouterr().err


def test_a_level_that_does_not_exist_is_refused_with_its_option(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["build", "--deciding-level", "halves", "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "--deciding-level: expected one of ['whole', 'two thirds', 'one third']" in said
    assert not out.exists()


def test_a_bundle_names_the_level_and_share_that_its_proof_is_about() -> None:
    whole = _initial_set(MonitorSpec(gem_e2(), 3.0, 0.05))
    assert "the level 'whole', share 1, decides" in whole.statement
    third = _initial_set(MonitorSpec(gem_e2(), 3.0, 0.05, deciding_level="one third"))
    assert "inner 0.333 about its centre" in third.statement
    assert "the level 'one third', share 0.333, decides" in third.statement


def test_a_bundle_is_decided_by_one_of_the_three() -> None:
    given: Deciding = "FailSafe"  # type: ignore[assignment]
    assert MonitorSpec(gem_e2(), 3.0, 0.05, deciding=given).deciding is Deciding.FAIL_SAFE
    given = "all"  # type: ignore[assignment]
    with pytest.raises(InputError, match="got 'all'"):
        MonitorSpec(gem_e2(), 3.0, 0.05, deciding=given)
