"""The whole decision of the shipped vehicle: time, its bound, growth, bytes, agreement of bits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.bench.decision_agreement import DecisionAgreement, decision_agreement
from workbench.bench.decision_bound import Bound, BoundPlan, instruction_bound
from workbench.bench.decision_cost import CHUNK, Calls, instructions, timed_calls
from workbench.bench.decision_growth import Growth, cell_growth, horizon_growth, people_growth
from workbench.bench.decision_kernel import (
    HORIZON_S,
    STEP_S,
    DecisionKernel,
    decision_kernel,
    shipped_sizes,
)
from workbench.bench.decision_memory import DecisionMemory, decision_memory
from workbench.bench.decision_scenes import Scene, hostile_scenes, random_scenes, telling_scenes
from workbench.bench.online_cost import CostCase, OnlineCost, online_costs
from workbench.bench.online_kernels import Setting, compiled, kernel_functions
from workbench.codegen.bundle import BUDGET
from workbench.models.benchmarks import b2
from workbench.reach.online.kernels import KERNELS, Form
from workbench.reach.tube import Array
from workbench.runtime.layout import TUBES

LIMIT_US: Final = 1000.0
"""What 99.9 % of the decisions shall stay below."""
# The larger budget, under which far more of the text runs, on this share of the inputs.
_INPUTS_PER_LARGE: Final = 50
_COUNTED: Final = 100


@final
@dataclass(frozen=True, slots=True)
class DecisionPlan:
    """calls: with the default budget and with the largest that keeps the limit; sweep_calls: with
    each of `budgets`; inputs: random ones whose bits are compared, with the budget `plain`; rounds:
    of the clock where one scene is repeated; slow: random scenes, those with most steps, whose
    parts are counted; stepped: scenes of which every single step is."""

    calls: int
    sweep_calls: int
    budgets: tuple[int, ...]
    inputs: int
    plain: int
    rounds: int
    people: tuple[int, ...]
    horizons_s: tuple[float, ...]
    slow: int
    stepped: int
    seed: int

    @property
    def units_of_work(self) -> int:
        """About how often `decision_board` counts on."""
        chunks = [self.calls] * 2 + [self.sweep_calls] * len(self.all_budgets)
        growth = len(self.people) + len(self.horizons_s) + 1
        bound = BoundPlan(self.people, (), self.stepped).units_of_work + self.slow
        return sum(math.ceil(count / CHUNK) for count in chunks) + growth + bound + 203

    @property
    def all_budgets(self) -> tuple[int, ...]:
        """The budgets that are tried, the default one among them, each once."""
        return tuple(sorted({*self.budgets, BUDGET}))


@final
@dataclass(frozen=True, slots=True)
class Latency:
    """Calls of random scenes with one budget.

    median_us, p999_us, max_us: of the calls as they came; quickest_us: the same three of the
    quicker of two calls per scene, which leaves out most of what other programs took; proved: share
    that lets both policies go on; by_tube: share that is SAFE, tube by tube; kept: share of what
    the default budget proves on the same scenes; spent_median, spent_max: attempted steps.
    """

    budget: int
    calls: int
    median_us: float
    p999_us: float
    max_us: float
    quickest_us: tuple[float, float, float]
    proved: float
    by_tube: dict[str, float]
    kept: float | None
    spent_median: int
    spent_max: int


@final
@dataclass(frozen=True, slots=True)
class TellingRow:
    """One scene: us: median of the quicker of two calls; instructions of one; what was found."""

    scene: str
    spent: int
    us: float
    instructions: int | None
    safe: dict[str, bool]
    cells: dict[str, int]


@final
@dataclass(frozen=True, slots=True)
class DecisionBoard:
    """Everything about one decision; latencies: default budget first, then the one that keeps the
    limit, if there is one; mean_instructions: over 100 random scenes; tubes: one tube of `local`
    and of `enclosed` on B2 beside."""

    sizes: dict[str, float]
    latencies: tuple[Latency, ...]
    sweep: tuple[Latency, ...]
    telling: tuple[TellingRow, ...]
    mean_instructions: int | None
    bound: Bound | None
    growth: tuple[Growth, ...]
    memory: DecisionMemory
    agreement: tuple[DecisionAgreement, ...]
    tubes: tuple[OnlineCost, ...]

    @property
    def disagreements(self) -> int:
        """Inputs for which the optimised build had other bits."""
        return sum(found.differing for found in self.agreement)

    @property
    def overspent(self) -> int:
        """Measurements in which more steps were tried than the budget has: must be none."""
        return sum(row.spent_max > row.budget for row in (*self.latencies, *self.sweep))


def decision_board(plan: DecisionPlan, *, advance: Callable[[], None]) -> DecisionBoard:
    """Measure all of it; `advance` counts on. Raises InputError without a C compiler."""
    kernel = decision_kernel(shipped_sizes())
    scenes = list(random_scenes(plan.sweep_calls, seed=plan.seed))
    usual = timed_calls(kernel, scenes, advance=advance)
    kernels = {BUDGET: kernel}
    sweep = []
    for budget in plan.all_budgets:
        found = usual
        if budget != BUDGET:
            kernels[budget] = decision_kernel(shipped_sizes(budget=budget))
            found = timed_calls(kernels[budget], scenes, advance=advance)
        sweep.append(latency(budget, found, usual))
    slowest = [scenes[k] for k in np.argsort(-usual.spent)[: plan.slow]]
    bound = instruction_bound(
        kernel, BoundPlan(plan.people, tuple(slowest), plan.stepped), advance=advance
    )
    return DecisionBoard(
        _sizes(kernel),
        _latencies(kernels, plan, chosen_budget(sweep), advance),
        tuple(sweep),
        _telling(kernel, plan.rounds),
        _mean(instructions(kernel, scenes[:_COUNTED]), len(scenes[:_COUNTED])),
        bound,
        (
            horizon_growth(plan.horizons_s, calls=plan.rounds, advance=advance),
            cell_growth(kernel, calls=plan.rounds, advance=advance),
            people_growth(kernel, plan.people, calls=plan.rounds, advance=advance),
        ),
        decision_memory(kernel, (*telling_scenes(), *hostile_scenes())),
        _agreement(kernels, plan, advance),
        _tubes(plan.rounds),
    )


def latency(budget: int, calls: Calls, usual: Calls | None) -> Latency:
    """What the calls took and found, and how much of `usual`, the same scenes, they kept."""
    safe = calls.verdicts == 0.0
    kept = None
    if usual is not None and usual.proved.any():
        kept = float((calls.proved & usual.proved).sum() / usual.proved.sum())
    median_us, p999_us, max_us = _told(calls.first_us)
    return Latency(
        budget, len(calls.spent), median_us, p999_us, max_us, _told(calls.quickest_us),
        float(calls.proved.mean()), dict(zip(TUBES, safe.mean(axis=0).tolist(), strict=True)),
        kept, int(np.median(calls.spent)), int(calls.spent.max()),
    )  # fmt: skip


def chosen_budget(sweep: Sequence[Latency]) -> int | None:
    """The largest budget whose 99.9th percentile keeps the limit; None where none does.

    Of the quicker of two calls: what other programs take says nothing of a budget.
    """
    fitting = [row.budget for row in sweep if row.quickest_us[1] <= LIMIT_US]
    return max(fitting, default=None)


def _told(values_us: Array) -> tuple[float, float, float]:
    return float(np.median(values_us)), float(np.quantile(values_us, 0.999)), float(values_us.max())


def _sizes(kernel: DecisionKernel) -> dict[str, float]:
    sizes = kernel.sizes
    return {
        "horizon_s": HORIZON_S,
        "step_s": STEP_S,
        "levels": sizes.levels,
        "budget": sizes.budget,
    }


def _latencies(
    kernels: dict[int, DecisionKernel], plan: DecisionPlan, chosen: int | None,
    advance: Callable[[], None],
) -> tuple[Latency, ...]:  # fmt: skip
    budgets = dict.fromkeys((BUDGET, *([] if chosen is None else [chosen])))
    return tuple(
        latency(
            budget,
            timed_calls(
                kernels[budget], random_scenes(plan.calls, seed=plan.seed + 1), advance=advance
            ),
            None,
        )
        for budget in budgets
    )


def _telling(kernel: DecisionKernel, rounds: int) -> tuple[TellingRow, ...]:
    return tuple(_row(kernel, scene, rounds) for scene in (*telling_scenes(), *hostile_scenes()))


def _row(kernel: DecisionKernel, scene: Scene, rounds: int) -> TellingRow:
    found = timed_calls(kernel, [scene] * rounds)
    return TellingRow(
        scene.name, int(found.spent[0]), float(np.median(found.quickest_us)),
        instructions(kernel, [scene]),
        dict(zip(TUBES, (found.verdicts[0] == 0.0).tolist(), strict=True)),
        dict(zip(TUBES, found.cells[0].astype(int).tolist(), strict=True)),
    )  # fmt: skip


def _mean(total: int | None, count: int) -> int | None:
    return None if total is None else total // count


def _agreement(
    kernels: dict[int, DecisionKernel], plan: DecisionPlan, advance: Callable[[], None]
) -> tuple[DecisionAgreement, ...]:
    small = kernels.get(plan.plain) or decision_kernel(shipped_sizes(budget=plan.plain))
    large = max(1, plan.inputs // _INPUTS_PER_LARGE)
    return (
        decision_agreement(small, inputs=plan.inputs, seed=plan.seed, advance=advance),
        decision_agreement(kernels[BUDGET], inputs=large, seed=plan.seed + 1, advance=advance),
    )


def _tubes(rounds: int) -> tuple[OnlineCost, ...]:
    """One linear tube of 3 s on B2, whose limits are active, with every kernel."""
    benchmark = b2()
    found: list[OnlineCost] = []
    for name in KERNELS:
        functions = kernel_functions(benchmark, name, Form.LINEAR)
        tube = compiled(functions, horizon_s=HORIZON_S, step_s=STEP_S)
        case = CostCase(tube, Setting(name, Form.LINEAR, STEP_S, 1), HORIZON_S)
        found += online_costs(benchmark, [case], rounds=rounds)
    return tuple(found)
