"""Runs of many points at once are the runs of each point, with the right slopes and extremes."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from workbench.errors import InputError
from workbench.models.benchmarks import b1, b2
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode, system_from_casadi
from workbench.sensitivity.ascent import Goals, Pairs, ascend, gradient_states
from workbench.sensitivity.inclusion import inclusion
from workbench.sensitivity.sampling import Flow, rollout, sample_initial_states
from workbench.sensitivity.vectorised import Vectorised
from workbench.sets.box import Box

_MATRIX = np.array([[0.0, 1.0], [-2.0, -0.3]])


def _linear() -> Ode:
    x = ca.SX.sym("x", 2)
    return system_from_casadi(x, ca.DM(_MATRIX) @ x, ("position", "rate"))


def test_vectorised_fields_agree_with_casadi_point_by_point() -> None:
    rng = np.random.default_rng(0)
    for benchmark in (b1(), b2()):
        ode = benchmark.system.ode
        points = sample_initial_states(benchmark.initial_set, count=40, seed=1)
        points = points + rng.normal(size=points.shape)
        nominal = np.array(ode.parameter_values())
        together = Vectorised(ode.function())(points.T, nominal[:, None], np.empty((0, 1)))[0]
        alone = [np.array(ode.function()(point, nominal, [])).ravel() for point in points]
        np.testing.assert_allclose(together.T, alone, rtol=1e-13, atol=1e-15)


@settings(max_examples=30, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(0.0, 0.5), st.floats(0.1, 3.0))
def test_inclusion_functions_keep_every_bit(middle: float, radius: float, speed: float) -> None:
    x = ca.SX.sym("x", 2)
    values = ca.vertcat(
        x[1] * ca.tan(x[0]) / 1.75, ca.fmin(ca.fmax(x[0], -0.5), 0.5) * ca.cos(x[0]), x[0] ** 2
    )
    lifted = inclusion(ca.Function("f", [x], [values], ["x"], ["y"]))
    low, high = [middle - radius, speed], [middle + radius, 2.0 * speed]
    expected = [np.array(part).ravel() for part in lifted(low, high)]
    columns = [np.repeat(np.array(end)[:, None], 3, axis=1) for end in (low, high)]
    for part, known in zip(Vectorised(lifted)(*columns), expected, strict=True):
        np.testing.assert_array_equal(part, np.repeat(known[:, None], 3, axis=1))


def test_linear_runs_follow_the_matrix_exponential() -> None:
    starts = np.array([[1.0, 0.0], [0.3, -2.0], [0.0, 0.0]])
    runs = rollout(_linear(), starts, horizon_s=2.0, step_s=0.01)
    assert runs.shape == (3, 201, 2)
    for k in (0, 50, 200):
        np.testing.assert_allclose(runs[:, k], starts @ expm(_MATRIX * 0.01 * k).T, atol=1e-9)


def test_blocks_do_not_change_a_run() -> None:
    box = b1().initial_set
    starts = sample_initial_states(box, count=9000, seed=0)
    runs = rollout(b1().system, starts, horizon_s=0.2, step_s=0.1)
    some = rollout(b1().system, starts[4090:4100], horizon_s=0.2, step_s=0.1)
    np.testing.assert_allclose(runs[4090:4100], some, rtol=1e-14, atol=1e-15)


def test_each_run_has_its_own_parameters_and_disturbances() -> None:
    x, p, w = ca.SX.sym("x"), ca.SX.sym("p"), ca.SX.sym("w")
    ranges = ((Ranged("decay", "1/s", 1.0, 0.5, 2.0),), (Ranged("push", "1/s", 0.0, -1.0, 1.0),))
    ode = Ode("decay", (Signal("x", ""),), *ranges, x, p, w, -p * x + w)
    starts = np.ones((2, 1))
    by_run = rollout(ode, starts, horizon_s=1.0, step_s=0.01, parameters=np.array([[0.5], [2.0]]))
    np.testing.assert_allclose(by_run[:, -1, 0], np.exp([-0.5, -2.0]), rtol=1e-8)
    pushed = rollout(ode, starts, horizon_s=1.0, step_s=0.01, disturbances=[1.0])
    np.testing.assert_allclose(pushed[:, -1, 0], 1.0, rtol=1e-12)
    np.testing.assert_allclose(
        rollout(ode, starts, horizon_s=1.0, step_s=0.01)[:, -1, 0], np.exp(-1.0), rtol=1e-8
    )


def test_slopes_are_the_derivatives_of_the_runs() -> None:
    benchmark = b1()
    starts = sample_initial_states(benchmark.initial_set, count=6, seed=2)
    parameters = np.tile(benchmark.system.ode.parameter_values(), (6, 1))
    states, slopes = Flow(benchmark.system, 1.0, 0.05).with_sensitivity(starts, parameters)
    for axis in range(7):
        shift = np.zeros(7)
        shift[axis] = 1e-5
        ahead = rollout(benchmark.system, starts + shift, horizon_s=1.0, step_s=0.05)
        behind = rollout(benchmark.system, starts - shift, horizon_s=1.0, step_s=0.05)
        np.testing.assert_allclose((ahead - behind) / 2e-5, slopes[..., axis], atol=1e-8)
    np.testing.assert_allclose(
        states, rollout(benchmark.system, starts, horizon_s=1.0, step_s=0.05)
    )


def test_samples_hold_all_vertices_and_faces_and_stay_in_the_box() -> None:
    box = b1().initial_set
    states = sample_initial_states(box, count=500, seed=4)
    assert states.shape == (500, 7)
    assert all(box.contains(state) for state in states.tolist())
    assert {tuple(state) for state in states.tolist()} >= set(box.vertices())
    on_end = (states == np.array(box.lower)) | (states == np.array(box.upper))
    touching = on_end[:, :5].any(axis=1)
    assert 0.4 < touching.mean() < 0.8
    np.testing.assert_array_equal(states, sample_initial_states(box, count=500, seed=4))
    assert not np.array_equal(states, sample_initial_states(box, count=500, seed=5))


def test_gradient_states_reach_the_extremes_of_a_linear_system() -> None:
    box = Box.around({"position": 0.5, "rate": 0.0}, radius={"position": 0.2, "rate": 0.4})
    states = gradient_states(_linear(), box, horizon_s=2.0, step_s=0.05, every=10, seed=0)
    runs = rollout(_linear(), states, horizon_s=2.0, step_s=0.05)
    for k in (10, 20, 30, 40):
        flow = expm(_MATRIX * 0.05 * k)
        middle, spread = flow @ np.array(box.center), np.abs(flow) @ np.array(box.radius)
        np.testing.assert_allclose(runs[:, k].max(axis=0), middle + spread, atol=1e-6)
        np.testing.assert_allclose(runs[:, k].min(axis=0), middle - spread, atol=1e-6)


def test_ascent_moves_both_ends_of_a_pair_to_where_they_part_most() -> None:
    x = ca.SX.sym("x")
    system = system_from_casadi(x, -(x**3), ("x",))
    box = Box.from_intervals({"x": (1.0, 2.0)})
    start = Pairs(np.array([[1.6]]), np.array([[1.5]]), np.empty((1, 0)))
    flow = Flow(system, 0.5, 0.05)
    for sign in (1.0, -1.0):
        goals = Goals(np.array([0]), np.array([10]), np.array([sign]))
        found = ascend(flow, box, goals=goals, start=start, rounds=20, move_first=True)
        # Runs from 1 and 1.5 part most: the pull towards 0 is weakest there.
        assert sorted([found.first[0, 0], found.second[0, 0]]) == pytest.approx(
            [1.0, 1.5], abs=1e-3
        )
        assert sign * (found.second[0, 0] - found.first[0, 0]) > 0.0


@pytest.mark.parametrize(
    ("states", "horizon_s", "step_s", "message"),
    [
        (np.zeros((3, 4)), 1.0, 0.1, "shape"),
        (np.zeros(2), 1.0, 0.1, "shape"),
        (np.zeros((3, 2)), 1.0, 0.3, "whole steps"),
        (np.zeros((3, 2)), 0.1, 0.3, "step_s <= horizon_s"),
    ],
)
def test_unusable_input_is_named(
    states: np.ndarray, horizon_s: float, step_s: float, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        rollout(_linear(), states, horizon_s=horizon_s, step_s=step_s)


def test_an_operation_numpy_lacks_is_named() -> None:
    x = ca.SX.sym("x")
    with pytest.raises(InputError, match="erf"):
        Vectorised(ca.Function("f", [x], [ca.erf(x)]))
