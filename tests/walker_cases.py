"""Cars and steps for the tests of simulated people."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence

from workbench.models.spline_path import SplinePath
from workbench.simulation.people import Body
from workbench.simulation.walkers.pedestrian import CarNow, Pedestrian, PersonNow

ROAD = SplinePath.through([(float(x), 0.0) for x in range(0, 61, 10)])
STEP_S = 1.0 / 64.0
"""Sums of it are exact."""


def car_at(station_m: float, speed_mps: float) -> CarNow:
    """A GEM e2's body on a straight road along x."""
    return CarNow(Body(station_m, 0.0, 0.0, 2.26, 0.47, 0.88), speed_mps, station_m)


FAR_AWAY = car_at(-1000.0, 0.0)


def steady(speed_mps: float, from_m: float = 0.0) -> Callable[[float], CarNow]:
    """A car that drives evenly."""
    return lambda t_s: car_at(from_m + speed_mps * t_s, speed_mps)


def standing_car(station_m: float = -1000.0) -> Callable[[float], CarNow]:
    """A car that stands."""
    return lambda t_s: car_at(station_m, 0.0)


def walk(
    person: Pedestrian,
    until_s: float,
    car: Callable[[float], CarNow],
    steps: Iterable[float] | None = None,
) -> list[tuple[float, PersonNow | None]]:
    """Instants and people, at 0 and after every step."""
    found, t_s = [(0.0, person.now)], 0.0
    given = iter(steps) if steps is not None else None
    while t_s < until_s - 1e-9:
        step_s = STEP_S if given is None else next(given)
        person.advance(t_s, t_s + step_s, car(t_s))
        t_s += step_s
        found.append((t_s, person.now))
    return found


def present(found: Sequence[tuple[float, PersonNow | None]]) -> list[tuple[float, PersonNow]]:
    """Those instants at which they are there."""
    return [(t_s, person) for t_s, person in found if person is not None]


def fastest(found: Sequence[tuple[float, PersonNow | None]]) -> tuple[float, float]:
    """Largest speed (m/s), and largest change of velocity per time (m/s^2)."""
    people = present(found)
    speed = max(math.hypot(p.vx_mps, p.vy_mps) for _, p in people)
    push = max(
        math.hypot(b.vx_mps - a.vx_mps, b.vy_mps - a.vy_mps) / (t - s)
        for (s, a), (t, b) in itertools.pairwise(people)
    )
    return speed, push
