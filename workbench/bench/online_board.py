"""The online kernels on one loop: width, escapes, time, instructions and memory, side by side."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

from workbench.bench.online_agreement import Agreement, agreement
from workbench.bench.online_cost import CostCase, OnlineCost, online_costs
from workbench.bench.online_kernels import (
    SPLIT_AXES,
    Setting,
    compiled,
    kernel_functions,
    tube_of_cells,
)
from workbench.bench.online_memory import OnlineMemory, online_memory
from workbench.bench.samples import SamplePlan, sampled_runs
from workbench.bench.tightness import SCORE_STEP_S, HorizonScore, Samples
from workbench.codegen.online_tube import OnlineTube
from workbench.models.benchmarks import Benchmark
from workbench.reach import Partitioned, ReachTube, ValidatedTube, compute_tube
from workbench.reach.online.functions import OnlineFunctions
from workbench.reach.online.kernels import Form

HORIZON_S = 3.0
GROWTH_S = (1.0, 2.0, 3.0, 4.0, 5.0)


@final
@dataclass(frozen=True, slots=True)
class OnlineRow:
    """One setting on one loop. score: against the samples, at the instants and segments of 0.05 s,
    or of the step where that is longer; cost: None where the tube ends early."""

    setting: Setting
    rigor: str
    status: str
    proved_until_s: float
    score: HorizonScore
    cost: OnlineCost | None


@final
@dataclass(frozen=True, slots=True)
class ValidatedRow:
    """The validated tube beside: cells, Rigor, how it ended, seconds, scores as `OnlineRow`."""

    cells: int
    rigor: str
    status: str
    proved_until_s: float
    elapsed_s: float
    score: HorizonScore


@final
@dataclass(frozen=True, slots=True)
class KernelFacts:
    """What holds for one kernel in one form: memory for 60 steps of 0.05 s, agreement of its C with
    CasADi, and cost over 1 to 5 s in steps of 0.05 s, one set, up to where the tube is complete."""

    kernel: str
    form: Form
    memory: OnlineMemory
    agreement: tuple[Agreement, ...]
    growth: tuple[OnlineCost, ...]


@final
@dataclass(frozen=True, slots=True)
class OnlineBoard:
    """Everything about the online kernels on one loop."""

    loop: str
    trajectories: int
    rows: tuple[OnlineRow, ...]
    validated: tuple[ValidatedRow, ...]
    kernels: tuple[KernelFacts, ...]

    @property
    def escapes(self) -> int:
        """Trajectories outside any tube of the board, over all tubes."""
        scores = [row.score for row in self.rows] + [row.score for row in self.validated]
        return sum(score.escapes for score in scores)

    @property
    def disagreements(self) -> int:
        """Inputs for which the C had other bits than CasADi, or than itself unoptimised."""
        return sum(
            sum(found.differing.values()) for facts in self.kernels for found in facts.agreement
        )


@final
@dataclass(frozen=True, slots=True)
class OnlinePlan:
    """settings: the rows; count, seed: of the sampled trajectories and inputs; step_s: of the
    trajectories; inputs: random ones per generated Function; rounds: of the clock; growth_s:
    horizons over which the cost is followed."""

    settings: tuple[Setting, ...]
    count: int
    seed: int
    step_s: float
    inputs: int
    rounds: int
    growth_s: tuple[float, ...]

    @property
    def samples(self) -> SamplePlan:
        """The trajectories to sample, over 3 s."""
        return SamplePlan(self.count, HORIZON_S, self.step_s, self.seed)

    @property
    def kinds(self) -> tuple[tuple[str, Form], ...]:
        """Kernels and forms that occur, once each."""
        return tuple(dict.fromkeys((s.kernel, s.form) for s in self.settings))

    @property
    def parts(self) -> tuple[int, ...]:
        """Partitions that occur, by their parts along each split axis."""
        return tuple(sorted({s.parts for s in self.settings}))

    @property
    def units_of_work(self) -> int:
        """How often `online_board` counts on."""
        cases = len(self.settings) + len(self.kinds) * (len(self.growth_s) + 1)
        return cases + len(self.parts) + self.samples.blocks


def online_board(
    benchmark: Benchmark, plan: OnlinePlan, *, advance: Callable[[], None]
) -> OnlineBoard:
    """Measure all of it; every tube is held against the same samples. `advance` counts on after
    each of `plan.units_of_work` pieces. Raises InputError without a C compiler."""
    functions = {kind: kernel_functions(benchmark, *kind) for kind in plan.kinds}
    kernels = _kernels(functions, plan)
    cases = [CostCase(kernels[s.kernel, s.form, s.step_s], s, HORIZON_S) for s in plan.settings]
    tubes = [
        tube_of_cells(case.kernel, benchmark, case.setting, horizon_s=HORIZON_S) for case in cases
    ]
    validated = [_validated(benchmark, parts, advance) for parts in plan.parts]
    samples = Samples(plan.samples.times, [*tubes, *(tube for tube, _ in validated)])
    for runs in sampled_runs(benchmark, plan.samples):
        samples.add(runs)
        advance()
    complete = [case for case, tube in zip(cases, tubes, strict=True) if tube.complete]
    measured = online_costs(benchmark, complete, rounds=plan.rounds, advance=advance)
    costs = {cost.setting: cost for cost in measured}
    for _ in range(len(cases) - len(complete)):
        advance()
    return OnlineBoard(
        benchmark.name,
        plan.count,
        tuple(
            _row(samples, which, case.setting, costs.get(case.setting))
            for which, case in enumerate(cases)
        ),
        tuple(
            _beside(samples, len(cases) + which, parts, validated[which][1])
            for which, parts in enumerate(plan.parts)
        ),
        tuple(
            _facts(benchmark, _usual(kernels, kind), functions[kind], plan, advance)
            for kind in plan.kinds
        ),
    )


def _kernels(
    functions: Mapping[tuple[str, Form], OnlineFunctions], plan: OnlinePlan
) -> dict[tuple[str, Form, float], OnlineTube]:
    """A compiled tube for every kernel, form and step of the plan, and for steps of 0.05 s."""
    wanted = {(*kind, SCORE_STEP_S) for kind in plan.kinds}
    wanted |= {(s.kernel, s.form, s.step_s) for s in plan.settings}
    return {
        (name, form, step_s): compiled(functions[name, form], horizon_s=HORIZON_S, step_s=step_s)
        for name, form, step_s in wanted
    }


def _row(samples: Samples, which: int, setting: Setting, cost: OnlineCost | None) -> OnlineRow:
    tube = samples.tubes[which]
    grid_s = max(setting.step_s, SCORE_STEP_S)
    score = samples.score(which, HORIZON_S, grid_s=grid_s)
    return OnlineRow(setting, tube.rigor.name, tube.status.name, float(tube.times[-1]), score, cost)


def _validated(
    benchmark: Benchmark, parts: int, advance: Callable[[], None]
) -> tuple[ReachTube, float]:
    """The validated tube in so many cells, and the seconds it took."""
    names = benchmark.system.ode.names
    method = Partitioned(ValidatedTube(SCORE_STEP_S), {names[i]: parts for i in SPLIT_AXES})
    start = time.perf_counter()
    tube = compute_tube(
        benchmark.system, initial_set=benchmark.initial_set, horizon_s=HORIZON_S, method=method
    )
    elapsed_s = time.perf_counter() - start
    advance()
    return tube, elapsed_s


def _beside(samples: Samples, which: int, parts: int, elapsed_s: float) -> ValidatedRow:
    tube = samples.tubes[which]
    return ValidatedRow(
        parts ** len(SPLIT_AXES), tube.rigor.name, tube.status.name, float(tube.times[-1]),
        elapsed_s, samples.score(which, HORIZON_S),
    )  # fmt: skip


def _usual(
    kernels: Mapping[tuple[str, Form, float], OnlineTube], kind: tuple[str, Form]
) -> CostCase:
    """One set in steps of 0.05 s."""
    kernel = kernels[*kind, SCORE_STEP_S]
    return CostCase(kernel, Setting(*kind, SCORE_STEP_S, 1), HORIZON_S)


def _facts(
    benchmark: Benchmark, case: CostCase, functions: OnlineFunctions, plan: OnlinePlan,
    advance: Callable[[], None],
) -> KernelFacts:  # fmt: skip
    facts = KernelFacts(
        case.setting.kernel,
        case.setting.form,
        online_memory(benchmark, case),
        agreement(benchmark, functions, inputs=plan.inputs, seed=plan.seed),
        _growth(benchmark, functions, case.setting, plan, advance),
    )
    advance()
    return facts


def _growth(
    benchmark: Benchmark, functions: OnlineFunctions, setting: Setting, plan: OnlinePlan,
    advance: Callable[[], None],
) -> tuple[OnlineCost, ...]:  # fmt: skip
    """Cost over growing horizons of one kernel with room for the longest."""
    longest: Sequence[float] = sorted(plan.growth_s)
    if not longest:
        return ()
    kernel = compiled(functions, horizon_s=longest[-1], step_s=setting.step_s)
    cases = [
        CostCase(kernel, setting, horizon_s)
        for horizon_s in longest
        if tube_of_cells(kernel, benchmark, setting, horizon_s=horizon_s).complete
    ]
    for _ in range(len(longest) - len(cases)):
        advance()
    return online_costs(benchmark, cases, rounds=plan.rounds, advance=advance)
