"""Bytes of code, tables, stack and working memory of a compiled online tube."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench.bench.online_cost import CostCase, harness_folder, prepare, run, touched_stack
from workbench.codegen.compiler import FLAGS, find_compiler
from workbench.codegen.native_calls import exported_size
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark

_DOUBLE = 8
_NODE = re.compile(r'node: { title: "([^"]+)" label: "[^"]*?\\n(\d+) bytes \(([^)]*)\)')
_EDGE = re.compile(r'edge: { sourcename: "([^"]+)" targetname: "([^"]+)"')
# Copies of one function for wider registers; which one runs is decided when the object is loaded.
_COPY = re.compile(r"\.(avx2|default)$")


@final
@dataclass(frozen=True, slots=True)
class OnlineMemory:
    """Bytes of the object that holds one kernel.

    code: .text, every copy for wider registers included; tables: read-only data; static: data that
    can be written (.data, .bss); stack_bound: along the deepest chain of calls, from the compiler's
    frame sizes and call graph, without the C library's memcpy and memset, None where the compiler
    writes no call graph; stack_touched: of a painted stack, in one run; caller: query, result and
    work, which the caller provides.
    """

    code: int | None
    tables: int | None
    static: int | None
    stack_bound: int | None
    stack_touched: int
    caller: int


def online_memory(benchmark: Benchmark, case: CostCase) -> OnlineMemory:
    """Compile the case's source once more, as an object with its call graph, and run it once.

    Sizes are None without the `size` of binutils. Raises InputError without a C compiler.
    """
    kernel = case.kernel
    n = len(benchmark.system.ode.states)
    work = exported_size(kernel.shared_object, "wb_work_size")
    query = len(kernel.query(benchmark.initial_set, case.horizon_s, case.setting.step_s))
    result = 2 + 2 * (2 * kernel.sizes.steps + 1) * n
    with harness_folder() as folder:
        prepare(benchmark, case, folder)
        touched = touched_stack(folder)
    sizes, graph = object_sections(kernel.source)
    return OnlineMemory(
        code=sections_total(sizes, ".text"),
        tables=sections_total(sizes, ".rodata"),
        static=sections_total(sizes, ".data", ".bss", ".tdata", ".tbss"),
        stack_bound=stack_bound(graph, "wb_tube") if graph else None,
        stack_touched=touched,
        caller=_DOUBLE * (work + query + result),
    )


def object_sections(source: str) -> tuple[dict[str, int], str]:
    """Bytes per section of the object, empty without `size`, and the call graph, '' without one."""
    flags = [flag for flag in FLAGS if flag != "-shared"]
    with tempfile.TemporaryDirectory(prefix="workbench-") as name:
        folder = Path(name)
        (folder / "kernel.c").write_text(source)
        command = [find_compiler(), *flags, "-w", "-c", "-o", "kernel.o", "kernel.c"]
        try:
            run([*command, "-fcallgraph-info=su"], folder)
        except InputError:  # clang has no call graph to write
            run(command, folder)
        written = folder / "kernel.ci"
        graph = written.read_text() if written.exists() else ""
        if shutil.which("size") is None:
            return {}, graph
        rows = [
            line.split()
            for line in run(["size", "-A", "-d", "kernel.o"], folder).stdout.split("\n")
        ]
    return {row[0]: int(row[1]) for row in rows if len(row) == 3 and row[1].isdigit()}, graph


def sections_total(sizes: Mapping[str, int], *prefixes: str) -> int | None:
    """Bytes of all sections whose names begin so; None where nothing was measured."""
    if not sizes:
        return None
    return sum(bytes_ for name, bytes_ in sizes.items() if name.startswith(prefixes))


def stack_bound(graph: str, entry: str) -> int:
    """Bytes of the frames along the deepest chain of calls from `entry`.

    graph: what gcc's -fcallgraph-info=su writes; of several copies of one function the largest
    counts. InputError where there is no bound: recursion, a call through a pointer, a frame whose
    size is not known before it runs, or an entry that is not there.
    """
    frames: dict[str, int] = {}
    for title, size, kind in _NODE.findall(graph):
        name = _COPY.sub("", title)
        if kind == "dynamic":
            raise InputError(f"expected frames of fixed size, {name} has one that grows")
        frames[name] = max(frames.get(name, 0), int(size))
    calls: dict[str, set[str]] = defaultdict(set)
    for source, target in _EDGE.findall(graph):
        calls[_COPY.sub("", source)].add(_COPY.sub("", target))
    if entry not in frames:
        raise InputError(f"expected the call graph to hold {entry}")
    known: dict[str, int] = {}

    def depth(name: str, above: tuple[str, ...]) -> int:
        if name in above or name == "__indirect_call":
            raise InputError(f"expected a bounded stack, {above[-1]} calls {name}")
        if name not in known:
            deepest = max((depth(c, (*above, name)) for c in calls[name]), default=0)
            known[name] = frames.get(name, 0) + deepest
        return known[name]

    return depth(entry, ())
