"""Programs in processes of their own, beside busy cores or not, with a priority or without."""

from __future__ import annotations

import contextlib
import enum
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Final, final

import workbench
from workbench.errors import InputError

ANALYSIS: Final = frozenset({
    "numpy", "casadi", "control", "scipy", "cvxpy", "clarabel", "filterpy", "matplotlib", "rosbags",
})  # fmt: skip
"""Packages that are not on a vehicle."""
REALTIME: Final = ("chrt", "--fifo", "10")
"""What gives a command real-time priority."""
# 8 MiB are copied over and over, so that the caches are taken as well as the core.
_BUSY: Final = "block = bytearray(1 << 23)\nwhile True:\n    bytes(block)"


@final
class Cores(enum.Enum):
    """What else runs: nothing of ours; a process per core that takes all it gets, at our priority;
    the same while what is measured has real-time priority (SCHED_FIFO), as it should on a
    vehicle."""

    IDLE = "idle"
    BUSY = "busy"
    BUSY_REALTIME = "busy, real-time"


@contextlib.contextmanager
def beside(cores: Cores) -> Iterator[None]:
    """Keeps every core busy meanwhile, or none."""
    busy: list[subprocess.Popen[bytes]] = []
    try:
        for core in sorted(os.sched_getaffinity(0)) if cores is not Cores.IDLE else ():
            busy.append(subprocess.Popen([sys.executable, "-c", _BUSY]))
            os.sched_setaffinity(busy[-1].pid, {core})
        yield
    finally:
        for each in busy:
            each.kill()
        for each in busy:
            each.wait()


def has_realtime() -> bool:
    """Whether processes of ours may have real-time priority."""
    if shutil.which(REALTIME[0]) is None:
        return False
    return subprocess.run([*REALTIME, "true"], capture_output=True, check=False).returncode == 0


def environment() -> Mapping[str, str]:
    """Of a process that finds the workbench."""
    root = str(Path(workbench.__file__).resolve().parents[1])
    return {**os.environ, "PYTHONPATH": root}


@contextlib.contextmanager
def told_by(
    program: str,
    arguments: Sequence[str],
    *,
    cores: Cores,
    line: Callable[[str], None] = lambda _: None,
) -> Iterator[tuple[Mapping[str, Any], Path]]:
    """Runs a program of this package as a file of its own, to its end, in a folder.

    What it wrote there as told.json, and the folder; line: takes what it prints. Raises InputError
    with its last words where it fails, and where analysis packages were in its memory.
    """
    path = str(files("workbench.bench") / program)
    prefix = REALTIME if cores is Cores.BUSY_REALTIME else ()
    with tempfile.TemporaryDirectory(prefix="workbench-") as name, beside(cores):
        command = [*prefix, sys.executable, "-P", path, *arguments, name]
        with (
            open(Path(name) / "errors", "w+") as errors,
            subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=errors, text=True, env=environment()
            ) as process,
        ):
            assert process.stdout is not None, "a pipe was asked for"
            try:
                for each in process.stdout:
                    line(each)
            except BaseException:
                process.kill()
                raise
            if process.wait():
                errors.seek(0)
                words = (errors.read().strip().splitlines() or ["no message"])[-1]
                raise InputError(f"expected {program} to measure the bundle, it failed: {words}")
        told = json.loads((Path(name) / "told.json").read_text())
        there = ANALYSIS & {module.partition(".")[0] for module in told["modules"]}
        if there:
            raise InputError(f"expected {program} without analysis packages, got {sorted(there)}")
        yield told, Path(name)
