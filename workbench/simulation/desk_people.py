"""People as a car at the desk knows them: in sets that come late, with stamps of another clock, as
on the bus, but without frames."""

from __future__ import annotations

import random
from collections import deque
from typing import Final, final

from workbench.runtime import ObservedPerson, Watched
from workbench.runtime.onboard.crowd import observed_person, watched_now
from workbench.runtime.onboard.dead_reckoning import Pose
from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.onboard.set_streams import SetSeen
from workbench.runtime.onboard.stamps import Stamps
from workbench.runtime.protocols import PeopleSeen
from workbench.simulation.bus_sensing import PEOPLE_US, Sensors
from workbench.simulation.scene import Scene

_WAY_ERROR_MPS: Final = 0.2
"""How wrong the way since a set may be known, for each second."""


@final
class DeskPeople:
    """The last set that has come. The first one is there at once: the car has listened before."""

    def __init__(self, scene: Scene, settings: SensorBounds, *, seed: int) -> None:
        self._scene, self._settings = scene, settings
        self._delay = random.Random(f"delays {seed}")
        self._stamps = Stamps(settings.stamps)
        self._under_way: deque[tuple[int, PeopleSeen, float]] = deque()
        self._seen: SetSeen[PeopleSeen] | None = None
        self._seen_at_m = 0.0
        self._due_us = 0

    def look(self, sensors: Sensors) -> None:
        """Measure where it is time, five times a second, and take what has come by now."""
        scene, at_us = self._scene, self._scene.now_us
        if at_us >= self._due_us:
            self._due_us += PEOPLE_US
            seen = sensors.people(scene.people, scene.car.motion, scene.eye, at_us)
            if seen is not None:
                wait_us = round(1e6 * self._delay.uniform(*scene.scenario.sensing.delay_s))
                self._under_way.append((at_us + wait_us, seen, scene.place().station_m))
        while self._under_way and (self._under_way[0][0] <= at_us or self._seen is None):
            came_us, seen, station_m = self._under_way.popleft()
            self._stamps, found = self._stamps.taking(seen.stamp_s, came_us)
            self._seen = SetSeen(seen, came_us, came_us, found.within_us, found.late_us)
            self._seen_at_m = station_m

    @property
    def lost(self) -> bool:
        """Whether there is none, or the last one is too old."""
        seen = self._seen
        return seen is None or self._age_us(seen) > self._settings.people_age_us

    def observed(self) -> tuple[ObservedPerson, ...]:
        """Everybody of the last set, now."""
        if self._seen is None:
            return ()
        return tuple(
            observed_person(
                sent, self._seen.stamp_us, now_us=self._scene.now_us, settings=self._settings
            )
            for sent in self._seen.value.people
        )

    def watched(self, pose: Pose) -> Watched:
        """The disc within which everybody is on the list now, about a car in this pose."""
        if self._seen is None:
            motion = self._scene.car.motion
            return Watched(motion.x_m, motion.y_m, 0.0)
        motion, age_us = self._scene.car.motion, self._age_us(self._seen)
        way_m = abs(self._scene.place().station_m - self._seen_at_m)
        # The stamp may have been earlier than it was, by what its interval is wide.
        unsure_us = self._seen.stamp_us[1] - self._seen.stamp_us[0]
        way_m += (_WAY_ERROR_MPS * age_us + motion.speed_mps * unsure_us) / 1e6
        return watched_now(
            self._seen, pose, now_us=self._scene.now_us, way_m=way_m, settings=self._settings
        )

    def _age_us(self, seen: SetSeen[PeopleSeen]) -> int:
        return self._scene.now_us - seen.stamp_us[0]
