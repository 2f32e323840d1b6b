"""The compiled tube contains every sampled trajectory and agrees with the desk tube."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from tube_cases import (
    Array,
    assert_contains,
    box,
    dense_times,
    disturbed,
    march,
    pressing_states,
    system_of,
    vehicle_sets,
)

from workbench.bench.scoreboard import compiled_tube
from workbench.codegen.c_source import KernelSizes
from workbench.codegen.tube_kernel import CompiledTube
from workbench.errors import InputError
from workbench.models import Ranged
from workbench.models.benchmarks import Benchmark, all_benchmarks
from workbench.reach import SensitivityTube, TubeStatus, compute_tube
from workbench.sensitivity.sampling import sample_initial_states
from workbench.sets import Box

LOOPS = {loop.name: loop for loop in all_benchmarks()}
MANY = settings(
    max_examples=30,
    deadline=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)
# Half widths of the compiled tube over those of the desk tube with the same step. The desk tube
# bounds the truncation that the compiled one estimates, so the compiled one may be narrower by it.
NARROWEST, WIDEST = 0.99, 1.05


@functools.cache
def kernel(name: str) -> CompiledTube:
    return compiled_tube(LOOPS[name], 5.0)


@pytest.mark.parametrize("name", ["B1", "B1-brake", "B2", "B2-slow", "B2-path"])
def test_benchmarks_are_contained(name: str) -> None:
    loop: Benchmark = LOOPS[name]
    tube = kernel(name).tube(loop.initial_set, horizon_s=3.0, step_s=0.05)
    assert tube.complete
    times = dense_times(tube)
    states = pressing_states(loop.system, loop.initial_set, tube, count=2000)
    assert_contains(tube, times, march(loop.system, states, times))


@pytest.mark.parametrize("name", ["B1", "B2"])
@MANY
@given(
    start=vehicle_sets(points=False), horizon_s=st.floats(0.01, 1.5), step_s=st.floats(0.01, 0.05)
)
def test_random_sets_are_contained(name: str, start: Box, horizon_s: float, step_s: float) -> None:
    step_s = max(step_s, horizon_s / 90)
    tube = kernel(name).tube(start, horizon_s=horizon_s, step_s=step_s)
    assert tube.complete, tube.message
    times = dense_times(tube, per_step=5)
    states = sample_initial_states(start.reordered(tube.names), count=256, seed=3)
    assert_contains(tube, times, march(LOOPS[name].system, states, times))


@pytest.mark.parametrize("name", ["B2"])
@MANY
@given(start=vehicle_sets(points=True), horizon_s=st.floats(0.01, 1.0))
def test_sets_without_width_in_some_axes(name: str, start: Box, horizon_s: float) -> None:
    tube = kernel(name).tube(start, horizon_s=horizon_s, step_s=0.04)
    if len(tube.times) > 1:
        times = dense_times(tube, per_step=5)
        states = sample_initial_states(start.reordered(tube.names), count=64, seed=3)
        assert_contains(tube, times, march(LOOPS[name].system, states, times))


@pytest.mark.parametrize("name", ["B1", "B2-noise"])
def test_half_widths_agree_with_the_desk_tube(name: str) -> None:
    loop = LOOPS[name]
    method = SensitivityTube(0.05)
    desk = compute_tube(loop.system, initial_set=loop.initial_set, horizon_s=1.5, method=method)
    compiled = kernel(name).tube(loop.initial_set, horizon_s=1.5, step_s=0.05)
    np.testing.assert_allclose(compiled.times, desk.times, rtol=1e-15)
    ratio = compiled.half_width_at()[1:] / desk.half_width_at()[1:]
    assert ratio.min() > NARROWEST
    assert ratio.max() < WIDEST
    centers = [(tube.lower_at + tube.upper_at) / 2 for tube in (desk, compiled)]
    np.testing.assert_allclose(*centers, atol=0.03 * desk.half_width_at().max())
    segments = (compiled.upper - compiled.lower) / (desk.upper - desk.lower)
    assert segments.min() > NARROWEST
    assert segments.max() < WIDEST


def switching(count: int, steps: int, ranges: tuple[Ranged, ...]) -> Array:
    """Disturbances at random corners of their ranges, switching at any of the reference's steps."""
    rng = np.random.default_rng(11)
    corners = np.array([(r.lower, r.upper) for r in ranges])
    values = np.empty((count, steps, len(ranges)))
    values[:, 0] = np.where(rng.random((count, len(ranges))) < 0.5, *corners.T)
    rate = rng.choice([0.01, 0.1, 0.5, 1.0], size=(count, 1))
    for k in range(1, steps):
        fresh = np.where(rng.random((count, len(ranges))) < 0.5, *corners.T)
        values[:, k] = np.where(rng.random((count, 1)) < rate, fresh, values[:, k - 1])
    return values


@pytest.mark.parametrize("method", ["desk", "compiled"])
def test_disturbances_that_switch_within_a_step_are_contained(method: str) -> None:
    loop = LOOPS["B2-noise"]
    tube = (
        kernel("B2-noise").tube(loop.initial_set, horizon_s=1.5, step_s=0.05)
        if method == "compiled"
        else compute_tube(
            loop.system,
            initial_set=loop.initial_set,
            horizon_s=0.6,
            method=SensitivityTube(0.03),
        )
    )
    assert tube.complete
    times = dense_times(tube)
    states = sample_initial_states(loop.initial_set, count=1000, seed=4)
    values = switching(len(states), len(times) - 1, loop.system.ode.disturbances)
    assert_contains(tube, times, march(loop.system, states, times, disturbances=values))


def test_a_pushed_cart_reaches_its_exact_extremes() -> None:
    push = (Ranged("push", "m/s^2", 0.0, -1.0, 1.0),)
    cart = disturbed(lambda x, _p, w: [x[1], w], ("x", "v"), disturbances=push)
    region = box(x=(-50.0, 50.0), v=(-50.0, 50.0))
    compiled = CompiledTube(cart, region=region, sizes=KernelSizes(40, 0.05, 2))
    tube = compiled.tube(box(x=(-0.1, 0.1), v=(0.0, 0.2)), horizon_s=2.0, step_s=0.05)
    assert tube.complete
    t = tube.times
    assert np.all(tube.upper_at[:, 0] >= 0.1 + 0.2 * t + t**2 / 2 - 1e-12)
    assert np.all(tube.lower_at[:, 0] <= -0.1 - t**2 / 2 + 1e-12)
    assert np.all(tube.upper_at[:, 0] <= 0.1 + 0.2 * t + 1.05 * t**2 / 2 + 2e-3)


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 0, 2), (2, 1, 0)])
def test_states_with_a_constant_rate(order: tuple[int, ...]) -> None:
    """Rows without derivatives must not shift the bounds of the others."""
    push = (Ranged.symmetric("push", "", 0.2),)
    names = tuple(("a", "b", "c")[i] for i in order)

    def field(x: ca.SX, _p: ca.SX, w: ca.SX) -> list[ca.SX]:
        a, b, c = (x[order.index(i)] for i in range(3))
        rows = [4 * ca.sin(2 * b) - c, ca.SX(3), 2 * ca.fmax(a, w) - c * c]
        return [rows[i] for i in order]

    system = disturbed(field, names, disturbances=push)
    region = Box(names, (-50.0,) * 3, (50.0,) * 3)
    start = box(a=(-0.1, 0.1), b=(0.0, 0.1), c=(0.2, 0.4)).reordered(names)
    kernel = CompiledTube(system, region=region, sizes=KernelSizes(20, 0.05, 2))
    tube = kernel.tube(start, horizon_s=1.0, step_s=0.05)
    assert tube.complete
    times = dense_times(tube)
    states = sample_initial_states(start, count=500, seed=4)
    values = switching(len(states), len(times) - 1, push)
    assert_contains(tube, times, march(system, states, times, disturbances=values))
    desk = compute_tube(system, initial_set=start, horizon_s=1.0, method=SensitivityTube(0.05))
    np.testing.assert_allclose(tube.upper, desk.upper, rtol=0.05, atol=0.01)
    np.testing.assert_allclose(tube.lower, desk.lower, rtol=0.05, atol=0.01)


def test_a_tube_ends_where_its_region_ends() -> None:
    system = system_of(lambda x: [1 + 0 * x], "x")
    compiled = CompiledTube(system, region=box(x=(-1.0, 1.0)), sizes=KernelSizes(100, 0.05, 2))
    tube = compiled.tube(box(x=(0.0, 0.1)), horizon_s=5.0, step_s=0.05)
    assert tube.status is TubeStatus.LEFT_REGION
    assert 0.5 < tube.times[-1] <= 0.9 + 1e-12
    assert tube.upper.max() <= 1.0


@pytest.mark.parametrize("start", [0.5, 1.0, 1.5])
def test_a_finite_escape_ends_the_proof(start: float) -> None:
    region = box(x=(-1e3, 1e3))
    compiled = CompiledTube(
        system_of(lambda x: [x * x], "x"), region=region, sizes=KernelSizes(300, 0.01, 2)
    )
    tube = compiled.tube(box(x=(start - 0.4, start + 0.4)), horizon_s=3.0, step_s=0.01)
    assert not tube.complete
    assert tube.times[-1] < 1 / (start + 0.4)
    times = dense_times(tube)
    x0 = np.linspace(start - 0.4, start + 0.4, 51)[:, None]
    assert_contains(tube, times, (x0 / (1 - x0 * times))[:, :, None])


def test_what_the_kernel_cannot_take_is_refused() -> None:
    loop = LOOPS["B1"]
    with pytest.raises(InputError, match="at most 100 steps"):
        kernel("B1").tube(loop.initial_set, horizon_s=5.1, step_s=0.05)
    with pytest.raises(InputError, match=r"of at most 0\.05 s"):
        kernel("B1").tube(loop.initial_set, horizon_s=1.0, step_s=0.1)
    query = kernel("B1").query(loop.initial_set, 3.0, 0.05)
    query[3] = float("nan")
    assert kernel("B1").bound(query)() == 0
    assert kernel("B1")._result[0] == 4.0
