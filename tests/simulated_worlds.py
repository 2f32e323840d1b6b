"""One rig and small scenarios that tests of simulated drives share."""

from __future__ import annotations

import functools
from dataclasses import dataclass

from workbench.models.spline_path import SplinePath
from workbench.simulation.rig import Rig
from workbench.simulation.scenarios.scenario import Scenario, Sensing
from workbench.simulation.simulated import build_rig
from workbench.simulation.walkers.pedestrian import CarNow, Pedestrian, PersonNow

STRAIGHT = tuple((float(x), 0.0) for x in range(0, 41, 4))


@functools.cache
def rig() -> Rig:
    """Built once."""
    return build_rig()


@dataclass
class Straight:
    """Goes straight on; begins when the car has come to a station."""

    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    begins_m: float = -100.0
    name: str = "walker"

    @property
    def now(self) -> PersonNow:
        return PersonNow(self.name, "ped", self.x_m, self.y_m, self._vx, self._vy, 0.3)

    _vx: float = 0.0
    _vy: float = 0.0

    def advance(self, from_s: float, until_s: float, car: CarNow) -> None:
        if car.station_m >= self.begins_m:
            self._vx, self._vy = self.vx_mps, self.vy_mps
        self.x_m += self._vx * (until_s - from_s)
        self.y_m += self._vy * (until_s - from_s)


@dataclass(frozen=True)
class Cast:
    """The same people again and again, by their arguments."""

    walkers: tuple[tuple[float, ...], ...] = ()

    def people(self, seed: int, path: SplinePath) -> tuple[Pedestrian, ...]:
        return tuple(Straight(*each, name=f"walker {k}") for k, each in enumerate(self.walkers))


def scenario(
    *walkers: tuple[float, ...], duration_s: float = 14.0, sensing: Sensing | None = None
) -> Scenario:
    """People on and beside a straight road of 40 m."""
    return Scenario(
        "test", "A test", "", STRAIGHT, duration_s, 30.0, Cast(walkers), sensing or Sensing()
    )
