"""What rounding may add to a guard is a micrometre and a grain, and the last of it still counts."""

from __future__ import annotations

import dataclasses
import math

import pytest

from workbench.runtime.person_guard import Disc, Guard, MotionLimits
from workbench.runtime.policies import Relation, SeenPerson, Watched
from workbench.runtime.policies.guards import Scene, people_violations, relation_to, remembered
from workbench.runtime.policies.horizon import GRAIN_S

SLACK = 1e-6
STILL = MotionLimits(0.0, 0.0)


def at(
    x: float, vx: float = 0.0, *, t: float = 0.0, limits: MotionLimits = STILL, radius: float = 0.0
) -> Guard:
    return Guard(t, Disc(x, 0.0, radius), Disc(vx, 0.0, 0.0), limits)


def agree(before: Guard, now: Guard) -> bool:
    return relation_to(before, now) is not Relation.OUTSIDE


def test_the_last_micrometre_counts_and_no_more() -> None:
    for x, agrees in ((SLACK, True), (math.nextafter(SLACK, 1.0), False), (1.1 * SLACK, False)):
        assert agree(at(0.0), at(x)) is agrees
    assert relation_to(at(0.0), at(SLACK)) is Relation.OVERLAPS


def test_the_last_micrometre_a_second_counts_and_no_more() -> None:
    walks = MotionLimits(1.0, 0.0)
    before = at(0.0, 0.5, limits=walks)
    assert agree(before, at(0.0, 0.5 + 0.99 * SLACK))
    assert not agree(before, at(0.0, 0.5 + 1.01 * SLACK))
    still = at(0.0, 0.0, limits=walks)
    assert agree(still, at(0.0, SLACK))
    assert not agree(still, at(0.0, math.nextafter(SLACK, 1.0)))
    # Nor is who runs a micrometre a second above their limit too fast.
    for vx, agrees in ((SLACK, True), (1.1 * SLACK, False)):
        assert agree(at(0.0), at(0.0, vx)) is agrees


def test_slow_people_who_touch_agree() -> None:
    slow = MotionLimits(0.1, 0.1)
    beside = at(1.0, limits=slow, radius=0.5)
    assert agree(at(0.0, limits=slow, radius=0.5), beside)


def test_within_a_grain_two_instants_are_one() -> None:
    quick = MotionLimits(2.5, 1.5)
    walked = 2.5 * GRAIN_S
    for late_s in (-0.9 * GRAIN_S, 0.0):
        now = at(0.98 * (SLACK + walked), t=5.0 + late_s, limits=quick)
        assert agree(at(0.0, t=5.0, limits=quick), now)
        beyond = at(1.02 * (SLACK + walked), t=5.0 + late_s, limits=quick)
        assert not agree(at(0.0, t=5.0, limits=quick), beyond)


def test_a_whole_grain_before_is_still_the_same_instant() -> None:
    """Only beyond it may they have walked from there to here."""
    quick = MotionLimits(2.5, 1.5)
    here = Guard(0.0, Disc(0.0, 0.0, 0.0), Disc(0.0, 0.0, 2.5), quick)
    for late_s, agrees in ((-GRAIN_S, False), (math.nextafter(-GRAIN_S, -1.0), True)):
        there = Guard(late_s, Disc(SLACK + 4.0 * GRAIN_S, 0.0, 0.0), here.velocity, quick)
        assert agree(here, there) is agrees


def test_what_is_seen_before_is_never_shown_to_be_inside() -> None:
    quick = MotionLimits(2.5, 1.5)
    wide = Guard(5.0, Disc(0.0, 0.0, 9.0), Disc(0.0, 0.0, 2.5), quick)
    assert relation_to(wide, at(0.0, t=5.0, limits=quick)) is Relation.INSIDE
    assert relation_to(wide, at(0.0, t=4.0, limits=quick)) is Relation.OVERLAPS
    assert relation_to(wide, at(90.0, t=4.0, limits=quick)) is Relation.OUTSIDE


@pytest.mark.parametrize("never", [math.nan, math.inf, -math.inf])
def test_an_instant_that_is_none_agrees_with_nothing(never: float) -> None:
    assert not agree(at(0.0), at(9.0, t=never))
    assert not agree(at(0.0), dataclasses.replace(at(0.0, 0.1), at_s=never))


def test_relations_are_ordered_from_refuted_to_shown() -> None:
    assert sorted(Relation) == [Relation.OUTSIDE, Relation.OVERLAPS, Relation.INSIDE]


WATCHED = Watched(0.0, 0.0, 30.0)


def test_who_leaves_is_forgotten_at_the_edge_itself() -> None:
    # At rest, nothing grows but by the micrometre.
    gone = SeenPerson("gone", at(30.0 + SLACK, t=5.0))
    near = SeenPerson("near", at(30.0 - SLACK, t=5.0))
    before, now = Scene(5.0, (gone, near), WATCHED), Scene(5.0, (), WATCHED)
    assert remembered(before, now).people == (near,)


def test_who_comes_from_beyond_may_have_been_at_the_very_edge() -> None:
    before, now_s = Scene(5.0, (), WATCHED), 5.0
    for x, fits in ((30.0 - SLACK, True), (30.0 - 1.1 * SLACK, False)):
        new = SeenPerson("new", at(x, t=now_s))
        found = people_violations(
            before, Scene(now_s, (new,), WATCHED), required=Relation.OVERLAPS, unseen_speed_mps=1.0
        )
        assert (not found) is fits


def test_who_is_assumed_slow_covers_who_is_slower() -> None:
    slow = MotionLimits(0.5, 9.0)
    lost = SeenPerson("lost", Guard(4.0, Disc(0.0, 0.0, 0.1), Disc(0.3, 0.0, 0.1), slow))
    before = Scene(4.0, (lost,), WATCHED)
    for radius, covers in ((0.6, True), (0.4, False)):
        edge = Guard(5.0, Disc(0.0, 0.0, 2.0), Disc(0.0, 0.0, radius), slow)
        now = Scene(5.0, (SeenPerson("edge", edge, assumed=True),), WATCHED)
        assert (remembered(before, now).people == now.people) is covers


@pytest.mark.parametrize(
    ("required", "x", "detail", "refutes"),
    [
        (Relation.OVERLAPS, 20.0, "Ann left the guard", True),
        (Relation.INSIDE, 0.3, "Ann is not shown to be inside the guard", False),
    ],
)
def test_a_guard_that_was_left_refutes_and_one_that_may_be_does_not(
    required: Relation, x: float, detail: str, refutes: bool
) -> None:
    quick = MotionLimits(2.5, 1.5)
    before = Scene(5.0, (SeenPerson("Ann", at(0.0, t=5.0, limits=quick, radius=0.2)),), WATCHED)
    now = Scene(5.0, (SeenPerson("Ann", at(x, t=5.0, limits=quick, radius=0.2)),), WATCHED)
    (found,) = people_violations(before, now, required=required, unseen_speed_mps=2.5)
    assert (found.detail, found.refutes_plan) == (detail, refutes)
