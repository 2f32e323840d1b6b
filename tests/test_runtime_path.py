"""Path coordinates enclose the true ones of every pose in a box, and exceed them by little."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from path_cases import Point, assert_encloses, projected, wavy_heading, wavy_point, wavy_table
from runtime_world import arc_point, arc_table

from workbench.runtime.path import NoProjection, PathPose, PathTable


@settings(max_examples=30, deadline=None)
@given(st.floats(-0.1, 0.1), st.floats(2.0, 30.0), st.floats(-3.0, 3.0), st.integers(0, 2**30))
def test_a_box_beside_an_arc_is_enclosed(
    curvature: float, station: float, offset: float, seed: int
) -> None:
    table = arc_table(curvature)
    heading = curvature * station
    x, y = arc_point(curvature, station, offset)
    pose = projected(table, x, y, heading + 0.05, (0.2, 0.15, 0.02))
    assert isinstance(pose, PathPose)
    assert_encloses(
        pose,
        lambda s, e: arc_point(curvature, s, e),
        ((x - 0.2, x + 0.2), (y - 0.15, y + 0.15)),
        seed,
    )
    for s in pose.station:
        assert pose.heading_error[0] <= 0.05 + heading - curvature * s + 0.02
        assert pose.heading_error[1] >= 0.05 + heading - curvature * s - 0.02


@settings(max_examples=30, deadline=None)
@given(st.floats(1.5, 38.0), st.floats(-1.5, 1.5), st.integers(0, 2**30))
def test_a_box_beside_a_path_of_changing_curvature_is_enclosed(
    station: float, offset: float, seed: int
) -> None:
    x, y = wavy_point(station, offset)
    pose = projected(wavy_table(), x, y, wavy_heading(station) + math.tau, (0.2, 0.2, 0.01))
    assert isinstance(pose, PathPose), pose
    assert_encloses(pose, wavy_point, ((x - 0.2, x + 0.2), (y - 0.2, y + 0.2)), seed)
    assert pose.heading_error[0] <= -0.01
    assert pose.heading_error[1] >= 0.01


@pytest.mark.parametrize("turn_deg", [0, 0.4, 0.8, 1.5, 15, 45, 60, 89.3, 90, 135, 180.7, 270])
def test_the_excess_on_a_radius_of_10_m_is_below_2_cm(turn_deg: float) -> None:
    station = 10.0 * math.radians(turn_deg)
    table = arc_table(0.1, start_m=-5.0, nodes=225)
    x, y = arc_point(0.1, station, 0.3)
    pose = projected(table, x, y, 0.1 * station, (0.2, 0.2, 0.0))
    assert isinstance(pose, PathPose)
    corners = [(x + a * 0.2, y + b * 0.2) for a in (-1, 1) for b in (-1, 1)]
    edge = [
        (corners[i][0] + (corners[j][0] - corners[i][0]) * t / 200,
         corners[i][1] + (corners[j][1] - corners[i][1]) * t / 200)
        for i, j in ((0, 1), (1, 3), (3, 2), (2, 0)) for t in range(201)
    ]  # fmt: skip
    turns = [math.atan2(px, 10.0 - py) for px, py in edge]
    stations = [10.0 * (t + math.tau * round((0.1 * station - t) / math.tau)) for t in turns]
    offsets = [10.0 - math.hypot(px, 10.0 - py) for px, py in edge]
    assert pose.station[0] <= min(stations) < pose.station[0] + 0.01
    assert pose.station[1] - 0.01 < max(stations) <= pose.station[1]
    assert pose.offset[0] <= min(offsets) < pose.offset[0] + 0.01
    assert pose.offset[1] - 0.01 < max(offsets) <= pose.offset[1]
    assert pose.heading_error[1] - pose.heading_error[0] < 0.1 * (
        max(stations) - min(stations) + 0.02
    )


def test_a_point_pose_is_found_within_the_allowance() -> None:
    x, y = arc_point(0.1, 7.3, -0.6)
    pose = projected(arc_table(0.1), x, y, 0.73 - 0.2, (0.0, 0.0, 0.0))
    assert isinstance(pose, PathPose)
    assert pose.station == pytest.approx((7.3, 7.3), abs=2e-5)
    assert pose.offset == pytest.approx((-0.6, -0.6), abs=2e-5)
    assert pose.heading_error == pytest.approx((-0.2, -0.2), abs=2e-5)


@pytest.mark.parametrize(
    ("center", "heading", "half_width", "reason"),
    [
        ((-10.3, 0.0), 0.0, 0.1, "beyond the path's start"),
        ((39.9, 0.0), 0.0, 0.1, "beyond the path's end"),
        ((0.0, 0.0), math.pi, 0.1, "faces within 90 degrees"),
        ((math.nan, 0.0), 0.0, 0.1, "expected finite intervals"),
        ((0.0, 0.0), 0.0, -0.1, "expected finite intervals"),
    ],
)
def test_a_straight_path_refuses_what_lies_off_it(
    center: Point, heading: float, half_width: float, reason: str
) -> None:
    pose = projected(arc_table(0.0), *center, heading, (half_width, half_width, 0.0))
    assert isinstance(pose, NoProjection)
    assert reason in pose.reason


@pytest.mark.parametrize(
    ("offset", "half_width", "reason"),
    [
        (4.9, 0.01, "1 - curvature * offset > 0"),
        (4.5, 0.4, "1 - curvature * offset > 0"),
        (-3.0, 4.6, "curvature"),
        (0.0, 2.5, ""),
        (3.5, 1.0, ""),
    ],
)
def test_near_the_centre_of_curvature_and_for_large_boxes_nothing_is_claimed(
    offset: float, half_width: float, reason: str
) -> None:
    table = arc_table(0.2, nodes=100, spacing_m=0.25, start_m=-12.5)
    pose = projected(table, *arc_point(0.2, 0.0, offset), 0.0, (half_width, half_width, 0.0))
    assert isinstance(pose, NoProjection)
    assert reason in pose.reason


def _straight_within(curvature: float) -> PathTable:
    """A straight row of nodes whose curvature in between is known only within +- the given one."""
    bins = (curvature,) * 199
    low = tuple(-bound for bound in bins)
    return replace(arc_table(0.0), curvature_lower=low, curvature_upper=bins)


@pytest.mark.parametrize(
    ("table", "center", "half_width", "reason"),
    [
        (arc_table(0.2, nodes=60, start_m=-7.5), (0.0, -3.0), 4.6, "a margin at both ends"),
        (_straight_within(0.3), (0.0, 3.2), 0.0, "> 0 is not proved"),
        (arc_table(0.0, nodes=1000, start_m=-125.0), (0.0, 0.0), 110.0, "no foot on the path"),
        (_straight_within(0.265), (0.125, 3.0), 0.0, "no unique foot"),
    ],
)
def test_what_cannot_be_proved_is_refused_with_its_reason(
    table: PathTable, center: Point, half_width: float, reason: str
) -> None:
    pose = projected(table, *center, 0.0, (half_width, half_width, 0.0))
    assert isinstance(pose, NoProjection)
    assert reason in pose.reason


@pytest.mark.parametrize("station", [-10.0, 39.75])
def test_the_ends_of_the_path_belong_to_it(station: float) -> None:
    pose = projected(arc_table(0.0), station, 0.5, 0.0, (0.0, 0.0, 0.0))
    assert isinstance(pose, PathPose)
    assert pose.station == pytest.approx((station, station), abs=2e-5)
    assert pose.offset == pytest.approx((0.5, 0.5), abs=2e-5)


def _ring() -> PathTable:
    """Twice around a circle of radius 10 m, so that every place is met twice."""
    return arc_table(0.1, nodes=520, spacing_m=0.25, start_m=0.0)


def test_two_equally_near_stretches_are_refused_unless_the_vehicle_knows_its_station() -> None:
    table = _ring()
    x, y = arc_point(0.1, 5.0, 0.2)
    box = ((x - 0.1, x + 0.1), (y - 0.1, y + 0.1), (0.5, 0.5))
    refused = table.project(*box, near_station_m=None)
    assert isinstance(refused, NoProjection)
    assert "equally near" in refused.reason
    for lap in (0.0, 20.0 * math.pi):
        pose = table.project(*box, near_station_m=lap + 4.0)
        assert isinstance(pose, PathPose)
        assert pose.station[0] < lap + 5.0 < pose.station[1]
        assert abs(0.5 * (pose.heading_error[0] + pose.heading_error[1])) < 1e-3


def test_a_wrong_last_station_falls_back_to_the_whole_path() -> None:
    table = arc_table(0.0)
    for hint in (-500.0, 25.0, 9000.0):
        pose = table.project((-0.1, 0.1), (0.0, 0.2), (0.0, 0.0), near_station_m=hint)
        assert isinstance(pose, PathPose)
        assert pose.station == pytest.approx((-0.1, 0.1), abs=1e-4)
