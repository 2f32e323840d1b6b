"""Claim: whoever wants to be hit gets to a car that drives on wherever their limits let them, does
not walk into one that stands, and gives up in the end."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.walker_cases import ROAD, STEP_S, car_at, present, standing_car, steady, walk
from workbench.errors import InputError
from workbench.simulation.walkers.cues import AtTime, CarPassed
from workbench.simulation.walkers.moving import GUARD, Who
from workbench.simulation.walkers.pedestrian import CarNow
from workbench.simulation.walkers.pursuing import Chase, Pursuer

WHO = Who("adversary", "ped", 0.3)
_NOW = AtTime(-1.0)


def _gap(pursuer: Pursuer, until_s: float, car: Callable[[float], CarNow]) -> float:
    """Smallest distance (m) between the body of the car and theirs, below 0 for a hit."""
    found = present(walk(pursuer, until_s, car))
    return min(car(t).body.distance(p.x_m, p.y_m) for t, p in found) - WHO.body_radius_m


@given(ahead_m=st.floats(12.0, 30.0), side_m=st.floats(-8.0, 8.0))
@settings(max_examples=40, deadline=None)
def test_they_hit_a_car_that_drives_on(ahead_m: float, side_m: float) -> None:
    pursuer = Pursuer(WHO, Chase((ahead_m, side_m), (0.0, 0.0), _NOW, GUARD), ROAD)
    assert _gap(pursuer, 12.0, steady(2.8)) < 0.0


@given(side_m=st.floats(2.0, 6.0), walks=st.floats(-1.5, 1.5))
@settings(max_examples=20, deadline=None)
def test_they_hit_it_from_a_walk_too(side_m: float, walks: float) -> None:
    pursuer = Pursuer(WHO, Chase((25.0, side_m), (walks, 0.0), CarPassed(8.0), GUARD), ROAD)
    assert _gap(pursuer, 15.0, steady(2.8)) < 0.0


def test_they_hit_it_on_a_bend() -> None:
    from workbench.models.spline_path import SplinePath
    from workbench.simulation.people import Body

    bend = SplinePath.through(
        [(15.0 * math.sin(0.1 * k), 15.0 - 15.0 * math.cos(0.1 * k)) for k in range(25)]
    )

    def car(t_s: float) -> CarNow:
        (x, y), heading = bend.position(2.8 * t_s), float(bend.heading(2.8 * t_s))
        return CarNow(Body(float(x), float(y), heading, 2.26, 0.47, 0.88), 2.8, 2.8 * t_s)

    for begin in ((6.0, 14.0), (22.0, 8.0)):
        assert _gap(Pursuer(WHO, Chase(begin, (0.0, 0.0), _NOW, GUARD), bend), 12.0, car) < 0.0


def test_they_wait_for_their_cue() -> None:
    pursuer = Pursuer(WHO, Chase((30.0, 6.0), (0.0, 0.0), CarPassed(20.0), GUARD), ROAD)
    found = present(walk(pursuer, 20.0, steady(2.8)))
    assert next(t for t, p in found if p.vy_mps != 0.0) == pytest.approx(20.0 / 2.8, abs=0.1)


def test_they_come_up_to_a_car_that_stands_and_not_into_it() -> None:
    pursuer = Pursuer(WHO, Chase((30.0, 6.0), (0.0, 0.0), _NOW, GUARD), ROAD)
    assert 0.4 < _gap(pursuer, 11.0, standing_car(25.0)) < 0.8


def test_they_go_back_when_they_give_up() -> None:
    chase = Chase((30.0, 6.0), (0.0, 0.0), _NOW, GUARD, gives_up_s=4.0)
    last = present(walk(Pursuer(WHO, chase, ROAD), 20.0, standing_car(25.0)))[-1][1]
    assert math.dist((last.x_m, last.y_m), (30.0, 6.0)) < 0.1


def test_the_first_push_is_the_one_of_the_law() -> None:
    pursuer = Pursuer(WHO, Chase((20.0, 5.0), (0.0, 0.0), _NOW, GUARD), ROAD)
    pursuer.advance(0.0, STEP_S, car_at(10.0, 2.8))
    person = pursuer.now
    assert person is not None
    push = (person.vx_mps / STEP_S, person.vy_mps / STEP_S)
    times = [0.1 * k for k in range(1, 61)]
    needed = [
        (2.0 * (11.0 + 2.8 * t - 20.0) / t**2, -10.0 / t**2)
        for t in times
        if math.hypot(11.0 + 2.8 * t - 20.0, 5.0) <= 2.5 * t
    ]
    expected = next(each for each in needed if math.hypot(*each) <= 1.5)
    assert push == pytest.approx(expected, rel=1e-6)


def test_lengths_below_zero_are_refused() -> None:
    with pytest.raises(InputError, match="standoff_m: expected"):
        Chase((0.0, 0.0), (0.0, 0.0), _NOW, GUARD, standoff_m=-1.0)
