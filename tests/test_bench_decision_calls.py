"""The board times the decisions that the kernel makes, and tells their quantiles and shares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from bench_decision_fixture import BUDGET, scenes, small_kernel

from workbench.bench import decision_cost
from workbench.bench.decision_cost import Calls, timed_calls
from workbench.bench.decision_kernel import DecisionCaller
from workbench.bench.decision_latency import Latency, chosen_budget, latency
from workbench.bench.decision_scenes import PEOPLE, TUBES_PER_PERSON, random_scenes
from workbench.codegen.decision_source import DecisionSizes
from workbench.reach.online.kernels import Method
from workbench.runtime.layout import TUBES


def test_the_harness_decides_what_the_kernel_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(decision_cost, "CHUNK", 25)
    kernel = small_kernel()
    paused: list[int] = []
    found = timed_calls(kernel, scenes(), advance=lambda: paused.append(1))
    assert len(paused) == 3
    caller = DecisionCaller(kernel)
    for k, scene in enumerate(scenes()):
        answer = caller(kernel.numbers(scene.values))
        assert found.spent[k] == caller.field(answer, "spent")[0] <= BUDGET
        for j, tube in enumerate(TUBES):
            assert found.verdicts[k, j] == caller.field(answer, f"{tube}_verdicts")[0]
            assert found.cells[k, j] == caller.field(answer, f"{tube}_cells")[0]
    assert np.all(found.quickest_us <= found.first_us)
    assert 1.0 < found.quickest_us.min() < found.quickest_us.max() < 1e6
    # More steps take longer, and both kinds of answers are among them.
    assert np.corrcoef(found.spent, found.quickest_us)[0, 1] > 0.5
    assert 5 <= found.proved.sum() <= len(scenes()) - 5


def test_every_scene_has_eight_people_with_three_tubes_and_comes_back() -> None:
    again, other = random_scenes(5, seed=3), random_scenes(5, seed=4)
    for one, two, third in zip(scenes()[:5], again, other, strict=True):
        assert one.values == two.values
        assert one.values["initial_center"] != third.values["initial_center"]
        assert list(one.values["people_count"]) == [PEOPLE]
        assert list(one.values["tubes_count"]) == [PEOPLE * TUBES_PER_PERSON]
        kinds = list(one.values["people_tubes"][1::5])
        assert (kinds.count(0.0), kinds.count(1.0)) == (16, 8)


def _calls(times_us: list[float], verdicts: Sequence[tuple[float, ...]]) -> Calls:
    times, spent = np.array(times_us), np.arange(float(len(times_us)))
    return Calls(times, times / 2, spent, np.array(verdicts), np.ones((len(spent), 3)))


def test_quantiles_and_shares_are_those_of_the_calls() -> None:
    verdicts = [(0.0, 0.0, 1.0)] * 400 + [(0.0, 1.0, 0.0)] * 500 + [(1.0, 0.0, 2.0)] * 101
    usual = _calls([float(k) for k in range(1001)], verdicts)
    fewer = replace(usual, verdicts=np.where(np.arange(1001)[:, None] < 100, 1.0, usual.verdicts))
    row = latency(DecisionSizes(60, 0.05, 3, 0, 300, Method("enclosed")), fewer, usual)
    assert (row.method, row.budget) == ("enclosed, linear", 300)
    assert [row.median_us, row.p999_us, row.max_us] == pytest.approx([500.0, 999.0, 1000.0])
    assert list(row.quickest_us) == pytest.approx([250.0, 499.5, 500.0])
    assert row.proved == pytest.approx(300 / 1001)
    assert row.kept == pytest.approx(0.75)
    assert row.by_tube == {
        "track": pytest.approx(800 / 1001),
        "stop": pytest.approx(401 / 1001),
        "brake": pytest.approx(500 / 1001),
    }
    assert (row.spent_median, row.spent_max) == (500, 1000)


def test_the_chosen_budget_is_the_largest_that_keeps_the_limit() -> None:
    def row(budget: int, p999_us: float) -> Latency:
        sizes = DecisionSizes(60, 0.05, 3, 0, budget)
        zero = latency(sizes, _calls([1.0, 1.0], [(0.0,) * 3] * 2), None)
        return replace(zero, p999_us=p999_us)

    rows = [row(100, 400.0), row(200, 1000.0), row(300, 1000.1)]
    assert chosen_budget(rows) == 200
    assert chosen_budget(rows[2:]) is None
