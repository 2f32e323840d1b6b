"""People who do anything at all within their limits, by chance."""

from __future__ import annotations

import math
import random
from typing import final

from workbench.errors import InputError
from workbench.runtime import MotionLimits
from workbench.simulation.frames import Point
from workbench.simulation.walkers.moving import Mover, Who
from workbench.simulation.walkers.pedestrian import CarNow, PersonNow


@final
class Wanderer:
    """Accelerations drawn uniformly from the disc that the limit allows, each kept for a time
    drawn uniformly from hold_s; what would break the speed limit is cut (`Mover`)."""

    def __init__(
        self, who: Who, start: tuple[Point, Point], *, limits: MotionLimits,
        hold_s: tuple[float, float], seed: int,
    ) -> None:  # fmt: skip
        """start: place (m) and velocity (m/s). Raises InputError as `Mover` and unless
        0 < least <= longest time."""
        if not 0.0 < hold_s[0] <= hold_s[1] < math.inf:
            raise InputError(f"hold_s: expected [least, longest] above 0 s, got {list(hold_s)}")
        self._who, self._hold_s, self._limit = who, hold_s, limits.acceleration_mps2
        self._mover = Mover(*start, limits)
        self._chance = random.Random(f"wanderer {who.name} {seed}")
        self._push, self._left_s = (0.0, 0.0), 0.0

    @property
    def now(self) -> PersonNow | None:
        """As `Pedestrian` says."""
        return self._who.at(self._mover.place, self._mover.velocity)

    def advance(self, from_s: float, until_s: float, car: CarNow) -> None:  # noqa: ARG002
        """As `Pedestrian` says."""
        # An acceleration is drawn at most once per call, so that it is constant over the call.
        if self._left_s <= 0.0:
            size = self._limit * math.sqrt(self._chance.random())
            turn = self._chance.uniform(0.0, math.tau)
            self._push = (size * math.cos(turn), size * math.sin(turn))
            self._left_s = self._chance.uniform(*self._hold_s)
        self._mover.push(self._push, until_s - from_s)
        self._left_s -= until_s - from_s
