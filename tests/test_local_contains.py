"""Every local tube contains the runs of its loop, at its instants and between them."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from local_cases import local_methods, switching_runs
from scipy.linalg import expm
from tube_cases import (
    Array,
    assert_contains,
    box,
    closed_loops,
    dense_times,
    disturbed,
    starts,
    system_of,
    vehicle_sets,
)

from workbench.claims import Rigor
from workbench.models import ClosedLoop, Ranged
from workbench.models.benchmarks import all_benchmarks
from workbench.reach.local import LocalGrowth, LocalLagrangian, Reference
from workbench.sets import Box

METHODS = tuple(local_methods(0.05))
CASES = [(loop, method) for loop in ("B1", "B2-noise") for method in METHODS]
CASES += [("B1-small", "blocks"), ("B1-small", "lagrangian"), ("B2", "growth"), ("B2", "blocks")]
HORIZON_S = 1.0


@functools.cache
def known(loop: str) -> tuple[Reference, Array, Array]:
    """The loop's reference, and runs of it."""
    found = next(each for each in all_benchmarks() if each.name == loop)
    reference = Reference.of(
        found.system, initial_set=found.initial_set, horizon_s=HORIZON_S, step_s=0.05
    )
    times, runs = switching_runs(found.system, found.initial_set, reference.tube, count=300)
    return reference, times, runs


@pytest.mark.parametrize(("loop", "method"), CASES)
def test_the_runs_of_a_loop_stay_in_the_tube(loop: str, method: str) -> None:
    reference, times, runs = known(loop)
    tube = local_methods(0.05)[method].along(reference).tube
    assert tube.rigor is Rigor.ENCLOSED
    assert tube.names == reference.system.ode.names
    assert len(tube.times) > 5
    assert_contains(tube, times, runs)


@settings(max_examples=4, deadline=None)
@given(closed_loops(limited=True), vehicle_sets(points=True))
def test_the_runs_of_any_loop_stay_in_the_tube(loop: ClosedLoop, initial_set: Box) -> None:
    reference = Reference.of(loop, initial_set=initial_set, horizon_s=0.6, step_s=0.1)
    # Tubes of single states are as thin as rounding, so the runs must be better than the allowance.
    times, runs = switching_runs(loop, initial_set, reference.tube, count=100, per_step=20)
    for method in (LocalGrowth(0.1), LocalLagrangian(0.1)):
        assert_contains(method.along(reference).tube, times, runs)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(-2.0, 2.0), min_size=9, max_size=9), st.sampled_from(METHODS))
def test_linear_flows_are_enclosed(entries: list[float], method: str) -> None:
    matrix = np.array(entries).round(3).reshape(3, 3)
    system = system_of(
        lambda *x: [sum(a * v for a, v in zip(r, x, strict=True)) for r in matrix], "x", "y", "z"
    )
    initial = box(x=(0.5, 1.5), y=(-0.3, 0.2), z=(0.1, 0.1))
    tube = local_methods(0.1)[method].tube(system, initial_set=initial, horizon_s=0.7)
    times = dense_times(tube)
    runs = np.stack([starts(initial, 3) @ expm(matrix * t).T for t in times], axis=1)
    assert_contains(tube, times, runs)


@pytest.mark.parametrize("method", METHODS)
def test_parameters_and_disturbances_are_contained(method: str) -> None:
    system = disturbed(
        lambda x, p, w: [x[1] + w[0], -p[0] * x[0] - 0.5 * x[1] * x[0] ** 2 + 0.2 * w[1]],
        ("x", "y"),
        parameters=(Ranged("stiffness", "1", 1.0, 0.8, 1.5),),
        disturbances=(Ranged("push", "1", 0.0, -0.1, 0.3), Ranged("pull", "1", 0.1, 0.0, 0.1)),
    )
    initial = box(x=(0.4, 0.6), y=(-0.1, 0.1))
    tube = local_methods(0.05)[method].tube(system, initial_set=initial, horizon_s=1.0)
    assert tube.complete
    assert_contains(tube, *switching_runs(system, initial, tube, count=200))
