"""One command run in this process, and vehicle files that differ from the shipped one."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path
from typing import Any, NamedTuple

from workbench.cli.main import main
from workbench.models.vehicle import gem_e2_path

SHORT = ("--system", "b1-small", "--horizon", "0.5", "--step", "0.05")


class Result(NamedTuple):
    """Exit status and what was printed."""

    status: int
    out: str
    err: str

    @property
    def data(self) -> Any:
        """Standard output as JSON."""
        return json.loads(self.out)


def invoke(*words: object) -> Result:
    """Run `workbench` with these words."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main([str(word) for word in words])
    return Result(status, out.getvalue(), err.getvalue())


def changed_vehicle(folder: Path, old: str, new: str) -> Path:
    """The shipped vehicle file with one text replaced, in `folder`."""
    text = gem_e2_path().read_text(encoding="utf-8")
    assert text.count(old) == 1
    file = folder / "changed.toml"
    file.write_text(text.replace(old, new), encoding="utf-8")
    return file
