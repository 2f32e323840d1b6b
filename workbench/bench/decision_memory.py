"""Bytes of the compiled decision: code, tables, stack, and the vectors that its caller provides."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.bench.decision_kernel import ENTRY, DecisionKernel
from workbench.bench.decision_scenes import Scene
from workbench.bench.online_cost import harness_folder, touched_stack
from workbench.bench.online_memory import object_sections, sections_total, stack_bound
from workbench.codegen.compiler import compile_shared
from workbench.codegen.decision_header import decision_header
from workbench.codegen.trajectory import CompiledTrajectory
from workbench.models.benchmarks import b1_small

_DOUBLE: Final = 8


@final
@dataclass(frozen=True, slots=True)
class DecisionMemory:
    """Bytes of the object that holds the decision.

    code: .text, every copy for wider registers included; tables: read-only data; static: data that
    can be written (.data, .bss); None without the `size` of binutils. stack_bound: along the
    deepest chain of calls, from the compiler's frame sizes and call graph, without the C library's
    memcpy and memset, None where the compiler writes no call graph; stack_touched: of a painted
    stack, in one run over several scenes. query, result, work: vectors of the caller. header: of
    the text that a user includes.
    """

    code: int | None
    tables: int | None
    static: int | None
    stack_bound: int | None
    stack_touched: int
    query: int
    result: int
    work: int
    header: int


def decision_memory(kernel: DecisionKernel, scenes: Sequence[Scene]) -> DecisionMemory:
    """Compile the kernel's text once more, with its call graph, and decide every scene once."""
    sizes, graph = object_sections(kernel.source)
    return DecisionMemory(
        code=sections_total(sizes, ".text"),
        tables=sections_total(sizes, ".rodata"),
        static=sections_total(sizes, ".data", ".bss", ".tdata", ".tbss"),
        stack_bound=stack_bound(graph, ENTRY) if graph else None,
        stack_touched=_touched(kernel, scenes),
        query=_DOUBLE * kernel.query_size,
        result=_DOUBLE * kernel.result_size,
        work=_DOUBLE * kernel.work_size,
        header=len(decision_header(kernel.query, kernel.result).encode()),
    )


def _touched(kernel: DecisionKernel, scenes: Sequence[Scene]) -> int:
    """The harness of the online tubes paints the stack below `wb_tube`; the decision takes its
    name, and the trajectory beside it is not run."""
    renamed = re.sub(rf"\b{ENTRY}\b", "wb_tube", re.sub(r"\bwb_tube\b", "wb_one", kernel.source))
    trajectory = CompiledTrajectory(b1_small().system, steps=1)
    queries = [kernel.numbers(scene.values) for scene in scenes]
    sizes = [len(queries), 1, kernel.query_size, kernel.result_size, 1, 1, 1, 1]
    content = np.concatenate([np.array(sizes, dtype=float), *queries, np.full(4, math.nan)])
    with harness_folder() as folder:
        (folder / "input").write_bytes(content.tobytes())
        shared = compile_shared(renamed).shared_object
        (folder / "tube.so").write_bytes(shared)
        (folder / "trajectory.so").write_bytes(trajectory.shared_object)
        return touched_stack(folder)
