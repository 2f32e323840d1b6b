"""Claim: people of a potential field get to their goals and keep away from things, each other and,
where they heed it, the car; a seed gives the same motion however the steps are asked for."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from tests.walker_cases import STEP_S, car_at, present, standing_car, walk
from workbench.errors import InputError
from workbench.estimation.field_paths import DISC_NUMBERS, VEHICLE_NUMBERS, Others, paths
from workbench.estimation.potential_field import Field, Repulsion
from workbench.runtime import MotionLimits
from workbench.simulation.walkers.field_walkers import Errand, FieldCrowd, FieldWalker, Ground
from workbench.simulation.walkers.moving import GUARD, Who
from workbench.simulation.walkers.pedestrian import PersonNow
from workbench.simulation.walkers.scripted import Script, Scripted

_FIELD = Field(1.0, 0.5, Repulsion(2.0, 0.4), Repulsion(2.0, 1.5))
_Goals = tuple[tuple[float, float], ...]


def _errand(begin: tuple[float, float], goals: _Goals, name: str = "a") -> Errand:
    return Errand(Who(name, "ped", 0.3), begin, (0.0, 0.0), goals, 1.3)


def _crowd(*errands: Errand, seed: int = 0, noise: float = 0.0, **ground: object) -> FieldCrowd:
    given = Ground(_FIELD, GUARD, noise_mps2=noise, **ground)  # type: ignore[arg-type]
    return FieldCrowd(errands, given, (), seed=seed)


def _steps(people: Sequence[FieldWalker], until_s: float) -> list[list[PersonNow]]:
    found = []
    for k in range(round(until_s / STEP_S)):
        for each in people:
            each.advance(k * STEP_S, (k + 1) * STEP_S, car_at(-1000.0, 0.0))
        found.append([each.crowd.at(each.index) for each in people])
    return found


def _gap(a: PersonNow, b: PersonNow) -> float:
    return math.dist((a.x_m, a.y_m), (b.x_m, b.y_m))


def test_they_get_to_one_goal_after_the_other() -> None:
    person = _crowd(_errand((0.0, 0.0), ((6.0, 0.0), (6.0, 8.0)))).people[0]
    found = present(walk(person, 25.0, standing_car()))
    assert min(math.dist((6.0, 0.0), (p.x_m, p.y_m)) for _, p in found) < 1.0
    assert math.dist((6.0, 8.0), (found[-1][1].x_m, found[-1][1].y_m)) < 0.2


def test_without_noise_they_go_as_the_predictions_of_the_field_say() -> None:
    errand, loose = _errand((0.0, 0.0), ((9.0, 4.0),)), MotionLimits(100.0, 100.0)
    person = FieldCrowd((errand,), Ground(_FIELD, loose), (), seed=0).people[0]
    walked = present(walk(person, 4.1, standing_car(4.0)))
    car = np.array([[4.0, 0.0, 0.0, 2.26, 0.47, 0.88, 0.0]])
    others = Others(np.empty((0, DISC_NUMBERS)), car.reshape(1, VEHICLE_NUMBERS))
    begin, goal = np.array([[0.0, 0.0, 0.0, 0.0, 1.3]]), np.array([[9.0, 4.0]])
    wanted = paths(_FIELD, begin, goal, np.array([[1.0, 2.0, 4.0]]), others=others)[0]
    for t_s, place in zip((1.0, 2.0, 4.0), wanted, strict=True):
        now = next(p for t, p in walked if t >= t_s)
        assert (now.x_m, now.y_m) == pytest.approx(tuple(place), abs=0.01)
    alone = paths(_FIELD, begin, goal, np.array([[1.0, 2.0, 4.0]]), others=Others.none())[0]
    assert np.abs(wanted - alone).max() > 0.1


def test_they_pass_an_obstacle_farther_away_than_without_it() -> None:
    def nearest(**ground: object) -> float:
        person = _crowd(_errand((0.0, 0.1), ((12.0, 0.1),)), **ground).people[0]
        found = present(walk(person, 12.0, standing_car()))
        return min(math.dist((6.0, 0.0), (p.x_m, p.y_m)) for _, p in found)

    assert nearest(obstacles=((6.0, 0.0, 1.0),)) > nearest() + 0.1


def test_they_heed_the_car_only_where_told() -> None:
    def nearest(heeds: bool) -> tuple[float, float]:
        person = _crowd(_errand((0.0, 3.5), ((20.0, 3.5),)), heeds_car=heeds).people[0]
        found = present(walk(person, 16.0, standing_car(9.0)))
        return min(p.y_m for _, p in found), max(p.y_m for _, p in found)

    assert nearest(False) == pytest.approx((3.5, 3.5))
    assert nearest(True) != pytest.approx((3.5, 3.5), abs=1e-3)


def test_two_who_meet_give_way_and_so_does_one_to_somebody_who_stands() -> None:
    there = _errand((0.0, 0.0), ((10.0, 0.0),), "a")
    back = _errand((10.0, 0.1), ((0.0, 0.1),), "b")
    both = _steps(_crowd(there, back).people, 8.0)
    assert min(_gap(a, b) for a, b in both) > 0.12
    standing = Scripted(Who("c", "ped", 0.3), Script((5.0, 0.05)))
    crowd = FieldCrowd((there,), Ground(_FIELD, GUARD), (standing,), seed=0)
    alone = _steps(_crowd(there).people, 8.0)
    passing = _steps(crowd.people, 8.0)
    assert max(abs(row[0].y_m) for row in alone) < 1e-9
    assert max(abs(row[0].y_m) for row in passing) > 0.05


def test_a_seed_gives_the_same_motion_whoever_is_asked_first() -> None:
    def made(seed: int) -> FieldCrowd:
        there = _errand((0.0, 0.0), ((10.0, 0.0),), "a")
        back = _errand((10.0, 0.1), ((0.0, 0.1),), "b")
        return _crowd(there, back, seed=seed, noise=0.4)

    one, other = made(5), made(5)
    first = _steps(one.people, 5.0)
    second = [list(reversed(row)) for row in _steps(tuple(reversed(other.people)), 5.0)]
    assert first == second
    assert first[-1] != _steps(made(6).people, 5.0)[-1]


def test_noise_moves_them_about_the_way_without_it() -> None:
    quiet = present(
        walk(_crowd(_errand((0.0, 0.0), ((40.0, 0.0),))).people[0], 10.0, standing_car())
    )
    ends = [
        present(
            walk(
                _crowd(_errand((0.0, 0.0), ((40.0, 0.0),)), seed=k, noise=0.5).people[0],
                10.0,
                standing_car(),
            )
        )[-1][1].y_m
        for k in range(12)
    ]
    assert quiet[-1][1].y_m == pytest.approx(0.0, abs=1e-9)
    assert np.std(ends) > 0.05
    assert abs(np.mean(ends)) < 3.0 * np.std(ends) / math.sqrt(len(ends)) + 0.05


def test_no_goals_and_negative_noise_are_refused() -> None:
    with pytest.raises(InputError, match="at least one goal"):
        _errand((0.0, 0.0), ())
    with pytest.raises(InputError, match="noise_mps2"):
        Ground(_FIELD, GUARD, noise_mps2=-0.1)
