"""A spline path follows its waypoints, and its arc length, heading and curvature fit each other."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.models.spline_path import SplinePath

TURN = np.linspace(0.0, 1.8 * np.pi, 60)
CIRCLE = 10.0 * np.column_stack([np.sin(TURN), 1.0 - np.cos(TURN)])
WAVE = np.column_stack([np.arange(0.0, 60.0, 3.0), 2.0 * np.sin(np.arange(20) / 3.0)])


def test_circle_has_its_length_heading_and_curvature() -> None:
    path = SplinePath.through(CIRCLE)
    assert path.length_m == pytest.approx(10.0 * TURN[-1], abs=1e-5)
    station = np.linspace(0.0, path.length_m, 301)
    np.testing.assert_allclose(path.curvature(station), 0.1, atol=1e-3)
    np.testing.assert_allclose(path.heading(station), station / 10.0, atol=3e-4)
    np.testing.assert_allclose(np.hypot(*(path.position(station) - [0.0, 10.0]).T), 10.0, atol=1e-4)


def test_straight_line_is_exact_and_clockwise_curvature_is_negative() -> None:
    line = SplinePath.through([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0], [9.0, 12.0]])
    assert line.length_m == pytest.approx(15.0, abs=1e-12)
    assert line.curvature(7.0) == pytest.approx(0.0, abs=1e-12)
    assert line.heading(7.0) == pytest.approx(math.atan2(4.0, 3.0))
    right = SplinePath.through(CIRCLE * [1.0, -1.0])
    assert right.curvature(20.0) == pytest.approx(-0.1, abs=1e-3)


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-0.6, 0.6), min_size=4, max_size=12),
    st.lists(st.floats(1.0, 10.0), min_size=12, max_size=12),
)
def test_position_heading_and_curvature_are_derivatives_by_station(
    turns: list[float], steps: list[float]
) -> None:
    heading = np.cumsum(turns)
    lengths = np.array(steps[: len(turns)])
    moves = lengths[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    waypoints = np.vstack([[0.0, 0.0], np.cumsum(moves, axis=0)])
    path = SplinePath.through(waypoints)
    step = 1e-4
    station = np.linspace(step, path.length_m - step, 101)
    before, after = path.position(station - step), path.position(station + step)
    tangent = (after - before) / (2 * step)
    np.testing.assert_allclose(np.hypot(*tangent.T), 1.0, atol=1e-5)
    angle = path.heading(station)
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(tangent, direction, atol=1e-5)
    turning = (path.heading(station + step) - path.heading(station - step)) / (2 * step)
    np.testing.assert_allclose(turning, path.curvature(station), atol=2e-3)


def test_every_waypoint_lies_on_the_path() -> None:
    path = SplinePath.through(WAVE)
    dense = path.position(np.linspace(0.0, path.length_m, 20001))
    for waypoint in WAVE:
        assert np.hypot(*(dense - waypoint).T).min() < 2e-3


def test_three_waypoints_give_a_parabola() -> None:
    path = SplinePath.through([[0.0, 0.0], [5.0, 1.0], [10.0, 0.0]])
    assert path.position(path.length_m) == pytest.approx([10.0, 0.0])
    assert path.curvature(path.length_m / 2) < 0.0


def test_table_contains_the_curvature_and_its_nodes_lie_on_the_path() -> None:
    path = SplinePath.through(WAVE)
    table = path.table(1.0)
    assert table.spacing_m <= 1.0
    assert table.spacing_m * (len(table.x) - 1) == pytest.approx(path.length_m)
    nodes = table.start_m + table.spacing_m * np.arange(len(table.x))
    np.testing.assert_allclose(np.column_stack([table.x, table.y]), path.position(nodes), atol=1e-9)
    np.testing.assert_allclose(table.heading, path.heading(nodes), atol=1e-12)
    station = np.random.default_rng(1).uniform(0.0, path.length_m, 20000)
    within = np.minimum((station / table.spacing_m).astype(int), len(table.x) - 2)
    curvature = path.curvature(station)
    assert (np.array(table.curvature_lower)[within] <= curvature).all()
    assert (curvature <= np.array(table.curvature_upper)[within]).all()
    width = np.array(table.curvature_upper) - np.array(table.curvature_lower)
    assert width.max() < 0.15


def test_table_goes_on_straight_beyond_both_ends() -> None:
    path = SplinePath.through(CIRCLE)
    table = path.table(0.5, before_m=3.0, after_m=4.0)
    assert table.start_m == -3.0
    assert (table.x[0], table.y[0]) == pytest.approx((-3.0, 0.0), abs=2e-3)
    assert table.heading[0] == pytest.approx(0.0, abs=1e-3)
    end, angle = path.position(path.length_m), path.heading(path.length_m)
    assert (table.x[-1], table.y[-1]) == pytest.approx(
        tuple(end + 4.0 * np.array([np.cos(angle), np.sin(angle)]))
    )
    assert -2e-9 < table.curvature_lower[0] < 0.0 < table.curvature_upper[0] < 2e-9
    assert max(table.curvature_upper) < 0.102
    assert min(table.curvature_lower) > -1e-3


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("noise", [0.02, 0.05])
def test_smoothing_recovers_a_noisy_arc_with_a_standing_car_at_both_ends(
    seed: int, noise: float
) -> None:
    rng = np.random.default_rng(seed)
    angle = np.concatenate([np.zeros(80), np.linspace(0.0, 2.0, 90), np.full(80, 2.0)])
    clean = 20.0 * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    path = SplinePath.smoothing(clean + rng.normal(0.0, noise, clean.shape), noise_std_m=noise)
    assert path.length_m == pytest.approx(40.0, abs=0.3)
    station = np.linspace(0.0, path.length_m, 400)
    off = np.hypot(*(path.position(station) - [0.0, 20.0]).T) - 20.0
    assert np.abs(off).max() < 4 * noise
    assert np.abs(path.curvature(station)).max() < 0.15
    middle = path.curvature(np.linspace(5.0, 35.0, 100))
    np.testing.assert_allclose(middle, 0.05, atol=0.03)


def test_smoothing_of_a_clean_line_stays_a_line() -> None:
    line = np.column_stack([np.arange(0.0, 30.0, 0.5), np.zeros(60)])
    path = SplinePath.smoothing(line, noise_std_m=0.05)
    assert np.abs(path.curvature(np.linspace(0.0, path.length_m, 100))).max() < 1e-6


@pytest.mark.parametrize(
    ("waypoints", "message"),
    [
        ([[0.0, 0.0], [1.0, 0.0]], r"n >= 3, got shape \(2, 2\)"),
        ([[0.0, 0.0, 0.0]] * 4, "n x 2"),
        ([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [2.0, 0.0]], "rows 1 and 2"),
        ([[0.0, 0.0], [1.0, math.nan], [2.0, 0.0]], "row 1"),
        ("abc", "n x 2 array of metres"),
    ],
)
def test_unusable_waypoints_are_named(waypoints: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        SplinePath.through(waypoints)  # type: ignore[arg-type]


def test_misuse_of_smoothing_table_and_stations() -> None:
    with pytest.raises(InputError, match="hardly moved"):
        SplinePath.smoothing(np.zeros((50, 2)), noise_std_m=0.04)
    with pytest.raises(InputError, match="noise_std_m"):
        SplinePath.smoothing(WAVE, noise_std_m=0.0)
    path = SplinePath.through(WAVE)
    with pytest.raises(InputError, match="spacing_m > 0"):
        path.table(0.0)
    with pytest.raises(InputError, match="the path's length"):
        path.position(path.length_m + 1.0)
