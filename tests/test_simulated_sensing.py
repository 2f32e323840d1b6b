"""Sensors of a scenario err, lose and hide as it says, and no more than it says."""

from __future__ import annotations

import dataclasses
import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("casadi", reason="needs the optional package casadi")

from simulated_worlds import rig

from workbench.runtime import ObservedPerson, Watched
from workbench.runtime.onboard.crowd import observed_person
from workbench.runtime.policies import Hypothesis, Relation, SeenPerson
from workbench.runtime.policies.guards import Scene as SeenScene
from workbench.runtime.policies.guards import people_violations
from workbench.runtime.protocols import PersonKind
from workbench.simulation.bus_sensing import CLOCK_US, Sensors
from workbench.simulation.occlusion import hidden, shadow_discs
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.scenarios.scenario import Dropout, Ghost, Occluder, Sensing
from workbench.simulation.walkers.pedestrian import PersonNow

CAR = Motion(5.0, 1.0, 0.3, 2.0, 0.0, 0.0, 0.0, 0.0)
VAN = Occluder(10.0, 2.0, 14.0, 4.0)
EYE = (7.0, 1.5)
seeds = st.integers(0, 10_000)


def sensors(sensing: Sensing, seed: int = 1) -> Sensors:
    return Sensors(sensing, random.Random(seed), 0)


def person(x_m: float, y_m: float, kind: str = "ped") -> PersonNow:
    return PersonNow("p", kind, x_m, y_m, 1.0, -0.5, 0.3)


@given(seeds)
def test_a_localisation_is_within_its_radii_and_changes_with_the_ranges(seed: int) -> None:
    looking = sensors(Sensing(position_m=0.2, heading_rad=0.03, speed_mps=0.1, dropped=0.0), seed)
    found = [looking.localised(CAR, k * 100_000) for k in range(40)]
    errors = set()
    for place in found:
        assert place is not None
        off = (place.x_m - CAR.x_m, place.y_m - CAR.y_m)
        errors.add(off)
        assert math.hypot(*off) <= 0.2 == place.x_radius_m == place.y_radius_m
        assert abs(place.heading_rad - CAR.heading) <= 0.03 == place.heading_radius_rad
        assert abs(place.speed_mps - CAR.speed_mps) <= 0.1 == place.speed_radius_mps
    assert 11 <= len(errors) <= 13
    assert len({place.number for place in found if place}) == 40


@given(seeds)
def test_a_person_is_within_what_is_said_of_them(seed: int) -> None:
    looking = sensors(Sensing(person_m=0.5, person_mps=0.4), seed)
    seen = looking.people([person(12.0, -3.0)], CAR, EYE, 200_000)
    assert seen is not None
    (found,) = seen.people
    assert math.dist((found.x_m, found.y_m), (12.0, -3.0)) + 0.3 <= found.position_radius_m + 1e-12
    away = math.dist((found.x_speed_mps, found.y_speed_mps), (1.0, -0.5))
    assert away <= found.velocity_radius_mps
    assert seen.stamp_s == (200_000 + CLOCK_US) / 1e6


def test_kinds_tracks_and_the_watched_radius() -> None:
    looking = sensors(Sensing(watched_m=20.0))
    people = [
        PersonNow("a", "cyclist", 10.0, -3.0, 0.0, 0.0, 0.9),
        PersonNow("b", "ped", 60.0, 0.0, 0.0, 0.0, 0.3),
        PersonNow("c", "sitting", 8.0, -5.0, 0.0, 0.0, 0.3),
    ]
    first = looking.people(people, CAR, EYE, 0)
    again = looking.people(people[::-1], CAR, EYE, 200_000)
    assert first is not None
    assert again is not None
    kinds = {each.track: each.kind for each in first.people}
    assert kinds == {0: PersonKind.ON_WHEELS, 1: PersonKind.ON_FOOT}
    assert {each.track for each in again.people} == {0, 1}


def test_more_people_than_a_set_takes_make_the_watched_disc_smaller() -> None:
    looking = sensors(Sensing(watched_m=30.0))
    crowd = [PersonNow(f"p{k}", "ped", 5.0 + 0.7 * k, -2.0, 0.0, 0.0, 0.3) for k in range(40)]
    seen = looking.people(crowd[::-1], CAR, EYE, 0)
    assert seen is not None
    assert len(seen.people) == 32
    reported = {each.track for each in seen.people}
    # Numbers are given in the order of looking: the farthest came first.
    left_out = [person for k, person in enumerate(crowd[::-1]) if k not in reported]
    nearest_m = min(math.dist((p.x_m, p.y_m), (CAR.x_m, CAR.y_m)) for p in left_out) - 0.3
    assert 0.0 < seen.watched_radius_m <= nearest_m
    assert seen.watched_radius_m < 30.0


def test_what_is_lost_is_lost() -> None:
    gone = Sensing(
        dropped=0.0, dropouts=(Dropout("localisation", 1.0, 2.0), Dropout("people", 3.0, 4.0))
    )
    looking = sensors(gone)
    places = [looking.localised(CAR, k * 500_000) is None for k in range(6)]
    assert places == [False, False, True, True, False, False]
    sets = [looking.people([], CAR, EYE, k * 500_000) is None for k in range(9)]
    assert sets == [False] * 6 + [True, True, False]
    always = sensors(Sensing(dropped=1.0))
    assert always.localised(CAR, 0) is None


def test_ghosts_come_and_are_given_up_as_people_are() -> None:
    """Reported from 1 s to 2 s; then for 2 s as they were last, for 1 s as somebody assumed."""
    looking = sensors(Sensing(ghosts=(Ghost(9.0, 0.0, 1.0, 2.0),)))
    found: list[list[tuple[PersonKind, float]]] = []
    for at_s in (0.5, 1.5, 2.0, 3.0, 4.0, 4.5, 5.0, 5.5):
        seen = looking.people([], CAR, EYE, round(at_s * 1e6))
        assert seen is not None
        found.append([(each.kind, each.age_s) for each in seen.people])
    foot, assumed = PersonKind.ON_FOOT, PersonKind.ASSUMED
    assert found == [
        [], [(foot, 0.0)], [(foot, 0.0)], [(foot, 1.0)], [(foot, 2.0)], [(assumed, 2.5)],
        [(assumed, 3.0)], [],
    ]  # fmt: skip


@pytest.mark.parametrize(("kind", "speed_mps"), [("ped", 2.5), ("cyclist", 7.0)])
def test_who_is_given_up_is_covered_by_somebody_assumed(kind: str, speed_mps: float) -> None:
    """As the runtime asks: nobody is lost for a plan that was made while they were told of."""
    looking, bounds = sensors(Sensing(), 3), rig().settings.sensors
    sets = []
    for stamp_us in range(0, 3_200_000, 200_000):
        there = [person(12.0, -3.0, kind)] if stamp_us < 800_000 else []
        seen = looking.people(there, CAR, EYE, stamp_us)
        assert seen is not None
        people = tuple(
            observed_person(each, (stamp_us, stamp_us), now_us=stamp_us, settings=bounds)
            for each in seen.people
        )
        watched = Watched(CAR.x_m, CAR.y_m, 30.0)
        sets.append(SeenScene(stamp_us / 1e6, at_clock(people, stamp_us / 1e6), watched))
    told = [each for each in sets if any(not person.assumed for person in each.people)]
    given_up = [each for each in sets if any(person.assumed for person in each.people)]
    assert (len(told), len(given_up)) == (14, 2)

    def found(now: SeenScene) -> set[Hypothesis]:
        """Of plans that were made with the last measurement."""
        return {
            each.hypothesis
            for before in told[3:]
            for each in people_violations(
                before, now, required=Relation.OVERLAPS, unseen_speed_mps=speed_mps
            )
        }

    assert [found(each) for each in given_up] == [set(), set()]
    nobody = SeenScene(given_up[0].stamp_s, (), given_up[0].watched)
    assert found(nobody) == {Hypothesis.NOBODY_LOST}


def at_clock(people: tuple[ObservedPerson, ...], now_s: float) -> tuple[SeenPerson, ...]:
    """With guards on the clock, not after the stamp."""
    return tuple(
        SeenPerson(
            each.name, dataclasses.replace(each.guard, at_s=now_s + each.guard.at_s), each.assumed
        )
        for each in people
    )


def test_who_goes_behind_a_van_is_remembered_for_two_seconds() -> None:
    looking = sensors(Sensing(occluders=(VAN,), assumes_unseen=False))
    ages = []
    for k in range(13):
        place = person(16.0, 0.0) if k == 0 else person(16.0, 4.5)
        seen = looking.people([place], CAR, EYE, k * 200_000)
        assert seen is not None
        foot = [each for each in seen.people if each.kind is PersonKind.ON_FOOT]
        ages.append([round(each.age_s, 3) for each in foot])
    assert ages[0] == [0.0]
    assert ages[5] == [1.0]
    assert ages[11:] == [[], []]


points = st.tuples(st.floats(-5.0, 30.0), st.floats(-15.0, 15.0))


@given(points)
def test_hidden_is_what_a_line_of_many_points_meets(place: tuple[float, float]) -> None:
    """The other way: walk along the line of sight."""
    steps = 4000
    line = (
        (EYE[0] + k / steps * (place[0] - EYE[0]), EYE[1] + k / steps * (place[1] - EYE[1]))
        for k in range(steps + 1)
    )
    inside = [(VAN.x_min_m < x < VAN.x_max_m, VAN.y_min_m < y < VAN.y_max_m) for x, y in line]
    met = any(a and b for a, b in inside)
    if met:
        assert hidden(place, EYE, (VAN,))
    elif hidden(place, EYE, (VAN,)):
        # A line that touches a corner may slip between two of the points.
        corners = [(x, y) for x in (10.0, 14.0) for y in (2.0, 4.0)]
        assert min(_aside(corner, place) for corner in corners) < 0.02


def _aside(corner: tuple[float, float], place: tuple[float, float]) -> float:
    ux, uy = place[0] - EYE[0], place[1] - EYE[1]
    way = math.hypot(ux, uy)
    if way == 0.0:
        return math.inf
    return abs(ux * (corner[1] - EYE[1]) - uy * (corner[0] - EYE[0])) / way


@given(points, st.floats(0.0, math.tau))
def test_nobody_comes_out_of_a_shadow_but_through_a_disc(
    place: tuple[float, float], towards: float
) -> None:
    """Walk from somewhere hidden: where it is seen first, one of the discs is."""
    if not hidden(place, EYE, (VAN,)) or (10.0 <= place[0] <= 14.0 and 2.0 <= place[1] <= 4.0):
        return
    x, y = place
    for _ in range(3000):
        x, y = x + 0.01 * math.cos(towards), y + 0.01 * math.sin(towards)
        if 10.0 <= x <= 14.0 and 2.0 <= y <= 4.0:
            # Nobody walks through a van.
            return
        if not hidden((x, y), EYE, (VAN,)):
            break
    else:
        return
    if math.dist((x, y), EYE) > 29.0:
        return
    discs = list(shadow_discs(EYE, VAN, reach_m=30.0))
    assert min(math.dist((x, y), (dx, dy)) - r for dx, dy, r in discs) <= 0.05


def test_no_shadow_from_inside_a_box_or_out_of_reach() -> None:
    assert list(shadow_discs((12.0, 3.0), VAN, reach_m=30.0)) == []
    assert list(shadow_discs((-50.0, 3.0), VAN, reach_m=30.0)) == []


def test_somebody_is_assumed_at_the_edges_of_a_shadow_where_the_scenario_says_so() -> None:
    for assumes, expected in ((True, {PersonKind.ASSUMED}), (False, set())):
        looking = sensors(Sensing(occluders=(VAN,), assumes_unseen=assumes))
        seen = looking.people([], CAR, EYE, 0)
        assert seen is not None
        assert {each.kind for each in seen.people} == expected
        # With room for the largest body about the shadow's edge itself.
        bare = [r for _, _, r in shadow_discs(EYE, VAN, reach_m=30.0)]
        radii = [each.position_radius_m for each in seen.people]
        assert all(any(r >= b + 0.9 - 1e-9 for b in bare) for r in radii)
