"""Worlds in random phases, gone on with from where they were driven to, and what answers faults."""

from __future__ import annotations

import functools
import os
import pickle
import random
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from onboard_core_cases import DRIVE_BY_WIRE, core
from onboard_world import VIN_US, Injector, World
from onboard_world_plant import PACMOD2, REPORT_US, STEP_US, framed
from onboard_world_sensors import LOCALISED_US, PEOPLE_US, Walker
from runtime_world import arc_table

from workbench.runtime.onboard.core import TurnResult
from workbench.runtime.onboard.faults import Fault, Found, Reaction
from workbench.runtime.onboard.states import Mode, Request, State

PATH = arc_table(0.05, nodes=500)
ARMED_US = 2_500_000
PROFILE = framed("BRAKE_CMD", {"BRAKE_CMD": DRIVE_BY_WIRE.pedals.brake_profile})
FREE = framed("ACCEL_CMD", {"ACCEL_CMD": 0.0})
FLAGS = {"CLEAR_OVERRIDE": 0, "IGNORE_OVERRIDE": 0}
ENABLED = framed("GLOBAL_CMD", {"PACMOD_ENABLE": 1, **FLAGS})
DISABLED = framed("GLOBAL_CMD", {"PACMOD_ENABLE": 0, **FLAGS})
ACCEL, GLOBAL, BRAKE, STEERING = (
    PACMOD2.by_name[f"{name}_CMD"].frame_id for name in ("ACCEL", "GLOBAL", "BRAKE", "STEERING")
)
COMMANDS = frozenset({ACCEL, GLOBAL, BRAKE, STEERING})
ANSWERING = frozenset({Reaction.BRAKE, Reaction.LATCH, Reaction.YIELD, Reaction.REFUSE})
Result = TypeVar("Result")


class Phased(World):
    """A world whose senders all begin in phases of their own; in GATE with an upstream controller
    on a bus of its own, read once per turn. mute: its frames that do not come; enable: its flag."""

    def __init__(self, mode: Mode, seed: int, **changed: Any) -> None:
        self.mute: set[str] = set()
        self.enable = 1
        self.upstream_us: dict[str, int] = {}
        self.read_us: dict[str, int] = {}
        self._upstream: deque[tuple[int, bytes]] = deque()
        walkers = [Walker(3, 30.0, -25.0), Walker(4, -20.0, 15.0, 0.3, 0.0)]
        made = core(mode, path=PATH, **changed)
        super().__init__(made, sends=mode is not Mode.SHADOW, seed=seed, walkers=walkers)
        if mode is Mode.GATE:
            self.timeline.every(self.chance.randrange(REPORT_US), REPORT_US, self._drive)
            before = self.notes.before

            def handed() -> list[Request]:
                while self._upstream:
                    number, data = self._upstream.popleft()
                    self.read_us[PACMOD2.by_id[number].name] = self.timeline.now_us
                    made.receive_upstream(number, data, self.timeline.now_us)
                return before()

            self.notes.before = handed  # type: ignore[method-assign]

    def _schedule(self) -> None:
        line, chance = self.timeline, self.chance
        self.localiser.delay_us = chance.randrange(5_000, 55_000)
        self.tracker.delay_us = chance.randrange(5_000, 55_000)
        line.every(0, STEP_US, lambda: self.plant.step(line.now_us))
        line.every(chance.randrange(REPORT_US), REPORT_US, self._report)
        line.every(chance.randrange(VIN_US), VIN_US, self._tell_vin)
        line.every(chance.randrange(LOCALISED_US), LOCALISED_US, self._localise)
        line.every(chance.randrange(PEOPLE_US), PEOPLE_US, self._track)

    def _drive(self) -> None:
        for name, values in (
            ("GLOBAL_CMD", {"PACMOD_ENABLE": self.enable, **FLAGS}),
            ("ACCEL_CMD", {"ACCEL_CMD": 0.45}),
            ("BRAKE_CMD", {"BRAKE_CMD": 0.0}),
            ("STEERING_CMD", {"POSITION_VALUE": self.plant.car.wheel_rad, "SPEED_LIMIT": 4.0}),
        ):
            if name not in self.mute:
                self.upstream_us[name] = self.timeline.now_us
                self._upstream.append((PACMOD2.by_name[name].frame_id, framed(name, values)))

    def inject(self, injector: Injector) -> None:
        """From now on it may go wrong."""
        self.injectors = (*self.injectors, injector)
        injector.begin(self)


@functools.cache
def warm(mode: Mode, seed: int, until_us: int) -> Phased:
    """A world that was armed, up to an instant; only to be gone on with in a child."""
    world = Phased(mode, seed)
    world.notes.asked = [(ARMED_US, Request.ARM)]
    world.run(until_us)
    assert until_us < ARMED_US or world.notes.turns[-1].state is State.TRACKING, seed
    return world


def in_child(work: Callable[[], Result]) -> Result:
    """What `work` returns, done in a copy of this process: nothing here is changed by it."""
    reads, writes = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(reads)
            try:
                told: tuple[bool, Any] = True, work()
            except BaseException as error:
                told = False, repr(error)
            with os.fdopen(writes, "wb") as pipe:
                pickle.dump(told, pipe)
        finally:
            os._exit(0)
    os.close(writes)
    with os.fdopen(reads, "rb") as pipe:
        content = pipe.read()
    os.waitpid(child, 0)
    went_well, found = pickle.loads(content)
    assert went_well, found
    return found  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Answer:
    """One trial. condition_us: when the fault was there and could be noticed; found_us: the turn;
    first_us, answered_us: when the last bit of the first frame that answers, and of the frame that
    brakes (or yields), was on the bus; made_us: when it was handed to it; since_us, faults: as the
    turn said; kept: nothing after the answer contradicts it."""

    injected_us: int
    condition_us: int
    found_us: int
    made_us: int
    first_us: int | None
    answered_us: int | None
    faults: tuple[str, ...]
    kept: bool


Truth = Callable[[Phased, Injector, TurnResult], int | None]


def tried(
    world: Phased,
    injector: Injector,
    *,
    truth: Truth,
    faults: frozenset[Fault],
    most_us: int,
    kept_us: int,
) -> Answer | None:
    """What comes of it from here on; None where nothing answers within most_us of its start.

    kept_us: so long after the answer it is watched that the answer stays.
    """
    world.inject(injector)
    begin = len(world.notes.turns)
    found = None
    while found is None and world.timeline.now_us < injector.start_us + most_us:
        world.run(world.timeline.now_us + 33_000)
        found = next((t for t in world.notes.turns[begin:] if answering(t.faults)), None)
    if found is None or not faults & {each.fault for each in found.faults}:
        return None
    world.run(found.at_us + kept_us)
    return _answer(world, injector, found, truth(world, injector, found))


def answering(found: tuple[Found, ...]) -> bool:
    return any(each.fault.reaction in ANSWERING for each in found)


def _answer(
    world: Phased, injector: Injector, found: TurnResult, true_us: int | None
) -> Answer | None:
    yields = found.state is State.YIELDED
    wanted = (GLOBAL, DISABLED) if yields else (BRAKE, PROFILE)
    first = wanted if yields else (ACCEL, FREE)
    made = [each for each in world.port.handed if each[0] >= found.at_us and each[1] in COMMANDS]
    made_us = next((at_us for at_us, *frame in made if tuple(frame) == wanted), None)
    if made_us is None:
        return None
    since = [each.since_us for each in found.faults if each.fault.reaction in ANSWERING]
    known = [each for each in since if injector.start_us <= each]
    known += [] if true_us is None else [true_us]
    return Answer(
        injector.start_us,
        min(known, default=found.at_us),
        found.at_us,
        made_us,
        _on_bus(world, found.at_us, first),
        _on_bus(world, made_us, wanted),
        tuple(each.fault.name for each in found.faults),
        _kept([(number, data) for _, number, data in made], yields=yields),
    )


def _on_bus(world: Phased, after_us: int, frame: tuple[int, bytes]) -> int | None:
    for at_us, number, data in world.of_monitor():
        if at_us > after_us and (number, data) == frame:
            return at_us
    return None


def _kept(made: list[tuple[int, bytes]], *, yields: bool) -> bool:
    """BRAKE on every turn, or ENABLE 0 once and silence; BRAKE may end in ENABLE 0."""
    usual: Mapping[int, bytes] = {ACCEL: FREE, BRAKE: PROFILE, GLOBAL: ENABLED}
    ends = next((k for k, frame in enumerate(made) if frame == (GLOBAL, DISABLED)), len(made))
    if yields and ends:
        return False
    return len(made) <= ends + 1 and all(
        usual.get(number, data) == data for number, data in made[:ends]
    )


def trials(
    count: int, *, mode: Mode, warm_us: int, salt: str
) -> list[tuple[Phased, random.Random]]:
    """So many worlds, several from one that was driven, and chance for each."""
    return [
        (warm(mode, seed % 10, warm_us), random.Random(f"{salt} {seed}")) for seed in range(count)
    ]
