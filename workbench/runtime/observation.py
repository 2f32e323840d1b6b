"""What the vehicle knows at one instant: its own state as intervals, and the people around it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from workbench.runtime.arc import Interval

_FARTHEST_M = 1e7
_FASTEST_MPS = 100.0
_LARGEST_RADIUS_M = 1e4
_LARGEST_HEADING_RAD = 1e6


@final
@dataclass(frozen=True, slots=True)
class Person:
    """A disc that contains a person from now on.

    At time tau (s) after the observation: centre (x_m + vx_mps tau, y_m + vy_mps tau), radius
    radius_m + growth_mps tau + growth_mps2 tau^2 / 2.
    """

    name: str
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    radius_m: float
    growth_mps: float
    growth_mps2: float

    @property
    def numbers(self) -> tuple[float, ...]:
        """The seven numbers in the kernel's order."""
        return (
            self.x_m,
            self.y_m,
            self.vx_mps,
            self.vy_mps,
            self.radius_m,
            self.growth_mps,
            self.growth_mps2,
        )


@final
@dataclass(frozen=True, slots=True)
class Observation:
    """One instant, unchecked: a sensor may say anything, and `Monitor` answers it with a decision.

    x, y (m), heading (rad, any turn), steering (rad), speed (m/s), speed_integral (m),
    offset_integral (m s): (lower, upper) intervals that jointly contain the state of the middle of
    the rear axle; reference_speed_mps: what the controller follows; people: everybody seen.
    """

    x: Interval
    y: Interval
    heading: Interval
    steering: Interval
    speed: Interval
    speed_integral: Interval
    offset_integral: Interval
    reference_speed_mps: float
    people: tuple[Person, ...]


_LIMITS = {
    "x": _FARTHEST_M,
    "y": _FARTHEST_M,
    "heading": _LARGEST_HEADING_RAD,
    "steering": math.pi,
    "speed": _FASTEST_MPS,
    "speed_integral": _FARTHEST_M,
    "offset_integral": _FARTHEST_M,
}


def fault_in_observation(observation: Observation) -> str | None:
    """Why the observation's own numbers cannot be used, or None.

    Intervals must be finite, ordered, and of a size that no later product can overflow.
    """
    for name, limit in _LIMITS.items():
        low, high = getattr(observation, name)
        if not (-limit <= low <= high <= limit):
            return f"{name}: expected lower <= upper within +-{limit:g}, got [{low!r}, {high!r}]"
    for person in observation.people:
        fault = _fault_in_person(person)
        if fault is not None:
            return f"person {person.name!r}: {fault}"
    return None


def _fault_in_person(person: Person) -> str | None:
    if not all(map(math.isfinite, person.numbers)):
        return f"expected finite numbers, got {person.numbers}"
    if max(abs(person.x_m), abs(person.y_m)) > _FARTHEST_M:
        return (
            f"expected a position within +-{_FARTHEST_M:g} m, got ({person.x_m!r}, {person.y_m!r})"
        )
    if max(abs(person.vx_mps), abs(person.vy_mps)) > _FASTEST_MPS:
        return (
            f"expected a velocity within +-{_FASTEST_MPS:g} m/s, "
            f"got ({person.vx_mps!r}, {person.vy_mps!r})"
        )
    sizes = (person.radius_m, person.growth_mps, person.growth_mps2)
    if min(sizes) < 0.0 or max(sizes) > _LARGEST_RADIUS_M:
        return f"expected radius and growth from 0 to {_LARGEST_RADIUS_M:g}, got {sizes}"
    return None
