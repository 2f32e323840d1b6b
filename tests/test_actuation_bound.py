"""No vehicle within its file's maps, dead bands and delays leaves the disturbance made of them."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable

import pytest
from actuation_cases import Plant, Worst, drive, drive_vehicle, shipped
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.errors import InputError
from workbench.models.actuation_bound import acceleration_bound, steering_bound
from workbench.models.drive_by_wire import reading_gain_per_s
from workbench.runtime.onboard.drive_by_wire import COUNT

_SIDES = (-1.0, 1.0)
_CORNERS = list(itertools.product(_SIDES, _SIDES, _SIDES, (0.0, 1.0)))


def _limits() -> tuple[float, float]:
    """What is left of W for a law that reads its road wheels without error."""
    dbw = shipped()
    return acceleration_bound(dbw).total, steering_bound(dbw, reading_gain_per_s=0.0).total


def _driven(
    corner: tuple[float, float, float, float],
    seed: int,
    fault: Callable[[dict[str, float]], dict[str, float]] = lambda said: said,
) -> Worst:
    pedals, rate, report, late = corner
    return drive(Plant(shipped(), pedals, rate, report, late, fault=fault), seed=seed)


@pytest.mark.parametrize("corner", _CORNERS)
def test_a_vehicle_at_every_corner_stays_within_the_bound(
    corner: tuple[float, float, float, float],
) -> None:
    limits = _limits()
    for seed in range(3):
        worst = _driven(corner, seed)
        assert worst.covered > 0.5
        assert not worst.fault
        assert worst.acceleration_mps2 <= limits[0]
        assert worst.steering_rate_radps <= limits[1]


def test_the_bound_is_not_far_from_what_the_worst_vehicle_does() -> None:
    limits = _limits()
    worst = [_driven(corner, seed) for corner in _CORNERS for seed in (5, 6)]
    assert max(each.acceleration_mps2 for each in worst) > 0.6 * limits[0]
    assert max(each.steering_rate_radps for each in worst) > 0.4 * limits[1]


def _swapped(said: dict[str, float]) -> dict[str, float]:
    return said | {"ACCEL_CMD": said["BRAKE_CMD"], "BRAKE_CMD": said["ACCEL_CMD"]}


def _wrong_way(said: dict[str, float]) -> dict[str, float]:
    return said | {"POSITION_VALUE": -said["POSITION_VALUE"]}


def _degrees_for_radians(said: dict[str, float]) -> dict[str, float]:
    return said | {"SPEED_LIMIT": math.degrees(said["SPEED_LIMIT"])}


@pytest.mark.parametrize("fault", [_swapped, _wrong_way, _degrees_for_radians])
def test_a_vehicle_wired_wrongly_is_seen(
    fault: Callable[[dict[str, float]], dict[str, float]],
) -> None:
    limits, middle = _limits(), (0.0, 0.0, 0.0, 0.0)
    worst = [_driven(middle, seed, fault) for seed in range(4)]
    assert any(
        each.acceleration_mps2 > limits[0] or each.steering_rate_radps > limits[1] for each in worst
    )


@settings(max_examples=150, deadline=None)
@given(st.floats(-2.0, 1.0), st.floats(-0.5, 0.5), st.floats(-1.0, 1.0))
def test_no_ratio_beats_the_error_of_the_pedals(
    acceleration: float, count: float, side: float
) -> None:
    pedals = shipped().pedals
    bound = acceleration_bound(shipped())
    if abs(acceleration) < pedals.coast_below_mps2:
        low, high = pedals.coast_mps2
        assert max(high - acceleration, acceleration - low) <= bound.dead_band
        return
    curve, sign = (pedals.accelerator, 1.0) if acceleration > 0.0 else (pedals.brake, -1.0)
    ratio = curve.command_for(sign * acceleration)
    low, high = curve.at(ratio + count * COUNT)
    found = sign * (low + 0.5 * (1.0 + side) * (high - low))
    assert abs(found - acceleration) <= bound.maps * (1.0 + 1e-12)


def test_each_part_counts() -> None:
    dbw = shipped()
    parts = acceleration_bound(dbw)
    assert parts.delay == pytest.approx(1.0 * (0.055 + 0.05 + 0.1))
    assert parts.maps == pytest.approx(0.15 + 0.0005 * 8.0)
    assert parts.dead_band == pytest.approx(0.1 + 0.05)
    assert parts.total == pytest.approx(max(parts.maps, parts.dead_band) + parts.delay + 0.05)
    turning = steering_bound(dbw, reading_gain_per_s=2.0)
    assert turning.delay == pytest.approx(0.4 * (0.055 + 0.03 + 0.02))
    steepest = max(dbw.steering.road_wheel.slopes)
    assert turning.reading == pytest.approx(2.0 * (0.001 + 0.005 * steepest))
    until_s = 0.05 + 0.055 + 0.05
    turned_rad = 1.05 * 0.4 * until_s**2 + (0.01 + 0.005 + 0.0005) * steepest
    least = turned_rad / (1.2 - 1.05 * until_s)
    assert turning.dead_band == pytest.approx(2.05 * least + 0.0005 * steepest)
    lively = dataclasses.replace(dbw.steering, wheel_rate_floor_radps=2.0)
    floored = steering_bound(dataclasses.replace(dbw, steering=lively), reading_gain_per_s=0.0)
    assert floored.dead_band == pytest.approx(2.05 * 2.0 * steepest + 0.0005 * steepest)
    assert turning.maps == pytest.approx(0.05 * 0.2 + 0.0005 * steepest)


def test_a_lead_that_is_too_short_is_refused() -> None:
    dbw = shipped()
    short = dataclasses.replace(dbw.steering, lead_s=0.1)
    with pytest.raises(InputError, match="lead_s: expected more than"):
        steering_bound(dataclasses.replace(dbw, steering=short), reading_gain_per_s=0.0)


def test_the_loop_feels_the_bound_and_the_file() -> None:
    vehicle = drive_vehicle()
    derived = vehicle.unsure()
    assert derived.acceleration_mps2 == acceleration_bound(shipped()).total
    gain = reading_gain_per_s(
        vehicle.steering_pid, wheelbase_m=1.75, speed_mps=4.0,
        tangent_rise=1.0 + math.tan(0.6) ** 2,
    )  # fmt: skip
    assert derived.steering_rate_radps == pytest.approx(
        steering_bound(shipped(), reading_gain_per_s=gain).total
    )
    assert derived.speed_mps == 0.05
    more = dataclasses.replace(vehicle.uncertainty, acceleration_mps2=0.9, lateral_m=0.1)
    both = dataclasses.replace(vehicle, uncertainty=more).unsure()
    assert both.lateral_m == 0.1
    assert both.acceleration_mps2 == pytest.approx(0.9 + derived.acceleration_mps2, rel=1e-15)
    assert both.steering_rate_radps == derived.steering_rate_radps
