"""A law starts without turning where its integral can make it so, and with 0 where nothing can."""

from __future__ import annotations

import dataclasses
import math

import pytest

from workbench.runtime.onboard.pid import Integrals, Reading, TrackLaw

LAW = TrackLaw(
    wheelbase_m=2.5, steering_min_rad=-0.6, steering_max_rad=0.6, look_ahead_m=2.0,
    steering_proportional=0.5, steering_integral=0.2, steering_derivative=0.4,
    rate_min_radps=-0.2, rate_max_radps=0.2, speed_proportional=0.8, speed_integral=0.1,
    accel_min_mps2=-2.0, accel_max_mps2=1.0,
)  # fmt: skip


@pytest.mark.parametrize("offset_m", [-0.3, 0.0, 0.2])
@pytest.mark.parametrize("heading_rad", [-0.1, 0.05])
def test_a_standing_car_does_not_turn_its_wheels_at_first(
    offset_m: float, heading_rad: float
) -> None:
    reading = Reading(offset_m, heading_rad, 0.1, 0.0, 0.02)
    integral = LAW.at_rest(reading, most_ms=9.0)
    command = LAW.track(reading, Integrals(offset_ms=integral), reference_speed_mps=1.0)
    assert command.steering_rate_radps == pytest.approx(0.0, abs=1e-15)
    ahead_m = offset_m + 2.0 * math.sin(heading_rad)
    assert integral == pytest.approx(-0.5 * ahead_m / 0.2)


@pytest.mark.parametrize(("offset_m", "expected"), [(3.0, -2.4), (-3.0, 2.4)])
def test_no_more_is_remembered_than_the_region_holds(offset_m: float, expected: float) -> None:
    assert LAW.at_rest(Reading(offset_m, 0.0, 0.0, 0.0, 0.0), most_ms=2.4) == expected


def test_where_there_is_no_such_number_nothing_is_remembered() -> None:
    for offset_m in (math.nan, math.inf):
        assert LAW.at_rest(Reading(offset_m, 0.0, 0.0, 0.0, 0.0), most_ms=2.4) == 0.0
    reading = Reading(0.2, 0.0, 0.0, 0.0, 0.0)
    for gain in (0.0, -0.2):
        law = dataclasses.replace(LAW, steering_integral=gain)
        assert law.at_rest(reading, most_ms=2.4) == 0.0


def test_who_has_driven_nothing_remembers_nothing() -> None:
    assert Integrals() == Integrals(speed_m=0.0, offset_ms=0.0)
