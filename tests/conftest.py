"""Optional tools skip their tests by name; `--forbid-skips` turns every skip into a failure.

A C text that several tests or commands compile is compiled once in a run (see `compile_once`).
"""

from __future__ import annotations

import importlib
import os
import shlex
import shutil
import sys
import tempfile
from collections.abc import Callable, Generator
from pathlib import Path
from types import ModuleType

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--forbid-skips", action="store_true", help="a skipped test is a failure")


_COMPILED_ONCE = "TESTS_COMPILED_ONCE"
"""Environment variable: the folder with the `cc` that all processes of this run use."""


def pytest_configure(config: pytest.Config) -> None:
    """Put a `cc` on the PATH, before the workers start, that shares what it compiles."""
    compiler = shutil.which("cc")
    if hasattr(config, "workerinput") or compiler is None:
        return
    folder = Path(tempfile.mkdtemp(prefix="workbench-cc-"))
    (folder / "kept").mkdir()
    front = Path(__file__).parent / "compile_once.py"
    words = [sys.executable, "-I", "-S", str(front), compiler, str(folder / "kept")]
    (folder / "cc").write_text(f'#!/bin/sh\nexec {shlex.join(words)} "$@"\n')
    (folder / "cc").chmod(0o755)
    before = os.environ.get("PATH", os.defpath)
    os.environ |= {"PATH": f"{folder}{os.pathsep}{before}", _COMPILED_ONCE: str(folder)}

    def undo() -> None:
        os.environ["PATH"] = before
        del os.environ[_COMPILED_ONCE]
        shutil.rmtree(folder)

    config.add_cleanup(undo)


@pytest.fixture
def compile_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test's compilations share nothing: for what is said of compiling twice."""
    if shared := os.environ.get(_COMPILED_ONCE):
        folders = os.environ["PATH"].split(os.pathsep)
        monkeypatch.setenv("PATH", os.pathsep.join(each for each in folders if each != shared))


@pytest.fixture
def require_tool() -> Callable[..., str]:
    """Call with program names, any of which will do; returns the path of the first, or skips."""

    def find(*programs: str) -> str:
        for program in programs:
            if path := shutil.which(program):
                return path
        pytest.skip(f"needs the optional tool {' or '.join(programs)}")

    return find


@pytest.fixture
def require_package() -> Callable[[str], ModuleType]:
    """Call with an import name; returns the module, or skips."""

    def load(name: str) -> ModuleType:
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if (error.name or "").partition(".")[0] != name.partition(".")[0]:
                raise
            pytest.skip(f"needs the optional package {name}")

    return load


def _forbid(report: pytest.TestReport | pytest.CollectReport) -> None:
    if report.skipped and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome = "failed"
        report.longrepr = f"skips are forbidden here: {reason}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if item.config.getoption("--forbid-skips"):
        _forbid(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    if collector.config.getoption("--forbid-skips"):
        _forbid(report)
    return report
