"""What the compiled decision takes from the heap: counted around every call, in C."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Final, final

from workbench.bench.online_cost import run
from workbench.codegen.compiler import find_compiler
from workbench.errors import InputError
from workbench.runtime.contents import Kernel

KINDS: Final = ("malloc", "calloc", "realloc", "free", "aligned")
"""What is counted; the last: memalign, aligned_alloc, posix_memalign."""


@final
@dataclass(frozen=True, slots=True)
class Heap:
    """calls: decisions, of `queries` different queries in turns; by_kind: calls of the heap inside
    them; imports: what the library asks others for, None without `nm`; marks: (decisions, resident
    MiB) of a process that does nothing else."""

    calls: int
    queries: int
    by_kind: Mapping[str, int]
    imports: tuple[str, ...] | None
    marks: tuple[tuple[int, float], ...]


def heap(
    library: Path,
    queries: Path,
    *,
    kernel: Kernel,
    calls: int,
    prefix: Sequence[str] = (),
    line: Callable[[str], None] = lambda _: None,
) -> Heap:
    """Decide the queries of a file in turns, in C; `line` takes a line per hundredth part, `prefix`
    starts the process.

    The C library must be glibc. Raises InputError without a C compiler, and where it fails.
    """
    with tempfile.TemporaryDirectory(prefix="workbench-") as name:
        folder = Path(name)
        _compile_harness(folder)
        sizes = (kernel.query_size, kernel.result_size)
        words = (library.resolve(), queries.resolve(), *sizes, calls)
        lines = []
        with subprocess.Popen(
            [*prefix, "./harness", *map(str, words)], cwd=folder, stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None, "a pipe was asked for"
            try:
                for each in process.stdout:
                    lines.append(each)
                    line(each)
            except BaseException:
                process.kill()
                raise
    if process.returncode:
        raise InputError(f"expected {library} to decide {queries}, it failed")
    *marks, counted = lines
    pairs = [re.findall(r"\d+", mark)[:2] for mark in marks]
    return Heap(
        calls, queries.stat().st_size // (8 * kernel.query_size),
        dict(zip(KINDS, map(int, counted.split()), strict=True)), _imports(library),
        tuple((int(count), int(kib) / 1024) for count, kib in pairs),
    )  # fmt: skip


def _compile_harness(folder: Path) -> None:
    source = (files("workbench.bench") / "c" / "heap_harness.c").read_text()
    (folder / "harness.c").write_text(source)
    # The compiler knows malloc, and would leave out what it takes to be unused.
    flags = ("-std=c99", "-O2", "-fno-builtin")
    run([find_compiler(), *flags, "-o", "harness", "harness.c", "-ldl"], folder)


def _imports(library: Path) -> tuple[str, ...] | None:
    """Functions that others must provide, but for those that may be missing."""
    if shutil.which("nm") is None:
        return None
    told = run(["nm", "--dynamic", "--undefined-only", str(library.resolve())], library.parent)
    found = (text.split() for text in told.stdout.splitlines())
    return tuple(sorted(words[-1].partition("@")[0] for words in found if words[-2] == "U"))
