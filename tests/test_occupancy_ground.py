"""The reported rectangles contain the car body at every time, and are not much larger."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from decision_fixture import BODY, STARTS, Start, kernel, query
from decision_paths import (
    arc,
    body_points,
    exact_runs,
    paths,
    plane_pose,
    rectangle_excess,
    segments,
    simulate,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.reach.occupancy import occupancy_function

# The spline's geometry is read off a grid of 0.6 mm in the simulation.
_ROUNDING_M = {"S": 1e-7}
_PAIRS = [
    *(("S", start) for start in STARTS),
    *(("left", start) for start in ("initial set", "rate limit", "point")),
    *(("right", start) for start in ("initial set", "accelerating", "standing")),
    *(("straight", start) for start in ("initial set", "braking", "point")),
]


@pytest.mark.parametrize(("where", "start"), _PAIRS)
def test_corners_and_edges_stay_in_the_rectangle_of_every_segment(where: str, start: str) -> None:
    answer, fine = exact_runs(where, start)
    x, y = body_points(plane_pose(paths()[where], segments(fine, answer.steps)))
    rectangles = answer.rows("occupancy", 5)[:, None, None, None, :]
    assert rectangle_excess(rectangles, x, y).max() <= _ROUNDING_M.get(where, 1e-12)


@pytest.mark.parametrize(
    "body", [(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 3.0, 0.5), (1.0, 1.0, 9.0)]
)
def test_bodies_of_every_proportion_stay_inside(body: tuple[float, float, float]) -> None:
    path, start = arc(-0.1), STARTS["initial set"]
    front, rear, half_width = body
    numbers = query(path.table, start, front_m=[front], rear_m=[rear], half_width_m=[half_width])
    answer = kernel()(numbers).track
    fine = exact_runs("right", "initial set")[1]
    x, y = body_points(plane_pose(path, segments(fine, answer.steps)), body)
    assert answer.steps > 25
    rectangles = answer.rows("occupancy", 5)[:, None, None, None, :]
    assert rectangle_excess(rectangles, x, y).max() <= 1e-12


@pytest.mark.parametrize(("where", "most_m"), [("straight", 2e-3), ("left", 0.035)])
def test_a_known_state_costs_a_few_centimetres_in_the_first_segment(
    where: str, most_m: float, record_property: Callable[[str, object], None]
) -> None:
    path, start = paths()[where], STARTS["point"]
    answer = kernel()(query(path.table, start)).track
    _, _, _, half_length, half_width = answer.rows("occupancy", 5)[0]
    # Two ends of the body move 0.05 s * 2.8 m/s / 2 from the middle of the segment.
    over_length = half_length - (BODY[0] + BODY[1]) / 2 - 0.07
    over_width = half_width - BODY[2]
    record_property("over_length_m", float(over_length))
    record_property("over_width_m", float(over_width))
    assert 0.0 <= over_length < most_m
    assert 0.0 <= over_width < most_m


_offsets = st.floats(-1.5, 1.5)
_errors = st.floats(-2.5, 2.5)


@st.composite
def _pose_boxes(draw: st.DrawFn) -> tuple[list[float], list[float]]:
    ends = [
        sorted([draw(st.floats(-3.0, 3.0)), draw(st.floats(-3.0, 3.0))]),
        sorted([draw(_offsets), draw(_offsets)]),
        sorted([draw(_errors), draw(_errors)]),
    ]
    return [low for low, _ in ends], [high for _, high in ends]


_occupancy = occupancy_function()


@settings(max_examples=200, deadline=None)
@given(
    box=_pose_boxes(),
    curvature=st.floats(-0.6, 0.6),
    widening=st.floats(0.0, 0.2),
    heading=st.floats(-7.0, 7.0),
    body=st.tuples(st.floats(0.0, 4.0), st.floats(0.0, 4.0), st.floats(0.0, 2.0)),
)
def test_a_valid_rectangle_contains_the_body_for_every_pose_of_the_box(
    box: tuple[list[float], list[float]],
    curvature: float,
    widening: float,
    heading: float,
    body: tuple[float, float, float],
) -> None:
    """An arc through the node, of a curvature inside the bounds given to the function."""
    lower, upper = box
    node = [0.0, 5.0, -3.0, heading]
    bounds = [curvature - widening, curvature + widening]
    rectangle, ok = _occupancy(lower, upper, node, bounds, body)
    if float(ok) != 1.0:
        return
    share = np.array(np.meshgrid(*[np.linspace(0, 1, 5)] * 3)).reshape(3, -1)
    station, offset, error = np.array(lower)[:, None] + share * np.subtract(upper, lower)[:, None]
    half = 0.5 * curvature * station
    chord = station * np.sinc(half / np.pi)
    turned = curvature * station + heading
    x = 5.0 + chord * np.cos(heading + half) - offset * np.sin(turned)
    y = -3.0 + chord * np.sin(heading + half) + offset * np.cos(turned)
    points = body_points((x, y, turned + error), body)
    assert rectangle_excess(np.array(rectangle).ravel(), *points).max() <= 1e-9


def test_a_station_known_poorly_on_a_bend_is_still_covered() -> None:
    """Arc and body turn by a radian within the set: the widest rotation to be covered."""
    path = arc(0.3, nodes=80)
    start = Start((2.0, 0.2, 0.4, 2.0, 0.0, 0.0, 0.0), (1.5, 0.3, 0.05, 0.2, 0.2, 0.0, 0.0))
    answer = kernel()(query(path.table, start)).track
    assert answer.steps > 3
    states = start.states(30, np.random.default_rng(3))
    fine = simulate(start, states, path.curvature, steps=answer.steps)
    x, y = body_points(plane_pose(path, segments(fine, answer.steps)))
    rectangles = answer.rows("occupancy", 5)[:, None, None, None, :]
    assert rectangle_excess(rectangles, x, y).max() <= 1e-12
