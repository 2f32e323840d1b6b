"""Each observation contains the true state of a car that keeps to the bicycle's equations."""

from __future__ import annotations

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.replay_fixture import drive, on_circle
from workbench.errors import InputError
from workbench.runtime import Disc, Guard, MotionLimits, ObservedPerson
from workbench.runtime.person_tubes import RadiusBetween, timed_discs
from workbench.simulation.drawn_people import as_frame
from workbench.simulation.observing import Observer, StateErrors, rear_axle

ERRORS = StateErrors.assumed()
WHEELBASE_M = 2.71


def observer() -> Observer:
    return Observer(ERRORS, wheelbase_m=WHEELBASE_M, reference_ahead_m=0.3, watched_m=25.0)


def contains(interval: tuple[float, float], value: float) -> bool:
    return interval[0] <= value <= interval[1]


@given(st.floats(0.6, 8.0), st.floats(6.0, 100.0), st.booleans(), st.floats(-0.99, 0.99))
def test_state_on_a_circle_lies_in_every_interval(
    speed_mps: float, radius_m: float, left: bool, share: float
) -> None:
    side = 1.0 if left else -1.0
    watch = observer()
    for k in range(6):
        sample = on_circle(0.1 * k, radius_m=side * radius_m, speed_mps=speed_mps, ahead_m=0.3)
        assert sample.yaw_rate_radps is not None
        blurred = dataclasses.replace(
            sample,
            x_m=sample.x_m + share * 0.9 * ERRORS.position_m,
            speed_mps=sample.speed_mps + share * ERRORS.speed_mps,
            yaw_rate_radps=sample.yaw_rate_radps - share * ERRORS.yaw_rate_radps,
        )
        seen = watch.observe(blurred, (), stamp_s=0.0)
        angle = 0.1 * k * speed_mps / (side * radius_m)
        assert contains(seen.steering, math.atan(WHEELBASE_M / (side * radius_m)))
        assert contains(seen.speed, speed_mps)
        assert contains(seen.heading, angle)
        assert contains(seen.x, side * radius_m * math.sin(angle))
        assert contains(seen.y, side * radius_m * (1.0 - math.cos(angle)))
        assert contains(seen.speed_integral, 0.0)
        assert contains(seen.offset_integral, 0.0)


def test_the_steering_interval_is_not_trivially_wide() -> None:
    watch = observer()
    seen = [watch.observe(sample, (), stamp_s=0.0).steering for sample in drive().vehicle]
    assert max(high - low for low, high in seen) < 0.05


def test_without_yaw_rate_the_past_heading_serves() -> None:
    watch = observer()
    for sample in drive().vehicle[:8]:
        seen = watch.observe(dataclasses.replace(sample, yaw_rate_radps=None), (), stamp_s=0.0)
    assert contains(seen.steering, math.atan(WHEELBASE_M / 20.0))
    assert seen.steering[1] - seen.steering[0] < 0.2


def test_at_standstill_steering_grows_from_the_last_known_up_to_the_limit() -> None:
    watch = observer()
    moving = drive().vehicle[0]
    known = watch.observe(moving, (), stamp_s=0.0).steering
    stopped = dataclasses.replace(moving, t_s=0.1, speed_mps=0.0)
    grown = watch.observe(stopped, (), stamp_s=0.0).steering
    rate = ERRORS.steering_rate_limit_radps
    assert grown == pytest.approx((known[0] - 0.1 * rate, known[1] + 0.1 * rate))
    assert watch.observe(stopped, (), stamp_s=0.0).speed == (0.0, ERRORS.speed_mps)
    later = watch.observe(dataclasses.replace(stopped, t_s=10.0), (), stamp_s=0.0).steering
    assert later == (-ERRORS.steering_limit_rad, ERRORS.steering_limit_rad)


def test_steering_is_unknown_before_the_car_moves() -> None:
    sample = dataclasses.replace(drive().vehicle[0], speed_mps=0.1)
    assert observer().observe(sample, (), stamp_s=0.0).steering == (-0.6, 0.6)


def test_speed_and_reference_are_never_negative() -> None:
    sample = dataclasses.replace(drive().vehicle[0], speed_mps=-0.05)
    seen = observer().observe(sample, (), stamp_s=0.0)
    assert seen.speed == pytest.approx((0.0, 0.05))
    assert seen.reference_speed_mps == 0.0


def test_the_rear_axle_lies_behind_the_recorded_point() -> None:
    sample = dataclasses.replace(drive().vehicle[0], x_m=1.0, y_m=2.0, heading_rad=math.pi / 2)
    assert rear_axle(sample, 0.3) == pytest.approx((1.0, 1.7))


def test_the_watched_disc_is_about_the_rear_axle_and_the_stamp_is_kept() -> None:
    seen = observer().observe(drive().vehicle[0], (), stamp_s=3.5)
    assert seen.stamp_s == 3.5
    assert (seen.watched.x_m, seen.watched.y_m, seen.watched.radius_m) == (0.0, 0.0, 25.0)


@pytest.mark.parametrize(
    ("name", "value"), [("position_m", 0.0), ("speed_mps", math.nan), ("slow_mps", 0.05)]
)
def test_impossible_errors_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        dataclasses.replace(ERRORS, **{name: value})


def test_a_prediction_that_begins_later_is_drawn_from_its_begin_and_the_person_where_they_are() -> (
    None
):
    later = timed_discs(
        (0.6, 1.0, 2.0), (5.0, 6.0, 7.0), (0.0,) * 3, (0.3,) * 3, between=RadiusBetween.LINE
    )
    guard = Guard(0.0, Disc(4.0, 0.0, 0.3), Disc(0.0, 0.0, 0.1), MotionLimits(2.5, 1.5))
    frame = as_frame(ObservedPerson("a", (later,), guard), horizon_s=2.0, step_s=0.5)
    assert (frame.x_m, frame.y_m, frame.radius_m) == (4.0, 0.0, 0.3)
    assert [disc[0] for disc in frame.predicted] == pytest.approx([6.0, 6.5, 7.0])
