"""`doctor` fails exactly when something is missing that the installed extras need."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from workbench.cli import doctor
from workbench.cli.main import main

NEEDED = ("casadi", "numpy", "scipy", "cvxpy", "clarabel", "control", "filterpy", "matplotlib")


def doctor_status(capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, object]]:
    status = main(["doctor", "--json"])
    return status, json.loads(capsys.readouterr().out)


def test_doctor_is_content_here(capsys: pytest.CaptureFixture[str]) -> None:
    status, data = doctor_status(capsys)
    assert (status, data["ready"]) == (0, True)
    assert main(["doctor"]) == 0
    assert "ready" in capsys.readouterr().out


def test_doctor_misses_a_compiler(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    status, data = doctor_status(capsys)
    assert (status, data["ready"]) == (1, False)
    assert main(["doctor"]) == 1
    assert "missing: cc, gcc, clang" in capsys.readouterr().out


def hide(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Let these packages look absent."""
    real = doctor.importlib.metadata.version

    def version(wanted: str) -> str:
        if wanted in names:
            raise doctor.importlib.metadata.PackageNotFoundError(wanted)
        return real(wanted)

    monkeypatch.setattr(doctor.importlib.metadata, "version", version)


@pytest.mark.parametrize("name", NEEDED)
def test_doctor_misses_each_package(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    hide(monkeypatch, name)
    assert main(["doctor"]) == 1
    assert f"missing: {name}\n" in capsys.readouterr().out


@pytest.mark.parametrize("left", [(), ("numpy", "scipy", "matplotlib")])
def test_doctor_is_content_with_a_base_install(
    left: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    hide(monkeypatch, *(name for name in NEEDED if name not in left))
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["doctor"]) == 0
    shown = capsys.readouterr().out
    assert "analysis extra not installed (needed for derive, build, replay, demo)" in shown
    assert "MISSING" not in shown
    hide(monkeypatch, *NEEDED, "python-can")
    assert main(["doctor"]) == 1
