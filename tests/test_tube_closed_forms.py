"""Tubes contain known solutions, end where a solution ends, and lose nothing on linear flows."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from tube_cases import (
    Array,
    assert_contains,
    box,
    dense_times,
    disturbed,
    starts,
    system_of,
    tube_of,
)

from workbench.models import Ranged

LINEAR = {
    "rotation": ([[0.0, -2.0], [2.0, 0.0]], 1e-4),
    "stable node": ([[-1.0, 0.5], [0.0, -2.0]], 1e-4),
    "saddle": ([[1.0, 0.3], [0.2, -1.5]], 1e-4),
    "shear": ([[0.0, 1.0], [0.0, 0.0]], 1e-12),
}


@pytest.mark.parametrize("name", LINEAR)
def test_a_linear_flow_is_enclosed_without_loss(name: str) -> None:
    matrix, loss = LINEAR[name]
    a = np.array(matrix)
    system = system_of(lambda x, y: list(ca.vertsplit(ca.DM(a) @ ca.vertcat(x, y))), "x", "y")
    initial = box(x=(0.5, 1.5), y=(-0.3, 0.2))
    tube = tube_of(system, initial, 2.0)
    assert tube.complete
    times = dense_times(tube)
    runs = np.stack([starts(initial) @ expm(a * t).T for t in times], axis=1)
    assert_contains(tube, times, runs)
    exact = np.array([np.abs(expm(a * t)) @ initial.radius for t in tube.times])
    assert np.all(tube.half_width_at() <= exact * (1 + loss) + 1e-9)


Solution = Callable[[Array, Array], Array]


def clipped(x0: Array, t: Array) -> Array:
    """x' = -clip(x, -0.2, 0.2)."""
    size = np.abs(x0)
    meets = np.maximum(0.0, (size - 0.2) / 0.2)
    after = np.minimum(size, 0.2) * np.exp(-np.maximum(0.0, t - meets))
    return np.asarray(np.sign(x0) * np.where(t < meets, size - 0.2 * t, after))


def slower_of_two(x0: Array, t: Array) -> Array:
    """x' = -fmin(x, 0.5) for x0 > 0."""
    meets = np.maximum(0.0, (x0 - 0.5) / 0.5)
    after = np.minimum(x0, 0.5) * np.exp(-np.maximum(0.0, t - meets))
    return np.asarray(np.where(t < meets, x0 - 0.5 * t, after))


SCALAR: dict[str, tuple[Callable[[ca.SX], ca.SX], Solution, tuple[float, float], float]] = {
    "square": (lambda x: x * x, lambda x0, t: x0 / (1 - x0 * t), (0.5, 0.9), 0.8),
    "logistic": (
        lambda x: x * (1 - x),
        lambda x0, t: x0 * np.exp(t) / (1 + x0 * (np.exp(t) - 1)),
        (0.1, 0.4),
        3.0,
    ),
    "exp": (lambda x: ca.exp(-x), lambda x0, t: np.log(np.exp(x0) + t), (-0.3, 0.3), 3.0),
    "inverse": (lambda x: 1 / x, lambda x0, t: np.sqrt(x0**2 + 2 * t), (0.6, 1.0), 3.0),
    "cosine": (lambda x: ca.cos(x) ** 2, lambda x0, t: np.arctan(np.tan(x0) + t), (-0.3, 0.3), 3.0),
    "tangent": (ca.tan, lambda x0, t: np.arcsin(np.sin(x0) * np.exp(t)), (0.1, 0.2), 1.0),
    "clip met on the way": (
        lambda x: -ca.fmin(ca.fmax(x, -0.2), 0.2),
        clipped,
        (0.1, 0.6),
        4.0,
    ),
    "clip on both sides": (lambda x: -ca.fmin(ca.fmax(x, -0.2), 0.2), clipped, (-0.4, 0.3), 3.0),
    "clip decided": (lambda x: -ca.fmin(ca.fmax(x, -0.2), 0.2), clipped, (0.9, 1.1), 2.0),
    "fabs about its kink": (
        lambda x: -ca.fabs(x),
        lambda x0, t: np.where(x0 > 0, x0 * np.exp(-t), x0 * np.exp(t)),
        (-0.1, 0.2),
        1.5,
    ),
    "fmin": (lambda x: -ca.fmin(x, ca.SX(0.5)), slower_of_two, (0.4, 0.9), 3.0),
}


@pytest.mark.parametrize("step_s", [0.05, 0.037])
@pytest.mark.parametrize("name", SCALAR)
def test_a_scalar_solution_is_contained(name: str, step_s: float) -> None:
    field, solution, interval, horizon_s = SCALAR[name]
    initial = box(x=interval)
    tube = tube_of(system_of(lambda x: [field(x)], "x"), initial, horizon_s, step_s)
    assert tube.complete, tube.message
    times = dense_times(tube, per_step=20)
    x0 = starts(initial, 101)
    runs = solution(x0, times[None, :])[:, :, None]
    assert_contains(tube, times, runs)
    width = np.ptp(runs[:, -1, 0])
    assert tube.half_width_at()[-1, 0] < 1.5 * width + 0.1


@pytest.mark.parametrize("interval", [(0.5, 1.5), (0.9, 1.1), (1.0, 1.0), (-3.0, 2.0), (1.0, 50.0)])
def test_no_tube_passes_a_finite_escape(interval: tuple[float, float]) -> None:
    initial = box(x=interval)
    tube = tube_of(system_of(lambda x: [x * x], "x"), initial, 2.0, 0.01)
    assert not tube.complete
    assert tube.message
    assert tube.times[-1] < 1 / interval[1]
    times = dense_times(tube)
    x0 = starts(initial, 101)
    assert_contains(tube, times, (x0 / (1 - x0 * times))[:, :, None])


@pytest.mark.parametrize("start", [1.4, 1.0, 0.0])
def test_no_tube_passes_a_pole_of_tan(start: float) -> None:
    system = system_of(lambda x, y: [ca.SX(1), ca.tan(x)], "x", "y")
    initial = box(x=(start - 0.05, start + 0.05), y=(0.0, 0.0))
    tube = tube_of(system, initial, 3.0)
    assert not tube.complete
    assert tube.times[-1] <= np.pi / 2 - initial.upper[0]
    times = dense_times(tube)
    x0 = starts(initial)
    x = x0[:, :1] + times
    runs = np.stack([x, x0[:, 1:] + np.log(np.cos(x0[:, :1]) / np.cos(x))], axis=2)
    assert_contains(tube, times, runs)


def pendulum(x: ca.SX, v: ca.SX) -> list[ca.SX]:
    return [v, -9.81 * ca.sin(x) - 0.1 * v]


def van_der_pol(x: ca.SX, v: ca.SX) -> list[ca.SX]:
    return [v, (1 - x**2) * v - x]


def minimum_of_states(x: ca.SX, y: ca.SX) -> list[ca.SX]:
    return [-ca.fmin(x, y) + 0.3 * y, ca.fmax(x, 0.1) - y]


@pytest.mark.parametrize("field", [pendulum, van_der_pol, minimum_of_states])
def test_planar_flows_contain_a_reference_integration(field: Callable[..., list[ca.SX]]) -> None:
    system = system_of(field, "x", "y")
    initial = box(x=(0.9, 1.0), y=(-0.05, 0.1))
    tube = tube_of(system, initial, 1.5, 0.02)
    assert tube.complete, tube.message
    times = dense_times(tube, per_step=5)
    rhs = system.function()
    runs = [
        solve_ivp(
            lambda _, y: np.array(rhs(y, [], [])).ravel(),
            (0.0, times[-1]),
            state,
            method="DOP853",
            t_eval=times,
            rtol=1e-12,
            atol=1e-13,
        ).y.T
        for state in starts(initial, 3)
    ]
    assert_contains(tube, times, np.array(runs))


def test_a_double_integrator_contains_bang_bang_inputs() -> None:
    push = (Ranged("push", "m/s^2", 0.0, -0.5, 1.0),)
    system = disturbed(lambda x, _p, w: [x[1], w], ("x", "v"), disturbances=push)
    initial = box(x=(-0.1, 0.1), v=(0.0, 0.2))
    tube = tube_of(system, initial, 2.0)
    assert tube.complete
    times = dense_times(tube)
    runs = []
    for corner in initial.vertices():
        for first, second in ((-0.5, 1.0), (1.0, -0.5)):
            for switch in (0.0, 0.31, 1.0, 2.0):
                before, after = np.minimum(times, switch), np.maximum(times - switch, 0.0)
                v = corner[1] + first * before + second * after
                x = corner[0] + corner[1] * times + first * before**2 / 2
                runs.append(np.stack([x + first * before * after + second * after**2 / 2, v], 1))
    assert_contains(tube, times, np.array(runs))
    exact = 0.1 + 0.1 * times[-1] + 0.75 * times[-1] ** 2 / 2
    assert tube.half_width_at()[-1, 0] < 1.05 * exact


def test_an_oscillator_contains_the_worst_disturbance_of_every_coordinate() -> None:
    a, column = np.array([[-0.2, 3.0], [-3.0, -0.2]]), np.array([0.0, 1.0])
    force = (Ranged.symmetric("force", "", 0.4),)
    system = disturbed(
        lambda x, _p, w: [-0.2 * x[0] + 3.0 * x[1], -3.0 * x[0] - 0.2 * x[1] + w],
        ("x", "y"),
        disturbances=force,
    )
    initial = box(x=(1.0, 1.0), y=(0.0, 0.0))
    tube = tube_of(system, initial, 3.0, 0.05)
    assert tube.complete
    for t in (0.05, 0.125, 0.5, 1.0, 2.025, 3.0):
        free = expm(a * t) @ initial.center
        for i in range(2):
            # The largest reach of coordinate i, by the input that follows the sign of its response.
            breaks = [k * np.pi / 6 for k in range(1, 7) if k * np.pi / 6 < t]
            reach, _ = quad(
                lambda s, i=i: 0.4 * abs((expm(a * s) @ column)[i]), 0, t, points=breaks or None
            )
            row = min(int(t / 0.05 + 1e-9), len(tube.lower) - 1)
            assert tube.upper[row, i] >= free[i] + reach - 1e-9
            assert tube.lower[row, i] <= free[i] - reach + 1e-9
            assert tube.upper[row, i] <= free[i] + 1.3 * reach + 0.3


def test_a_disturbance_that_multiplies_the_state_is_contained() -> None:
    rate = (Ranged("rate", "1/s", -1.0, -1.5, -0.5),)
    system = disturbed(lambda x, _p, w: [w * x], ("x",), disturbances=rate)
    initial = box(x=(0.8, 1.2))
    tube = tube_of(system, initial, 2.0)
    assert tube.complete
    times = dense_times(tube)
    runs = [x0 * np.exp(w * times) for x0 in (0.8, 1.0, 1.2) for w in (-1.5, -1.0, -0.5)]
    runs += [
        1.2 * np.exp(-0.5 * np.minimum(times, s) - 1.5 * np.maximum(times - s, 0))
        for s in (0.32, 1.01)
    ]
    assert_contains(tube, times, np.array(runs)[:, :, None])


def test_every_value_of_a_ranged_parameter_is_contained() -> None:
    rates = (Ranged("rate", "1/s", 1.0, 0.5, 1.5), Ranged("goal", "", 0.0, -0.2, 0.3))
    system = disturbed(lambda x, p, _w: [-p[0] * (x - p[1])], ("x",), parameters=rates)
    initial = box(x=(0.9, 1.1))
    tube = tube_of(system, initial, 2.0)
    assert tube.complete
    assert tube.names == ("x",)
    times = dense_times(tube)
    grid = np.meshgrid([0.9, 1.1], np.linspace(0.5, 1.5, 5), np.linspace(-0.2, 0.3, 5))
    x0, rate, goal = (axis.ravel()[:, None] for axis in grid)
    assert_contains(tube, times, (goal + (x0 - goal) * np.exp(-rate * times))[:, :, None])
