"""The whole decision of the shipped vehicle: time, its bound, growth, bytes, agreement of bits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.bench.decision_agreement import PAUSES, DecisionAgreement, decision_agreement
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
from workbench.bench.decision_latency import Latency, chosen_budget, latency
from workbench.bench.decision_memory import DecisionMemory, decision_memory
from workbench.bench.decision_methods import METHODS, MethodCost, method_costs
from workbench.bench.decision_scenes import Scene, hostile_scenes, random_scenes, telling_scenes
from workbench.codegen.bundle import BUDGET
from workbench.reach.online.kernels import LOCAL_LINEAR, Method
from workbench.runtime.layout import TUBES

# The larger budget, under which far more of the text runs, on this share of the inputs.
_INPUTS_PER_LARGE: Final = 50
# Timed on as many scenes as the default, and its bits compared.
_BESIDE: Final = Method("enclosed")


@final
@dataclass(frozen=True, slots=True)
class DecisionPlan:
    """calls: with the default budget, with the largest that keeps the limit, and by `enclosed`;
    sweep_calls: with each of `budgets` and by every other kernel and form; inputs: random ones
    whose bits are compared, with the budget `plain`; rounds: of the clock where one scene is
    repeated; slow: random scenes, those with most steps, whose parts are counted; stepped: scenes
    of which every single step is."""

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
        sweeps = len(self.all_budgets) + len(METHODS) - 1
        chunks = [self.calls] * 3 + [self.sweep_calls] * sweeps
        growth = len(self.people) + len(self.horizons_s) + 1
        bound = BoundPlan(self.people, (), self.stepped).units_of_work + self.slow
        agreement = sum(min(count, PAUSES) for count in self.compared)
        timed = sum(math.ceil(count / CHUNK) for count in chunks) + len(METHODS)
        return timed + growth + bound + agreement

    @property
    def compared(self) -> tuple[int, int, int]:
        """Inputs whose bits are compared: budget `plain`, the default budget, by `enclosed`."""
        large = max(1, self.inputs // _INPUTS_PER_LARGE)
        return self.inputs, large, large

    @property
    def all_budgets(self) -> tuple[int, ...]:
        """The budgets that are tried, the default one among them, each once."""
        return tuple(sorted({*self.budgets, BUDGET}))


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
    """Everything about one decision, by `local` in the linear form where nothing else is said.

    latencies: default budget first, then the one that keeps the limit, if there is one, and the
    default budget by `enclosed`; methods: every kernel in every form, the default first.
    """

    sizes: dict[str, float]
    latencies: tuple[Latency, ...]
    sweep: tuple[Latency, ...]
    methods: tuple[MethodCost, ...]
    telling: tuple[TellingRow, ...]
    bound: Bound | None
    growth: tuple[Growth, ...]
    memory: DecisionMemory
    agreement: tuple[DecisionAgreement, ...]

    @property
    def disagreements(self) -> int:
        """Inputs for which the optimised build had other bits."""
        return sum(found.differing for found in self.agreement)

    @property
    def overspent(self) -> int:
        """Measurements in which more steps were tried than the budget has: must be none."""
        methods = (each.latency for each in self.methods)
        rows = (*self.latencies, *self.sweep, *methods)
        return sum(row.spent_max > row.budget for row in rows)


def decision_board(plan: DecisionPlan, *, advance: Callable[[], None]) -> DecisionBoard:
    """Measure all of it; `advance` counts on. Raises InputError without a C compiler."""
    methods = {each: decision_kernel(shipped_sizes(method=each)) for each in METHODS}
    kernel = methods[LOCAL_LINEAR]
    scenes = list(random_scenes(plan.sweep_calls, seed=plan.seed))
    usual = timed_calls(kernel, scenes, advance=advance)
    kernels, sweep = _sweep(kernel, plan, (scenes, usual), advance)
    slowest = [scenes[k] for k in np.argsort(-usual.spent)[: plan.slow]]
    bound = instruction_bound(
        kernel, BoundPlan(plan.people, tuple(slowest), plan.stepped), advance=advance
    )
    chosen = chosen_budget(sweep)
    within = [] if chosen is None or chosen == BUDGET else [kernels[chosen]]
    small = kernels.get(plan.plain) or decision_kernel(shipped_sizes(budget=plan.plain))
    return DecisionBoard(
        _sizes(kernel),
        tuple(_latency(each, plan, advance) for each in (kernel, *within, methods[_BESIDE])),
        sweep,
        method_costs(tuple(methods.values()), scenes, usual, advance=advance),
        _telling(kernel, plan.rounds),
        bound,
        (
            horizon_growth(plan.horizons_s, calls=plan.rounds, advance=advance),
            cell_growth(kernel, calls=plan.rounds, advance=advance),
            people_growth(kernel, plan.people, calls=plan.rounds, advance=advance),
        ),
        decision_memory(kernel, (*telling_scenes(), *hostile_scenes())),
        _agreement((small, kernel, methods[_BESIDE]), plan, advance),
    )


def _sizes(kernel: DecisionKernel) -> dict[str, float]:
    sizes = kernel.sizes
    return {
        "horizon_s": HORIZON_S,
        "step_s": STEP_S,
        "levels": sizes.levels,
        "budget": sizes.budget,
    }


def _sweep(
    kernel: DecisionKernel, plan: DecisionPlan, asked: tuple[Sequence[Scene], Calls],
    advance: Callable[[], None],
) -> tuple[dict[int, DecisionKernel], tuple[Latency, ...]]:  # fmt: skip
    """A kernel for each budget, and what it takes; asked: the scenes, and the default's calls."""
    scenes, usual = asked
    kernels, rows = {BUDGET: kernel}, []
    for budget in plan.all_budgets:
        found = usual
        if budget != BUDGET:
            kernels[budget] = decision_kernel(shipped_sizes(budget=budget))
            found = timed_calls(kernels[budget], scenes, advance=advance)
        rows.append(latency(kernels[budget].sizes, found, usual))
    return kernels, tuple(rows)


def _latency(kernel: DecisionKernel, plan: DecisionPlan, advance: Callable[[], None]) -> Latency:
    scenes = random_scenes(plan.calls, seed=plan.seed + 1)
    return latency(kernel.sizes, timed_calls(kernel, scenes, advance=advance), None)


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


def _agreement(
    kernels: Sequence[DecisionKernel], plan: DecisionPlan, advance: Callable[[], None]
) -> tuple[DecisionAgreement, ...]:
    """The first on all inputs, the others, which take longer, on a share."""
    counts = plan.compared
    return tuple(
        decision_agreement(kernel, inputs=count, seed=plan.seed + k, advance=advance)
        for k, (kernel, count) in enumerate(zip(kernels, counts, strict=True))
    )
