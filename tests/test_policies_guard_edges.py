"""Each bound on people counts with its sign and size, just inside and just outside of its edge."""

from __future__ import annotations

import dataclasses
import functools
import math

import pytest

from workbench.runtime.person_guard import Disc, Guard, MotionLimits
from workbench.runtime.policies import Relation, SeenPerson, Watched
from workbench.runtime.policies.guards import Scene, people_violations, relation_to, remembered

LIMITS = MotionLimits(2.5, 1.5)
_violations = functools.partial(
    people_violations, required=Relation.OVERLAPS, unseen_speed_mps=LIMITS.speed_mps
)
# After 2 s: moved by (1.6, -2.4), reach 0.1 2 + 1.5 2^2 / 2 = 3.2 by acceleration, 5 by speed.
BEFORE = Guard(7.0, Disc(3.0, 4.0, 0.4), Disc(0.8, -1.2, 0.1), LIMITS)
NOW_S = 9.0
MOVED = (4.6, 1.6)
COURSES = [(math.cos(a), math.sin(a)) for a in (0.3, 1.9, 3.4, 5.1)]
CLOSE = 1e-4


def _at(position: Disc, velocity: Disc) -> Guard:
    return Guard(NOW_S, position, velocity, LIMITS)


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("over", [-CLOSE, CLOSE])
def test_reach_by_acceleration(course: tuple[float, float], over: float) -> None:
    far = 0.4 + 3.2 + 0.3 + over
    place = Disc(MOVED[0] + far * course[0], MOVED[1] + far * course[1], 0.3)
    fast = dataclasses.replace(BEFORE, limits=MotionLimits(9.0, 1.5))
    assert (relation_to(fast, _at(place, BEFORE.velocity)) is Relation.OUTSIDE) == (over > 0.0)


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("over", [-CLOSE, CLOSE])
def test_reach_by_speed(course: tuple[float, float], over: float) -> None:
    far = 0.4 + 5.0 + 0.3 + over
    place = Disc(3.0 + far * course[0], 4.0 + far * course[1], 0.3)
    nimble = dataclasses.replace(BEFORE, limits=MotionLimits(2.5, 15.0))
    assert (relation_to(nimble, _at(place, BEFORE.velocity)) is Relation.OUTSIDE) == (over > 0.0)


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("over", [-CLOSE, CLOSE])
def test_reach_of_the_velocity(course: tuple[float, float], over: float) -> None:
    turn = 0.1 + 3.0 + 0.2 + over
    velocity = Disc(0.8 + turn * course[0], -1.2 + turn * course[1], 0.2)
    quick = dataclasses.replace(BEFORE, limits=MotionLimits(9.0, 1.5))
    now = _at(Disc(*MOVED, 0.4), velocity)
    assert (relation_to(quick, now) is Relation.OUTSIDE) == (over > 0.0)


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("over", [-CLOSE, CLOSE])
def test_largest_speed(course: tuple[float, float], over: float) -> None:
    speed = 2.5 + 0.2 + over
    now = _at(Disc(*MOVED, 0.4), Disc(speed * course[0], speed * course[1], 0.2))
    nimble = dataclasses.replace(BEFORE, limits=MotionLimits(2.5, 15.0))
    assert (relation_to(nimble, now) is Relation.OUTSIDE) == (over > 0.0)


def test_the_edges_themselves_are_within() -> None:
    still = Guard(7.0, Disc(0.0, 0.0, 0.5), Disc(0.0, 0.0, 0.0), LIMITS)
    beside = dataclasses.replace(still, position=Disc(1.0, 0.0, 0.5))
    assert relation_to(still, beside) is Relation.OVERLAPS
    barely = dataclasses.replace(still, position=Disc(1.0 + 5e-7, 0.0, 0.5))
    assert relation_to(still, barely) is Relation.OVERLAPS
    beyond = dataclasses.replace(still, position=Disc(1.0 + 5e-6, 0.0, 0.5))
    assert relation_to(still, beyond) is Relation.OUTSIDE


# Watched about (10, -20) with 30 m; a new person may have walked 2.5 m/s for 0.4 s since.
WATCHED = Watched(10.0, -20.0, 30.0)


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("over", [-CLOSE, CLOSE])
def test_who_may_have_come_from_beyond(course: tuple[float, float], over: float) -> None:
    away = 30.0 - 1.0 - 0.4 + over
    place = Disc(10.0 + away * course[0], -20.0 + away * course[1], 0.4)
    new = SeenPerson("new", Guard(5.4, place, Disc(1.0, 0.0, 0.1), LIMITS))
    found = _violations(Scene(5.0, (), WATCHED), Scene(5.4, (new,), WATCHED))
    assert (not found) == (over > 0.0)


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("over", [-CLOSE, CLOSE])
def test_who_must_have_left(course: tuple[float, float], over: float) -> None:
    # Walks outward at 1 m/s for 2 s; 0.4 + (0.1 + 1.5) 2 = 3.6 m uncertain by then.
    away = 30.0 + 3.6 - 2.0 + over
    place = Disc(10.0 + away * course[0], -20.0 + away * course[1], 0.4)
    left = SeenPerson("left", Guard(7.0, place, Disc(*course, 0.1), LIMITS))
    before, now = Scene(7.0, (left,), WATCHED), Scene(NOW_S, (), WATCHED)
    assert (not _violations(before, now)) == (over > 0.0)
    assert (remembered(before, now).people == ()) == (over > 0.0)


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("over", [-CLOSE, CLOSE])
def test_who_covers_somebody_lost(course: tuple[float, float], over: float) -> None:
    # As above: anywhere within 3.6 m of where they would have walked to, as fast as they may be.
    walked = (20.0 + 2.0 * course[0], -20.0 + 2.0 * course[1])
    lost = SeenPerson("lost", Guard(7.0, Disc(20.0, -20.0, 0.4), Disc(*course, 0.1), LIMITS))
    before = Scene(7.0, (lost,), WATCHED)
    aside = (walked[0] + 1.5 * course[1], walked[1] - 1.5 * course[0])
    for place, speed, covers in (
        (Disc(*walked, 3.6 + over), 2.5, over > 0.0),
        (Disc(*aside, 5.1 + over), 2.5, over > 0.0),
        (Disc(*walked, 4.0), 2.5 - CLOSE, False),
    ):
        edge = Guard(NOW_S, place, Disc(0.0, 0.0, speed), LIMITS)
        now = Scene(NOW_S, (SeenPerson("edge", edge, assumed=True),), WATCHED)
        found = _violations(before, now)
        assert (not found) == covers


def test_who_cannot_be_fast_yet_is_covered_by_somebody_slow() -> None:
    lost = SeenPerson("lost", Guard(8.9, Disc(20.0, -20.0, 0.4), Disc(0.5, 0.5, 0.1), LIMITS))
    before = Scene(8.9, (lost,), WATCHED)
    for radius, covers in ((0.26, True), (0.24, False)):
        edge = Guard(NOW_S, Disc(20.0, -20.0, 3.0), Disc(0.5, 0.5, radius), LIMITS)
        now = Scene(NOW_S, (SeenPerson("edge", edge, assumed=True),), WATCHED)
        assert (not _violations(before, now)) == covers


def test_inside_may_be_required_of_who_is_assumed() -> None:
    edge = Guard(5.0, Disc(20.0, -20.0, 3.0), Disc(0.0, 0.0, 2.5), LIMITS)
    before = Scene(5.0, (SeenPerson("edge", edge, assumed=True),), WATCHED)
    for x, required, covered in (
        (20.0, Relation.INSIDE, True),
        (23.5, Relation.INSIDE, False),
        (23.5, Relation.OVERLAPS, True),
    ):
        new = SeenPerson("new", Guard(5.1, Disc(x, -20.0, 0.4), Disc(1.0, 0.0, 0.1), LIMITS))
        found = _violations(before, Scene(5.1, (new,), WATCHED), required=required)
        assert (not found) == covered


def test_who_is_assumed_under_the_name_of_somebody_lost_must_cover_them() -> None:
    lost = SeenPerson("p", Guard(8.9, Disc(20.0, -20.0, 0.4), Disc(0.5, 0.5, 0.1), LIMITS))
    before = Scene(8.9, (lost,), WATCHED)
    for radius, covers in ((3.0, True), (0.3, False)):
        edge = Guard(NOW_S, Disc(20.0, -20.0, radius), Disc(0.0, 0.0, 2.5), LIMITS)
        now = Scene(NOW_S, (SeenPerson("p", edge, assumed=True),), WATCHED)
        assert (not _violations(before, now)) == covers
        assert (lost in remembered(before, now).people) != covers
