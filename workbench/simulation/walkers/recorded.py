"""Recorded people in a scene: their samples moved and turned, linear in between."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.people_data import PersonTrack
from workbench.simulation.frames import Point
from workbench.simulation.walkers.moving import Who
from workbench.simulation.walkers.pedestrian import CarNow, PersonNow


@final
@dataclass(frozen=True, slots=True)
class Placement:
    """How a recording lies in a scene: turned (rad, to the left) about a point of it (m) that comes
    to lie at another (m); its instant from_s is the scene's 0."""

    about: Point
    to: Point
    turn_rad: float
    from_s: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (*self.about, *self.to, self.turn_rad, self.from_s))):
            raise InputError(f"expected finite numbers for where a recording lies, got {self}")

    def apply(self, track: PersonTrack) -> PersonTrack:
        """The track in the scene's plane and time."""
        cos, sin = math.cos(self.turn_rad), math.sin(self.turn_rad)
        turned = (track.xy_m - np.array(self.about)) @ np.array([[cos, sin], [-sin, cos]])
        xy_m = turned + np.array(self.to)
        return PersonTrack(track.recording, track.agent, track.kind, track.t_s - self.from_s, xy_m)


@final
class Recorded:
    """Somebody who goes where a track says, at constant velocity from sample to sample; not there
    before its first and after its last. Nothing limits how the velocity jumps at a sample."""

    def __init__(self, who: Who, track: PersonTrack) -> None:
        """track: in the scene's plane and time; raises InputError for fewer than two samples."""
        if len(track.t_s) < 2:
            raise InputError(
                f"track of {track.agent!r} in {track.recording!r}: expected two samples or more, "
                f"got {len(track.t_s)}; leave this person out"
            )
        self._who = who
        self._times = [float(t) for t in track.t_s]
        self._places = [(float(x), float(y)) for x, y in track.xy_m]
        self._t_s = 0.0

    @property
    def now(self) -> PersonNow | None:
        """As `Pedestrian` says."""
        times, places = self._times, self._places
        if not times[0] <= self._t_s <= times[-1]:
            return None
        k = min(bisect_right(times, self._t_s), len(times) - 1) - 1
        long_s = times[k + 1] - times[k]
        (ax, ay), (bx, by) = places[k], places[k + 1]
        velocity = ((bx - ax) / long_s, (by - ay) / long_s)
        since = self._t_s - times[k]
        return self._who.at((ax + velocity[0] * since, ay + velocity[1] * since), velocity)

    def advance(self, from_s: float, until_s: float, car: CarNow) -> None:  # noqa: ARG002
        """As `Pedestrian` says."""
        self._t_s = until_s
