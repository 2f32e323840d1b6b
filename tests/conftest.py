"""Optional tools skip their tests by name; `--forbid-skips` turns every skip into a failure."""

from __future__ import annotations

import importlib
import shutil
from collections.abc import Callable, Generator
from types import ModuleType

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--forbid-skips", action="store_true", help="a skipped test is a failure")


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
