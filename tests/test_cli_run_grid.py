"""Options that a bundle settles are refused beside it, and a level that does not exist by name."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.cli.build import FORMS, KERNELS
from workbench.cli.main import main
from workbench.codegen import MonitorSpec
from workbench.codegen.assumptions import _initial_set, assumptions
from workbench.errors import InputError
from workbench.models.vehicle import gem_e2
from workbench.reach.online import kernels
from workbench.reach.online.kernels import Form, Method
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


@pytest.mark.parametrize(("option", "known"), [("--kernel", KERNELS), ("--form", FORMS)])
def test_a_kernel_or_form_that_does_not_exist_is_refused_with_the_known_ones(
    option: str, known: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["build", option, "table", "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert all(f"'{name}'" in said for name in ("table", *known))
    assert not out.exists()


def test_a_bundle_names_the_level_and_share_that_its_proof_is_about() -> None:
    whole = _initial_set(MonitorSpec(gem_e2(), 3.0, 0.05))
    assert "the level 'whole', share 1, decides" in whole.statement
    third = _initial_set(MonitorSpec(gem_e2(), 3.0, 0.05, deciding_level="one third"))
    assert "inner 0.333 about its centre" in third.statement
    assert "the level 'one third', share 0.333, decides" in third.statement


def test_every_kernel_in_every_form_is_offered_and_says_how_its_rounding_is_proved() -> None:
    assert set(KERNELS) == set(kernels.KERNELS)
    assert {Form(name) for name in FORMS} == set(Form)
    told = {}
    for kernel in KERNELS:
        spec = MonitorSpec(gem_e2(), 3.0, 0.05, method=Method(kernel))
        assert spec.sizes.method == spec.method
        evidence = {each.name: each.evidence for each in assumptions(spec)}
        assert len(evidence) == len(assumptions(spec))
        told[kernel] = evidence["rounding"]
    assert MonitorSpec(gem_e2(), 3.0, 0.05).method == Method(KERNELS[0], Form(FORMS[0]))
    assert "a budget over the operating region" in told["local"]
    assert "outward throughout the tube" in told["enclosed"]


def test_a_bundle_is_decided_by_one_of_the_three() -> None:
    given: Deciding = "FailSafe"  # type: ignore[assignment]
    assert MonitorSpec(gem_e2(), 3.0, 0.05, deciding=given).deciding is Deciding.FAIL_SAFE
    given = "all"  # type: ignore[assignment]
    with pytest.raises(InputError, match="got 'all'"):
        MonitorSpec(gem_e2(), 3.0, 0.05, deciding=given)
