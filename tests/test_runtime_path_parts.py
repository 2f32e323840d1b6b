"""Coordinates of a part of a box, from those of the whole, enclose the true ones as tightly."""

from __future__ import annotations

import itertools
import operator
from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from path_cases import assert_encloses, projected, wavy_heading, wavy_point, wavy_table
from runtime_world import Asked, arc_table, assert_invalid, observation

from workbench.runtime.measuring import Measuring, initial_sets
from workbench.runtime.path import NoProjection, PathPose, PathTable


@settings(max_examples=40, deadline=None)
@given(
    st.floats(2.0, 37.5),
    st.floats(-1.5, 1.5),
    st.floats(0.2, 0.95),
    st.floats(-1.0, 1.0),
    st.integers(0, 2**30),
)
@example(17.0, 1.5, 0.5, 1.0, 0)
@example(35.319387263345625, 1.5, 0.21839368701423334, 1.0, 0)
def test_a_part_of_a_box_is_enclosed_and_not_much_wider_than_by_itself(
    station: float, offset: float, share: float, aside: float, seed: int
) -> None:
    """The part lies anywhere in the whole box, not only around its middle."""
    (x, y), heading = wavy_point(station, offset), wavy_heading(station)
    width, height, turn = 0.2, 0.15, 0.02
    whole = projected(wavy_table(), x, y, heading, (width, height, turn))
    assert isinstance(whole, PathPose)
    x, y = x + (1.0 - share) * width * aside, y - (1.0 - share) * height * aside
    part_of_it = (share * width, share * height, share * turn)
    ends = [(at - r, at + r) for at, r in zip((x, y, heading), part_of_it, strict=True)]
    pose = wavy_table().project_part(whole, *ends)
    assert isinstance(pose, PathPose), pose
    assert_encloses(pose, wavy_point, (ends[0], ends[1]), seed)
    alone = projected(wavy_table(), x, y, heading, part_of_it)
    assert isinstance(alone, PathPose)
    for name in PathPose.__dataclass_fields__:
        (low, high), (least, most) = getattr(pose, name), getattr(alone, name)
        # A search over this world found 1.33 times, far off the path on its inner side.
        assert high - low <= 1.5 * (most - least) + 0.005


def test_a_part_that_is_elsewhere_has_no_coordinates() -> None:
    table = arc_table(0.0)
    whole = projected(table, 3.0, 0.0, 0.0, (0.1, 0.1, 0.01))
    assert isinstance(whole, PathPose)
    for x, y in ((5.0, 0.0), (3.0, 0.5)):
        found = table.project_part(whole, (x, x), (y, y), (0.0, 0.0))
        assert isinstance(found, NoProjection)
        assert "outside of the whole" in found.reason


@settings(max_examples=40, deadline=None)
@given(st.floats(2.0, 37.5), st.floats(-1.5, 1.5), st.floats(0.0, 0.3))
def test_every_level_s_box_lies_in_the_one_before(
    station: float, offset: float, radius: float
) -> None:
    x, y = wavy_point(station, offset)
    heading = wavy_heading(station)
    seen = replace(
        observation(),
        x=(x - radius, x + radius),
        y=(y - 0.2, y + 0.2),
        heading=(heading - 0.1, heading + 0.1),
    )
    boxes = Measuring(wavy_table(), (1.0, 0.999, 0.5, 0.4999), station_m=None).boxes(seen)
    sets = initial_sets(boxes)
    for k, (outer, inner) in enumerate(itertools.pairwise(boxes)):
        for name in outer.names:
            (low, high), (least, most) = outer.interval(name), inner.interval(name)
            assert low <= least <= most <= high
        assert inner.interval("steering")[1] < outer.interval("steering")[1]
        radii = [sets["initial_radius"][7 * j : 7 * j + 7] for j in (k, k + 1)]
        assert all(map(operator.ge, *radii))
    for k, box in enumerate(boxes):
        c, r = (sets[name][7 * k : 7 * k + 7] for name in ("initial_center", "initial_radius"))
        for i, (low, high) in enumerate(zip(box.lower, box.upper, strict=True)):
            assert Fraction(c[i]) - Fraction(r[i]) <= Fraction(low)
            assert Fraction(c[i]) + Fraction(r[i]) >= Fraction(high)


@pytest.mark.parametrize("speed", [(-0.1, 0.01), (-0.01, 0.1), (0.0, 0.2), (-0.2, 0.0)])
def test_a_car_that_may_stand_may_do_so_at_every_level(speed: tuple[float, float]) -> None:
    x, y = wavy_point(10.0, 0.0)
    seen = replace(
        observation(), x=(x, x), y=(y, y), heading=(wavy_heading(10.0),) * 2, speed=speed
    )
    boxes = Measuring(wavy_table(), (1.0, 2.0 / 3.0, 1.0 / 3.0), station_m=None).boxes(seen)
    for outer, inner in itertools.pairwise((boxes[0], *boxes)):
        (low, high), (least, most) = outer.interval("speed"), inner.interval("speed")
        assert low <= least <= 0.0 <= most <= high


def test_a_level_without_coordinates_of_its_own_is_not_judged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def nowhere(*_arguments: object) -> NoProjection:
        return NoProjection("nowhere")

    monkeypatch.setattr(PathTable, "project_part", nowhere)
    assert_invalid(Asked().step(observation()), "no path coordinates: nowhere")
