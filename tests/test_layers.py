"""Imports point only downwards, and a wrong one is caught."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def lint(tree: Path) -> subprocess.CompletedProcess[str]:
    program = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports())"
    return subprocess.run(
        [sys.executable, "-P", "-c", f"import sys; sys.path.insert(0, '.'); {program}"],
        cwd=tree,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    sources = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "workbench", tmp_path / "workbench", ignore=sources)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def test_the_tree_keeps_its_contracts(tree: Path) -> None:
    result = lint(tree)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize(
    ("module", "line", "broken"),
    [
        ("runtime/wrong.py", "import casadi", "what drives needs no analysis package BROKEN"),
        ("sets/wrong.py", "import numpy", "what drives needs no analysis package BROKEN"),
        ("sets/wrong.py", "import workbench.claims", "imports point down BROKEN"),
        ("controllers/wrong.py", "import workbench.models", "imports point down BROKEN"),
        ("sensitivity/wrong.py", "import workbench.reach", "imports point down BROKEN"),
        ("reach/wrong.py", "import workbench.cli", "imports point down BROKEN"),
    ],
)
def test_a_wrong_import_is_caught(tree: Path, module: str, line: str, broken: str) -> None:
    (tree / "workbench" / module).write_text(f"{line}\n")
    result = lint(tree)
    assert result.returncode != 0
    assert broken in result.stdout


def test_a_package_outside_the_layers_is_caught(tree: Path) -> None:
    (tree / "workbench" / "unplaced.py").write_text("")
    result = lint(tree)
    assert result.returncode != 0
    assert "unplaced" in result.stdout + result.stderr
