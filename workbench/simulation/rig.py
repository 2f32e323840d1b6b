"""A built vehicle on a test rig: any scenario, plant and policy, on the bus or at the desk."""

from __future__ import annotations

import functools
import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.models.vehicle import Vehicle
from workbench.runtime import Bundle, Deciding, Monitor
from workbench.runtime.onboard.core import Core
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.pid import law_of
from workbench.runtime.onboard.sensors_file import settings_from
from workbench.runtime.onboard.states import Mode
from workbench.runtime.path import PathTable
from workbench.simulation.bus_drive import BusDrive, BusLoop, Recorded, drive
from workbench.simulation.bus_world import BusSetting, BusWorld
from workbench.simulation.clock import SetClock
from workbench.simulation.desk_drive import DeskLoop, Driving
from workbench.simulation.drive_outcomes import DriveOutcome, Step
from workbench.simulation.measures import Judge, Progress
from workbench.simulation.plants.actuators import Actuators, DriveByWireCar
from workbench.simulation.plants.make import chassis
from workbench.simulation.ranged_place import require_heard
from workbench.simulation.run_up import AWAY_M
from workbench.simulation.scenarios.scenario import Scenario
from workbench.simulation.scene import Scene, Setting

SPACING_M: Final = 0.25
_BEFORE_M, _AFTER_M = 10.0, 40.0

MakeJudge = Callable[[PathTable, SetClock], Judge]
"""Who decides at the desk, made for a path and a clock."""


@final
@dataclass(frozen=True, slots=True)
class Trial:
    """What is driven: scenario, plant (one of `PLANTS`), and the seed of all errors, actuators and
    people. Seed 0 takes the middle of every actuator's band."""

    scenario: Scenario
    plant: str
    seed: int


@final
@dataclass(frozen=True, slots=True)
class Rig:
    """A vehicle and its bundle, which must be one for driving (see `MonitorSpec`); paths are those
    of the scenarios, not the bundle's own."""

    bundle: Bundle
    vehicle: Vehicle

    @property
    def settings(self) -> OnboardSettings:
        """Of the core."""
        return settings_from(self.bundle.manifest, signed=True, tag=0)

    def scene(self, trial: Trial, *, away_m: float = 0.0) -> Scene:
        """The car at standstill at the path's beginning, or away_m before it, everybody in
        place."""
        path = path_table(trial.scenario)
        wire = self.settings.drive_by_wire
        actuators = Actuators.middle(wire)
        if trial.seed:
            actuators = Actuators.drawn(wire, random.Random(f"actuators {trial.seed}"))
        place = trial.scenario.path
        x_m, y_m = (float(value) for value in place.position(0.0))
        heading = float(place.heading(0.0))
        x_m, y_m = x_m - away_m * math.cos(heading), y_m - away_m * math.sin(heading)
        body = chassis(trial.plant, self.vehicle, x_m=x_m, y_m=y_m, heading=heading)
        setting = Setting(trial.scenario, self.vehicle, path)
        return Scene(setting, DriveByWireCar(body, wire, actuators), seed=trial.seed)

    def on_bus(
        self,
        trial: Trial,
        *,
        deciding: Deciding,
        setting: BusSetting | None = None,
        recorded: Recorded | None = None,
        progress: Progress | None = None,
    ) -> BusDrive:
        """Driven by the core that runs on the vehicle, over CAN frames, in virtual time.

        With ranging, a driver takes the car to the path's beginning first. Raises InputError for a
        localiser whose sets come later than the bundle allows.
        """
        settings = self.settings
        world = self.world(trial, setting or BusSetting(settings.maker))
        path = world.scene.setting.path
        core = Core(self.bundle.with_deciding(deciding), path, settings, mode=Mode.DRIVE)
        loop = BusLoop(core, world, seed=trial.seed)
        return drive(loop, world, recorded or Recorded(), progress=progress)

    def world(self, trial: Trial, setting: BusSetting) -> BusWorld:
        """The scene on the bus. With ranging the car stands before the path's beginning, and a
        driver takes it there; InputError as of `on_bus`."""
        away_m = 0.0
        if setting.ranging is not None:
            require_heard(setting.ranging, self.settings)
            away_m = AWAY_M
        return BusWorld(self.scene(trial, away_m=away_m), setting, seed=trial.seed)

    def at_desk(self, trial: Trial, judge: MakeJudge) -> DriveOutcome:
        """Driven without frames, faster; judge: a monitor (`monitor`) or whoever else decides."""
        scene, clock = self.scene(trial), SetClock()
        law = law_of(self.bundle.manifest.parameters)
        driving = Driving(judge(scene.setting.path, clock), clock, law, self.settings)
        loop, steps = DeskLoop(scene, driving, seed=trial.seed), []
        while scene.now_s < trial.scenario.duration_s:
            loop.turn()
            motion = scene.car.motion
            steps.append(
                Step(
                    scene.now_s, scene.place().station_m, motion.speed_mps,
                    motion.acceleration_mps2, loop.tracks, loop.grounds,
                )
            )  # fmt: skip
        return DriveOutcome.of(steps, scene.nearness, trial.scenario)

    def monitor(self, deciding: Deciding) -> MakeJudge:
        """The bundle's own decision, as `at_desk` takes it."""
        settings = self.settings

        def made(path: PathTable, clock: SetClock) -> Monitor:
            return Monitor(
                self.bundle, path, release_steps=settings.release_steps,
                clearance_required_m=settings.clearance_required_m, timing=settings.timing,
                deciding=deciding, clock=clock,
            )  # fmt: skip

        return made


def outcome_on_bus(driven: BusDrive, scenario: Scenario) -> DriveOutcome:
    """What came of a drive over the bus."""
    steps = [
        Step(
            i.t_s, i.station_m, i.motion.speed_mps, i.motion.acceleration_mps2, i.tracks, i.grounds
        )
        for i in driven.instants
    ]  # fmt: skip
    return DriveOutcome.of(steps, driven.nearness, scenario)


@functools.lru_cache(maxsize=64)
def _table(waypoints: tuple[tuple[float, float], ...]) -> PathTable:
    from workbench.models.spline_path import SplinePath

    return SplinePath.through(waypoints).table(SPACING_M, before_m=_BEFORE_M, after_m=_AFTER_M)


def path_table(scenario: Scenario) -> PathTable:
    """The scenario's path as the monitor has it, with straight ends. InputError where it bends
    more than the spline allows."""
    if len(scenario.waypoints) < 2:
        raise InputError(
            f"{scenario.name}: expected at least 2 waypoints, got {len(scenario.waypoints)}"
        )
    return _table(scenario.waypoints)
