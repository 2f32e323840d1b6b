"""Every example in the documents and docstrings does what it says.

A fenced block of `python` or `console` directly below the line `<!-- runs -->` is executed; Python
blocks of one document share their names, and console lines run in one folder per document. Every
other `$ workbench ...` line of the documents must still be accepted by the command's parser.
"""

from __future__ import annotations

import doctest
import importlib
import os
import pkgutil
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import workbench
from workbench.cli.main import COMMANDS, load_command

ROOT = Path(__file__).parent.parent
DOCUMENTS = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"(?ms)^(<!-- runs -->\n)?```(python|console)\n(.*?)^```$")
MODULES = sorted(
    module.name
    for module in pkgutil.walk_packages(workbench.__path__, "workbench.")
    if not module.name.startswith("workbench.cli.templates.")
)


def blocks(document: Path) -> list[tuple[bool, str, str]]:
    """(marked as running, language, text) of each block, in order."""
    found = BLOCK.findall(document.read_text(encoding="utf-8"))
    return [(bool(mark), language, text) for mark, language, text in found]


def command_lines(text: str) -> list[list[str]]:
    """The words after `$ workbench` of each such line."""
    lines = re.findall(r"(?m)^\$ workbench +(.*)$", text.replace("\\\n", " "))
    return [shlex.split(line, comments=True) for line in lines]


def title(document: Path) -> str:
    return str(document.relative_to(ROOT))


RUNNING = [each for each in DOCUMENTS if any(mark for mark, _, _ in blocks(each))]
ALL_LINES = [
    words
    for document in DOCUMENTS
    for _, language, text in blocks(document)
    if language == "console"
    for words in command_lines(text)
]


@pytest.mark.parametrize("document", RUNNING, ids=title)
def test_marked_blocks_run(document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "__main__"}
    for marked, language, text in blocks(document):
        if marked and language == "python":
            exec(compile(text, title(document), "exec"), names)
        elif marked:
            for words in command_lines(text):
                run_command(words, tmp_path)


def run_command(words: list[str], folder: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-m", "workbench.cli.main", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert ran.returncode == 0, f"workbench {shlex.join(words)}\n{ran.stdout}{ran.stderr}"


def parsed(words: list[str]) -> None:
    name, *rest = words
    if name in ("--help", "--version"):
        return
    assert name in COMMANDS
    parser = load_command(name).parser()
    try:
        parser.parse_args(rest)
    except SystemExit as leaving:
        assert leaving.code == 0, f"workbench {shlex.join(words)} is not accepted"


@pytest.mark.parametrize("words", ALL_LINES, ids=" ".join)
def test_every_command_line_in_the_documents_is_accepted(words: list[str]) -> None:
    parsed(words)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_line_in_an_example_is_accepted(name: str) -> None:
    text = re.sub(r"(?m)^workbench ", "$ workbench ", load_command(name).example)
    lines = command_lines(text)
    assert lines
    for words in lines:
        parsed(words)


@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples_hold(name: str) -> None:
    assert doctest.testmod(importlib.import_module(name)).failed == 0
