"""A point that moves by pushes and never breaks its limits of speed and acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime import MotionLimits
from workbench.simulation.frames import Point
from workbench.simulation.walkers.pedestrian import PersonNow

GUARD = MotionLimits(2.5, 1.5)
"""Limits of speed (m/s) and acceleration (m/s^2): [guard] of the shipped vehicle file."""

_ROUNDING = 1e-9
_RADIUS_M = {"ped": 0.3, "sitting": 0.4}
_WHEELS_RADIUS_M = 0.9


def body_radius_m(kind: str) -> float:
    """Radius (m) of a disc that contains somebody of a kind; who is not on foot has wheels."""
    return _RADIUS_M.get(kind, _WHEELS_RADIUS_M)


@final
@dataclass(frozen=True, slots=True)
class Who:
    """Name, kind and body of somebody; radius in m. Raises InputError unless it is above 0."""

    name: str
    kind: str
    body_radius_m: float

    def __post_init__(self) -> None:
        if not 0.0 < self.body_radius_m < math.inf:
            raise InputError(
                f"person {self.name!r}: expected a body radius above 0 m, got {self.body_radius_m}"
            )

    def at(self, place: Point, velocity: Point) -> PersonNow:
        """The person at a place (m) with a velocity (m/s)."""
        return PersonNow(self.name, self.kind, *place, *velocity, self.body_radius_m)


@final
class Mover:
    """A point whose acceleration is constant over each step: x + v t + a t^2 / 2, v + a t.

    Both limits hold at every instant, not only between steps: a push is cut to the limit of
    acceleration, and the velocity it leads to is projected to the disc of allowed ones. The
    velocity before lies in that disc, which is convex: the projection brings the two nearer to
    each other, and all that is passed through lies between them. Limits are taken smaller by 1e-9
    of themselves, against rounding.
    """

    def __init__(self, place: Point, velocity: Point, limits: MotionLimits) -> None:
        """place in m, velocity in m/s; raises InputError for numbers that are not finite, limits
        that are not above 0 and a velocity above the limit (beyond rounding: a direction times
        the limit may exceed it by an ulp)."""
        speed, push = limits.speed_mps, limits.acceleration_mps2
        if not (0.0 < speed < math.inf and 0.0 < push < math.inf):
            raise InputError(f"expected limits above 0 m/s and 0 m/s^2, got {speed} and {push}")
        finite = all(map(math.isfinite, (*place, *velocity)))
        if not finite or math.hypot(*velocity) > (1.0 + _ROUNDING) * speed:
            raise InputError(
                f"expected a place in finite metres and a velocity of at most {speed:g} m/s, got "
                f"{place} and {velocity}"
            )
        self._speed, self._push = (1.0 - _ROUNDING) * speed, (1.0 - _ROUNDING) * push
        self.place = place
        self.velocity = _within(velocity, self._speed)

    def push(self, acceleration: Point, duration_s: float) -> None:
        """Go on for a time with an acceleration (m/s^2), cut to the limits."""
        if duration_s <= 0.0:
            return
        ax, ay = _within(acceleration, self._push)
        vx, vy = self.velocity
        wx, wy = _within((vx + ax * duration_s, vy + ay * duration_s), self._speed)
        half = 0.5 * duration_s
        self.place = (self.place[0] + half * (vx + wx), self.place[1] + half * (vy + wy))
        self.velocity = (wx, wy)

    def turn_to(self, velocity: Point, duration_s: float) -> None:
        """Go on for a time, towards a velocity (m/s) as fast as the limits allow."""
        if duration_s > 0.0:
            wx, wy = _within(velocity, self._speed)
            vx, vy = self.velocity
            self.push(((wx - vx) / duration_s, (wy - vy) / duration_s), duration_s)

    def walk_to(self, goal: Point, speed_mps: float, duration_s: float, *, stops: bool) -> None:
        """Go on for a time towards a place (m), to come to rest there if it stops.

        Speed sqrt(2 b d) at distance d, with b at 0.8 of the limit of acceleration.
        """
        dx, dy = goal[0] - self.place[0], goal[1] - self.place[1]
        away_m = math.hypot(dx, dy)
        if stops and duration_s > 0.0:
            speed_mps = min(speed_mps, math.sqrt(1.6 * self._push * away_m), away_m / duration_s)
        share = speed_mps / away_m if away_m > 0.0 else 0.0
        self.turn_to((share * dx, share * dy), duration_s)


def _within(vector: Point, radius: float) -> Point:
    """The vector, or the one of length radius in its direction."""
    size = math.hypot(*vector)
    return vector if size <= radius else (vector[0] * radius / size, vector[1] * radius / size)
