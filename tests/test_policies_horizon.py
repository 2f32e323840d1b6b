"""The fail-safe horizon is when the vehicle's brake has stopped the car, and never before."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.controllers import VehicleBrake
from workbench.errors import InputError
from workbench.models.vehicle import gem_e2
from workbench.runtime.policies import BrakeBounds, Timing, fail_safe_horizon_s

times = st.floats(0.0, 2.0)
speeds = st.floats(0.0, 20.0)
decelerations = st.floats(0.1, 9.0)


@given(times, st.floats(1e-3, 2.0), decelerations, st.floats(1.0, 3.0), speeds)
def test_it_is_never_shorter_than_the_closed_form(
    delay: float, build_up: float, least: float, factor: float, speed: float
) -> None:
    mode = VehicleBrake(least, least * 3.0, delay, build_up, 0.2)
    bounds = BrakeBounds(deceleration_min_mps2=least, delay_s=delay, build_up_s=build_up)
    stop_s = bounds.stop_s(speed)
    assert stop_s >= mode.standstill_time_s(speed, least)
    assert stop_s >= mode.standstill_time_s(speed, least * factor)
    if speed >= least * build_up / 2.0:
        # What is given away is half the build-up, no more.
        assert stop_s <= mode.standstill_time_s(speed, least) + 0.5 * build_up + 1e-9


@given(times, times, st.floats(1e-3, 1.0), speeds, st.floats(0.0, 3.0))
def test_it_is_the_last_switch_and_the_stop_from_there(
    period: float, latency: float, share: float, speed: float, accel: float
) -> None:
    gap = share * (period + 0.01)
    timing = Timing(period_s=period + 0.01, latency_s=latency, send_gap_s=gap)
    brake = BrakeBounds(deceleration_min_mps2=2.0, delay_s=0.1, build_up_s=0.1)
    horizon_s = fail_safe_horizon_s(timing, brake, speed_mps=speed, accel_max_mps2=accel)
    last_s = period + 0.01 + latency + gap
    mode = VehicleBrake(2.0, 3.0, 0.1, 0.1, 0.2)
    exact_s = last_s + mode.standstill_time_s(speed + accel * last_s, 2.0)
    assert exact_s <= horizon_s <= exact_s + 0.2 + 1e-4
    first, last = timing.switch_s
    assert first >= period + 0.01 + latency
    assert last - first >= gap


def test_the_shipped_vehicle_looks_1_7_s_ahead_after_a_period_without_delays() -> None:
    brake = gem_e2().brake
    bounds = BrakeBounds(
        deceleration_min_mps2=brake.deceleration_min_mps2,
        delay_s=brake.delay_s,
        build_up_s=brake.build_up_s,
    )
    timing = Timing(period_s=0.1, latency_s=0.0, send_gap_s=1e-9)
    horizon_s = fail_safe_horizon_s(timing, bounds, speed_mps=2.8, accel_max_mps2=0.0)
    assert horizon_s == pytest.approx(1.7, abs=1e-5)
    assert fail_safe_horizon_s(timing, bounds, speed_mps=-1.0, accel_max_mps2=0.0) < 0.301


@pytest.mark.parametrize("bad", [-0.1, float("nan"), float("inf")])
def test_numbers_that_cannot_be_are_refused(bad: float) -> None:
    good = {"deceleration_min_mps2": 2.0, "delay_s": 0.1, "build_up_s": 0.1}
    for key in good:
        with pytest.raises(InputError, match=key if key[0] == "d" else "build_up"):
            BrakeBounds(**{**good, key: bad})
    times = {"period_s": 0.1, "latency_s": 0.05, "send_gap_s": 0.03}
    for key in times:
        with pytest.raises(InputError, match=key):
            Timing(**{**times, key: bad})
    for period_s, gap_s in ((0.0, 0.1), (0.1, 0.0), (0.1, 0.11), (0.0, 0.0)):
        with pytest.raises(InputError, match="0 < send_gap_s <= period_s"):
            Timing(period_s=period_s, latency_s=0.1, send_gap_s=gap_s)
    with pytest.raises(InputError, match="deceleration_min"):
        BrakeBounds(deceleration_min_mps2=0.0, delay_s=0.0, build_up_s=0.0)
