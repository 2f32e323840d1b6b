"""A core under its real loop in virtual time, among a bus, a car, sensors, and what goes wrong."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from onboard_world_bus import Delivered, Frame, Port, Timeline, VirtualBus, VirtualClock
from onboard_world_plant import PACMOD2, REPORT_US, STEP_US, VIN, Plant, framed
from onboard_world_sensors import (
    LOCALISED_US,
    PEOPLE_US,
    Localiser,
    Tracker,
    framed_localisation,
)

from workbench.runtime.onboard.loop import Core, Counts, Loop
from workbench.runtime.onboard.states import Request

VIN_US = 1_000_000


class Injector(Protocol):
    """Something that goes wrong from start_us on.

    condition_us: the instant at which its condition was true and could be noticed, None: not yet.
    """

    start_us: int

    @property
    def condition_us(self) -> int | None: ...

    def begin(self, world: World) -> None:
        """Called once, before anything happens."""

    def passing(self, frame: Frame, at_us: int) -> Sequence[tuple[int, Frame]] | None:
        """What becomes of a frame that is about to be sent: (delay in us, frame) of each that is;
        None leaves it alone."""

    def delivered(self, delivered: Delivered) -> None:
        """A frame was on the bus."""


class Paced:
    """A core whose decisions take time: the clock it reads at their end has gone on."""

    def __init__(self, core: Core, timeline: Timeline, chance: random.Random) -> None:
        self._core, self._timeline, self._chance = core, timeline, chance
        self.decision_us = (4_000, 12_000)
        self.held_until_us: int | None = None
        self._next_decision_us, self._hang_us = 0, 0

    def hold_up(self, for_us: int, hangs: bool) -> None:
        """The next decision takes so long, or the next turn is followed by such a pause."""
        if hangs:
            self._hang_us = for_us
        else:
            self._next_decision_us = for_us

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        self._core.receive(identifier, data, at_us)

    def bus_error(self, kind: Any, at_us: int) -> None:
        self._core.bus_error(kind, at_us)

    def request(self, request: Request, at_us: int) -> None:
        self._core.request(request, at_us)

    def turn(self, at_us: int, clock: Callable[[], int]) -> Any:
        def ended() -> int:
            held_us, self._next_decision_us = self._next_decision_us, 0
            self._pass(held_us or self._chance.randint(*self.decision_us))
            if held_us:
                self.held_until_us = self._timeline.now_us
            return clock()

        result = self._core.turn(at_us, ended)
        if self._hang_us:
            hang_us, self._hang_us = self._hang_us, 0
            self._pass(hang_us)
            self.held_until_us = self._timeline.now_us
        return result

    def _pass(self, duration_us: int) -> None:
        self._timeline.run(self._timeline.now_us + duration_us)


@dataclass
class Notes:
    """What the loop says of itself, and what the operator asks: (instant, request)."""

    timeline: Timeline
    asked: list[tuple[int, Request]] = field(default_factory=list)
    turns: list[Any] = field(default_factory=list)

    def turned(self, result: Any, counts: Counts) -> None:
        self.turns.append(result)

    def before(self) -> list[Request]:
        due = [request for at_us, request in self.asked if at_us <= self.timeline.now_us]
        self.asked = [each for each in self.asked if each[0] > self.timeline.now_us]
        return due


class World:
    """Everything around a core. Same seed and same arguments: the same run, to the last bit.

    phase_us: when the car's reports begin. The bus carries vehicle, sensors and monitor; trace
    holds every frame that was on it, with the instant of its last bit.
    """

    def __init__(
        self,
        core: Core,
        *,
        sends: bool,
        seed: int = 0,
        injectors: Sequence[Injector] = (),
        plant: Plant | None = None,
        walkers: Sequence[Any] = (),
    ) -> None:
        self.chance = random.Random(seed)
        self.timeline = Timeline()
        self.bus = VirtualBus(self.timeline)
        self.port = Port(self.timeline, self.bus)
        self.plant = Plant() if plant is None else plant
        self.localiser = Localiser(random.Random(seed + 1))
        self.tracker = Tracker(random.Random(seed + 2), list(walkers))
        self.core = Paced(core, self.timeline, random.Random(seed + 3))
        self.notes = Notes(self.timeline)
        self.injectors = tuple(injectors)
        self.trace: list[Delivered] = []
        self.loop = Loop(
            self.core, self.port, open_bus=self.port.reopened, sends=sends,
            clock=VirtualClock(self.timeline), surroundings=self.notes,
        )  # fmt: skip
        self.bus.hears.append(self._delivered)
        self._schedule()
        for injector in self.injectors:
            injector.begin(self)

    def _schedule(self) -> None:
        line = self.timeline
        line.every(0, STEP_US, lambda: self.plant.step(line.now_us))
        line.every(self.chance.randrange(REPORT_US), REPORT_US, self._report)
        line.every(self.chance.randrange(VIN_US), VIN_US, self._tell_vin)
        line.every(self.localiser.begin_us, LOCALISED_US, self._localise)
        line.every(self.tracker.begin_us, PEOPLE_US, self._track)

    def run(self, until_us: int) -> World:
        """Turns until that instant; returns itself."""
        while self.timeline.now_us < until_us:
            if self.loop.once() is not None:
                break
        return self

    def send(
        self, sender: str, identifier: int, data: bytes, *, by: Injector | None = None
    ) -> None:
        """Onto the bus, past whatever is injected into others' frames."""
        frames = [(0, Frame(sender, identifier, data, by))]
        for injector in self.injectors if by is None else ():
            if self.timeline.now_us >= injector.start_us:
                frames = [
                    (earlier_us + later_us, changed)
                    for earlier_us, frame in frames
                    for later_us, changed in _passed(injector, frame, self.timeline.now_us)
                ]
        for delay_us, frame in frames:
            self._put(delay_us, frame)

    def _put(self, delay_us: int, frame: Frame) -> None:
        if delay_us:
            at_us = self.timeline.now_us + delay_us
            self.timeline.at(at_us, lambda: self._put(0, frame), order=frame.identifier)
        else:
            self.bus.send(frame)

    def _delivered(self, delivered: Delivered) -> None:
        frame = delivered.frame
        self.trace.append(delivered)
        if frame.sender != "pacmod":
            self.plant.hear(frame.identifier, frame.data, delivered.at_us)
        for injector in self.injectors:
            injector.delivered(delivered)

    def _report(self) -> None:
        for identifier, data in self.plant.report_frames():
            self.send("pacmod", identifier, data)

    def _tell_vin(self) -> None:
        self.send("pacmod", PACMOD2.by_name["VIN_RPT"].frame_id, framed("VIN_RPT", VIN))

    def _localise(self) -> None:
        localised = self.localiser.measured(self.plant.car, self.timeline.now_us)
        if localised is not None:
            self._later("localiser", framed_localisation(localised), self.localiser.delay_us)

    def _track(self) -> None:
        frames = self.tracker.measured(self.timeline.now_us)
        self._later("tracker", frames, self.tracker.delay_us)

    def _later(self, sender: str, frames: list[tuple[int, bytes]], delay_us: int) -> None:
        def send() -> None:
            for identifier, data in frames:
                self.send(sender, identifier, data)

        self.timeline.at(self.timeline.now_us + delay_us, send)

    def of_monitor(self, name: str | None = None) -> list[tuple[int, int, bytes]]:
        """(instant on the bus, identifier, bytes) of what the monitor sent; name: a command."""
        wanted = None if name is None else PACMOD2.by_name[name].frame_id
        return [
            (each.at_us, each.frame.identifier, each.frame.data)
            for each in self.trace
            if each.frame.sender == "monitor" and wanted in (None, each.frame.identifier)
        ]

    def answered_us(self, since_us: int, *, holds: Callable[[Any], bool]) -> int | None:
        """When the first frame of a turn that `holds` was on the bus, for turns that ended after an
        instant; None: never. Frames of the monitor that were sent before the turn do not count."""
        for result in self.notes.turns:
            if result.at_us >= since_us and holds(result):
                after = (at_us for at_us, _, _ in self.of_monitor() if at_us > result.at_us)
                return next(after, None)
        return None


def _passed(injector: Injector, frame: Frame, at_us: int) -> Sequence[tuple[int, Frame]]:
    found = injector.passing(frame, at_us)
    return [(0, frame)] if found is None else found
