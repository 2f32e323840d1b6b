"""Everything around a monitor on a vehicle's bus: a car with its plant, its sensors, and people."""

from __future__ import annotations

import heapq
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.estimation.people_estimator import PeopleEstimator, Wanted
from workbench.simulation.bus_sensing import (
    LOCALISED_US,
    PEOPLE_US,
    Sensors,
    place_frames,
    set_frames,
    way_frames,
)
from workbench.simulation.onboard_car import Sent
from workbench.simulation.pacmod2_unit import CanFrame, Outputs, Pacmod2Unit, maker_frame
from workbench.simulation.ranged_place import RangedPlace, Ranging
from workbench.simulation.run_up import BEGUN_US as RUN_UP_US
from workbench.simulation.scene import STEP_US, Scene

BEGUN_US: Final = 2_000_000
"""The scene begins so long after the bus: the monitor listens first, and nobody is there."""
_REPORT_US: Final = 33_333
_VIN_US: Final = 1_000_000
_BODY_M: Final = 0.3
_SPEED_GAIN: Final = 0.005
"""The reported speed may be wrong by this share of it, to either side."""


@final
@dataclass(frozen=True, slots=True)
class BusSetting:
    """What the bus carries beside the scene: maker: code that the vehicle reports, None for none;
    estimator: finds out what people want, None where that is not sent; ranging: the vehicle's own
    localiser among beacons says where the car is, None for errors within what `Sensing` says."""

    maker: int | None = None
    estimator: PeopleEstimator | None = None
    ranging: Ranging | None = None


@final
class BusWorld:
    """A scene on the bus: frames come out, commands go in, all in us since the bus began.

    The same scene, setting and seed give the same frames for the same commands, to the last bit.
    """

    def __init__(self, scene: Scene, setting: BusSetting, *, seed: int) -> None:
        self.scene, self._setting, self._unit = scene, setting, Pacmod2Unit()
        chance = random.Random(f"bus {seed}")
        self._delay = random.Random(f"delays {seed}")
        self._gain = 1.0 + chance.uniform(-_SPEED_GAIN, _SPEED_GAIN)
        self._sensors = Sensors(
            scene.scenario.sensing, random.Random(f"sensors {seed}"), BEGUN_US, setting.estimator
        )
        self._due_us = {
            "reports": chance.randrange(_REPORT_US), "place": chance.randrange(LOCALISED_US),
            "people": chance.randrange(PEOPLE_US), "vin": 7_000,
        }  # fmt: skip
        self._under_way: list[tuple[int, int, CanFrame]] = []
        self._count = 0
        self.now_us, self._begun_us = 0, BEGUN_US
        self.ranged: RangedPlace | None = None
        if setting.ranging is not None:
            self.ranged = RangedPlace(setting.ranging, scene, seed=seed)
            del self._due_us["place"]
            self.begin(RUN_UP_US)

    def begin(self, at_us: int) -> None:
        """Let the scenario begin at an instant of the bus, not at `BEGUN_US`.

        Raises ValueError for one that has passed, and where the scenario has begun.
        """
        if at_us < self.now_us or self._begun_us < self.now_us:
            raise ValueError(f"expected an instant to come before the scenario, got {at_us} us")
        self._begun_us = self._sensors.begun_us = at_us

    @property
    def begun_us(self) -> int:
        """When the scenario begins."""
        return self._begun_us

    @property
    def scenario_s(self) -> float:
        """Time of the scenario; below 0 before it begins."""
        return (self.now_us - self._begun_us) / 1e6

    @property
    def wanted(self) -> Mapping[str, tuple[Wanted, ...]]:
        """What is estimated of everybody's intents, by track; {} where nobody does."""
        return self._sensors.wanted

    def hear(self, identifier: int, data: bytes) -> None:
        """A frame of whoever commands the car."""
        self._unit.hear(identifier, data, self.now_us)

    def until(self, at_us: int) -> Iterator[Sent]:
        """Lets the world go on until an instant, and every frame on the way there."""
        while self.now_us < at_us:
            self._step(min(STEP_US, at_us - self.now_us))
            self._measure()
            while self._under_way and self._under_way[0][0] <= self.now_us:
                _, _, frame = heapq.heappop(self._under_way)
                if self.ranged is not None:
                    self.ranged.hear(*frame, self.now_us)
                yield Sent(self.now_us, *frame)

    def _step(self, step_us: int) -> None:
        """Until the scene begins nobody is there, and the car stands, or is driven by hand to where
        it begins."""
        if self.ranged is not None and self.now_us < self._begun_us:
            self.ranged.drive(self.now_us - self._begun_us + RUN_UP_US, step_us)
        else:
            self._command()
        self.now_us += step_us
        if self.now_us > self._begun_us:
            self.scene.advance(min(step_us, self.now_us - self._begun_us))

    def _command(self) -> None:
        told, car = self._unit.commands(self.now_us), self.scene.car
        if not told:
            car.release()
            return
        car.command(
            accelerator=told.get("ACCEL_CMD", 0.0),
            brake=told.get("BRAKE_CMD", 0.0),
            wheel_rad=told.get("POSITION_VALUE", car.wheel_rad),
            wheel_rate_radps=told.get("SPEED_LIMIT", 0.0),
        )

    def _measure(self) -> None:
        for name, due_us in self._due_us.items():
            if due_us <= self.now_us:
                self._due_us[name] = due_us + _PERIODS_US[name]
                self._send(self._frames(name), delayed=name in ("place", "people"))
        if self.ranged is not None:
            silent = self._sensors.lost("localisation", self.now_us)
            for at_us, frame in self.ranged.due(self.now_us, silent=silent):
                self._put(at_us, frame)

    def _send(self, frames: Sequence[CanFrame], *, delayed: bool) -> None:
        low, high = self.scene.scenario.sensing.delay_s
        wait_us = round(1e6 * self._delay.uniform(low, high)) if delayed else 0
        for frame in frames:
            self._put(self.now_us + wait_us, frame)

    def _put(self, at_us: int, frame: CanFrame) -> None:
        self._count += 1
        heapq.heappush(self._under_way, (at_us, self._count, frame))

    def _frames(self, name: str) -> list[CanFrame]:
        car = self.scene.car
        if name == "reports":
            speed_mps = self._gain * car.motion.speed_mps
            outputs = Outputs(car.accelerator, car.brake, car.wheel_rad, speed_mps)
            return self._unit.reports(outputs, self.now_us)
        if name == "vin":
            return [maker_frame(self._setting.maker)]
        if name == "place":
            place = self._sensors.localised(car.motion, self.now_us)
            return [] if place is None else place_frames(place)
        return self._people_frames()

    def _people_frames(self) -> list[CanFrame]:
        scene = self.scene
        people = scene.people if self.now_us >= self._begun_us else ()
        seen = self._sensors.people(people, scene.car.motion, scene.eye, self.now_us)
        if seen is None:
            return []
        frames = set_frames(seen)
        if self._setting.estimator is not None:
            body_m = _BODY_M + scene.scenario.sensing.person_m
            frames += way_frames(seen, self._sensors.wants(seen, self.now_us), body_m=body_m)
        return frames


_PERIODS_US: Final = {
    "reports": _REPORT_US, "place": LOCALISED_US, "people": PEOPLE_US, "vin": _VIN_US,
}  # fmt: skip
