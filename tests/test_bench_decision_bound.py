"""The bound of the instructions is made of counts that hold and of the largest costs there were."""

from __future__ import annotations

import shutil
from dataclasses import replace

import pytest
from bench_decision_fixture import BUDGET, scenes, small_kernel

from workbench.bench import decision_bound
from workbench.bench.decision_bound import (
    ROW,
    STEP,
    BoundPlan,
    Limits,
    instruction_bound,
    parts,
    single_calls,
    with_parts_apart,
)
from workbench.bench.decision_cost import instructions
from workbench.bench.decision_kernel import DecisionCaller, DecisionKernel
from workbench.bench.decision_scenes import (
    hostile_scenes,
    people_values,
    telling_scenes,
    worst_people,
)
from workbench.codegen.decision_source import DecisionSizes
from workbench.errors import InputError
from workbench.runtime.person_tubes import fault_in_people

PLAN = BoundPlan((0, 8), scenes()[:1], 1)


def test_counts_by_construction() -> None:
    # Three tubes; three levels and eight more cells, each coarsely and finely.
    assert Limits.of(DecisionSizes(60, 0.05, 3, 0, 3000)) == Limits(3000, 66, 3066, 3)
    assert Limits.of(DecisionSizes(60, 0.05, 1, 0, 100)) == Limits(100, 54, 154, 3)


def test_a_text_without_the_parts_is_refused() -> None:
    wrong = replace(small_kernel(), source=small_kernel().source.replace("wb_compare", "wb_other"))
    with pytest.raises(InputError, match="one function wb_compare in the kernel's text, got 0"):
        with_parts_apart(wrong)


@pytest.mark.parametrize(("count", "each"), [(8, 16), (16, 16), (17, 15), (32, 8)])
def test_the_most_costly_people_fit(count: int, each: int) -> None:
    people = worst_people(count, tubes=4, bounds=16)
    assert fault_in_people(people) is None
    values = people_values(people)
    assert len(values["people_pieces"]) == 9 * 4 * count * each <= 9 * 1024
    assert values["people_tubes"][1::5].count(1.0) == 2 * count


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="needs the optional tool valgrind")
def test_no_decision_exceeds_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    telling, hostile = telling_scenes()[:3], hostile_scenes()[:2]
    monkeypatch.setattr(decision_bound, "telling_scenes", lambda: telling)
    monkeypatch.setattr(decision_bound, "CROWDS", decision_bound.CROWDS[-1:])
    monkeypatch.setattr(decision_bound, "hostile_scenes", lambda: hostile)
    kernel, apart = small_kernel(), with_parts_apart(small_kernel())
    monkeypatch.setattr(decision_bound, "with_parts_apart", lambda _: apart)
    done: list[int] = []
    found = instruction_bound(kernel, PLAN, advance=lambda: done.append(1))
    assert found is not None
    assert len(done) == PLAN.units_of_work
    caller = DecisionCaller(kernel)
    for part, scene in zip(found.scenes, PLAN.all_scenes(), strict=True):
        spent = caller.field(caller(kernel.numbers(scene.values)), "spent")[0]
        assert part.scene == scene.name
        assert part.attempts == spent <= BUDGET
        assert part.compared <= found.limits.rows
        assert min(part.rest, part.boxes, part.rows, part.steps) > 0
        assert part.total == part.steps + part.rows + part.boxes + part.rest
    none, most = found.people
    assert [(each.people, each.tubes, each.pieces) for each in found.people] == [
        (0, 4, 16),
        (8, 4, 16),
    ]
    assert 30 * none.row < most.row
    assert 3 * none.bound < most.bound
    assert all(each.largest < each.bound for each in found.people)
    # Every scene has eight people at most.
    assert max(part.total for part in found.scenes) < most.bound
    # Steps are dear, not the number of them: without the dearest one the bound would not hold.
    dearest = max(found.scenes, key=lambda part: part.per_attempt)
    assert dearest.per_attempt < found.step < 20 * dearest.per_attempt
    assert instructions(kernel, telling[:1]) == pytest.approx(found.scenes[0].total, rel=0.05)
    _check_single_calls(apart, found.scenes[0].scene)


def _check_single_calls(apart: DecisionKernel, name: str) -> None:
    """Call by call they are what one count of them all says."""
    scene = telling_scenes()[0]
    whole = parts(apart, scene)
    assert whole is not None
    assert scene.name == name
    steps, rows = single_calls(apart, scene, STEP), single_calls(apart, scene, ROW)
    assert sum(tries for _, tries in steps) == whole.attempts
    assert sum(total for total, _ in steps) == pytest.approx(whole.steps, rel=0.01)
    assert sum(total for total, _ in rows) == pytest.approx(whole.rows, rel=0.01)
    assert len(rows) == whole.compared
