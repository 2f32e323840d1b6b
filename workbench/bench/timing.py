"""Time and instructions of the online tubes beside the compiled trajectory alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from workbench.bench.online_cost import CostCase, online_costs
from workbench.bench.online_kernels import Setting, compiled, kernel_functions, steps_in
from workbench.bench.scoreboard import ONLINE_KERNEL
from workbench.bench.tightness import SCORE_STEP_S
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark
from workbench.reach.online.kernels import Form

_STEPS = 60


@final
@dataclass(frozen=True, slots=True)
class KernelTime:
    """Cost of one call in steps of 0.05 s, in C, without any interpreter.

    steps: 60, or as many as the tube is proved for; method: as on the board of tightness; tube_us,
    trajectory_us: medians of interleaved runs, microseconds; ratio: median of the rounds'
    quotients; tube_instructions, trajectory_instructions, instruction_ratio: by callgrind, None
    without valgrind.
    """

    loop: str
    method: str
    steps: int
    rounds: int
    tube_us: float
    trajectory_us: float
    ratio: float
    tube_instructions: int | None
    trajectory_instructions: int | None
    instruction_ratio: float | None


def kernel_times(benchmark: Benchmark) -> tuple[KernelTime, ...]:
    """Measure one loop in every form, as far as its tube is proved.

    Raises InputError without a C compiler, and where a tube cannot do its first step.
    """
    cases = []
    for form in Form:
        functions = kernel_functions(benchmark, ONLINE_KERNEL, form)
        kernel = compiled(functions, horizon_s=_STEPS * SCORE_STEP_S, step_s=SCORE_STEP_S)
        tube = kernel.tube(
            benchmark.initial_set, horizon_s=_STEPS * SCORE_STEP_S, step_s=SCORE_STEP_S
        )
        if len(tube.times) == 1:
            raise InputError(f"{benchmark.name}: expected a tube to measure, got {tube.message}")
        setting = Setting(ONLINE_KERNEL, form, SCORE_STEP_S, 1)
        cases.append(CostCase(kernel, setting, float(tube.times[-1])))
    return tuple(
        KernelTime(
            benchmark.name, f"online-{cost.setting.form.value}",
            steps_in(cost.horizon_s, SCORE_STEP_S), cost.rounds, cost.tube_us,
            cost.trajectory_us, cost.ratio, cost.tube_instructions, cost.trajectory_instructions,
            cost.instruction_ratio,
        )
        for cost in online_costs(benchmark, cases)
    )  # fmt: skip
