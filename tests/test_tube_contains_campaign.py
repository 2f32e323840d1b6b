"""None of the trajectories of the long campaigns leaves its tube.

100,000 of each of four benchmark loops within 3, 4 or 5 s, from every tube that is compared; a
million of 200 random loops from the validated tube.
"""

from __future__ import annotations

import pytest

from workbench.bench import SamplePlan, bench_loops, score_loop
from workbench.bench.campaign import run_campaign
from workbench.bench.scoreboard import SAMPLE_STEP_S
from workbench.reach import ValidatedTube

pytestmark = pytest.mark.campaign


@pytest.mark.parametrize("name", ["B1", "B1-small", "B2", "B1-brake"])
def test_no_trajectory_escapes(name: str) -> None:
    plan = SamplePlan(count=100_000, horizon_s=5.0, step_s=SAMPLE_STEP_S, seed=2024)
    (loop,) = bench_loops((name,))
    methods = score_loop(loop, plan, advance=lambda _: None)
    names = {method.method for method in methods}
    assert names > {"validated", "online-linear", "online-quadratic"}
    for method in methods:
        assert [horizon.horizon_s for horizon in method.horizons] == [3.0, 4.0, 5.0]
        for horizon in method.horizons:
            assert horizon.covered, (method.method, method.status, method.proved_until_s)
            assert horizon.trajectories == 100_000
            assert horizon.times_checked >= 50
            assert horizon.escapes == 0


def test_no_trajectory_of_random_loops_escapes() -> None:
    result = run_campaign(ValidatedTube(), loops=200, trajectories=1_000_000, seed=2024)
    accused = [loop for loop in result.loops if loop.escapes or loop.undecided]
    assert not accused
    assert result.trajectories >= 990_000
    assert result.completed >= 160
