"""Claim: whoever is told limits of speed and acceleration keeps to them exactly, at every step of
any length, whatever the car does; and moves as their velocities say."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.walker_cases import ROAD, STEP_S, car_at, fastest, present, walk
from workbench.errors import InputError
from workbench.estimation.motion_parameters import shipped_motion
from workbench.runtime import MotionLimits
from workbench.simulation.walkers.cues import AtTime
from workbench.simulation.walkers.field_walkers import Errand, FieldCrowd, Ground
from workbench.simulation.walkers.moving import GUARD, Mover, Who
from workbench.simulation.walkers.pedestrian import CarNow, Pedestrian
from workbench.simulation.walkers.pursuing import Chase, Pursuer
from workbench.simulation.walkers.scripted import Leg, Script, Scripted
from workbench.simulation.walkers.wandering import Wanderer

WHO = Who("somebody", "ped", 0.3)
_STEPS = st.lists(st.floats(1e-3, 0.3), min_size=40, max_size=40)
_PLACE = st.tuples(st.floats(-5.0, 40.0), st.floats(-12.0, 12.0))
_SLOW = st.tuples(st.floats(-1.7, 1.7), st.floats(-1.7, 1.7))


def _jumpy(steps: list[float]) -> Callable[[float], CarNow]:
    """A car whose place and speed jump about, which no limit may hang on."""

    def car(t_s: float) -> CarNow:
        return car_at(20.0 + 15.0 * math.sin(7.0 * t_s), 4.0 * math.cos(3.0 * t_s))

    return car


def _wanderer(place: tuple[float, float], velocity: tuple[float, float], seed: int) -> Pedestrian:
    return Wanderer(WHO, (place, velocity), limits=GUARD, hold_s=(0.05, 1.0), seed=seed)


def _pursuer(place: tuple[float, float], velocity: tuple[float, float], seed: int) -> Pedestrian:
    chase = Chase(place, velocity, AtTime(0.01 * seed), GUARD, gives_up_s=2.0)
    return Pursuer(WHO, chase, ROAD)


def _in_field(place: tuple[float, float], velocity: tuple[float, float], seed: int) -> Pedestrian:
    wild = dataclasses.replace(shipped_motion().field, relaxation_s=0.05)
    ground = Ground(wild, GUARD, ((20.0, 0.0, 1.0),), noise_mps2=5.0)
    errand = Errand(WHO, place, velocity, ((60.0, 5.0),), 2.4)
    return FieldCrowd((errand,), ground, (), seed=seed).people[0]


def _scripted(place: tuple[float, float], velocity: tuple[float, float], seed: int) -> Pedestrian:
    legs = tuple(Leg((k * 3.0 % 7.0, -k * 5.0 % 11.0), 2.5) for k in range(1, 9))
    return Scripted(WHO, Script(place, legs, acceleration_mps2=1.5))


@pytest.mark.parametrize("made", [_wanderer, _pursuer, _in_field, _scripted])
@given(place=_PLACE, velocity=_SLOW, seed=st.integers(0, 100), steps=_STEPS)
@settings(max_examples=30, deadline=None)
def test_speed_and_acceleration_stay_within_the_guard(
    made: Callable[..., Pedestrian],
    place: tuple[float, float],
    velocity: tuple[float, float],
    seed: int,
    steps: list[float],
) -> None:
    found = walk(made(place, velocity, seed), sum(steps) - 1e-6, _jumpy(steps), steps)
    speed, push = fastest(found)
    assert speed <= GUARD.speed_mps
    assert push <= GUARD.acceleration_mps2


@given(place=_PLACE, velocity=_SLOW, steps=_STEPS)
@settings(max_examples=30, deadline=None)
def test_places_change_by_the_mean_velocity(
    place: tuple[float, float], velocity: tuple[float, float], steps: list[float]
) -> None:
    found = present(walk(_wanderer(place, velocity, 1), sum(steps) - 1e-6, _jumpy(steps), steps))
    for (s, a), (t, b) in itertools.pairwise(found):
        assert b.x_m - a.x_m == pytest.approx(0.5 * (t - s) * (a.vx_mps + b.vx_mps), abs=1e-9)
        assert b.y_m - a.y_m == pytest.approx(0.5 * (t - s) * (a.vy_mps + b.vy_mps), abs=1e-9)


@given(velocity=_SLOW, push=st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)))
def test_a_push_within_both_limits_is_not_cut(
    velocity: tuple[float, float], push: tuple[float, float]
) -> None:
    mover = Mover((0.0, 0.0), velocity, MotionLimits(100.0, 100.0))
    mover.push(push, 0.5)
    assert mover.velocity[0] == pytest.approx(velocity[0] + 0.5 * push[0])
    assert mover.place[1] == pytest.approx(0.5 * velocity[1] + 0.125 * push[1])


def test_limits_are_reached_and_not_only_kept() -> None:
    mover = Mover((0.0, 0.0), (0.0, 0.0), GUARD)
    mover.push((99.0, 0.0), 1.0)
    assert mover.velocity[0] == pytest.approx(1.5)
    mover.push((99.0, 0.0), 1.0)
    assert mover.velocity[0] == pytest.approx(2.5)


def test_an_acceleration_by_chance_is_held_and_then_drawn_anew() -> None:
    wide = MotionLimits(100.0, 1.5)
    wanderer = Wanderer(WHO, ((0.0, 0.0), (0.0, 0.0)), limits=wide, hold_s=(0.5, 0.5), seed=1)
    found = [p for _, p in present(walk(wanderer, 4.0, _jumpy([])))]
    pushes = [round((b.vx_mps - a.vx_mps) / STEP_S, 6) for a, b in itertools.pairwise(found)]
    assert [len(list(same)) for _, same in itertools.groupby(pushes)] == [32] * 8


def test_the_same_seed_gives_the_same_walk_and_another_one_another() -> None:
    def last(seed: int) -> object:
        return walk(_wanderer((0.0, 0.0), (1.0, 0.0), seed), 5.0, _jumpy([]))[-1]

    assert last(3) == last(3)
    assert last(3) != last(4)


@pytest.mark.parametrize(
    ("place", "velocity", "limits"),
    [
        ((0.0, 0.0), (2.6, 0.0), GUARD),
        ((math.nan, 0.0), (0.0, 0.0), GUARD),
        ((0.0, 0.0), (0.0, 0.0), MotionLimits(0.0, 1.0)),
        ((0.0, 0.0), (0.0, 0.0), MotionLimits(1.0, -1.0)),
    ],
)
def test_a_start_outside_of_the_limits_is_refused(
    place: tuple[float, float], velocity: tuple[float, float], limits: MotionLimits
) -> None:
    with pytest.raises(InputError, match="expected"):
        Mover(place, velocity, limits)
