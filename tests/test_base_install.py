"""What drives, and the command line's frame, work without any analysis package."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from workbench.cli.main import PACKAGES_OF_EXTRAS

ROOT = Path(__file__).parent.parent
ABSENT = sorted(name for packages in PACKAGES_OF_EXTRAS.values() for name in packages)

BLOCK = f"""
import importlib.abc, sys
class Block(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {ABSENT!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Block())
"""


def run_without_extras(program: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", BLOCK + program],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def command(*words: str) -> subprocess.CompletedProcess[str]:
    return run_without_extras(
        f"from workbench.cli.main import main\nsys.exit(main({list(words)!r}))"
    )


def test_the_block_blocks() -> None:
    result = run_without_extras("import casadi")
    assert "No module named 'casadi'" in result.stderr


def modules_of(package: str) -> list[str]:
    folder = ROOT / "workbench" / package
    names = [path.stem for path in folder.glob("*.py") if not path.stem.startswith("__")]
    return [f"workbench.{package}", *(f"workbench.{package}.{name}" for name in sorted(names))]


@pytest.mark.parametrize(
    "module", [*modules_of("runtime"), *modules_of("sets"), "workbench.claims", "workbench.errors"]
)
def test_what_drives_imports(module: str) -> None:
    result = run_without_extras(f"import {module}")
    assert result.returncode == 0, result.stderr


def test_help_lists_every_command() -> None:
    result = command("--help")
    assert result.returncode == 0, result.stderr
    assert "doctor" in result.stdout


def test_doctor_says_what_the_machine_lacks() -> None:
    result = command("doctor")
    assert "Traceback" not in result.stderr
    assert "C compilers" in result.stdout


@pytest.mark.parametrize("name", ["derive", "learn", "examine", "reach", "gains"])
def test_an_analysis_command_names_its_extra(name: str) -> None:
    result = command(name)
    assert result.returncode == 2, result.stderr
    assert f"`workbench {name}` needs the analysis extra" in result.stderr
    assert "pip install 'reach-workbench[analysis]'" in result.stderr
    assert len(result.stderr.splitlines()) == 1
