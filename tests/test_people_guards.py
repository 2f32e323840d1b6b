"""A guard under limits holds the fastest change that they allow, and no more than that; who is lost
is assumed to do all that they could."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.estimation.people_data import PersonTrack
from workbench.estimation.people_guards import (
    LimitsGuard,
    LimitsGuards,
    assumed_guard,
    with_body,
)
from workbench.runtime import Disc, Guard, MotionLimits
from workbench.runtime.person_guard import guard_contains

LIMITS = MotionLimits(2.5, 1.5)
LAW = LimitsGuard(LIMITS, 0.05, 0.05, 0.0, 0.5)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(0.02, 0.4), min_size=1, max_size=6), st.floats(-3.0, 3.0))
def test_who_speeds_up_as_fast_as_allowed_is_on_the_edge_of_the_velocities(
    gaps: list[float], speed: float
) -> None:
    """The lag of a fit is the whole error where nothing else errs, for any spacing of samples."""
    times = np.cumsum([0.0, *gaps])
    xy = np.stack([speed * times + 0.5 * 1.5 * times**2, 0.0 * times], axis=1)
    exact = LimitsGuard(LIMITS, 0.0, 0.0, 0.0, 9.0)
    guard = exact.guard(PersonTrack("", "anna", "ped", times, xy), LIMITS)
    missed = speed + 1.5 * times[-1] - guard.velocity.x
    assert guard.velocity.radius == pytest.approx(missed, abs=1e-9)


def test_measurements_before_the_window_do_not_count_and_one_alone_says_nothing_of_speed() -> None:
    times = np.array([0.0, 0.5, 1.0])
    track = PersonTrack("", "anna", "ped", times, np.array([[9.0, 9.0], [0.0, 0.0], [0.6, 0.0]]))
    guard = LAW.guard(track, LIMITS)
    assert (guard.at_s, guard.velocity.x, guard.velocity.y) == (1.0, pytest.approx(1.2), 0.0)
    # Jitter of either end, and half the window of the allowed acceleration.
    assert guard.velocity.radius == pytest.approx(2.0 * 0.05 / 0.5 + 1.5 * 0.25)
    assert guard.position == Disc(0.6, 0.0, 0.05)
    assert LAW.guard(track.until(0.1), LIMITS).velocity == Disc(0.0, 0.0, 2.5)
    assert with_body(guard, 0.3).position.radius == pytest.approx(0.35)


@given(st.floats(-2.0, 2.0), st.floats(0.0, 4.0), st.floats(0.0, 2.0))
def test_who_is_lost_is_assumed_to_do_all_that_they_could(
    speed: float, drift: float, later_s: float
) -> None:
    """With any velocity within the limit at once, so also after any time."""
    guard = Guard(0.0, Disc(1.0, 2.0, 0.4), Disc(speed, 0.0, drift), LIMITS)
    lost = assumed_guard(guard)
    for turn in range(8):
        way = 2.5 * math.cos(turn), 2.5 * math.sin(turn)
        moved = Disc(1.0 + later_s * way[0], 2.0 + later_s * way[1], 0.4)
        member = Guard(later_s, moved, Disc(*way, 0.0), LIMITS)
        assert guard_contains(lost, member)


def test_kinds_choose_their_guard() -> None:
    wheels = dataclasses.replace(LAW, limits=MotionLimits(7.0, 1.5))
    guards = LimitsGuards(LAW, wheels)
    assert guards.of("ped") is guards.of("sitting") is LAW
    assert guards.of("cyclist") is guards.of("hoverboard") is wheels


def test_figures_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InputError, match="window"):
        dataclasses.replace(LAW, window_s=0.0)
    with pytest.raises(InputError, match="expected finite numbers"):
        dataclasses.replace(LAW, limits=MotionLimits(math.nan, 1.0))
