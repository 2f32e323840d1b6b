"""The ground that a car covers and the disc that is watched are bounded from the right sides."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from runtime_world import observation

from workbench.runtime import Watched
from workbench.runtime.judgement import farthest_m
from workbench.runtime.observation import watched_at_stamp


@given(st.floats(-5.0, 5.0), st.floats(0.0, 5.0), st.floats(0.0, 3.0), st.floats(0.0, 1.0))
def test_whoever_was_beyond_the_disc_when_listed_is_beyond_it_at_the_stamp(
    low: float, width: float, speed: float, share: float
) -> None:
    seen = replace(observation(), skew_s=(low, low + width), watched=Watched(0.0, 0.0, 20.0))
    # The list is of this instant after the stamp; from there they walk straight at the centre.
    listed_s = -(low + share * width)
    nearest_m = 20.0 - speed * abs(listed_s)
    assert watched_at_stamp(seen, unseen_speed_mps=speed).radius_m <= max(nearest_m, 0.0) + 1e-12


def test_without_a_skew_the_disc_is_the_one_that_is_watched() -> None:
    assert watched_at_stamp(observation(), unseen_speed_mps=2.5) == observation().watched
    late = replace(observation(), skew_s=(0.1, 0.4))
    assert watched_at_stamp(late, unseen_speed_mps=2.5).radius_m == pytest.approx(199.0)


@given(
    st.lists(
        st.tuples(*[st.floats(-50.0, 50.0)] * 2, st.floats(-7.0, 7.0), *[st.floats(0.0, 9.0)] * 2),
        max_size=4,
    ),
    st.floats(-50.0, 50.0),
)
def test_no_corner_is_farther_than_the_farthest(
    rectangles: list[tuple[float, ...]], x_m: float
) -> None:
    farthest = farthest_m(rectangles, Watched(x_m, 3.0, 1.0))
    corners = [0.0]
    for x, y, heading, a, b in rectangles:
        for u, v in ((a, b), (-a, b), (a, -b), (-a, -b)):
            dx = x + u * math.cos(heading) - v * math.sin(heading) - x_m
            corners.append(math.hypot(dx, y + u * math.sin(heading) + v * math.cos(heading) - 3.0))
    assert max(corners) * (1.0 - 1e-14) <= farthest <= max(corners) * (1.0 + 1e-13)
