"""People who want to be hit: within their limits they head to where the car will be."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.models.spline_path import SplinePath
from workbench.runtime import MotionLimits
from workbench.simulation.frames import Point
from workbench.simulation.walkers.cues import Cue
from workbench.simulation.walkers.moving import Mover, Who
from workbench.simulation.walkers.pedestrian import CarNow, PersonNow

_GRID_S = 0.1
_ANEW_S = 0.05
_SOONEST, _LATEST = 1, 60
_STANDS_MPS = 0.1
_TABLE_M = 0.5


@final
@dataclass(frozen=True, slots=True)
class Chase:
    """What somebody does who wants to be hit.

    begin (m), velocity (m/s): until the cue they go on with it; ahead_m: aims at the point of the
    car so far before its rear axle; standoff_m: stops so far from the body of a standing car;
    gives_up_s: after the cue; they then go back to where they were at the cue. Raises InputError
    for a length or time below 0.
    """

    begin: Point
    velocity: Point
    cue: Cue
    limits: MotionLimits
    ahead_m: float = 1.0
    standoff_m: float = 0.6
    gives_up_s: float = 12.0

    def __post_init__(self) -> None:
        for name in ("ahead_m", "standoff_m", "gives_up_s"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InputError(f"{name}: expected a number >= 0, got {getattr(self, name)}")


@final
class Pursuer:
    """Somebody who knows the car's place, speed and path, and is bound by nothing but limits.

    The law: with the car where its speed now takes it along its path, the earliest time T at which
    a constant acceleration within the limit leads to its point: a = 2 (aim(T) - p - v T) / T^2.
    Where there is none within 6 s, the one that needs least. Asked anew every 0.05 s; `Mover` cuts
    what would break the limits.
    """

    def __init__(self, who: Who, chase: Chase, path: SplinePath) -> None:
        """At the begin; path: the car's. Raises InputError as `Mover`."""
        self._who, self._chase = who, chase
        self._mover = Mover(chase.begin, chase.velocity, chase.limits)
        count = max(2, round(path.length_m / _TABLE_M) + 1)
        stations = [path.length_m * k / (count - 1) for k in range(count)]
        self._spacing_m = stations[1]
        self._table = [(float(x), float(y)) for x, y in path.position(stations)]
        self._cued_s: float | None = None
        self._home = chase.begin
        self._push, self._asked_s = (0.0, 0.0), -math.inf

    @property
    def now(self) -> PersonNow | None:
        """As `Pedestrian` says."""
        return self._who.at(self._mover.place, self._mover.velocity)

    def advance(self, from_s: float, until_s: float, car: CarNow) -> None:
        """As `Pedestrian` says."""
        chase, mover, duration_s = self._chase, self._mover, until_s - from_s
        if self._cued_s is None and chase.cue.given(from_s, mover.place, car):
            self._cued_s, self._home = from_s, mover.place
        if self._cued_s is None:
            mover.push((0.0, 0.0), duration_s)
        elif from_s - self._cued_s > chase.gives_up_s:
            mover.walk_to(self._home, chase.limits.speed_mps, duration_s, stops=True)
        elif abs(car.speed_mps) <= _STANDS_MPS:
            self._stand_by(car, duration_s)
        else:
            if from_s - self._asked_s >= _ANEW_S - 1e-9:
                self._push, self._asked_s = self._intercept(car), from_s
            mover.push(self._push, duration_s)

    def _stand_by(self, car: CarNow, duration_s: float) -> None:
        """Up to a standing car, and no farther than that."""
        body, (x, y) = car.body, self._mover.place
        left_m = body.distance(x, y) - self._chase.standoff_m - self._who.body_radius_m
        aim = self._at(car.station_m + self._chase.ahead_m)
        away_m = math.hypot(aim[0] - x, aim[1] - y)
        share = max(0.0, left_m) / away_m if away_m > 0.0 else 0.0
        goal = (x + share * (aim[0] - x), y + share * (aim[1] - y))
        self._mover.walk_to(goal, self._chase.limits.speed_mps, duration_s, stops=True)

    def _intercept(self, car: CarNow) -> Point:
        """The acceleration (m/s^2) of the law above."""
        limit = self._chase.limits.acceleration_mps2
        least, found = math.inf, (0.0, 0.0)
        for push in self._pushes(car):
            size = math.hypot(*push)
            if size < least:
                least, found = size, push
            if size <= limit:
                break
        return found

    def _pushes(self, car: CarNow) -> Iterator[Point]:
        (x, y), (vx, vy) = self._mover.place, self._mover.velocity
        fastest = self._chase.limits.speed_mps
        for k in range(_SOONEST, _LATEST + 1):
            t = k * _GRID_S
            aim = self._at(car.station_m + car.speed_mps * t + self._chase.ahead_m)
            # Farther than the speed limit allows: no acceleration is of use.
            if math.hypot(aim[0] - x, aim[1] - y) <= fastest * t or k == _LATEST:
                yield 2.0 * (aim[0] - x - vx * t) / t**2, 2.0 * (aim[1] - y - vy * t) / t**2

    def _at(self, station_m: float) -> Point:
        """The path there, straight on behind its end and before its begin."""
        at = station_m / self._spacing_m
        k = min(max(int(at), 0), len(self._table) - 2)
        (ax, ay), (bx, by) = itertools.islice(self._table, k, k + 2)
        return ax + (at - k) * (bx - ax), ay + (at - k) * (by - ay)
