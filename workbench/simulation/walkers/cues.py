"""What people wait for before they do something: an instant, or the car itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, final

from workbench.simulation.frames import Point
from workbench.simulation.walkers.pedestrian import CarNow


class Cue(Protocol):
    """Something that happens once or not at all. What the car gives depends neither on how fast
    the car is nor on who drives it."""

    def given(self, t_s: float, place: Point, car: CarNow) -> bool:
        """Whether it is so at an instant, for somebody at a place (m)."""


@final
@dataclass(frozen=True, slots=True)
class AtTime:
    """From an instant of the scenario on, s."""

    at_s: float

    def given(self, t_s: float, place: Point, car: CarNow) -> bool:  # noqa: ARG002
        """As `Cue` says."""
        return t_s >= self.at_s


@final
@dataclass(frozen=True, slots=True)
class CarWithin:
    """The car's body is no farther than a distance, m."""

    within_m: float

    def given(self, t_s: float, place: Point, car: CarNow) -> bool:  # noqa: ARG002
        """As `Cue` says."""
        return car.body.distance(*place) <= self.within_m


@final
@dataclass(frozen=True, slots=True)
class CarPassed:
    """The middle of the car's rear axle has come to a station of its path, m."""

    station_m: float

    def given(self, t_s: float, place: Point, car: CarNow) -> bool:  # noqa: ARG002
        """As `Cue` says."""
        return car.station_m >= self.station_m
