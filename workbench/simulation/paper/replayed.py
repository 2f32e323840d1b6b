"""Drives over the bus, replayed: what each decision was asked, and where the car then truly was."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.runtime import Deciding, Decision, Observation
from workbench.runtime.judgement import CannotJudgeError
from workbench.runtime.measuring import Measuring
from workbench.runtime.onboard.core import Core
from workbench.runtime.onboard.states import Mode, State
from workbench.runtime.onboard.times import TURN_US, seconds
from workbench.runtime.path import NoProjection, PathTable
from workbench.sets import Box
from workbench.simulation.bus_drive import BusLoop
from workbench.simulation.bus_world import BusSetting, BusWorld
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.rig import Rig, Trial
from workbench.simulation.walkers.pedestrian import PersonNow

Array = NDArray[np.float64]

TURN_S: Final = seconds(TURN_US)
"""Between two instants at which tubes are compared with the car."""
_LEFT_M: Final = 25.0
"""A run ends where less of the path is left: tubes of 5 s would leave it."""


@final
@dataclass(frozen=True, slots=True)
class Replayed:
    """One turn: scenario time, the car's true motion, whether TRACK was sent, people where they
    truly are; observation and decision of a turn that decided, else None."""

    t_s: float
    motion: Motion
    tracks: bool
    people: tuple[PersonNow, ...]
    observation: Observation | None
    decision: Decision | None


def turns(rig: Rig, trial: Trial, *, deciding: Deciding) -> Iterator[Replayed]:
    """Every turn of a scenario that the vehicle's own core drives; see `Rig.on_bus`."""
    scene, settings = rig.scene(trial), rig.settings
    core = Core(rig.bundle.with_deciding(deciding), scene.setting.path, settings, mode=Mode.DRIVE)
    world = BusWorld(scene, BusSetting(settings.maker), seed=trial.seed)
    loop = BusLoop(core, world, seed=trial.seed)
    while world.scenario_s < trial.scenario.duration_s:
        result = loop.turn()
        if world.scenario_s >= 0.0:
            yield Replayed(
                world.scenario_s, scene.car.motion, result.state is State.TRACKING, scene.people,
                result.observation, result.decision,
            )  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Asked:
    """One decision: at which turn, about which nested sets of path states (the largest first), and
    the speed that the controller follows."""

    turn: int
    sets: tuple[Box, ...]
    reference_speed_mps: float


@final
@dataclass(frozen=True, slots=True, eq=False)
class ReplayedRun:
    """One run. name: of scenario, plant and seed; lower, upper (M, 2): station and offset (m) of
    the car's true place at each turn, enclosed to rounding, NaN off the path; speed_mps (M,): true;
    tracks (M,): was TRACK sent?; asked: the decisions whose sets could be measured; unmeasured: how
    many others there were."""

    name: str
    plant: str
    path: PathTable
    lower: Array
    upper: Array
    speed_mps: Array
    tracks: NDArray[np.bool_]
    asked: tuple[Asked, ...]
    unmeasured: int

    def kept(self, *, horizon_s: float) -> tuple[tuple[Asked, int], ...]:
        """Decisions under TRACK that stayed in force, and after how many turns it no longer did (or
        the run was over), at most as many as the horizon has."""
        most = int(horizon_s / TURN_S + 1e-9)
        left = np.append(np.flatnonzero(~self.tracks), len(self.tracks) - 1)
        found = []
        for asked in self.asked:
            turn = asked.turn
            if turn and self.tracks[turn - 1] and self.tracks[turn]:
                # What is sent at a turn moves the car after it.
                until = int(left[np.searchsorted(left, turn)])
                found.append((asked, min(until - turn, most)))
        return tuple(found)


def replay(
    rig: Rig, trial: Trial, *, shares: Sequence[float],
    deciding: Deciding = Deciding.LOOK_AHEAD, advance: Callable[[], None] = lambda: None,
) -> ReplayedRun:  # fmt: skip
    """Drive, and keep what the tubes are compared with; `advance` once per second of the scenario.

    shares: of the measured set's radii, one for each nested set, 1 first and falling.

    The run is over where less than 25 m of the path are left."""
    path = rig.scene(trial).setting.path
    measuring = Measuring(path, shares, station_m=None)
    places, taken, asked, unmeasured = _Places(path), [], [], 0
    for k, each in enumerate(_counted(turns(rig, trial, deciding=deciding), advance)):
        if places.take(each.motion) > path.end_m - _LEFT_M:
            break
        taken.append(each)
        if each.observation is None:
            continue
        try:
            sets = measuring.boxes(each.observation)
        except CannotJudgeError:
            unmeasured += 1
        else:
            asked.append(Asked(k, sets, each.observation.reference_speed_mps))
    return ReplayedRun(
        f"{trial.scenario.name} {trial.plant} {trial.seed}", trial.plant, path,
        np.array(places.lower[: len(taken)]), np.array(places.upper[: len(taken)]),
        np.array([each.motion.speed_mps for each in taken]),
        np.array([each.tracks for each in taken]), tuple(asked), unmeasured,
    )  # fmt: skip


def _counted(each: Iterable[Replayed], advance: Callable[[], None]) -> Iterator[Replayed]:
    done = 0
    for turn in each:
        if done < int(turn.t_s):
            done = int(turn.t_s)
            advance()
        yield turn


class _Places:
    """Station and offset of the rear axle's middle, instant by instant, enclosed; NaN where it has
    no place on the path."""

    def __init__(self, path: PathTable) -> None:
        self._path = path
        self._near_m: float | None = None
        self.lower: list[tuple[float, float]] = []
        self.upper: list[tuple[float, float]] = []

    def take(self, motion: Motion) -> float:
        """One instant; the station, NaN where there is none."""
        sides = ((value, value) for value in (motion.x_m, motion.y_m, motion.heading))
        pose = self._path.project(*sides, near_station_m=self._near_m)
        if isinstance(pose, NoProjection):
            self.lower.append((math.nan, math.nan))
            self.upper.append((math.nan, math.nan))
            return math.nan
        self.lower.append((pose.station[0], pose.offset[0]))
        self.upper.append((pose.station[1], pose.offset[1]))
        self._near_m = 0.5 * sum(pose.station)
        return self._near_m
