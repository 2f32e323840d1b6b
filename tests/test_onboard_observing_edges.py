"""The worst that bounds, rounding and clocks allow at once still lies in the observation."""

from __future__ import annotations

import dataclasses

import pytest
from onboard_sensors import pacmod2_reports
from onboard_truth import CarState
from onboard_worst_cases import (
    CHECKS,
    EXACT,
    NOBODY,
    STANDING,
    check_rounding_of_the_pose,
    crowd,
    observed,
    seen,
    whole,
)

from workbench.runtime.observation import Observation
from workbench.runtime.onboard.observing import NotObserved, Unobserved
from workbench.runtime.onboard.sensor_bounds import PersonBounds
from workbench.runtime.person_guard import MotionLimits
from workbench.runtime.protocols import PersonKind


@pytest.mark.parametrize("check", CHECKS)
def test_the_worst_case_is_contained(check: object) -> None:
    assert callable(check)
    check()


def test_rounding_the_other_way() -> None:
    check_rounding_of_the_pose(-1.0)


@pytest.mark.parametrize(
    ("kind", "speed_mps", "assumed"),
    [
        (PersonKind.ON_FOOT, 2.5, False),
        (PersonKind.ON_WHEELS, 7.0, False),
        (PersonKind.ASSUMED, 7.0, True),
    ],
)
def test_limits_are_those_of_the_kind(kind: PersonKind, speed_mps: float, assumed: bool) -> None:
    sent = dataclasses.replace(NOBODY, kind=kind)
    found = observed([*whole(STANDING)[:4], *crowd(sent)], now_us=101_000)
    (person,) = found.people
    assert (person.guard.limits.speed_mps, person.assumed) == (speed_mps, assumed)
    assert person.name == "7"
    # Whoever is only assumed may intend whatever they can do.
    growth = person.intent[0].bounds[0][0].growth2_mps2
    assert growth == (3.0 if assumed else 0.1 if kind is PersonKind.ON_FOOT else 0.2)


def test_a_person_of_two_kinds_gets_the_larger_limit_of_each_sort() -> None:
    slow = PersonBounds(MotionLimits(9.0, 1.0), 0.0)
    settings = dataclasses.replace(EXACT, on_wheels=slow)
    sent = dataclasses.replace(NOBODY, kind=PersonKind.ASSUMED)
    found = observed([*whole(STANDING)[:4], *crowd(sent)], now_us=101_000, settings=settings)
    assert found.people[0].guard.limits == MotionLimits(9.0, 1.5)


def test_a_watched_disc_never_gets_negative() -> None:
    frames = [*whole(STANDING)[:4], *crowd(watched_radius_m=0.5)]
    assert observed(frames, now_us=600_000).watched.radius_m == 0.0


def test_contradicting_reports_are_no_observation() -> None:
    frames = whole(CarState(0.0, 0.0, 0.0, 2.0, 0.0))
    found = seen(frames, now_us=130_000, speed_mps=2.0 * 2.237)
    assert isinstance(found, NotObserved)
    assert found.fault is Unobserved.CONTRADICTION
    assert isinstance(seen(frames, now_us=130_000, speed_mps=2.0), Observation)


def test_reports_that_contradict_each_other_only_at_this_instant() -> None:
    """0.05 m/s in 24 ms need more than 1 m/s^2; 24 ms earlier or later either would be possible."""
    settings = dataclasses.replace(EXACT, acceleration_mps2=(-1.0, 1.0))
    frames = whole(CarState(0.0, 0.0, 0.0, 2.0, 0.0), radii=(0.0, 0.0, 0.0, 9.0))
    faster = [(149_000, *report) for report in pacmod2_reports(speed_mps=2.05, wheel_rad=0.0)]
    found = seen([*frames, *faster], now_us=149_000, settings=settings, speed_mps=2.0)
    assert isinstance(found, NotObserved)
    assert found.fault is Unobserved.CONTRADICTION
    assert "instant of the observation" in found.detail


def test_the_newest_report_counts_though_it_came_soon_after_another() -> None:
    frames = whole(CarState(0.0, 0.0, 0.0, 2.0, 0.0), radii=(0.0, 0.0, 0.0, 9.0))
    settings = dataclasses.replace(EXACT, acceleration_mps2=(-99.0, 99.0))
    soon = [(129_000, *report) for report in pacmod2_reports(speed_mps=2.3, wheel_rad=0.0)]
    found = observed([*frames, *soon], now_us=129_000, settings=settings, speed_mps=2.0)
    assert 2.29 < found.speed[0] <= 2.3 <= found.speed[1] < 2.31
