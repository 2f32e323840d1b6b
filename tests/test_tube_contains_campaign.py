"""None of 100,000 trajectories of a benchmark loop leaves its tubes within 3, 4 or 5 s."""

from __future__ import annotations

import pytest

from workbench.bench import SamplePlan, bench_loops, score_loop
from workbench.bench.scoreboard import SAMPLE_STEP_S

pytestmark = pytest.mark.campaign


@pytest.mark.parametrize("name", ["B1", "B1-small", "B2", "B1-brake"])
def test_no_trajectory_escapes(name: str) -> None:
    plan = SamplePlan(count=100_000, horizon_s=5.0, step_s=SAMPLE_STEP_S, seed=2024)
    (loop,) = bench_loops((name,))
    methods = score_loop(loop, plan, advance=lambda _: None)
    assert [method.method for method in methods] == ["desk", "compiled"]
    for method in methods:
        assert [horizon.horizon_s for horizon in method.horizons] == [3.0, 4.0, 5.0]
        for horizon in method.horizons:
            assert horizon.covered, (method.method, method.status, method.proved_until_s)
            assert horizon.trajectories == 100_000
            assert horizon.times_checked >= 50
            assert horizon.escapes == 0
