"""The compiled online tube contains every sampled trajectory and agrees with the validated tube."""

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

from workbench.bench.online_kernels import operating_region
from workbench.bench.online_method import OnlineMethod
from workbench.codegen.online_tube import OnlineTube, online_tube
from workbench.errors import InputError
from workbench.models import Ode, Ranged
from workbench.models.benchmarks import all_benchmarks
from workbench.reach import Partitioned, ReachTube, TubeStatus, ValidatedTube, compute_tube
from workbench.reach.online.kernels import Form
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
# Half widths over those of the validated tube of the same degree and step, at instants and in
# between; the linear forms bound what is quadratic in other ways.
NARROWEST, WIDEST, WIDEST_BETWEEN = 0.9, 1.05, 1.2
FOLLOWED = {"linear": (), "quadratic": ("y", "steering", "speed", "heading")}


@functools.cache
def kernel(name: str, form: str = "linear") -> OnlineTube:
    loop = LOOPS[name]
    return online_tube(
        loop.system, region=operating_region(loop), steps=100, step_max_s=0.05,
        quadratic=FOLLOWED[form],
    )  # fmt: skip


@pytest.mark.parametrize("form", FOLLOWED)
@pytest.mark.parametrize("name", ["B1", "B2", "B2-slow"])
def test_benchmarks_are_contained(name: str, form: str) -> None:
    loop = LOOPS[name]
    tube = kernel(name, form).tube(loop.initial_set, horizon_s=2.5, step_s=0.05)
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


@MANY
@given(start=vehicle_sets(points=True), horizon_s=st.floats(0.01, 1.0))
def test_sets_without_width_in_some_axes(start: Box, horizon_s: float) -> None:
    tube = kernel("B2", "quadratic").tube(start, horizon_s=horizon_s, step_s=0.04)
    if len(tube.times) > 1:
        times = dense_times(tube, per_step=5)
        states = sample_initial_states(start.reordered(tube.names), count=64, seed=3)
        assert_contains(tube, times, march(LOOPS["B2"].system, states, times))


@pytest.mark.parametrize("form", FOLLOWED)
def test_half_widths_agree_with_the_validated_tube(form: str) -> None:
    loop = LOOPS["B1"]
    method = ValidatedTube(0.05, degree=1 if form == "linear" else 2)
    desk = compute_tube(loop.system, initial_set=loop.initial_set, horizon_s=1.5, method=method)
    online = kernel("B1", form).tube(loop.initial_set, horizon_s=1.5, step_s=0.05)
    np.testing.assert_array_equal(online.times, desk.times)
    ratio = online.half_width_at()[1:] / desk.half_width_at()[1:]
    assert NARROWEST < ratio.min() <= ratio.max() < WIDEST
    centers = [(tube.lower_at + tube.upper_at) / 2 for tube in (desk, online)]
    np.testing.assert_allclose(*centers, atol=0.03 * desk.half_width_at().max())
    segments = (online.upper - online.lower) / (desk.upper - desk.lower)
    assert NARROWEST < segments.min() <= segments.max() < WIDEST_BETWEEN


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


@pytest.mark.parametrize("method", ["online", "validated"])
def test_disturbances_that_switch_within_a_step_are_contained(method: str) -> None:
    loop = LOOPS["B2-noise"]
    tube = (
        kernel("B2-noise").tube(loop.initial_set, horizon_s=0.9, step_s=0.05)
        if method == "online"
        else compute_tube(loop.system, initial_set=loop.initial_set, horizon_s=0.6)
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
    pushed = online_tube(cart, region=region, steps=40, step_max_s=0.05)
    tube = pushed.tube(box(x=(-0.1, 0.1), v=(0.0, 0.2)), horizon_s=2.0, step_s=0.05)
    assert tube.complete
    t = tube.times
    assert np.all(tube.upper_at[:, 0] >= 0.1 + 0.2 * t + t**2 / 2 - 1e-12)
    assert np.all(tube.lower_at[:, 0] <= -0.1 - t**2 / 2 + 1e-12)
    assert np.all(tube.upper_at[:, 0] <= 0.1 + 0.2 * t + 1.05 * t**2 / 2 + 2e-3)


PUSH = (Ranged.symmetric("push", "", 0.2),)


@functools.cache
def constant_rate_tube(order: tuple[int, ...]) -> tuple[Ode, ReachTube]:
    """A system with states a, b, c in this order, of which b has a constant rate; and its tube."""
    names = tuple(("a", "b", "c")[i] for i in order)

    def field(x: ca.SX, _p: ca.SX, w: ca.SX) -> list[ca.SX]:
        a, b, c = (x[order.index(i)] for i in range(3))
        rows = [4 * ca.sin(2 * b) - c, ca.SX(3), 2 * ca.fmax(a, w) - c * c]
        return [rows[i] for i in order]

    system = disturbed(field, names, disturbances=PUSH)
    region = Box(names, (-50.0,) * 3, (50.0,) * 3)
    made = online_tube(system, region=region, steps=20, step_max_s=0.05)
    start = box(a=(-0.1, 0.1), b=(0.0, 0.1), c=(0.2, 0.4))
    return system, made.tube(start, horizon_s=1.0, step_s=0.05)


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 0, 2), (2, 1, 0)])
def test_states_with_a_constant_rate(order: tuple[int, ...]) -> None:
    """Rows without derivatives must not shift the bounds of the others."""
    system, tube = constant_rate_tube(order)
    assert tube.complete
    times = dense_times(tube)
    start = Box(tube.names, tuple(tube.lower_at[0]), tuple(tube.upper_at[0]))
    states = sample_initial_states(start, count=500, seed=4)
    values = switching(len(states), len(times) - 1, PUSH)
    assert_contains(tube, times, march(system, states, times, disturbances=values), 1e-8)
    _, plain = constant_rate_tube((0, 1, 2))
    np.testing.assert_allclose(tube.upper, plain.upper[:, order], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(tube.lower, plain.lower[:, order], rtol=1e-9, atol=1e-12)


def test_a_tube_ends_where_its_region_ends() -> None:
    system = system_of(lambda x: [1 + 0 * x], "x")
    moving = online_tube(system, region=box(x=(-1.0, 1.0)), steps=100, step_max_s=0.05)
    tube = moving.tube(box(x=(0.0, 0.1)), horizon_s=5.0, step_s=0.05)
    assert tube.status is TubeStatus.LEFT_REGION
    assert 0.5 < tube.times[-1] <= 0.9 + 1e-12
    assert tube.upper.max() <= 1.0
    outside = moving.tube(box(x=(0.5, 1.1)), horizon_s=5.0, step_s=0.05)
    assert outside.status is TubeStatus.LEFT_REGION
    assert len(outside.lower) == 0
    assert outside.message == "the initial set is not inside the operating region along ['x']"


@pytest.mark.parametrize("start", [0.5, 1.0, 1.5])
def test_a_finite_escape_ends_the_proof(start: float) -> None:
    tube = square_kernel().tube(
        box(x=(start - 0.4, start + 0.4)), horizon_s=3.0, step_s=0.01
    )  # fmt: skip
    assert not tube.complete
    assert 0.0 < tube.times[-1] < 1 / (start + 0.4)
    times = dense_times(tube)
    x0 = np.linspace(start - 0.4, start + 0.4, 51)[:, None]
    assert_contains(tube, times, (x0 / (1 - x0 * times))[:, :, None])


@functools.cache
def square_kernel() -> OnlineTube:
    system = system_of(lambda x: [x * x], "x")
    return online_tube(system, region=box(x=(-1e3, 1e3)), steps=300, step_max_s=0.01)


RATES = (Ranged("rate", "1/s", 0.7, 0.5, 0.8), Ranged("gain", "1/s", 2.0, 2.0, 2.0))


@functools.cache
def ranged_kernel() -> OnlineTube:
    """x' = 2 p x with a range of p."""
    system = disturbed(lambda x, p, _w: [p[0] * p[1] * x[0]], ("x",), parameters=RATES)
    return online_tube(system, region=box(x=(0.0, 20.0)), steps=20, step_max_s=0.05)


def test_one_parameter_value_acts_in_a_whole_trajectory() -> None:
    tube = ranged_kernel().tube(box(x=(1.0, 1.2)), horizon_s=1.0, step_s=0.05)
    assert tube.complete
    assert tube.names == ("x",)
    low, high = np.exp(2 * 0.5 * tube.times), 1.2 * np.exp(2 * 0.8 * tube.times)
    assert np.all(tube.lower_at[:, 0] <= low + 1e-14)
    assert np.all(tube.upper_at[:, 0] >= high - 1e-14)
    assert tube.upper_at[-1, 0] < 1.2 * high[-1]
    part = ranged_kernel().tube(box(x=(1.0, 1.0), rate=(0.6, 0.6)), horizon_s=1.0, step_s=0.05)
    assert part.lower_at[-1, 0] <= np.exp(1.2) <= part.upper_at[-1, 0]
    assert part.half_width_at()[-1, 0] < 1e-6


def test_a_wrong_parameter_range_or_none_is_refused() -> None:
    with pytest.raises(InputError, match="expected 'rate' within its range"):
        ranged_kernel().tube(box(x=(1.0, 1.0), rate=(0.4, 0.6)), horizon_s=1.0, step_s=0.05)
    made = ranged_kernel()
    system = made.original
    with pytest.raises(InputError, match="expected a region over the states"):
        online_tube(system, region=box(y=(0.0, 1.0)), steps=1, step_max_s=0.05)


def test_the_method_compiles_once_for_all_cells_and_their_hull_is_tighter() -> None:
    loop, method = LOOPS["B2"], OnlineMethod(0.05, Form.LINEAR)
    whole, cells = (
        compute_tube(loop.system, initial_set=loop.initial_set, horizon_s=1.0, method=each)
        for each in (method, Partitioned(method, {"y": 2, "heading": 2}))
    )
    assert cells.complete
    times = dense_times(cells)
    states = pressing_states(loop.system, loop.initial_set, cells, count=500)
    assert_contains(cells, times, march(loop.system, states, times))
    ratio = cells.half_width_at()[-1] / whole.half_width_at()[-1]
    # Speed and its integral are a linear system of their own: nothing to gain.
    assert ratio.max() <= 1 + 1e-6
    assert ratio[1] < 0.95
    for step_s in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="step_s"):
            OnlineMethod(step_s, Form.LINEAR)


def test_what_the_kernel_cannot_take_is_refused() -> None:
    made, start = kernel("B1"), LOOPS["B1"].initial_set
    with pytest.raises(InputError, match="at most 100 steps"):
        made.tube(start, horizon_s=5.1, step_s=0.05)
    with pytest.raises(InputError, match=r"of at most 0\.05 s"):
        made.tube(start, horizon_s=1.0, step_s=0.1)
    for bad in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="horizon_s"):
            made.tube(start, horizon_s=bad, step_s=0.05)
        with pytest.raises(InputError, match="step_s"):
            made.tube(start, horizon_s=1.0, step_s=bad)
    with pytest.raises(InputError, match="expected an initial set over the states"):
        made.tube(box(x=(0.0, 1.0)), horizon_s=1.0, step_s=0.05)
    query = made.query(start, 3.0, 0.05)
    query[3] = float("nan")
    assert made.bound(query)() == 0
    assert made._result[0] == 4.0
