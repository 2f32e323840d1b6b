"""A car and people in virtual time: they move at random, often at the limits of what they may."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.person_guard import MotionLimits
from workbench.runtime.protocols import PersonKind

GRID_US = 5_000
"""Truth is known at multiples of this."""


@dataclass(frozen=True)
class CarState:
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    steering_rad: float


class Car:
    """A bicycle under accelerations and steering rates at random, often at their limits.

    standing: it never moves.
    """

    def __init__(
        self, dice: random.Random, bounds: SensorBounds, *, standing: bool = False
    ) -> None:
        self._dice, self._bounds = dice, bounds
        self._wheelbase_m = dice.choice((*bounds.wheelbase_m, dice.uniform(*bounds.wheelbase_m)))
        limit = bounds.steering_limit_rad
        self._standing = standing
        self.states = [
            CarState(
                dice.uniform(-50.0, 50.0),
                dice.uniform(-50.0, 50.0),
                dice.uniform(-3.1, 3.1),
                0.0 if standing else dice.uniform(0.0, 5.0),
                0.0 if standing else dice.uniform(-limit, limit),
            )
        ]
        self._command = (0.0, 0.0)

    def at(self, at_us: int) -> CarState:
        """The true state at a multiple of the grid."""
        while len(self.states) <= at_us // GRID_US:
            self.states.append(self._next(self.states[-1]))
        return self.states[at_us // GRID_US]

    def _next(self, now: CarState) -> CarState:
        dice, bounds = self._dice, self._bounds
        if self._standing:
            return now
        if dice.random() < 0.03:
            rate = bounds.steering_rate_radps
            self._command = (
                dice.choice((*bounds.acceleration_mps2, 0.0, dice.uniform(-3.0, 2.0))),
                dice.choice((-rate, rate, 0.0, dice.uniform(-rate, rate))),
            )
        acceleration, rate = self._command
        step_s = GRID_US / 1e6
        low, high = bounds.speed_range_mps
        limit = bounds.steering_limit_rad
        if not low <= now.speed_mps + acceleration * step_s <= high:
            acceleration = 0.0
        if not abs(now.steering_rad + rate * step_s) <= limit:
            rate = 0.0
        return _driven(now, acceleration, rate, self._wheelbase_m)


def _driven(now: CarState, acceleration: float, rate: float, wheelbase_m: float) -> CarState:
    """One step of the grid, by RK4 in pose; speed and steering are straight lines."""
    step_s = GRID_US / 1e6

    def slope(heading: float, t: float) -> tuple[float, float, float]:
        v, angle = now.speed_mps + acceleration * t, now.steering_rad + rate * t
        return v * math.cos(heading), v * math.sin(heading), v * math.tan(angle) / wheelbase_m

    k1 = slope(now.heading_rad, 0.0)
    k2 = slope(now.heading_rad + 0.5 * step_s * k1[2], 0.5 * step_s)
    k3 = slope(now.heading_rad + 0.5 * step_s * k2[2], 0.5 * step_s)
    k4 = slope(now.heading_rad + step_s * k3[2], step_s)
    moves = [
        (a + 2 * b + 2 * c + d) * step_s / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)
    ]
    return CarState(
        now.x_m + moves[0],
        now.y_m + moves[1],
        now.heading_rad + moves[2],
        now.speed_mps + acceleration * step_s,
        now.steering_rad + rate * step_s,
    )


@dataclass
class Walker:
    """Somebody who moves at random within the limits of their kind; known on the grid."""

    dice: random.Random
    track: int
    kind: PersonKind
    limits: MotionLimits
    places: list[tuple[float, float, float, float]]
    push: tuple[float, float] = (0.0, 0.0)

    def at(self, at_us: int) -> tuple[float, float, float, float]:
        """x, y (m), and velocity (m/s)."""
        while len(self.places) <= at_us // GRID_US:
            self.places.append(self._next(*self.places[-1]))
        return self.places[max(at_us // GRID_US, 0)]

    def _next(self, x: float, y: float, vx: float, vy: float) -> tuple[float, float, float, float]:
        if self.dice.random() < 0.02:
            size, angle = self.limits.acceleration_mps2, self.dice.uniform(0.0, math.tau)
            size *= self.dice.choice((0.0, 1.0, 1.0))
            self.push = (size * math.cos(angle), size * math.sin(angle))
        step_s, (ax, ay) = GRID_US / 1e6, self.push
        if math.hypot(vx + ax * step_s, vy + ay * step_s) > self.limits.speed_mps:
            ax = ay = 0.0
        moved = (vx + 0.5 * ax * step_s) * step_s, (vy + 0.5 * ay * step_s) * step_s
        return x + moved[0], y + moved[1], vx + ax * step_s, vy + ay * step_s


def unlucky(dice: random.Random, most: float) -> float:
    """An error of at most so much, often as large as it may be."""
    return most * dice.choice((-1.0, 1.0, dice.uniform(-1.0, 1.0)))
