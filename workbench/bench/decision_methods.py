"""The whole decision by every kernel in every form, on the same scenes."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.bench.decision_cost import Calls, instructions, timed_calls
from workbench.bench.decision_kernel import DecisionKernel
from workbench.bench.decision_latency import Latency, latency
from workbench.bench.decision_scenes import Scene
from workbench.bench.online_memory import object_sections, sections_total
from workbench.reach.online.kernels import KERNELS, Form, Method

METHODS: Final = tuple(Method(*each) for each in itertools.product(KERNELS, Form))
"""Every kernel in every form, the default one first."""
COUNTED: Final = 100
"""Scenes whose instructions are counted."""


@final
@dataclass(frozen=True, slots=True)
class MethodCost:
    """One kernel in one form: its calls; instructions: mean of a decision, None without valgrind;
    code, static: bytes of the object's instructions and of its data that can be written."""

    latency: Latency
    instructions: int | None
    code: int | None
    static: int | None

    def times(self, least: MethodCost) -> float:
        """Median time of the quicker of two calls, over that of `least`."""
        return self.latency.quickest_us[0] / least.latency.quickest_us[0]

    def times_instructions(self, least: MethodCost) -> float | None:
        """Mean instructions over those of `least`; None without valgrind."""
        if self.instructions is None or least.instructions is None:
            return None
        return self.instructions / least.instructions


def method_costs(
    kernels: Sequence[DecisionKernel], scenes: Sequence[Scene], usual: Calls, *,
    advance: Callable[[], None] = lambda: None,
) -> tuple[MethodCost, ...]:  # fmt: skip
    """Decide the same scenes with each kernel; `usual` are the first one's calls.

    `advance` is called after every thousand calls of the others, and once for each kernel.
    """
    costs = []
    for k, kernel in enumerate(kernels):
        found = timed_calls(kernel, scenes, advance=advance) if k else usual
        costs.append(_cost(kernel, scenes[:COUNTED], latency(kernel.sizes, found, usual)))
        advance()
    return tuple(costs)


def _cost(kernel: DecisionKernel, scenes: Sequence[Scene], row: Latency) -> MethodCost:
    total = instructions(kernel, scenes)
    sizes, _ = object_sections(kernel.source)
    return MethodCost(
        row, None if total is None else total // len(scenes), sections_total(sizes, ".text"),
        sections_total(sizes, ".data", ".bss", ".tdata", ".tbss"),
    )  # fmt: skip
