"""For bounded errors boxes hold the truth, grow with the bounds, and say when nothing agrees."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localisation_cases import hall

from workbench.errors import InputError
from workbench.estimation.bounded_localisation import (
    BoundedRange,
    BoundedTrack,
    Spot,
    contracted,
    heading_between,
    nearest_turn,
)
from workbench.estimation.lanes import Array
from workbench.runtime.arc import Interval
from workbench.runtime.onboard.dead_reckoning import (
    Driven,
    Pose,
    Quantity,
    Sampled,
    per_wheelbase,
)

ANTENNA = hall().antenna
LEFT = ANTENNA.__class__(0.9, 0.4, 1.9, "tests")


def inside(value: float, side: Interval) -> bool:
    return side[0] <= value <= side[1]


def tight(start: Pose, ranges: list[BoundedRange], wrong: int) -> Pose | None:
    found = contracted(start, ranges, LEFT, wrong=wrong)
    return None if found is None else found[0]


def ranges_of(
    rng: np.random.Generator, place: tuple[float, float, float], *, error_m: float, wrong: int
) -> list[BoundedRange]:
    """True ranges with errors up to error_m, whose bounds are that wide; `wrong` of them lie."""
    x, y, heading = place
    ax = x + math.cos(heading) * LEFT.forward_m - math.sin(heading) * LEFT.left_m
    ay = y + math.sin(heading) * LEFT.forward_m + math.cos(heading) * LEFT.left_m
    found = []
    for k, b in enumerate(hall().beacons):
        true = math.sqrt((ax - b.x_m) ** 2 + (ay - b.y_m) ** 2 + (1.9 - b.height_m) ** 2)
        said = true + rng.uniform(-error_m, error_m) + (rng.uniform(0.5, 9.0) if k < wrong else 0)
        found.append(BoundedRange(b, (max(said - error_m, 0.0), said + error_m)))
    return [found[k] for k in rng.permutation(len(found))]


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 10**6), error_m=st.floats(0.0, 0.5), wrong=st.integers(0, 2))
def test_truth_stays_inside_and_larger_bounds_give_larger_boxes(
    seed: int, error_m: float, wrong: int
) -> None:
    rng = np.random.default_rng(seed)
    place = (*rng.uniform([3, 3], [37, 22]), rng.uniform(-7, 7))
    ranges = ranges_of(rng, place, error_m=error_m, wrong=wrong)
    off, wide = rng.uniform(-1, 1, 3), np.array([3.0, 3.0, 0.3])
    sides = [(p + o * w - w, p + o * w + w) for p, o, w in zip(place, off, wide, strict=True)]
    start = Pose(*sides)
    found = tight(start, ranges, wrong)
    assert found is not None
    assert inside(place[0], found.x)
    assert inside(place[1], found.y)
    larger = [BoundedRange(r.beacon, (0.9 * r.range_m[0], 1.1 * r.range_m[1])) for r in ranges]
    wider = Pose((start.x[0] - 1, start.x[1]), start.y, (sides[2][0], sides[2][1] + 0.1))
    for other in (
        tight(start, larger, wrong),
        tight(start, ranges, wrong + 1),
        tight(wider, ranges, wrong),
    ):
        assert other is not None
        for small, large in ((found.x, other.x), (found.y, other.y)):
            assert large[0] <= small[0]
            assert small[1] <= large[1]


def test_six_ranges_of_20_cm_place_a_car_within_half_a_metre() -> None:
    rng = np.random.default_rng(41)
    for _ in range(50):
        place = (*rng.uniform([5, 5], [35, 20]), 0.3)
        start = Pose((-5.0, 45.0), (-5.0, 30.0), (0.25, 0.35))
        found: Pose | None = start
        for _ in range(4):
            assert found is not None
            ranges = ranges_of(rng, place, error_m=0.2, wrong=0)
            found = tight(found, ranges, 0)
        assert found is not None
        assert max(found.x[1] - found.x[0], found.y[1] - found.y[0]) < 1.0


def test_ranges_that_contradict_leave_nothing() -> None:
    rng = np.random.default_rng(42)
    ranges = ranges_of(rng, (20.0, 12.0, 0.0), error_m=0.1, wrong=2)
    start = Pose((15.0, 25.0), (7.0, 17.0), (-0.1, 0.1))
    assert contracted(start, ranges, LEFT, wrong=0) is None
    assert contracted(start, ranges, LEFT, wrong=2) is not None


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_heading_of_a_drive_between_two_boxes_is_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = rng.uniform(-9, 9)
    rates = rng.uniform(-0.4, 0.4, 200)
    headings = first + np.concatenate([[0.0], np.cumsum(rates * 0.02)])
    speeds = rng.uniform(0.0, 3.0, 201)
    x = np.cumsum(speeds * np.cos(headings)) * 0.02
    y = np.cumsum(speeds * np.sin(headings)) * 0.02

    def around(value: float) -> Interval:
        low, high = rng.uniform(0, 0.4, 2)
        return value - low, value + high

    own = np.array([[math.cos(first), math.sin(first)], [-math.sin(first), math.cos(first)]])
    ahead, aside = own @ [x[-1], y[-1]]
    start, end = Spot(around(0.0), around(0.0)), Spot(around(x[-1]), around(y[-1]))
    found = heading_between(start, end, Spot(around(ahead), around(aside)))
    assert found is not None
    assert inside(first, nearest_turn(found, to=(first, first)))


def test_boxes_that_are_too_near_tell_nothing_and_others_what_their_corners_do() -> None:
    box, far = Spot((0.0, 1.0), (0.0, 1.0)), Spot((5.0, 6.0), (0.0, 1.0))
    ahead = Spot((5.0, 5.0), (0.0, 0.0))
    assert heading_between(box, box, ahead) is None
    assert heading_between(box, far, box) is None
    found = heading_between(box, far, ahead)
    assert found is not None
    corners = [math.atan2(b, a) for a, b in itertools.product((4.0, 6.0), (-1.0, 1.0))]
    assert found == pytest.approx((min(corners), max(corners)))


def straight_and_curves(seed: int) -> tuple[Array, Driven, np.random.Generator]:
    """Poses (x, y, heading) every ms for 14 s, and bounded reports of speed and steering."""
    rng, h, wheelbase = np.random.default_rng(seed), 0.001, 1.75
    time = np.arange(14_001) * h
    speed = 2.0 + 0.3 * np.sin(0.7 * time + rng.uniform(0, 6))
    steering = 0.25 * np.sin(0.5 * time + rng.uniform(0, 6))
    rate = speed * np.tan(steering) / wheelbase
    heading = rng.uniform(-3, 3) + np.concatenate([[0.0], np.cumsum(rate[:-1])]) * h
    x = 15 + np.concatenate([[0.0], np.cumsum((speed * np.cos(heading))[:-1])]) * h
    y = 10 + np.concatenate([[0.0], np.cumsum((speed * np.sin(heading))[:-1])]) * h

    def samples(values: Array, error: float) -> tuple[Sampled, ...]:
        said = values + rng.uniform(-error, error, len(values))
        return tuple(
            Sampled((said[k] - error, said[k] + error), 1000 * k, 1000 * k)
            for k in range(0, len(values), 33)
        )

    driven = Driven(
        Quantity(samples(speed, 0.02), (-6.0, 3.0), (-0.1, 8.0)),
        Quantity(samples(steering, 0.005), (-0.4, 0.4), (-0.6, 0.6)),
        per_wheelbase((1.74, 1.76)),
    )
    return np.stack([x, y, heading], axis=1), driven, rng


@pytest.mark.parametrize("seed", range(4))
def test_a_drive_stays_in_its_boxes_and_its_heading_becomes_known(seed: int) -> None:
    poses, driven, rng = straight_and_curves(seed)
    start = Pose((5.0, 25.0), (0.0, 20.0), (-math.pi, math.pi))
    track = BoundedTrack(start, 0)
    for at in range(333, 14_000, 333):
        moved = track.moved_on(driven, until_us=1000 * at)
        assert moved is not None
        place = tuple(poses[at])
        found = moved.ranged(ranges_of(rng, place, error_m=0.15, wrong=1), LEFT, wrong=1)
        assert found is not None
        track = found
        assert inside(place[0], track.pose.x)
        assert inside(place[1], track.pose.y)
        middle = 0.5 * sum(track.pose.heading)
        true = middle + math.remainder(place[2] - middle, math.tau)
        assert inside(true, track.pose.heading)
    # A whole circle and twenty metres at first; what a worst case leaves is no Gaussian's width.
    assert track.pose.heading[1] - track.pose.heading[0] < 0.7
    assert track.pose.x[1] - track.pose.x[0] < 1.2


def test_misuse_is_refused() -> None:
    box = Pose((0.0, 1.0), (0.0, 1.0), (0.0, 0.1))
    one = BoundedRange(hall().beacons[0], (1.0, 2.0))
    with pytest.raises(InputError, match="wrong"):
        contracted(box, [one], LEFT, wrong=1)
    with pytest.raises(InputError, match="heading"):
        contracted(Pose(box.x, box.y, (0.0, 1e9)), [one], LEFT, wrong=0)
    with pytest.raises(InputError, match="range_m"):
        BoundedRange(hall().beacons[0], (2.0, 1.0))
