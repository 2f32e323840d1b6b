"""`enclosed` decides as `local` does, contains runs, keeps its bits; the board has all methods."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bench_decision_fixture import BUDGET, scenes, small_kernel
from decision_answers import Answer
from decision_fixture import COMPLETE, STARTS
from decision_paths import paths, segments, simulate

from workbench.bench import (
    decision_agreement,
    decision_board,
    decision_cost,
    decision_growth,
    decision_methods,
)
from workbench.bench.decision_board import DecisionPlan
from workbench.bench.decision_bound import BoundPlan
from workbench.bench.decision_kernel import (
    DecisionCaller,
    DecisionKernel,
    compiled_again,
    shipped_loop,
)
from workbench.bench.decision_memory import DecisionMemory
from workbench.bench.decision_methods import METHODS
from workbench.bench.decision_scenes import Scene, Start, path_values, scene
from workbench.codegen.decision_source import DecisionSizes
from workbench.reach.online.kernels import LOCAL_LINEAR, Method

_ENCLOSED = Method("enclosed")
# What the simulation may miss by rounding.
_ROUNDING = 1e-13
# The tubes differ in what they merge and when, by some millimetres at the most.
_ALIKE = 0.03


def _answers(method: Method, asked: tuple[Scene, ...]) -> list[Answer]:
    kernel = small_kernel(method)
    caller, spans = DecisionCaller(kernel), kernel.spans(kernel.result)
    return [Answer(caller(kernel.numbers(each.values)), spans) for each in asked]


def test_both_kernels_give_the_same_verdicts_and_nearly_the_same_tubes() -> None:
    verdicts, compared = [], 0
    both = (_answers(method, scenes()) for method in (LOCAL_LINEAR, _ENCLOSED))
    for local, enclosed in zip(*both, strict=True):
        assert enclosed.numbers.tobytes() != local.numbers.tobytes()
        assert enclosed.spent <= BUDGET
        for one, other in zip(local.tubes, enclosed.tubes, strict=True):
            assert one.verdicts == other.verdicts
            verdicts.append(one.verdict)
            if (one.cells, one.steps) == (other.cells, other.steps) and one.steps:
                for end in ("lower", "upper"):
                    assert np.abs(one.rows(end, 7) - other.rows(end, 7)).max() < _ALIKE
                compared += 1
    assert 0.1 < np.mean(verdicts) < 0.9
    assert compared > 100


@pytest.mark.parametrize("start", ["initial set", "accelerating", "rate limit"])
@pytest.mark.parametrize(("where", "share"), [("straight", 1.0), ("S", 1 / 3)])
def test_runs_stay_in_the_tubes_of_enclosed(where: str, share: float, start: str) -> None:
    """The share of the start is what the small budget is enough for."""
    path, box = paths()[where], STARTS[start].scaled(share)
    loop = shipped_loop()
    speed = [each.name for each in loop.parameters].index("reference_speed")
    assert loop.parameter_values()[speed] == box.reference_mps
    values = {**scene("", Start(box.center, box.radius), ()).values, **path_values(path.table)}
    [answer] = _answers(_ENCLOSED, (Scene("", values),))
    tube = answer.track
    assert (tube.status, tube.steps) == (COMPLETE, 30)
    states = box.states(50, np.random.default_rng(7))
    seen = segments(simulate(box, states, path.curvature, steps=tube.steps), tube.steps)
    lower, upper = (tube.rows(end, 7)[:, None, :, None] for end in ("lower", "upper"))
    assert np.maximum(lower - seen, seen - upper).max() < _ROUNDING
    # Runs come near to both ends of the offset at first; the path's bins widen the tube later on.
    reached = np.ptp(seen[0, :, 1]) / (upper - lower)[0, 0, 1, 0]
    assert reached > 0.9


def _stub(kernel_of: Callable[[Method], DecisionKernel]) -> Callable[..., DecisionKernel]:
    def made(sizes: DecisionSizes) -> DecisionKernel:
        kernel = kernel_of(Method(sizes.method.kernel))
        return replace(
            kernel, sizes=replace(kernel.sizes, budget=sizes.budget, method=sizes.method)
        )

    return made


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A board of small kernels under the names of others, without what callgrind counts."""

    def bound(kernel: DecisionKernel, plan: BoundPlan, *, advance: Callable[[], None]) -> None:
        for _ in range(plan.units_of_work):
            advance()

    for module in (decision_board, decision_growth):
        monkeypatch.setattr(module, "decision_kernel", _stub(small_kernel))
    monkeypatch.setattr(decision_board, "instruction_bound", bound)
    monkeypatch.setattr(decision_board, "chosen_budget", lambda _: 200)
    memory = DecisionMemory(1, 2, 3, 4, 5, 6, 7, 8, 9)
    monkeypatch.setattr(decision_board, "decision_memory", lambda *_: memory)
    monkeypatch.setattr(decision_cost, "counted", lambda *_, **__: 1000)
    sections = {".text": 70, ".rodata": 5, ".data": 2, ".bss": 1}
    monkeypatch.setattr(decision_methods, "object_sections", lambda _: (sections, ""))
    monkeypatch.setattr(decision_agreement, "compiled_again", functools.cache(compiled_again))


def test_the_board_measures_every_method_on_the_same_scenes(quick: None) -> None:
    plan = DecisionPlan(
        calls=40, sweep_calls=25, budgets=(200, 300), inputs=150, plain=300, rounds=1,
        people=(1, 8), horizons_s=(1.5,), slow=2, stepped=1, seed=1,
    )  # fmt: skip
    done: list[int] = []
    board = decision_board.decision_board(plan, advance=lambda: done.append(1))
    assert len(done) == plan.units_of_work
    local, enclosed = str(LOCAL_LINEAR), str(_ENCLOSED)
    assert [(row.method, row.budget, row.calls) for row in board.latencies] == [
        (local, 3000, 40), (local, 200, 40), (enclosed, 3000, 40),
    ]  # fmt: skip
    assert [(row.method, row.budget) for row in board.sweep] == [
        (local, 200), (local, 300), (local, 3000),
    ]  # fmt: skip
    assert [each.latency.method for each in board.methods] == [str(each) for each in METHODS]
    assert {(each.latency.budget, each.latency.calls) for each in board.methods} == {(3000, 25)}
    first, *_ = board.methods
    assert first.latency == board.sweep[-1]
    assert (first.instructions, first.code, first.static) == (40, 70, 3)
    assert (first.times(first), first.times_instructions(first)) == (1.0, 1.0)
    assert {each.latency.kept for each in board.methods} == {1.0}
    assert [(each.method, each.budget, each.inputs) for each in board.agreement] == [
        (local, 300, 150), (local, 3000, 3), (enclosed, 3000, 3),
    ]  # fmt: skip
    assert (board.disagreements, board.overspent) == (0, 0)


def test_both_builds_of_enclosed_agree_on_answers_of_every_kind() -> None:
    kernel = small_kernel(_ENCLOSED)
    found = decision_agreement.decision_agreement(kernel, inputs=100, seed=7)
    assert (found.method, found.differing) == (str(_ENCLOSED), 0)
    assert min(found.safe, found.unproved) > 10
    assert found.invalid > 0
