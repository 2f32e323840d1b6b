"""A scenario under way: a car on its path among people, and how near they came."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final, final

from workbench.models.vehicle import Vehicle
from workbench.runtime.path import PathTable
from workbench.simulation.frames import Point
from workbench.simulation.people import Body
from workbench.simulation.plants.actuators import DriveByWireCar
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.scenarios.scenario import Scenario
from workbench.simulation.walkers.pedestrian import CarNow, PersonNow

STEP_US: Final = 5_000
_MOVES_MPS: Final = 0.05
_FAR_M: Final = 12.0
_NEAR_NODES: Final = 4


@final
@dataclass(frozen=True, slots=True)
class Setting:
    """Who drives where: the scenario, the vehicle and its path as the monitor has it."""

    scenario: Scenario
    vehicle: Vehicle
    path: PathTable


@final
@dataclass(frozen=True, slots=True)
class Contact:
    """The moving car touched somebody: when, whom, and how fast the car was."""

    t_s: float
    person: str
    speed_mps: float


@final
@dataclass(slots=True)
class Nearness:
    """How near the car came to people: distances (m) from its body to a disc around theirs.

    moving_m: smallest while the car moved; contact: the first, where it is below 0.
    """

    moving_m: float = math.inf
    contact: Contact | None = None

    def see(self, t_s: float, car: CarNow, people: Iterable[PersonNow]) -> None:
        """One instant."""
        if car.speed_mps <= _MOVES_MPS:
            return
        body = car.body
        for person in people:
            if abs(person.x_m - body.x_m) + abs(person.y_m - body.y_m) > _FAR_M:
                continue
            away_m = body.distance(person.x_m, person.y_m) - person.body_radius_m
            self.moving_m = min(self.moving_m, away_m)
            if away_m < 0.0 and self.contact is None:
                self.contact = Contact(t_s, person.name, car.speed_mps)


@final
@dataclass(frozen=True, slots=True)
class OnPath:
    """The car's place on its path: station, offset to the left (m), the path's direction (rad) and
    curvature (1/m) there."""

    station_m: float
    offset_m: float
    tangent: float
    curvature_per_m: float


@final
class Scene:
    """Car and people, moved on together in steps of up to 5 ms, from the scenario's beginning.

    The same setting, car and seed give the same motion for the same commands.
    """

    def __init__(self, setting: Setting, car: DriveByWireCar, *, seed: int) -> None:
        self.setting, self.car = setting, car
        self.scenario = setting.scenario
        self._people = self.scenario.cast.people(seed, self.scenario.path)
        self._node: int | None = None
        self._car: CarNow | None = None
        self.now_us = 0
        self.nearness = Nearness()

    @property
    def now_s(self) -> float:
        """Time of the scenario."""
        return self.now_us / 1e6

    @property
    def people(self) -> tuple[PersonNow, ...]:
        """Everybody who is there."""
        return tuple(self._present())

    @property
    def eye(self) -> Point:
        """Where the sensors are: in the middle of the front."""
        motion, front_m = self.car.motion, self.setting.vehicle.geometry.front_m
        return (
            motion.x_m + front_m * math.cos(motion.heading),
            motion.y_m + front_m * math.sin(motion.heading),
        )

    def car_now(self) -> CarNow:
        """The car as people see it."""
        motion, shape = self.car.motion, self.setting.vehicle.geometry
        body = Body(
            motion.x_m, motion.y_m, motion.heading, shape.front_m, shape.rear_m, shape.half_width_m
        )
        return CarNow(body, motion.speed_mps, self.place().station_m)

    def place(self) -> OnPath:
        """On the chord of the path's two nearest nodes; the table's are near enough for that."""
        motion, table = self.car.motion, self.setting.path
        j = self._nearest(motion.x_m, motion.y_m)
        tangent = table.heading[j]
        dx_m, dy_m = motion.x_m - table.x[j], motion.y_m - table.y[j]
        along_m = dx_m * math.cos(tangent) + dy_m * math.sin(tangent)
        bin_at = min(max(j if along_m >= 0.0 else j - 1, 0), len(table.curvature_lower) - 1)
        bent = 0.5 * (table.curvature_lower[bin_at] + table.curvature_upper[bin_at])
        aside_m = dy_m * math.cos(tangent) - dx_m * math.sin(tangent)
        return OnPath(
            table.start_m + j * table.spacing_m + along_m,
            aside_m - 0.5 * bent * along_m * along_m,
            tangent + bent * along_m,
            bent,
        )

    def advance(self, duration_us: int) -> None:
        """Go on for a time."""
        end_us = self.now_us + duration_us
        while self.now_us < end_us:
            step_us = min(STEP_US, end_us - self.now_us)
            from_s, before = self.now_s, self._car or self.car_now()
            self.car.advance(step_us)
            self.now_us += step_us
            for each in self._people:
                each.advance(from_s, self.now_s, before)
            if self._car is None or not _is_at(self._car, self.car.motion):
                self._car = self.car_now()
            self.nearness.see(self.now_s, self._car, self._present())

    def _present(self) -> Iterator[PersonNow]:
        return (now for each in self._people if (now := each.now) is not None)

    def _nearest(self, x_m: float, y_m: float) -> int:
        """The nearest node, near the one before."""
        table, node = self.setting.path, self._node
        first, last = 0, len(table.x)
        if node is not None:
            first, last = max(node - _NEAR_NODES, 0), node + _NEAR_NODES + 1
        nodes = zip(table.x[first:last], table.y[first:last], strict=True)
        squares_m2 = [(x - x_m) ** 2 + (y - y_m) ** 2 for x, y in nodes]
        self._node = first + squares_m2.index(min(squares_m2))
        return self._node


def _is_at(car: CarNow, motion: Motion) -> bool:
    body = car.body
    return (
        body.x_m == motion.x_m
        and body.y_m == motion.y_m
        and body.heading == motion.heading
        and car.speed_mps == motion.speed_mps
    )
