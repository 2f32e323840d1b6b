"""Claim: scripted people go where they are told to, when they are told to, and come to rest there;
what they wait for of the car does not depend on how fast it is."""

from __future__ import annotations

import itertools
import math

import pytest

from tests.walker_cases import FAR_AWAY, ROAD, car_at, present, standing_car, steady, walk
from workbench.errors import InputError
from workbench.simulation.scenarios.frames_of_path import PathFrame
from workbench.simulation.walkers.cues import AtTime, CarPassed, CarWithin
from workbench.simulation.walkers.moving import Who, body_radius_m
from workbench.simulation.walkers.scripted import Leg, Script, Scripted, group

WHO = Who("somebody", "ped", 0.3)


def _person(
    *legs: Leg, begin: tuple[float, float] = (0.0, 0.0), start_mps: float = 0.0
) -> Scripted:
    return Scripted(WHO, Script(begin, legs, start_mps))


def test_who_has_no_legs_stands() -> None:
    last = present(walk(_person(begin=(3.0, 4.0)), 5.0, standing_car()))[-1][1]
    assert (last.x_m, last.y_m, last.vx_mps, last.vy_mps) == (3.0, 4.0, 0.0, 0.0)


def test_a_walk_takes_the_time_that_speed_and_acceleration_give_and_ends_at_rest() -> None:
    found = present(walk(_person(Leg((0.0, 7.0), 1.4)), 12.0, standing_car()))
    half = next(t for t, p in found if p.y_m >= 3.5)
    # 1.4 / 1.2 s to walk off, in which they get half as far.
    assert half == pytest.approx(3.5 / 1.4 + 0.5 * 1.4 / 1.2, abs=0.03)
    last = found[-1][1]
    assert math.dist((last.x_m, last.y_m), (0.0, 7.0)) < 0.02
    assert math.hypot(last.vx_mps, last.vy_mps) < 0.02
    assert max(p.y_m for _, p in found) < 7.05


def test_who_walks_already_does_not_walk_off() -> None:
    found = present(walk(_person(Leg((50.0, 0.0), 1.3), start_mps=1.3), 10.0, standing_car()))
    assert found[-1][1].x_m == pytest.approx(13.0, abs=1e-6)


@pytest.mark.parametrize("speed_mps", [0.7, 2.8, 6.0])
def test_a_station_or_distance_gives_the_same_place_of_the_car_at_any_speed(
    speed_mps: float,
) -> None:
    begun = []
    for cue in (CarPassed(20.0), CarWithin(5.0)):
        person = _person(Leg((30.0, -5.0), 1.4, cue), begin=(30.0, 5.0))
        found = present(walk(person, 60.0 / speed_mps, steady(speed_mps)))
        begun.append(speed_mps * next(t for t, p in found if p.vy_mps != 0.0))
    assert begun[0] == pytest.approx(20.0, abs=0.2)
    # 4.12 m to the side of its body: the rest of 5 m ahead of its bumper.
    ahead_m = math.sqrt(5.0**2 - 4.12**2)
    assert begun[1] == pytest.approx(30.0 - ahead_m - 2.26, abs=0.2)


def test_a_cue_turns_back_who_is_on_the_way() -> None:
    legs = (Leg((0.0, -30.0), 1.4, AtTime(1.0)), Leg((0.0, 5.0), 1.4, AtTime(6.0)))
    found = present(walk(_person(*legs, begin=(0.0, 5.0)), 20.0, standing_car()))
    least = min(found, key=lambda each: each[1].y_m)
    assert 6.0 < least[0] < 7.5
    assert -3.0 < least[1].y_m < 0.0
    assert found[-1][1].y_m == pytest.approx(5.0, abs=0.05)


def test_a_cue_passes_over_legs_that_are_not_done() -> None:
    along = tuple(Leg((2.0 * k, -3.0), 1.3) for k in range(1, 40))
    person = _person(*along, Leg((6.0, 9.0), 1.3, AtTime(3.0)), begin=(0.0, -3.0))
    assert present(walk(person, 15.0, standing_car()))[-1][1].y_m == pytest.approx(9.0, abs=0.05)


def test_a_pause_begins_at_the_end_of_the_leg_before() -> None:
    legs = (Leg((0.0, 2.0), 1.0), Leg((0.0, 6.0), 1.0, delay_s=3.0))
    found = present(walk(_person(*legs), 15.0, standing_car()))
    resting = [t for t, p in found if t > 1.0 and p.vy_mps < 0.05 and p.y_m < 4.0]
    assert resting[-1] - resting[0] == pytest.approx(3.0, abs=0.2)
    assert all(abs(p.y_m - 2.0) < 0.06 for t, p in found if t in resting)
    assert found[-1][1].y_m == pytest.approx(6.0, abs=0.05)


def test_who_goes_on_at_once_does_not_stop_at_a_corner() -> None:
    corners = ((4.0, 0.0), (4.0, 4.0), (8.0, 4.0))
    found = present(walk(_person(*(Leg(c, 1.2) for c in corners)), 12.0, standing_car()))
    slowest = min(math.hypot(p.vx_mps, p.vy_mps) for t, p in found if 2.0 < t < 8.0)
    assert slowest > 0.6
    for corner in corners:
        assert min(math.dist(corner, (p.x_m, p.y_m)) for _, p in found) < 0.8


def test_people_come_and_leave() -> None:
    script = Script((1.0, 2.0), there_s=(2.0, 4.0))
    found = walk(Scripted(WHO, script), 6.0, standing_car())
    there = [t for t, person in found if person is not None]
    assert (there[0], there[-1]) == (2.0, pytest.approx(4.0, abs=0.02))


def test_a_group_does_the_same_side_by_side() -> None:
    people = group(WHO, Script((0.0, 5.0), (Leg((0.0, -5.0), 1.4),)), ((0.0, 0.0), (1.5, 0.5)))
    one, other = (present(walk(each, 9.0, standing_car())) for each in people)
    assert [each.now.name for each in people if each.now] == ["somebody 1", "somebody 2"]
    for (_, a), (_, b) in zip(one, other, strict=True):
        assert (b.x_m - a.x_m, b.y_m - a.y_m) == (pytest.approx(1.5), pytest.approx(0.5))


def test_legs_of_a_path_keep_their_distance_to_its_left() -> None:
    from workbench.models.spline_path import SplinePath

    circle = SplinePath.through(
        [(20.0 * math.sin(0.1 * k), 20.0 - 20.0 * math.cos(0.1 * k)) for k in range(16)]
    )
    frame = PathFrame(circle)
    begin = (2.0, -4.0)
    legs = frame.legs(begin, (Leg((26.0, -4.0), 1.3),))
    found = present(walk(_person(*legs, begin=frame.place(begin)), 30.0, standing_car()))
    radii = [math.dist((0.0, 20.0), (p.x_m, p.y_m)) for _, p in found]
    assert min(radii) > 23.9
    assert max(radii) < 24.2
    end = frame.place((26.0, -4.0))
    assert math.dist(end, (found[-1][1].x_m, found[-1][1].y_m)) < 0.05


def test_a_path_goes_straight_on_before_and_behind() -> None:
    frame = PathFrame(ROAD)
    assert frame.place((-7.0, 2.0)) == pytest.approx((-7.0, 2.0))
    assert frame.place((65.0, -2.0)) == pytest.approx((65.0, -2.0))
    assert frame.vector((10.0, 0.0), (1.0, 2.0)) == pytest.approx((1.0, 2.0))


def test_cues_of_a_path_stay_on_the_first_piece() -> None:
    legs = PathFrame(ROAD).legs((0.0, 0.0), (Leg((9.0, 0.0), 1.0, AtTime(4.0), 2.0),))
    assert [leg.cue for leg in legs] == [AtTime(4.0), *[None] * 4]
    assert [leg.delay_s for leg in legs] == [2.0, 0.0, 0.0, 0.0, 0.0]
    assert [leg.to[0] for leg in legs] == pytest.approx([1.8, 3.6, 5.4, 7.2, 9.0])


def test_a_cued_delay_runs_from_when_the_cue_was_first_given() -> None:
    person = _person(Leg((0.0, 9.0), 1.0, CarWithin(3.0), 2.0))
    near, far = car_at(0.0, 1.0), FAR_AWAY

    def car(t_s: float) -> object:
        return near if 1.0 <= t_s < 1.5 else far

    found = present(walk(person, 5.0, car))  # type: ignore[arg-type]
    assert next(t for t, p in found if p.vy_mps > 0.0) == pytest.approx(3.0, abs=0.04)


@pytest.mark.parametrize(
    "made",
    [
        lambda: Leg((0.0, math.inf), 1.0),
        lambda: Leg((0.0, 0.0), 0.0),
        lambda: Leg((0.0, 0.0), 1.0, delay_s=-1.0),
        lambda: Script((0.0, 0.0), start_mps=1.0),
        lambda: Script((0.0, 0.0), (Leg((1.0, 0.0), 1.0),), there_s=(2.0, 2.0)),
        lambda: Scripted(WHO, Script((0.0, 0.0), (Leg((0.0, 0.0), 1.0),), 1.0)),
        lambda: Who("a", "ped", 0.0),
    ],
)
def test_what_cannot_be_is_refused(made: object) -> None:
    with pytest.raises(InputError, match="expected"):
        made()  # type: ignore[operator]


def test_bodies_are_those_of_their_kind() -> None:
    kinds = ("ped", "sitting", "cyclist", "skater")
    sizes = [body_radius_m(kind) for kind in kinds]
    assert all(a <= b for a, b in itertools.pairwise(sizes))
    assert sizes[0] == 0.3
    assert sizes[2] == sizes[3] == 0.9
