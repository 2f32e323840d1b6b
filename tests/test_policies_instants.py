"""Times of a cycle are ordered and finite, ages count to their ends, and stamps only move on."""

from __future__ import annotations

import dataclasses
import math

import pytest
from policy_cases import cycle, tracking
from policy_runs import TIMING

from workbench.errors import InputError
from workbench.runtime.policies import BrakeBounds, Cycle, Hypothesis, Timing, fail_safe_horizon_s
from workbench.runtime.policies.instants import age_violation, arithmetic_violation, clock_violation


def timed(stamp_s: float, started_s: float, finished_s: float) -> Cycle:
    drive = tracking()
    made = cycle(drive.state, drive.car, drive.now_s)
    return dataclasses.replace(made, stamp_s=stamp_s, started_s=started_s, finished_s=finished_s)


@pytest.mark.parametrize(
    ("times", "clock_s", "ordered"),
    [
        ((1.0, 2.0, 3.0), 2.5, True),
        ((1.0, 1.0, 1.0), 1.0, True),
        ((1.0, 2.0, 3.0), 3.0, True),
        ((1.0, 2.0, 3.0), 3.1, False),
        ((2.1, 2.0, 3.0), 0.0, False),
        ((1.0, 3.1, 3.0), 0.0, False),
        ((1.0, 2.0, math.inf), 0.0, False),
        ((-math.inf, 2.0, 3.0), 0.0, False),
        ((1.0, math.nan, 3.0), 0.0, False),
    ],
)
def test_stamp_start_and_end_follow_each_other_and_the_clock(
    times: tuple[float, float, float], clock_s: float, ordered: bool
) -> None:
    found = clock_violation(timed(*times), clock_s=clock_s)
    if ordered:
        assert found is None
    else:
        assert found is not None
        assert (found.hypothesis, found.refutes_plan) == (Hypothesis.CLOCK, True)


def test_a_check_may_take_the_latency_and_no_more() -> None:
    allowed = age_violation(timed(8.0, 8.0, 8.0 + 0.0625), _latency(0.0625), stamp_s=7.0)
    assert allowed is None
    late = age_violation(timed(8.0, 8.0, 8.0 + 0.0626), _latency(0.0625), stamp_s=7.0)
    assert late is not None
    assert (late.hypothesis, late.refutes_plan) == (Hypothesis.AGE, False)


def _latency(latency_s: float) -> Timing:
    return dataclasses.replace(TIMING, latency_s=latency_s)


@pytest.mark.parametrize("before_s", [8.0, 8.1, math.inf])
def test_a_stamp_that_is_not_after_the_last_is_no_observation(before_s: float) -> None:
    found = age_violation(timed(8.0, 8.0, 8.0), TIMING, stamp_s=before_s)
    assert found is not None
    assert (found.hypothesis, found.refutes_plan) == (Hypothesis.AGE, False)
    assert "no observation since" in found.detail


def test_arithmetic_is_in_order_unless_a_fault_is_named() -> None:
    made = timed(8.0, 8.0, 8.0)
    assert arithmetic_violation(made) is None
    found = arithmetic_violation(dataclasses.replace(made, fault="rounding"))
    assert found is not None
    assert (found.hypothesis, found.refutes_plan) == (Hypothesis.ARITHMETIC, False)
    assert found.detail == "rounding"


def test_a_sender_may_turn_as_seldom_as_checks_are_made() -> None:
    assert Timing(period_s=0.1, latency_s=0.0, send_gap_s=0.1).switch_s[0] >= 0.1
    with pytest.raises(InputError, match="send_gap_s"):
        Timing(period_s=0.1, latency_s=0.0, send_gap_s=math.nextafter(0.1, 1.0))


@pytest.mark.parametrize("below", [-0.5, -1.0, -7.0])
def test_a_car_that_rolls_back_or_only_slows_stops_no_sooner_than_one_at_rest(
    below: float,
) -> None:
    brake = BrakeBounds(deceleration_min_mps2=2.0, delay_s=0.1, build_up_s=0.1)
    rest_s = fail_safe_horizon_s(TIMING, brake, speed_mps=0.0, accel_max_mps2=0.0)
    assert fail_safe_horizon_s(TIMING, brake, speed_mps=below, accel_max_mps2=0.0) == rest_s
    assert fail_safe_horizon_s(TIMING, brake, speed_mps=0.0, accel_max_mps2=below) == rest_s


def test_neither_a_car_that_rolls_back_nor_one_that_slows_shortens_the_other_s_part() -> None:
    brake = BrakeBounds(deceleration_min_mps2=2.0, delay_s=0.1, build_up_s=0.1)
    plain_s = fail_safe_horizon_s(TIMING, brake, speed_mps=2.0, accel_max_mps2=0.0)
    assert fail_safe_horizon_s(TIMING, brake, speed_mps=2.0, accel_max_mps2=-0.5) == plain_s
    pushed_s = fail_safe_horizon_s(TIMING, brake, speed_mps=0.0, accel_max_mps2=9.0)
    assert fail_safe_horizon_s(TIMING, brake, speed_mps=-0.5, accel_max_mps2=9.0) == pushed_s
