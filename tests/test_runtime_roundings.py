"""Allowances for rounding lie on the outer side; rounding uses part of them, no more is given.

Each formula is evaluated in rational numbers beside the floats. In units of the allowance, what is
found exceeds the exact number by more than a share of it and by less than a little more than it.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

from runtime_world import observation, observed, standing

from workbench.runtime import Watched
from workbench.runtime.judgement import farthest_m
from workbench.runtime.observation import seen_people, watched_at_stamp
from workbench.runtime.person_guard import Disc, MotionLimits
from workbench.runtime.policies import BrakeBounds, Timing, fail_safe_horizon_s
from workbench.runtime.policies.horizon import GRAIN_S

SAMPLES = 2000
Chance = Callable[[], float]


def within(found: float, exact: Fraction, allowance: float, *, least: float, most: float) -> None:
    """found / exact - 1, in units of the allowance, lies in [least, most]."""
    excess = (Fraction(found) / exact - 1) / Fraction(allowance)
    assert least <= excess <= most, float(excess)


def chances(low: float, high: float) -> Chance:
    source = random.Random(20)
    return lambda: source.uniform(low, high)


def test_the_farthest_corner_keeps_most_of_its_allowance() -> None:
    place, size = chances(-50.0, 50.0), chances(0.1, 3.0)
    for _ in range(SAMPLES):
        x, y, a, b, u, v = place(), place(), size(), size(), place(), place()
        along = abs(Fraction(x) - Fraction(u)) + Fraction(a)
        across = abs(Fraction(y) - Fraction(v)) + Fraction(b)
        found = farthest_m([(x, y, 0.0, a, b)], Watched(u, v, 1.0))
        # Of the distance's square the allowance counts twice.
        square, exact = Fraction(found) ** 2, along**2 + across**2
        excess = (square / exact - 1) / Fraction(2.0**-47)
        assert 0.75 <= excess <= 1.5


def test_a_disc_on_the_stamp_s_clock_shrinks_outward() -> None:
    speed, ahead = chances(0.5, 3.0), chances(0.01, 5.0)
    for _ in range(SAMPLES):
        v, d = speed(), ahead()
        # Nothing is left of a disc as large as what is walked without any allowance.
        seen = replace(observation(), skew_s=(0.0, d), watched=Watched(0.0, 0.0, v * d))
        assert watched_at_stamp(seen, unseen_speed_mps=v).radius_m == 0.0
        wide = replace(seen, skew_s=(-d, 0.0), watched=Watched(0.0, 0.0, 2.0 * (v * d)))
        left = watched_at_stamp(wide, unseen_speed_mps=v).radius_m
        gone = 2 * Fraction(v * d) - Fraction(left)
        within(float(gone), Fraction(v) * Fraction(d), 2.0**-50, least=0.5, most=1.5)


def test_a_guard_that_is_taken_earlier_grows_outward() -> None:
    radius, speed, accel, back = (
        chances(0.1, 1.0), chances(0.5, 3.0), chances(0.5, 3.0), chances(0.1, 5.0)
    )  # fmt: skip
    for _ in range(SAMPLES):
        r, q, v, a, d = radius(), radius(), speed(), accel(), back()
        plain = observed(standing("far", 30.0, 9.0), limits=MotionLimits(v, a))
        guard = replace(
            plain.guard, at_s=0.0, position=Disc(1.0, 2.0, r), velocity=Disc(0.5, 0.25, q)
        )
        seen = replace(observation(replace(plain, guard=guard)), skew_s=(0.0, d), stamp_s=50.0)
        (found,) = seen_people(seen)
        limits = {"least": 0.3, "most": 1.5}
        moved, turned = (
            Fraction(r) + Fraction(v) * Fraction(d),
            Fraction(q) + Fraction(a) * Fraction(d),
        )
        within(found.guard.position.radius, moved, 2.0**-50, **limits)
        within(found.guard.velocity.radius, turned, 2.0**-50, **limits)


def test_standstill_is_never_said_too_early_and_hardly_too_late() -> None:
    time, speed, rate = chances(0.0, 2.0), chances(0.1, 20.0), chances(0.1, 9.0)
    for _ in range(SAMPLES):
        delay, build_up, v, least = time(), time(), speed(), rate()
        brake = BrakeBounds(deceleration_min_mps2=least, delay_s=delay, build_up_s=build_up)
        exact = Fraction(delay) + Fraction(build_up) + Fraction(v) / Fraction(least)
        within(brake.stop_s(v), exact, 2.0**-50, least=0.3, most=1.6)


def test_a_switch_lies_beyond_the_next_check_and_four_grains_hold_a_turn() -> None:
    time, gap = chances(0.05, 2.0), chances(0.01, 0.05)
    for _ in range(SAMPLES):
        timing = Timing(period_s=time(), latency_s=time(), send_gap_s=gap())
        first, last = timing.switch_s
        checked = Fraction(timing.period_s) + Fraction(timing.latency_s)
        within(first, checked, 2.0**-50, least=0.3, most=1.5)
        turned = checked + Fraction(timing.send_gap_s) + 4 * Fraction(GRAIN_S)
        within(last, turned, 2.0**-50, least=0.3, most=1.6)


def test_the_horizon_is_the_last_switch_and_the_stop_from_the_fastest_speed() -> None:
    time, speed, rate = chances(0.05, 1.0), chances(0.1, 20.0), chances(0.1, 9.0)
    for _ in range(SAMPLES):
        timing = Timing(period_s=time(), latency_s=time(), send_gap_s=0.05)
        brake = BrakeBounds(deceleration_min_mps2=rate(), delay_s=time(), build_up_s=time())
        v, accel, until = speed(), rate(), Fraction(timing.switch_s[1])
        fastest = Fraction(v) + until * Fraction(accel)
        stop = fastest / Fraction(brake.deceleration_min_mps2)
        exact = until + Fraction(brake.delay_s) + Fraction(brake.build_up_s) + stop
        found = fail_safe_horizon_s(timing, brake, speed_mps=v, accel_max_mps2=accel)
        # At least the last factor, at most all three.
        within(found, exact, 2.0**-50, least=0.3, most=3.8)
    assert math.isfinite(found)


def test_the_fastest_speed_has_an_allowance_of_its_own() -> None:
    speed = chances(900.0, 999.0)
    timing = Timing(period_s=1e-3, latency_s=0.0, send_gap_s=1e-3)
    brake = BrakeBounds(deceleration_min_mps2=0.1, delay_s=0.0, build_up_s=0.0)
    until = Fraction(timing.switch_s[1])
    for _ in range(SAMPLES):
        v = speed()
        exact = until + (Fraction(v) + until / 2) / Fraction(0.1)
        found = fail_safe_horizon_s(timing, brake, speed_mps=v, accel_max_mps2=0.5)
        # All three factors count where nearly all the time is the brake's.
        within(found, exact, 2.0**-50, least=2.0, most=4.0)
