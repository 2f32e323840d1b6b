"""A guard from a track holds whoever keeps its limits, knows no future, and its area is exact."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from guard_walkers import walker
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.estimation.guard_model import (
    GuardModel,
    VelocityError,
    common_area,
    guard_areas,
    is_inside,
)
from workbench.estimation.guard_motion import LONG_S, SHORT_S, motion_at, motion_rows
from workbench.estimation.people_data import PersonTrack
from workbench.runtime import MotionLimits

LIMITS = MotionLimits(2.0, 1.5)
EXACT = VelocityError(*[0.0] * 10)
SOME = VelocityError(0.3, 0.1, 0.4, 0.8, 0.02, 0.5, 0.2, 0.1, 0.3, 0.05)
BARE = GuardModel(0.0, EXACT, 1.0, LIMITS, "exact limits, exact measurements")
FULL = GuardModel(0.1, SOME, 0.7, LIMITS, "made up")


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6))
def test_everybody_within_the_limits_stays_inside_from_every_time_of_their_walk(seed: int) -> None:
    track = walker(np.random.default_rng(seed), LIMITS)
    exact = dataclasses.replace(BARE, position_m=1e-9)
    for horizon in (0.1, 0.5, 1.0, 2.0):
        rows = motion_rows([track], [track], horizon)
        assert len(rows.person) == len(track.t_s) - round(horizon / 0.1)
        assert is_inside(exact, rows).all()


def test_whoever_breaks_the_limits_leaves() -> None:
    faster = MotionLimits(2.0 * LIMITS.speed_mps, 2.0 * LIMITS.acceleration_mps2)
    tracks = [walker(np.random.default_rng(seed), faster) for seed in range(20)]
    assert not is_inside(BARE, motion_rows(tracks, tracks, 1.0)).all()


def test_the_guard_for_the_monitor_has_the_discs_that_the_figures_are_of() -> None:
    track = walker(np.random.default_rng(3), LIMITS)
    for t_s in (0.0, 0.1, 1.0, 3.04):
        guard = FULL.guard(track, t_s, body_radius_m=0.3)
        assert guard is not None
        assert guard.limits == LIMITS
        motion = motion_at(track, np.array([t_s]))
        reach = motion.age_s + 1.0
        assert -guard.at_s == pytest.approx(motion.age_s[0], abs=1e-12)
        grown, fast = FULL.radii(motion, reach)
        t = 1.0 - guard.at_s
        radius = guard.position.radius + guard.velocity.radius * t + 0.5 * 1.5 * t * t
        assert radius == pytest.approx(grown[0] + 0.3, abs=1e-9)
        assert guard.position.radius + 2.0 * t == pytest.approx(fast[0] + 0.3, abs=1e-9)
        missed = math.hypot(
            *(motion.velocity_mps[0] - (guard.velocity.x, guard.velocity.y)).tolist()
        )
        assert missed <= guard.velocity.radius + 1e-12
    assert FULL.guard(track, -0.5, body_radius_m=0.3) is None


def test_guards_of_many_times_are_those_of_each() -> None:
    track = walker(np.random.default_rng(3), LIMITS)
    times = np.array([0.0, 0.1, 1.0, 3.04])
    each = tuple(FULL.guard(track, t_s, body_radius_m=0.3) for t_s in times)
    assert FULL.guards(track, times, body_radius_m=0.3) == each


@given(st.integers(0, 58), st.integers(0, 10**6))
def test_later_measurements_change_nothing(newest: int, seed: int) -> None:
    track = walker(np.random.default_rng(1), LIMITS)
    t_s = track.t_s[newest] + 0.05
    moved = track.xy_m.copy()
    moved[newest + 1 :] += np.random.default_rng(seed).normal(size=(len(moved) - newest - 1, 2))
    other = PersonTrack("r", "p", "ped", track.t_s, moved)
    assert FULL.guard(track, t_s, body_radius_m=0.0) == FULL.guard(other, t_s, body_radius_m=0.0)
    assert FULL.guard(track, t_s, body_radius_m=0.0) == FULL.guard(
        track.until(t_s), t_s, body_radius_m=0.0
    )
    whole, cut = (motion_at(known, np.array([t_s])) for known in (track, track.until(t_s)))
    assert all((getattr(whole, n) == getattr(cut, n)).all() for n in whole.__slots__)


def test_velocities_are_those_of_straight_lines_fitted_to_each_window() -> None:
    rng = np.random.default_rng(5)
    times = np.cumsum(rng.uniform(0.05, 0.9, 40))
    track = PersonTrack("r", "p", "ped", times, rng.normal(size=(40, 2)) * 5.0 + 900.0)
    motion = motion_at(track, times)
    for k in range(1, 40):
        lines = {}
        for window in (SHORT_S, LONG_S):
            first = min(int(np.searchsorted(times, times[k] - window)), k - 1)
            span = slice(first, k + 1)
            lines[window] = np.polyfit(times[span] - times[k], track.xy_m[span], 1)[0]
        assert motion.velocity_mps[k] == pytest.approx(lines[LONG_S], abs=1e-6)
        unsteady = np.hypot(*(lines[SHORT_S] - lines[LONG_S]))
        assert motion.unsteady_mps[k] == pytest.approx(unsteady, abs=1e-6)
    assert not motion.known[0]
    assert motion.speed_mps[0] == 0.0


sizes = st.floats(0.0, 10.0)


@given(sizes, sizes, sizes)
def test_a_common_area_is_that_of_strips(apart: float, first: float, second: float) -> None:
    x = np.linspace(-10.0, 20.0, 30001)
    half = [
        np.sqrt(np.maximum(r * r - (x - centre) ** 2, 0.0))
        for r, centre in ((first, 0.0), (second, apart))
    ]
    strips = 2.0 * float(np.minimum(*half).sum()) * (x[1] - x[0])
    found = common_area(np.array([apart]), np.array([first]), np.array([second]))[0]
    assert found == pytest.approx(strips, abs=2e-2)


def test_a_common_area_of_equal_discs_one_radius_apart_is_the_known_lens() -> None:
    found = common_area(np.array([1.0]), np.array([1.0]), np.array([1.0]))[0]
    assert found == pytest.approx(2.0 * math.pi / 3.0 - math.sqrt(3.0) / 2.0, rel=1e-14)


@settings(deadline=None)
@given(st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(1.0, 3.0))
def test_wider_limits_and_larger_scales_reach_farther(
    speed: float, acceleration: float, factor: float
) -> None:
    track = walker(np.random.default_rng(9), LIMITS)
    rows = motion_rows([track], [track], 1.0)
    small = dataclasses.replace(FULL, limits=MotionLimits(speed, acceleration))
    for wide in (
        dataclasses.replace(FULL, limits=MotionLimits(speed + 1.0, acceleration)),
        dataclasses.replace(FULL, limits=MotionLimits(speed, acceleration + 1.0)),
        small.scaled(factor),
    ):
        assert (guard_areas(wide, rows) >= guard_areas(small, rows) - 1e-9).all()
        assert (is_inside(wide, rows) >= is_inside(small, rows)).all()


@given(st.integers(0, 9))
def test_whatever_the_past_shows_more_of_widens_the_velocity(which: int) -> None:
    track = walker(np.random.default_rng(9), LIMITS)
    motion = motion_at(track, np.array([2.0]))
    numbers = [0.0] * 10
    numbers[which] = 1.0
    error = VelocityError(*numbers)
    assert error.of(motion) == VelocityError.terms(motion)[:, which] >= 0.0
    assert error.scaled(3.0).of(motion) == 3.0 * error.of(motion)
    assert SOME.of(motion)[0] == pytest.approx(
        sum(n * t for n, t in zip(SOME.numbers(), VelocityError.terms(motion)[0], strict=True))
    )


def test_being_slow_and_being_new_fade() -> None:
    times = np.arange(40) * 0.1
    track = PersonTrack("r", "p", "ped", times, np.column_stack([times**3, 0.0 * times]))
    motion = motion_at(track, times[1:])
    terms = VelocityError.terms(motion)
    assert terms[:, 2] == pytest.approx(0.5 ** (motion.speed_mps / (2.0 * math.log(2.0))))
    assert terms[:, 5] == pytest.approx(0.5 ** (times[1:] / math.log(2.0)))


@pytest.mark.parametrize("number", [-0.1, math.nan, math.inf])
def test_an_error_that_makes_no_sense_is_refused(number: float) -> None:
    with pytest.raises(InputError, match="expected finite numbers"):
        dataclasses.replace(SOME, per_scatter=number)


@pytest.mark.parametrize(
    ("position_m", "kept", "speed_mps"), [(-0.1, 0.7, 2.0), (0.1, 1.1, 2.0), (0.1, 0.7, math.nan)]
)
def test_a_model_that_makes_no_sense_is_refused(
    position_m: float, kept: float, speed_mps: float
) -> None:
    limits = MotionLimits(speed_mps, 1.5)
    with pytest.raises(InputError, match="expected finite numbers"):
        dataclasses.replace(FULL, position_m=position_m, kept=kept, limits=limits)
