"""A car that the analysis did not write, under its controller on a road of one curvature."""

from __future__ import annotations

import functools
import math
import random
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.vehicle import Vehicle
from workbench.runtime.contents import Parameter
from workbench.runtime.onboard.actuation import Sent, Wanted, actuate, resting
from workbench.runtime.onboard.drive_by_wire import DriveByWire
from workbench.runtime.onboard.pid import (
    Integrals,
    LawCommand,
    Reading,
    TrackLaw,
    advanced,
    law_of,
)
from workbench.runtime.onboard.times import TURN_US
from workbench.sensitivity.learning.draws import Words
from workbench.sensitivity.vectorised import Array
from workbench.simulation.plants.actuators import Actuators, DriveByWireCar
from workbench.simulation.plants.chassis import Motion, Start
from workbench.simulation.plants.make import chassis_at

_TURN_S: Final = TURN_US / 1e6


@final
@dataclass(frozen=True, slots=True)
class Road:
    """A straight line or a circle through the origin, which it leaves along x; curvature in 1/m,
    positive to the left."""

    curvature_per_m: float

    def place(self, station_m: float, offset_m: float) -> tuple[float, float, float]:
        """x, y (m) and the road's direction (rad) at a station, offset_m to the left of it."""
        bent = self.curvature_per_m
        turned = bent * station_m
        x, y = (math.sin(turned) / bent, (1.0 - math.cos(turned)) / bent) if bent else (
            station_m, 0.0
        )  # fmt: skip
        return x - offset_m * math.sin(turned), y + offset_m * math.cos(turned), turned

    def found(self, x_m: float, y_m: float, *, near_m: float) -> tuple[float, float]:
        """Station (the one nearest to near_m) and offset of a place, m."""
        bent = self.curvature_per_m
        if not bent:
            return x_m, y_m
        radius, side = 1.0 / abs(bent), math.copysign(1.0, bent)
        inward = radius - side * y_m
        before = abs(bent) * near_m
        turned = before + math.remainder(math.atan2(x_m, inward) - before, math.tau)
        return turned * radius, side * (radius - math.hypot(x_m, inward))


@final
@dataclass(frozen=True, slots=True, eq=False)
class PlantSimulator:
    """The vehicle's TRACK law at its own rate, its drive-by-wire, and a plant, as a black box.

    plant: one of `PLANTS`. The law reads the truth. Actuators are drawn from a row's seed within
    what the vehicle file claims, so that both runs of a pair have one car. States: those of the
    loop along a path; the plant's own others begin at rest with it. Raises InputError for a vehicle
    without [drive_by_wire], and as `chassis` does.
    """

    plant: str
    vehicle: Vehicle
    curvature_per_m: float
    times: Array

    def __post_init__(self) -> None:
        self._wire()

    @property
    def names(self) -> tuple[str, ...]:
        """Station, offset, steering, speed, heading error and both integrals."""
        loop = self.vehicle.closed_loop(self.vehicle.track(), PathFrame(0.0, 0.0))
        return loop.ode.names

    @property
    def what(self) -> str:
        """Whose runs they are."""
        return (
            f"runs of the {self.plant} plant under the vehicle's TRACK law, actuators drawn "
            "uniformly from their bands and shared by the two"
        )

    def runs(self, initial_states: Array, seeds: Words) -> Array:
        """As `Simulator` says."""
        law = _law(self.vehicle)
        rows = zip(initial_states.tolist(), seeds.tolist(), strict=True)
        return np.array([self._run(law, state, seed) for state, seed in rows])

    def _run(self, law: TrackLaw, state: list[float], seed: int) -> list[list[float]]:
        wire, road = self._wire(), Road(self.curvature_per_m)
        station, offset, steering, speed, heading_error, *integrals = state
        x_m, y_m, tangent = road.place(station, offset)
        body = chassis_at(
            self.plant, self.vehicle,
            Start(x_m, y_m, tangent + heading_error, speed, steering),
        )  # fmt: skip
        car = DriveByWireCar(body, wire, Actuators.drawn(wire, random.Random(seed)))
        sent = resting(wire, car.wheel_rad)
        if sent is None:
            raise InputError(f"expected a steering within the wheel's limit, got {steering!r} rad")
        drive = _Drive(law, road, car, self.vehicle.operation.reference_speed_mps)
        drive.begin(station, Integrals(*integrals), sent)
        rows = [state]
        for at_us in np.round(self.times[1:] * 1e6).astype(int).tolist():
            drive.until(at_us, wire)
            rows.append(drive.state())
        return rows

    def _wire(self) -> DriveByWire:
        if self.vehicle.drive_by_wire is None:
            raise InputError(
                f"expected a vehicle with [drive_by_wire], which the {self.plant} plant is driven "
                f"by, got {self.vehicle.name!r} without; add the section, or leave --vehicle out "
                "for the simulated one"
            )
        return self.vehicle.drive_by_wire.value


@final
class _Drive:
    """One run under way."""

    __slots__ = ("_car", "_command", "_integrals", "_law", "_reference", "_road", "_sent",
                 "_station", "_turn_us")  # fmt: skip

    def __init__(
        self, law: TrackLaw, road: Road, car: DriveByWireCar, reference_mps: float
    ) -> None:
        self._law, self._road, self._car, self._reference = law, road, car, reference_mps
        self._command, self._turn_us = LawCommand(0.0, 0.0, 0.0, 0.0), -1

    def begin(self, station_m: float, integrals: Integrals, sent: Sent) -> None:
        """From this station, with these integrals, after this was sent."""
        self._station, self._integrals, self._sent = station_m, integrals, sent

    def until(self, at_us: int, wire: DriveByWire) -> None:
        """Go on; at every turn the law reads and commands."""
        car = self._car
        while car.now_us < at_us:
            if car.now_us % TURN_US == 0 and car.now_us != self._turn_us:
                self._turn(wire)
            car.advance(min(at_us, self._turn_us + TURN_US) - car.now_us)

    def state(self) -> list[float]:
        """The loop's states now; the integrals grow evenly between turns."""
        motion = self._car.motion
        self._station, offset = self._road.found(motion.x_m, motion.y_m, near_m=self._station)
        turned = self._road.curvature_per_m * self._station
        since_s = (self._car.now_us - self._turn_us) / 1e6
        now = advanced(self._integrals, self._command, since_s)
        return [
            self._station, offset, motion.road_wheel_rad, motion.speed_mps,
            motion.heading - turned, now.speed_m, now.offset_ms,
        ]  # fmt: skip

    def _turn(self, wire: DriveByWire) -> None:
        car = self._car
        if self._turn_us >= 0:
            self._integrals = advanced(self._integrals, self._command, _TURN_S)
        self._turn_us = car.now_us
        self._command = self._law.track(
            self._reading(car.motion), self._integrals, reference_speed_mps=self._reference
        )
        wanted = Wanted(self._command.acceleration_mps2, self._command.steering_rate_radps)
        self._sent = actuate(
            wire, wanted, read_back_rad=car.wheel_rad, before=self._sent, elapsed_s=_TURN_S
        ).sent
        outputs = self._sent.outputs
        car.command(
            accelerator=outputs.accelerator, brake=outputs.brake, wheel_rad=outputs.wheel_rad,
            wheel_rate_radps=outputs.wheel_rate_radps,
        )  # fmt: skip

    def _reading(self, motion: Motion) -> Reading:
        bent = self._road.curvature_per_m
        self._station, offset = self._road.found(motion.x_m, motion.y_m, near_m=self._station)
        heading_error = math.remainder(motion.heading - bent * self._station, math.tau)
        return Reading(offset, heading_error, motion.road_wheel_rad, motion.speed_mps, bent)


@functools.lru_cache(maxsize=4)
def _law(vehicle: Vehicle) -> TrackLaw:
    loop = vehicle.closed_loop(vehicle.track(), PathFrame(0.0, 0.0))
    return law_of(
        [Parameter(p.name, p.unit, p.nominal, p.lower, p.upper) for p in loop.ode.parameters]
    )
