"""A tube contains every sampled trajectory of a closed loop, at its instants and between them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tube_cases import (
    assert_contains,
    closed_loops,
    dense_times,
    march,
    pressing_states,
    vehicle_sets,
)

from workbench.models import ClosedLoop
from workbench.models.benchmarks import b1, b1_brake, b2, b2_path
from workbench.reach import Partitioned, SensitivityTube, compute_tube
from workbench.sets import Box

FEW = settings(
    max_examples=6,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


def check(system: ClosedLoop, initial_set: Box, horizon_s: float, step_s: float) -> None:
    tube = compute_tube(
        system, initial_set=initial_set, horizon_s=horizon_s, method=SensitivityTube(step_s)
    )
    assert tube.complete, tube.message
    times = dense_times(tube)
    assert_contains(
        tube, times, march(system, pressing_states(system, initial_set, tube, count=300), times)
    )


@FEW
@given(closed_loops(limited=False), vehicle_sets(), st.floats(0.2, 1.2), st.floats(0.02, 0.05))
def test_without_limits(system: ClosedLoop, start: Box, horizon_s: float, step_s: float) -> None:
    check(system, start, horizon_s, step_s)


@FEW
@given(closed_loops(limited=True), vehicle_sets(), st.floats(0.2, 0.8), st.floats(0.01, 0.04))
def test_with_limits(system: ClosedLoop, start: Box, horizon_s: float, step_s: float) -> None:
    check(system, start, horizon_s, step_s)


@pytest.mark.parametrize(
    ("benchmark", "step_s", "horizon_s"),
    [(b1, 0.05, 3.0), (b1_brake, 0.05, 3.0), (b2, 0.03, 1.5), (b2_path, 0.03, 1.5)],
)
def test_benchmarks(benchmark, step_s: float, horizon_s: float) -> None:
    loop = benchmark()
    tube = compute_tube(
        loop.system,
        initial_set=loop.initial_set,
        horizon_s=horizon_s,
        method=SensitivityTube(step_s),
    )
    assert tube.complete, tube.message
    times = dense_times(tube)
    states = pressing_states(loop.system, loop.initial_set, tube, count=2000)
    assert_contains(tube, times, march(loop.system, states, times))


def test_the_hull_of_cells_contains_too_and_is_tighter() -> None:
    loop = b2()
    whole, cells = (
        compute_tube(loop.system, initial_set=loop.initial_set, horizon_s=0.6, method=method)
        for method in (
            SensitivityTube(0.03),
            Partitioned(SensitivityTube(0.03), {"y": 2, "heading": 2}),
        )
    )
    times = dense_times(cells)
    states = pressing_states(loop.system, loop.initial_set, cells, count=1000)
    assert_contains(cells, times, march(loop.system, states, times))
    assert np.all(cells.half_width_at()[-1, [1, 2, 4]] < whole.half_width_at()[-1, [1, 2, 4]])
