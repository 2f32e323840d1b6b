"""A person within the limits never refutes their guard; one who cannot have got there does."""

from __future__ import annotations

import dataclasses
import functools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from policy_world import LIMITS, Walker

from workbench.runtime.person_guard import Disc, Guard, MotionLimits
from workbench.runtime.policies import Hypothesis, Relation, SeenPerson, Watched
from workbench.runtime.policies.guards import Scene, people_violations, relation_to, remembered

angles = st.floats(-math.pi, math.pi)
shares = st.floats(0.0, 1.0)
errors = st.tuples(angles, shares, angles, shares)
pushes = st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), max_size=12)
WATCHED = Watched(0.0, 0.0, 100.0)
_violations = functools.partial(
    people_violations, required=Relation.OVERLAPS, unseen_speed_mps=LIMITS.speed_mps
)


def walker(x: float = 0.0, vx: float = 1.0, vy: float = 0.0) -> Walker:
    return Walker("Ann", x, 0.0, vx, vy)


@given(st.floats(-50.0, 50.0), angles, st.floats(0.0, 2.5), errors, errors, pushes)
def test_whoever_keeps_to_the_limits_is_never_outside(
    x: float, course: float, speed: float, first: tuple[float, ...], then: tuple[float, ...],
    accelerations: list[tuple[float, float]],
) -> None:  # fmt: skip
    moving = walker(x, speed * math.cos(course), speed * math.sin(course))
    before = moving.seen(3.0, first).guard
    for ax, ay in accelerations:
        moving.move(ax, ay, 0.1)
    now = moving.seen(3.0 + 0.1 * len(accelerations), then).guard
    assert relation_to(before, now) >= Relation.OVERLAPS


@given(st.floats(0.0, 2.0), angles, st.floats(1e-3, 5.0))
def test_whoever_cannot_be_there_is_outside(t: float, course: float, too_far: float) -> None:
    before = walker().seen(0.0, (0.0, 0.0, 0.0, 0.0)).guard
    p, w = before.position, before.velocity
    reach = 2.0 * p.radius + (w.radius + 0.75 * t) * t + too_far
    x, y = p.x + w.x * t + reach * math.cos(course), p.y + reach * math.sin(course)
    assert relation_to(before, Guard(t, Disc(x, y, p.radius), w, LIMITS)) is Relation.OUTSIDE
    turn = 2.0 * w.radius + 1.5 * t + too_far
    turned = Disc(w.x + turn * math.cos(course), w.y + turn * math.sin(course), w.radius)
    here = Disc(p.x + w.x * t, p.y, p.radius)
    assert relation_to(before, Guard(t, here, turned, LIMITS)) is Relation.OUTSIDE
    fast = Disc(2.6 + too_far, 0.0, 0.1)
    assert relation_to(before, Guard(t, here, fast, LIMITS)) is Relation.OUTSIDE
    away = p.x + 2.5 * t + 2.0 * p.radius + too_far
    ran = Guard(t, Disc(away, 0.0, p.radius), Disc(2.5, 0.0, 5.0), LIMITS)
    assert relation_to(before, ran) is Relation.OUTSIDE


def test_a_guard_from_before_is_compared_the_other_way_round() -> None:
    before = walker().seen(1.0, (0.0, 0.0, 0.0, 0.0)).guard
    older = dataclasses.replace(before, at_s=0.9)
    assert relation_to(before, older) is Relation.OVERLAPS
    for moved, relation in ((0.25, Relation.OVERLAPS), (1.5, Relation.OUTSIDE)):
        place = dataclasses.replace(before.position, x=before.position.x - moved)
        assert relation_to(before, dataclasses.replace(older, position=place)) is relation


def test_a_guard_that_is_no_number_is_outside() -> None:
    before = walker().seen(1.0, (0.0, 0.0, 0.0, 0.0)).guard
    assert relation_to(before, before) is Relation.INSIDE
    assert relation_to(before, dataclasses.replace(before, at_s=math.nan)) is Relation.OUTSIDE
    for k in range(3):
        numbers = [0.0, 0.0, 0.3]
        numbers[k] = math.nan
        for part in ("position", "velocity"):
            broken = dataclasses.replace(before, **{part: Disc(*numbers)})
            assert relation_to(before, broken) is Relation.OUTSIDE
            assert relation_to(broken, before) is Relation.OUTSIDE


@given(shares, angles, st.floats(0.0, 1.0))
def test_a_smaller_disc_within_the_reach_is_inside(share: float, course: float, t: float) -> None:
    before = walker().seen(0.0, (0.0, 0.0, 0.0, 0.0)).guard
    p, w = before.position, before.velocity
    free = 0.9 * share * p.radius
    place = Disc(p.x + w.x * t + free * math.cos(course), free * math.sin(course), 0.05 * p.radius)
    now = Guard(t, place, Disc(w.x, w.y, 0.5 * w.radius), LIMITS)
    assert relation_to(before, now) is Relation.INSIDE


def _scene(stamp_s: float, *people: SeenPerson) -> Scene:
    return Scene(stamp_s, people, WATCHED)


def _standing(name: str, at_s: float, x: float, y: float = 0.0, radius: float = 0.4) -> SeenPerson:
    return SeenPerson(name, Guard(at_s, Disc(x, y, radius), Disc(0.0, 0.0, 0.1), LIMITS))


def _assumed(at_s: float, x: float, radius: float, speed: float = 2.5) -> SeenPerson:
    guard = Guard(at_s, Disc(x, 0.0, radius), Disc(0.0, 0.0, speed), LIMITS)
    return SeenPerson("edge", guard, assumed=True)


def test_somebody_new_is_covered_by_place_and_by_speed() -> None:
    new = _standing("Bob", 0.1, 10.0)
    running = dataclasses.replace(
        new, guard=dataclasses.replace(new.guard, velocity=Disc(2.0, 0.0, 0.1))
    )
    for before, person, covered in (
        (_assumed(0.0, 10.0, 2.0), new, True),
        (_assumed(0.0, 14.0, 2.0), new, False),
        (_assumed(0.0, 10.0, 2.0), running, True),
        (_assumed(0.0, 10.0, 2.0, speed=0.5), running, False),
    ):
        found = _violations(_scene(0.0, before), _scene(0.1, person))
        assert ([v.hypothesis for v in found] == []) == covered
    fast = dataclasses.replace(
        new, guard=dataclasses.replace(new.guard, velocity=Disc(3.0, 0.0, 0.1))
    )
    found = _violations(_scene(0.0, _assumed(0.0, 10.0, 2.0)), _scene(0.1, fast))
    assert [v.hypothesis for v in found] == [Hypothesis.PEOPLE]


@pytest.mark.parametrize(
    ("x", "radius", "speed", "covered"),
    [(10.0, 2.0, 2.5, True), (10.0, 0.3, 2.5, False), (12.0, 2.0, 2.5, False),
     (10.0, 2.0, 0.2, False)],
)  # fmt: skip
def test_somebody_lost_is_covered_only_by_one_who_can_do_the_same(
    x: float, radius: float, speed: float, covered: bool
) -> None:
    before, now = (
        _scene(0.0, _standing("Bob", 0.0, 10.0)),
        _scene(0.2, _assumed(0.2, x, radius, speed)),
    )
    found = _violations(before, now)
    assert ([v.hypothesis for v in found] == []) == covered
    assert (remembered(before, now).people == now.people) == covered


def test_whoever_leaves_the_watched_disc_is_forgotten_and_nobody_else() -> None:
    near, far = _standing("near", 0.0, 50.0), _standing("far", 0.0, 100.5)
    kept = remembered(_scene(0.0, near, far), _scene(0.1))
    assert [person.name for person in kept.people] == ["near"]
    again = remembered(kept, _scene(5.0))
    assert again.people == kept.people


def test_who_is_faster_than_their_own_limit_is_named_known_or_new() -> None:
    fast = Guard(0.1, Disc(10.0, 0.0, 0.4), Disc(2.0, 0.0, 0.1), MotionLimits(1.0, 1.5))
    ran = SeenPerson("Bob", fast)
    before = _standing("Bob", 0.0, 10.0)
    before = dataclasses.replace(
        before, guard=dataclasses.replace(before.guard, velocity=Disc(2.0, 0.0, 0.1))
    )
    for scene in (_scene(0.0, before), _scene(0.0, _assumed(0.0, 10.0, 2.0)), _scene(0.1, ran)):
        (found,) = _violations(scene, _scene(0.1, ran))
        assert (found.hypothesis, found.refutes_plan) == (Hypothesis.PEOPLE, True)


def test_who_comes_from_beyond_is_no_faster_than_is_assumed_of_people_there() -> None:
    for speed, named in ((2.4, False), (4.0, True)):
        course = Disc(-speed, 0.0, 0.1)
        guard = Guard(0.1, Disc(100.0, 0.0, 0.4), course, MotionLimits(7.0, 1.5))
        found = _violations(_scene(0.0), _scene(0.1, SeenPerson("cyclist", guard)))
        assert ([v.hypothesis for v in found] == [Hypothesis.NOBODY_NEW]) == named


def test_a_disc_that_shrinks_makes_nobody_forgotten() -> None:
    known, small = _scene(0.0, _standing("Ann", 0.0, 50.0)), Watched(0.0, 0.0, 1.0)
    (found,) = _violations(known, Scene(0.1, (), small))
    assert found.hypothesis is Hypothesis.NOBODY_LOST
    kept = known
    for k in range(1, 4):
        kept = remembered(kept, Scene(0.1 * k, (), small))
    assert kept.people == known.people
    (found,) = _violations(kept, _scene(0.4))
    assert found.hypothesis is Hypothesis.NOBODY_LOST
    # Seen again, they leave by the disc as it is now.
    seen = remembered(kept, Scene(0.5, (_standing("Ann", 0.5, 50.0),), small))
    assert remembered(seen, Scene(0.6, (), small)).people == ()


def test_who_walks_no_farther_than_the_speed_limit_covers_somebody_lost_for_long() -> None:
    # After 5 s: 12.9 m by the speed limit, 19.6 m by acceleration.
    for radius, covered in ((13.0, True), (12.8, False)):
        found = _violations(
            _scene(0.0, _standing("Bob", 0.0, 10.0)), _scene(5.0, _assumed(5.0, 10.0, radius))
        )
        assert ([v.hypothesis for v in found] == []) == covered
