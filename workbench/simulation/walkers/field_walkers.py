"""People in a potential field: drawn by goals, pushed by things, by each other and by the car."""

from __future__ import annotations

import functools
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from workbench.errors import InputError
from workbench.estimation.field_paths import STEP_S, Values
from workbench.estimation.potential_field import Field, field_step
from workbench.runtime import MotionLimits
from workbench.simulation.frames import Disc, Point
from workbench.simulation.walkers.moving import Mover, Who
from workbench.simulation.walkers.pedestrian import CarNow, Pedestrian, PersonNow

_ABSENT: Disc = (1e6, 1e6, 0.3)
_REACHED_M = 1.0


@final
@dataclass(frozen=True, slots=True)
class Errand:
    """Who walks where: begin (m), velocity there (m/s), goals (m) one after the other, each left
    when it is less than 1 m away, and the speed (m/s) they like."""

    who: Who
    begin: Point
    velocity: Point
    goals: tuple[Point, ...]
    speed_mps: float

    def __post_init__(self) -> None:
        if not self.goals or not all(math.isfinite(v) for goal in self.goals for v in goal):
            raise InputError(
                f"person {self.who.name!r}: expected at least one goal in finite metres, got "
                f"{list(self.goals)}"
            )


@final
@dataclass(frozen=True, slots=True)
class Ground:
    """What moves and limits people: the field, things that stand (x, y, radius, m), whether they
    keep away from the car, and noise_mps2, the standard deviation per axis of an acceleration that
    is drawn every 0.1 s."""

    field: Field
    limits: MotionLimits
    obstacles: tuple[Disc, ...] = ()
    heeds_car: bool = True
    noise_mps2: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.noise_mps2 < math.inf:
            raise InputError(f"noise_mps2: expected a number >= 0, got {self.noise_mps2}")


@final
class FieldCrowd:
    """People of one field, moved together: each sees the others where they were at the step's
    begin. The field's acceleration is asked for every 0.1 s and constant in between."""

    def __init__(
        self, errands: Sequence[Errand], ground: Ground, others: Sequence[Pedestrian], *, seed: int
    ) -> None:
        """others: whom they keep away from but who are moved elsewhere. Raises InputError as
        `Mover`."""
        self._errands, self._ground, self._others = tuple(errands), ground, tuple(others)
        self._movers = [Mover(e.begin, e.velocity, ground.limits) for e in errands]
        self._goals = [0] * len(self._errands)
        self._pushes: list[Point] = [(0.0, 0.0)] * len(self._errands)
        self._left_s = 0.0
        self._until_s = -math.inf
        self._chance = random.Random(f"field {seed}")
        count = len(ground.obstacles) + len(self._others) + len(self._errands) - 1
        self._step = _step(ground.field, max(0, count), int(ground.heeds_car))

    @property
    def people(self) -> tuple[FieldWalker, ...]:
        """Each of them."""
        return tuple(FieldWalker(self, k) for k in range(len(self._errands)))

    def at(self, index: int) -> PersonNow:
        """One of them."""
        mover = self._movers[index]
        return self._errands[index].who.at(mover.place, mover.velocity)

    def advance(self, from_s: float, until_s: float, car: CarNow) -> None:
        """All go on, once for each until_s, whoever of them is asked."""
        t_s = max(from_s, self._until_s)
        self._until_s = max(until_s, self._until_s)
        while until_s - t_s > 1e-12:
            if self._left_s <= 1e-9:
                self._pushes = self._asked(car)
                self._left_s = STEP_S
            duration_s = min(self._left_s, until_s - t_s)
            for mover, push in zip(self._movers, self._pushes, strict=True):
                mover.push(push, duration_s)
            self._left_s -= duration_s
            t_s += duration_s

    def _asked(self, car: CarNow) -> list[Point]:
        body = car.body
        cars = np.array(
            [[body.x_m, body.y_m, body.heading, body.front_m, body.rear_m, body.half_width_m]]
        )
        vehicles = cars.T if self._ground.heeds_car else np.empty((6, 0))
        discs = [*self._ground.obstacles, *(_disc(each.now) for each in self._others)]
        own = [_disc(self.at(k)) for k in range(len(self._errands))]
        return [
            self._push(k, [*discs, *own[:k], *own[k + 1 :]], vehicles)
            for k in range(len(self._errands))
        ]

    def _push(self, index: int, discs: Sequence[Disc], vehicles: Values) -> Point:
        errand, mover = self._errands[index], self._movers[index]
        if math.dist(mover.place, errand.goals[self._goals[index]]) < _REACHED_M:
            self._goals[index] = min(self._goals[index] + 1, len(errand.goals) - 1)
        state = np.array([*mover.place, *mover.velocity])
        goal = np.array(errand.goals[self._goals[index]])
        obstacles = np.array(discs).reshape(-1, 3).T
        after = self._step(state, goal, errand.speed_mps, obstacles, vehicles).full().ravel()
        noise = self._ground.noise_mps2
        return (
            float(after[2] - state[2]) / STEP_S + self._chance.gauss(0.0, noise),
            float(after[3] - state[3]) / STEP_S + self._chance.gauss(0.0, noise),
        )


@final
@dataclass(frozen=True, slots=True, eq=False)
class FieldWalker:
    """One of a `FieldCrowd`."""

    crowd: FieldCrowd
    index: int

    @property
    def now(self) -> PersonNow | None:
        """As `Pedestrian` says."""
        return self.crowd.at(self.index)

    def advance(self, from_s: float, until_s: float, car: CarNow) -> None:
        """As `Pedestrian` says."""
        self.crowd.advance(from_s, until_s, car)


def _disc(person: PersonNow | None) -> Disc:
    return _ABSENT if person is None else (person.x_m, person.y_m, person.body_radius_m)


@functools.lru_cache(maxsize=32)
def _step(field: Field, obstacles: int, vehicles: int) -> ca.Function:
    return field_step(field, STEP_S, obstacles=obstacles, vehicles=vehicles)
