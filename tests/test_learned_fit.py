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
from workbench.sensitivity.learned import fit_exponentials
from workbench.sets.box import Box

Array = npt.NDArray[np.float64]
_FREE = np.array([False])


def test_two_points_give_the_line_through_them() -> None:
    times = np.array([0.0, 1.0, 2.0])
    offset, rate = fit_exponentials(times, np.array([[-np.inf], [1.0], [3.0]]), at_least_one=_FREE)
    assert rate[0] == pytest.approx(2.0, abs=1e-4)
    assert offset[0] == pytest.approx(-1.0, abs=1e-4)


def test_a_peak_in_the_middle_is_touched_with_the_flattest_line() -> None:
    times = np.linspace(0.0, 4.0, 5)
    logs = np.array([[-np.inf], [0.0], [2.0], [2.5], [0.0]])
    offset, rate = fit_exponentials(times, logs, at_least_one=_FREE)
    # The mean instant is 2.5, between the peaks at 2 and 3, so their line is the optimum.
    assert rate[0] == pytest.approx(0.5, abs=1e-4)
    assert offset[0] == pytest.approx(1.0, abs=1e-4)


def test_a_coordinate_with_width_starts_at_factor_one_even_if_samples_shrink() -> None:
    times = np.array([0.0, 1.0, 2.0])
    logs = np.array([[-5.0], [-1.0], [-2.0]])
    offset, rate = fit_exponentials(times, logs, at_least_one=np.array([True]))
    assert offset[0] == pytest.approx(0.0, abs=1e-4)
    assert rate[0] == pytest.approx(-1.0, abs=1e-4)


def test_no_constraint_means_no_envelope() -> None:
    offset, rate = fit_exponentials(
        np.array([0.0, 1.0]), np.full((2, 1), -np.inf), at_least_one=_FREE
    )
    assert offset[0] == -np.inf
    assert rate[0] == 0.0


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
    logs = np.array([-np.inf, *values])[:, None]
    offset, rate = fit_exponentials(times, logs, at_least_one=_FREE)
    line = offset[0] + rate[0] * times
    assert np.all(line[1:] >= np.array(values))
    best = _best_value(times[1:], np.array(values), float(times[1:].mean()))
    assert float(line[1:].mean()) == pytest.approx(best, abs=1e-4)


def test_a_linear_system_is_learned_exactly() -> None:
    x = ca.SX.sym("x")
    system = system_from_casadi(x, -2.0 * x, ("x",))
    method = LearnedExponential(pairs=5, seed=0, step_s=0.01, delta=0.5)
    box = Box.around({"x": 1.0}, radius={"x": 0.25})
    learned = learn_discrepancy(system, initial_set=box, horizon_s=1.0, method=method)
    for t in (0.0, 0.3, 1.0):
        assert learned.radius({"x": 0.1}, t)[0] == pytest.approx(0.1 * math.exp(-2.0 * t), rel=1e-5)
