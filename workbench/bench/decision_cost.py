"""Time and instructions of whole decisions, called in C from one process, one core."""

from __future__ import annotations

import contextlib
import itertools
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Final, final

import numpy as np

from workbench.bench.decision_kernel import ENTRY, DecisionKernel
from workbench.bench.decision_scenes import Scene
from workbench.bench.online_cost import run
from workbench.codegen.compiler import find_compiler
from workbench.reach.tube import Array
from workbench.runtime.layout import TUBES

# Queries that one process is given; what it has read lies in memory.
CHUNK: Final = 1000
# A scene is decided twice: as called, and again in case that something else took the core.
_CALLS: Final = 2
_TIMES: Final = 2
COUNTS_FILE: Final = "counts"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Calls:
    """What N calls took and found.

    first_us: of the first call of each scene (N,); quickest_us: of the quicker of two; spent:
    attempted steps (N,); verdicts: numbers as the kernel writes them, of the deciding level, by
    tube (N, 3); cells: tubes that what is reported is the hull of, by tube (N, 3).
    """

    first_us: Array
    quickest_us: Array
    spent: Array
    verdicts: Array
    cells: Array

    @property
    def proved(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Where TRACK and TRACK-then-BRAKE are safe: both policies let the car go on."""
        both = [TUBES.index("track"), TUBES.index("stop")]
        return np.asarray((self.verdicts[:, both] == 0.0).all(axis=1))


def timed_calls(
    kernel: DecisionKernel, scenes: Iterable[Scene], *, advance: Callable[[], None] = lambda: None
) -> Calls:
    """Decide every scene, in the order given; `advance` is called after every thousand.

    Raises InputError without a C compiler.
    """
    told = []
    with decision_folder(kernel) as folder:
        rest = iter(scenes)
        while chunk := list(itertools.islice(rest, CHUNK)):
            write_input(kernel, chunk, folder)
            lines = run(["./harness", "./kernel.so", "input", str(_CALLS)], folder).stdout
            told.append(np.array([line.split() for line in lines.splitlines()], dtype=float))
            advance()
    numbers = np.concatenate(told)
    times, results = np.split(numbers, [_TIMES], axis=1)
    spent, verdicts, cells = np.split(results, [1, 1 + len(TUBES)], axis=1)
    return Calls(times[:, 0] / 1e3, times[:, 1] / 1e3, spent[:, 0], verdicts, cells)


def instructions(kernel: DecisionKernel, scenes: Sequence[Scene]) -> int | None:
    """Instructions of one call per scene, by callgrind; None without valgrind."""
    with decision_folder(kernel) as folder:
        write_input(kernel, scenes, folder)
        return counted(folder)


def counted(folder: Path, *, toggle: str = ENTRY, dump_after: str | None = None) -> int | None:
    """Instructions inside `toggle` while every query in `folder` is decided once.

    callgrind's files are left there: `COUNTS_FILE`, and with `dump_after` one more per call of that
    function, numbered from 1. None without valgrind.
    """
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        return None
    options = ["--tool=callgrind", "--collect-atstart=no", f"--toggle-collect={toggle}"]
    options += [f"--callgrind-out-file={COUNTS_FILE}"]
    options += [f"--dump-after={dump_after}"] if dump_after else []
    command = [valgrind, *options, "./harness", "./kernel.so", "input", "1"]
    found = re.search(r"Collected : (\d+)", run(command, folder).stderr)
    return int(found.group(1)) if found else None


@contextlib.contextmanager
def decision_folder(kernel: DecisionKernel) -> Iterator[Path]:
    """A temporary folder with the kernel and the compiled harness in it."""
    with tempfile.TemporaryDirectory(prefix="workbench-") as name:
        folder = Path(name)
        source = (files("workbench.bench") / "c" / "decision_harness.c").read_text()
        (folder / "harness.c").write_text(source)
        run([find_compiler(), "-std=c99", "-O2", "-o", "harness", "harness.c", "-ldl"], folder)
        (folder / "kernel.so").write_bytes(kernel.shared_object)
        yield folder


def write_input(kernel: DecisionKernel, scenes: Sequence[Scene], folder: Path) -> None:
    """Write what the harness reads."""
    at, into = kernel.spans(kernel.query), kernel.spans(kernel.result)
    head, pieces, tail = at["people_tubes"].start, at["people_pieces"].start, at["skew_s"].start
    asked = [into["spent"].start]
    for name in ("verdicts", "cells"):
        shift = kernel.sizes.deciding if name == "verdicts" else 0
        asked += [into[f"{tube}_{name}"].start + shift for tube in TUBES]
    sizes = [kernel.query_size, kernel.result_size, head, kernel.query_size - tail, pieces, tail,
             len(asked), len(scenes)]  # fmt: skip
    parts: list[Sequence[float] | Array] = [sizes, asked]
    for each in scenes:
        numbers = kernel.numbers(each.values)
        people = each.values["people_tubes"], each.values["people_pieces"]
        parts += [list(map(len, people)), numbers[:head], *people, numbers[tail:]]
    (folder / "input").write_bytes(np.concatenate(parts).tobytes())
