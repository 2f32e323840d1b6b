"""What every simulated person is to a world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, final

from workbench.simulation.people import Body


@final
@dataclass(frozen=True, slots=True)
class PersonNow:
    """A person at an instant: kind as in recordings ("ped", "cyclist", ...), position (m) and
    velocity (m/s), radius of a disc that contains the body (m)."""

    name: str
    kind: str
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    body_radius_m: float


@final
@dataclass(frozen=True, slots=True)
class CarNow:
    """The car as people see it: body, speed (m/s) and station (m) on its path."""

    body: Body
    speed_mps: float
    station_m: float


class Pedestrian(Protocol):
    """Somebody who walks, stands, rides, comes or leaves; asked at instants that do not run
    backwards. The same steps give the same motion."""

    @property
    def now(self) -> PersonNow | None:
        """Where they are; None while they are not there."""

    def advance(self, from_s: float, until_s: float, car: CarNow) -> None:
        """Go on until an instant of the scenario; car: where it is at from_s."""
