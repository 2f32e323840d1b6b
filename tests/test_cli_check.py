"""`workbench check` ends with 0 for a proved claim, 1 for one that is not, 2 for other files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from certificate_cases import METHODS, RADIUS, REGION, pendulum, spread
from cli_fixture import invoke

from workbench.cli.certificate import write_certificate
from workbench.errors import InputError
from workbench.reach.certified.certificate import certificate_text
from workbench.sensitivity import derive_discrepancy


def test_a_written_certificate_is_proved(tmp_path: Path) -> None:
    bound = derive_discrepancy(pendulum(), region=REGION, horizon_s=1.5, method=METHODS["max"])
    file = tmp_path / "bound.json"
    slack = write_certificate(file, pendulum(), bound, initial_radius=RADIUS, instants_s=(0.5, 1.5))
    assert slack == 1e-9
    result = invoke("check", file)
    assert result.status == 0, result.err
    assert result.out.startswith("proved: Let x, y solve the model")
    assert invoke("check", file, "--json").data["proved"] is True


def test_a_false_claim_ends_with_1(tmp_path: Path) -> None:
    document = json.loads(json.dumps(spread("max")))
    document["claim"]["instants"][0]["widths"][0] *= 0.5
    file = tmp_path / "bound.json"
    file.write_text(certificate_text(document), encoding="utf-8")
    result = invoke("check", file)
    assert result.status == 1
    assert result.out.startswith("not proved: a width is smaller than the bound gives")


def test_another_file_ends_with_2(tmp_path: Path) -> None:
    file = tmp_path / "bound.json"
    file.write_text("[]", encoding="utf-8")
    result = invoke("check", file)
    assert result.status == 2
    assert "expected a certificate" in result.err
    assert len(result.err.splitlines()) == 1
    assert invoke("check", tmp_path / "absent.json").status == 2


def test_what_the_checker_cannot_show_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("workbench.cli.certificate._SLACKS", (-0.5,))
    bound = derive_discrepancy(pendulum(), region=REGION, horizon_s=1.5, method=METHODS["max"])
    file = tmp_path / "bound.json"
    with pytest.raises(InputError, match="cannot show this bound"):
        write_certificate(file, pendulum(), bound, initial_radius=RADIUS, instants_s=(1.5,))
    assert not file.exists()
