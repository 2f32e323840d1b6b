"""A tube contains every sampled trajectory of a closed loop, at its instants and between them."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from tube_cases import (
    assert_contains,
    box,
    closed_loops,
    dense_times,
    march,
    pressing_states,
    system_of,
    vehicle_sets,
)

from workbench.models import ClosedLoop
from workbench.models.benchmarks import b1, b2, b2_path
from workbench.reach import Partitioned, ReachTube, ValidatedTube, compute_tube
from workbench.sets import Box

# A failing example is small enough as it is: each costs a second, shrinking would take minutes.
FEW = settings(
    max_examples=3,
    deadline=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)
STEPS_S = st.floats(0.02, 0.05)


def checked(system: ClosedLoop, initial_set: Box, horizon_s: float, step_s: float) -> ReachTube:
    """The tube, after every reference run was found inside it as far as it goes."""
    method = ValidatedTube(step_s)
    tube = compute_tube(system, initial_set=initial_set, horizon_s=horizon_s, method=method)
    if len(tube.times) > 1:
        times = dense_times(tube)
        states = pressing_states(system, initial_set, tube, count=300)
        assert_contains(tube, times, march(system, states, times))
    return tube


@FEW
@given(closed_loops(limited=False), vehicle_sets(points=False), st.floats(0.2, 1.2), STEPS_S)
def test_without_limits(system: ClosedLoop, start: Box, horizon_s: float, step_s: float) -> None:
    tube = checked(system, start, horizon_s, step_s)
    assert tube.complete, tube.message


@FEW
@given(closed_loops(limited=True), vehicle_sets(points=False), st.floats(0.2, 0.8), STEPS_S)
def test_with_limits(system: ClosedLoop, start: Box, horizon_s: float, step_s: float) -> None:
    tube = checked(system, start, horizon_s, step_s / 2)
    assert tube.complete, tube.message


@settings(FEW, max_examples=2)
@given(closed_loops(limited=True), vehicle_sets(points=True), st.floats(0.2, 0.8), STEPS_S)
def test_sets_without_width_in_some_axes(
    system: ClosedLoop, start: Box, horizon_s: float, step_s: float
) -> None:
    checked(system, start, horizon_s, step_s)


@pytest.mark.parametrize("axis", ["y", "steering", "heading"])
def test_a_set_with_width_in_one_axis_only_is_covered(axis: str) -> None:
    loop = b1()
    center = dict(zip(loop.initial_set.names, loop.initial_set.center, strict=True))
    tube = checked(loop.system, Box.around(center, radius={axis: 0.02}), 1.0, 0.05)
    assert tube.complete, tube.message


@pytest.mark.parametrize(
    ("benchmark", "step_s", "horizon_s"),
    [(b1, 0.05, 3.0), (b2, 0.03, 1.0), (b2_path, 0.03, 1.0)],
)
def test_benchmarks(benchmark, step_s: float, horizon_s: float) -> None:
    loop = benchmark()
    tube = compute_tube(
        loop.system,
        initial_set=loop.initial_set,
        horizon_s=horizon_s,
        method=ValidatedTube(step_s),
    )
    assert tube.complete, tube.message
    times = dense_times(tube)
    states = pressing_states(loop.system, loop.initial_set, tube, count=2000)
    assert_contains(tube, times, march(loop.system, states, times))


def test_the_hull_of_cells_contains_too_and_is_tighter() -> None:
    system = system_of(lambda x, v: [v, (1 - x**2) * v - ca.fmax(x, -0.5)], "x", "v")
    start = box(x=(0.5, 1.5), v=(-0.2, 0.4))
    method = ValidatedTube(0.03)
    whole, cells = (
        compute_tube(system, initial_set=start, horizon_s=1.5, method=m)
        for m in (method, Partitioned(method, {"x": 3, "v": 2}))
    )
    assert cells.complete
    times = dense_times(cells)
    states = pressing_states(system, start, cells, count=1000)
    assert_contains(cells, times, march(system, states, times))
    assert np.all(cells.half_width_at()[-1] < whole.half_width_at()[-1])
