"""The exponential fit is the best line above the points: hand cases and the upper hull agree."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.models.system import system_from_casadi
from workbench.sensitivity import LearnedExponential, learn_discrepancy
from workbench.sensitivity.learning.log_lines import fit_log_lines, hats
from workbench.sets.box import Box

Array = npt.NDArray[np.float64]


def _line(times: Array, values: list[float]) -> Array:
    """Heights at the instants of the fitted line."""
    logs = np.array(values)[:, None]
    lines = fit_log_lines(times, logs, nodes=times[[0, -1]])
    return np.asarray(hats(times, times[[0, -1]]) @ lines.heights[:, 0])


def test_two_points_give_the_line_through_them() -> None:
    line = _line(np.array([0.0, 1.0, 2.0]), [-math.inf, 1.0, 3.0])
    assert line == pytest.approx([-1.0, 1.0, 3.0], abs=1e-4)


def test_a_peak_in_the_middle_is_touched_with_the_flattest_line() -> None:
    line = _line(np.linspace(0.0, 4.0, 5), [-math.inf, 0.0, 2.0, 2.5, 0.0])
    # The mean instant is 2.5, between the peaks at 2 and 3, so their line is the optimum.
    assert line == pytest.approx([1.0, 1.5, 2.0, 2.5, 3.0], abs=1e-4)


def test_a_known_first_point_holds_even_if_samples_shrink() -> None:
    line = _line(np.array([0.0, 1.0, 2.0]), [0.0, -1.0, -2.0])
    assert line == pytest.approx([0.0, -1.0, -2.0], abs=1e-4)


def test_a_bend_is_followed_at_its_node() -> None:
    times = np.linspace(0.0, 4.0, 9)
    values = np.minimum(times, 4.0 - times)[:, None]
    lines = fit_log_lines(times, values, nodes=np.array([0.0, 2.0, 4.0]))
    assert lines.heights[:, 0] == pytest.approx([0.0, 2.0, 0.0], abs=1e-4)


def test_many_points_on_one_line_are_carried_by_two() -> None:
    times = np.linspace(0.0, 4.0, 9)
    lines = fit_log_lines(times, (0.5 * times - 1.0)[:, None], nodes=times[[0, -1]])
    assert 1 <= int(lines.carried.sum()) <= 2


def _best_value(times: Array, points: Array, at: float) -> float:
    """Height at `at` of the lowest line above the points: their upper hull there."""
    heights = [p for t, p in zip(times, points, strict=True) if t == at]
    for t, p in zip(times, points, strict=True):
        for u, q in zip(times, points, strict=True):
            if t < at < u:
                heights.append(p + (q - p) * (at - t) / (u - t))
    return float(max(heights))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=8))
def test_objective_is_the_upper_hull_at_the_mean_instant(values: list[float]) -> None:
    times = np.linspace(0.0, 0.5 * len(values), len(values) + 1)
    line = _line(times, [-math.inf, *values])
    assert np.all(line[1:] >= np.array(values))
    best = _best_value(times[1:], np.array(values), float(times[1:].mean()))
    assert float(line[1:].mean()) == pytest.approx(best, abs=1e-4)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(-300, 300), min_size=4, max_size=8), st.integers(1, 3))
def test_the_points_that_carry_a_line_alone_give_it(values: list[int], pieces: int) -> None:
    times = np.linspace(0.0, 1.0, len(values))
    nodes = np.linspace(0.0, 1.0, pieces + 1)
    logs = 0.01 * np.array(values)[:, None]
    lines = fit_log_lines(times, logs, nodes=nodes)
    assert 1 <= int(lines.carried.sum()) <= pieces + 1
    # Elsewhere far below: the cost still counts every instant.
    alone = fit_log_lines(times, np.where(lines.carried, logs, -50.0), nodes=nodes)
    assert alone.heights == pytest.approx(lines.heights, abs=1e-3)


@pytest.mark.parametrize("apart", [1e-8, 1.2e-7, 1e-6])
def test_points_that_the_solver_cannot_tell_apart_all_carry_the_line(apart: float) -> None:
    """More of them only weaken what is stated."""
    times = np.linspace(0.0, 1.0, 4)
    logs = np.array([0.0, 0.0, 0.0, apart])[:, None]
    lines = fit_log_lines(times, logs, nodes=times[[0, -1]])
    assert lines.carried.all()
    assert np.all(hats(times, times[[0, -1]]) @ lines.heights >= logs)


def test_a_linear_system_is_learned_exactly() -> None:
    x = ca.SX.sym("x")
    system = system_from_casadi(x, -2.0 * x, ("x",))
    method = LearnedExponential(pairs=5, seed=0, step_s=0.01, delta=0.5)
    box = Box.around({"x": 1.0}, radius={"x": 0.25})
    learned = learn_discrepancy(system, initial_set=box, horizon_s=1.0, method=method)
    for t in (0.0, 0.3, 1.0):
        assert learned.radius({"x": 0.1}, t)[0] == pytest.approx(0.1 * math.exp(-2.0 * t), rel=1e-5)
