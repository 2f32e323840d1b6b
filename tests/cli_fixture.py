"""One command run in this process, and vehicle files that differ from the shipped one in one place."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from workbench.cli.main import main
from workbench.models.vehicle import gem_e2_path

SHORT = ("--system", "b1-small", "--horizon", "0.5", "--step", "0.05")


class Result(NamedTuple):
    status: int
    out: str
    err: str

    @property
    def data(self) -> Any:
        return json.loads(self.out)


Invoke = Callable[..., Result]


@pytest.fixture
def invoke(capsys: pytest.CaptureFixture[str]) -> Invoke:
    """Run one command in this process."""

    def run(*words: object) -> Result:
        capsys.readouterr()
        status = main([str(word) for word in words])
        shown = capsys.readouterr()
        return Result(status, shown.out, shown.err)

    return run


@pytest.fixture
def changed_vehicle(tmp_path: Path) -> Callable[..., Path]:
    """The shipped vehicle file with one text replaced."""

    def write(old: str, new: str) -> Path:
        text = gem_e2_path().read_text(encoding="utf-8")
        assert text.count(old) == 1
        file = tmp_path / "changed.toml"
        file.write_text(text.replace(old, new), encoding="utf-8")
        return file

    return write
