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

ENDLESS = Path("/dev/zero")


def test_a_written_certificate_is_proved(tmp_path: Path) -> None:
    bound = derive_discrepancy(pendulum(), region=REGION, horizon_s=1.5, method=METHODS["max"])
    file = tmp_path / "bound.json"
    slack = write_certificate(file, pendulum(), bound, initial_radius=RADIUS, instants_s=(0.5, 1.5))
    assert slack == 1e-9
    result = invoke("check", file)
    assert result.status == 0, result.err
    assert result.out.startswith("proved: Let x, y solve the model")
    assert "width at 0.5 s  width at 1.5 s" in result.out
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


@pytest.mark.parametrize(
    "name", ["\ud800", "a\nproved: it is safe", "\x1b[2J", "\u202e", "x" * 10_000]
)
def test_a_name_adds_neither_lines_nor_commands(name: str, tmp_path: Path) -> None:
    document = json.loads(json.dumps(spread("max")))
    file = tmp_path / "bound.json"
    file.write_text(certificate_text(document), encoding="utf-8")
    lines = len(invoke("check", file).out.splitlines())
    document["model"]["states"][0] = name
    file.write_text(certificate_text(document), encoding="utf-8")
    result = invoke("check", file)
    assert result.status == 0
    assert len(result.out.splitlines()) == lines
    assert name not in result.out


def test_figures_are_rounded_to_the_weaker_side(tmp_path: Path) -> None:
    document = json.loads(json.dumps(spread("max")))
    claim = document["claim"]
    claim["initial"] = [0.09999999, 0.04999999]
    claim["instants"] = [{"time_s": 0.1, "widths": [9.00001, 9.5]}] * 5000
    claim["region"] = [[-0.79999, 0.79999], [-0.9, 0.9]]
    file = tmp_path / "bound.json"
    file.write_text(certificate_text(document), encoding="utf-8")
    out = invoke("check", file).out
    row = next(line for line in out.splitlines() if line.startswith("angle")).split()
    assert row[1:6] == ["-0.7999", "0.7999", "0.09999", "9.001", "9.001"]
    assert max(map(len, out.splitlines())) < 1000


@pytest.mark.skipif(not ENDLESS.exists(), reason="needs a device that never ends")
def test_a_file_without_end_is_refused() -> None:
    result = invoke("check", ENDLESS)
    assert result.status == 2
    assert "larger than 16 MiB" in result.err


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "it is not JSON"),
        ("{", "it is not JSON"),
        ("\x00\xff", "it is not JSON"),
        ("[" * 100_000, "nests deeper than 8 levels"),
        ("[]", "it has no format"),
        ('{"format": "workbench certificate 0"}', "its format is 'workbench certificate 0'"),
        ('{"format": "workbench certificate 1"}', "the file: expected"),
        ('{"format": ' + "9" * 100_000 + "}", "the file: expected an object of format, statement"),
    ],
)
def test_what_is_no_certificate_is_named_in_one_line(
    content: str, said: str, tmp_path: Path
) -> None:
    file = tmp_path / "bound.json"
    file.write_text(content, encoding="latin-1")
    result = invoke("check", file)
    assert result.status == 2
    assert said in result.err
    assert len(result.err.splitlines()) == 1
    assert len(result.err) < 600
    assert result.out == ""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"statement": "It is safe."}, "it states something else (altered, or another version)"),
        ({"kind": "proof"}, "kind: expected spread or tube"),
        ({"kind": 1}, "the file.kind: expected text, got 1"),
        ({"claim": []}, "claim: expected an object of region, ranges, differences"),
        ({"proof": {"splits": [1]}}, "proof.splits[0]: expected an object of axis, at, got 1"),
        ({"proof": {"splits": {}}}, "proof.splits: expected a list of items, got {}"),
        ({"proof": {"splits": [{"axis": "0", "at": 0}]}}, "axis: expected an index, got '0'"),
    ],
)
def test_an_altered_file_is_told_what_was_expected(
    change: dict[str, object], said: str, tmp_path: Path
) -> None:
    file = tmp_path / "bound.json"
    file.write_text(json.dumps(spread("max") | change), encoding="utf-8")
    result = invoke("check", file)
    assert result.status == 2
    assert said in result.err
    assert "class" not in result.err


@pytest.mark.parametrize("name", ["", "absent.json"])
def test_what_cannot_be_read_is_told_how_to_be_written(name: str, tmp_path: Path) -> None:
    result = invoke("check", tmp_path / name)
    assert result.status == 2
    assert "write one with `workbench derive --certificate FILE`" in result.err


def test_a_certificate_that_cannot_be_shown_fails_the_claim_and_keeps_the_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("workbench.cli.certificate._SLACKS", (-0.5,))
    file = tmp_path / "bound.json"
    words = ("--horizon", "0.2", "--method", "growth-matrix", "--certificate", file)
    result = invoke("derive", "--system", "b1-small", *words)
    assert result.status == 1
    assert "recommended as a formula: growth-matrix" in result.out
    assert "no certificate for growth-matrix: the independent checker cannot show" in result.out
    assert not file.exists()


def test_what_the_checker_cannot_show_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("workbench.cli.certificate._SLACKS", (-0.5,))
    bound = derive_discrepancy(pendulum(), region=REGION, horizon_s=1.5, method=METHODS["max"])
    file = tmp_path / "bound.json"
    with pytest.raises(InputError, match="cannot show this bound"):
        write_certificate(file, pendulum(), bound, initial_radius=RADIUS, instants_s=(1.5,))
    assert not file.exists()
