"""A scenario driven by the very core that runs on the vehicle, in virtual time over CAN frames."""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.estimation.people_estimator import PeopleNow
from workbench.runtime.decision import Action, Decision
from workbench.runtime.grounds import ground_of
from workbench.runtime.observation import Observation
from workbench.runtime.onboard.core import Core
from workbench.runtime.onboard.faults import Found, Reaction
from workbench.runtime.onboard.states import Request, State
from workbench.runtime.onboard.times import TURN_US
from workbench.runtime.onboard.turns import TurnResult
from workbench.runtime.policies import Ground, Turn
from workbench.simulation.bus_world import BusWorld
from workbench.simulation.measures import Drawing, Moment, Progress
from workbench.simulation.objections import Objections
from workbench.simulation.onboard_operator import ASKS, refused_as_latched
from workbench.simulation.people import PeopleModel
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.ranged_place import Told
from workbench.simulation.recorded_path import corners
from workbench.simulation.recording import PersonSample, Track
from workbench.simulation.runlog import Entry
from workbench.simulation.scene import Nearness
from workbench.simulation.walkers.pedestrian import PersonNow

_ARM_US: Final = 300_000
"""So long after the scenario's beginning."""
_AGAIN_US: Final = 2_000_000
_DECIDES_US: Final = (3_000, 12_000)
"""What the core is told that a decision took, by chance: a run must not depend on the machine."""


@final
@dataclass(frozen=True, slots=True)
class Instant:
    """One turn of the loop: the car's true motion, the core's state, people where they are.

    t_s: on the scenario's clock; tracks: whether TRACK was sent; faults: names of those that brake
    or yield; station_m: of the car on its path; observation: of a turn that decided; grounds: what
    stands against TRACK (`Objections`); details: in words, for each of the faults.
    """

    t_s: float
    motion: Motion
    station_m: float
    state: State
    tracks: bool
    people: tuple[PersonNow, ...]
    faults: tuple[str, ...]
    observation: Observation | None
    grounds: tuple[Ground, ...]
    details: tuple[str, ...] = ()


@final
@dataclass(frozen=True, slots=True)
class BusDrive:
    """What happened: every turn, every decision as a page shows it, how near the car came, and what
    a localiser among beacons said of where it was, () where there was none."""

    instants: tuple[Instant, ...]
    entries: tuple[Entry, ...]
    nearness: Nearness
    told: tuple[Told, ...] = ()


@final
class BusLoop:
    """A core among a world, turn by turn; the operator arms it when the scenario begins."""

    def __init__(self, core: Core, world: BusWorld, *, seed: int) -> None:
        self._core, self._world = core, world
        self._chance = random.Random(f"decisions {seed}")
        self._at_us, self._asked_us, self._latched = 0, -_AGAIN_US, False
        self._result: TurnResult | None = None

    def turn(self) -> TurnResult:
        """All that comes until the next turn, and the turn."""
        self._at_us += TURN_US
        for came in self._world.until(self._at_us):
            self._core.receive(came.identifier, came.data, came.at_us)
        asked = self._asks()
        if asked is not None:
            self._core.request(asked, self._at_us)
        self._result = result = self._core.turn(self._at_us, self._ended)
        for frame in result.frames:
            self._world.hear(frame.identifier, frame.data)
        return result

    def _ended(self) -> int:
        return self._at_us + self._chance.randint(*_DECIDES_US)

    def _asks(self) -> Request | None:
        """ARM once the scenario has begun, and again where a fault has ended the driving."""
        result = self._result
        self._latched = result is not None and (self._latched or refused_as_latched(result))
        late = self._at_us - self._asked_us < _AGAIN_US
        early = self._at_us < self._world.begun_us + _ARM_US
        if result is None or early or late or result.state not in ASKS:
            return None
        self._asked_us = self._at_us
        if self._latched and result.state is State.YIELDED:
            self._latched = False
            return Request.DISARM
        return ASKS[result.state]


_SENT: Final = {State.TRACKING: "TRACK", State.BRAKING: "BRAKE", State.FAULT: "BRAKE"}


@final
@dataclass(frozen=True, slots=True)
class Recorded:
    """What a drive keeps. pages: whether every decision is kept as a page shows it; horizon_s: how
    far ahead people's discs are kept for it."""

    pages: bool = True
    horizon_s: float = 3.0


def drive(
    loop: BusLoop, world: BusWorld, recorded: Recorded, *, progress: Progress | None = None,
) -> BusDrive:  # fmt: skip
    """Let the loop turn until the scenario is over.

    `progress(done, total)` is called once per second of the scenario.
    """
    story = _Story(world, recorded)
    duration_s = world.scene.scenario.duration_s
    last_us = world.begun_us + round(1e6 * duration_s)
    seconds = math.ceil(duration_s)
    done = 0
    while world.now_us < last_us:
        story.turned(loop.turn())
        if progress is not None and done < int(world.scenario_s) <= seconds:
            done = int(world.scenario_s)
            progress(done, seconds)
    return story.told()


class _Story:
    """Keeps what happens, turn by turn."""

    def __init__(self, world: BusWorld, recorded: Recorded) -> None:
        self._world, self._recorded = world, recorded
        self._drawing = Drawing(recorded.horizon_s, 0.5, corners(world.scene.setting.path))
        self._objections = Objections()
        self._instants: list[Instant] = []
        self._decided: list[tuple[Moment, TurnResult]] = []
        self._samples: dict[str, tuple[str, list[PersonSample]]] = {}

    def turned(self, result: TurnResult) -> None:
        """One turn has ended."""
        world, scene = self._world, self._world.scene
        faults, details = names_and_details(result.faults)
        grounds = self._objections.after(result.decision, blind=bool(faults))
        if world.scenario_s < 0.0:
            return
        car, people = scene.car_now(), scene.people
        tracks = result.state is State.TRACKING
        t_s = world.scenario_s
        self._instants.append(
            Instant(
                t_s,
                scene.car.motion,
                car.station_m,
                result.state,
                tracks,
                people,
                faults,
                result.observation,
                grounds,
                details,
            )
        )
        for person in people:
            known = self._samples.setdefault(person.name, (person.kind, []))
            known[1].append(PersonSample(t_s, person.x_m, person.y_m))
        if self._recorded.pages and result.decision is not None:
            turn = Turn(Action.TRACK if tracks else Action.BRAKE, None)
            told = PeopleNow((), world.wanted)
            moment = Moment(t_s, (turn,), car.body, car.speed_mps, (), PeopleModel.assumed(), told)
            self._decided.append((moment, result))

    def told(self) -> BusDrive:
        """All of it."""
        tracks = tuple(
            Track(name, kind, tuple(samples)) for name, (kind, samples) in self._samples.items()
        )
        entries = [
            entry_of(moment, result, tracks, self._drawing) for moment, result in self._decided
        ]
        ranged = self._world.ranged
        told = () if ranged is None else tuple(ranged.told)
        return BusDrive(tuple(self._instants), tuple(entries), self._world.scene.nearness, told)


def entry_of(
    moment: Moment, result: TurnResult, tracks: tuple[Track, ...], drawing: Drawing
) -> Entry:
    """A decision as a page shows it. Among the violations stand what the core found wrong, and what
    stood against TRACK by the name of its ground, people apart, where nothing else names it."""
    assert result.decision is not None, "only turns that decided are kept"
    assert result.observation is not None, "a decision is about one"
    moment = dataclasses.replace(moment, people=tracks)
    entry = moment.entry(result.observation, result.decision, drawing)
    names, details = names_and_details(result.faults)
    found = [f"{name}: {detail}" for name, detail in zip(names, details, strict=True)]
    found += _against_track(result.decision, blind=bool(found))
    frame = dataclasses.replace(
        entry.frame, violations=(*entry.frame.violations, *found), sent=sent_in(result.state)
    )
    return dataclasses.replace(entry, frame=frame)


def sent_in(state: State) -> str:
    """ "TRACK" or "BRAKE" as the state sends it; "" where it sends neither."""
    return _SENT.get(state, "")


def _against_track(decision: Decision, *, blind: bool) -> list[str]:
    named = {Ground.PEOPLE, *(ground_of(each.hypothesis) for each in decision.violations)}
    if blind:
        named.add(Ground.READING)
    return [f"{each.name}: {decision.reason}" for each in decision.grounds if each not in named]


def names_and_details(found: Sequence[Found]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the faults that the core answers, and what it says of each."""
    those = [each for each in found if answered(each)]
    return tuple(each.fault.name for each in those), tuple(each.detail for each in those)


def answered(found: Found) -> bool:
    """Whether the core brakes or lets go of the car for it, and not only says so."""
    return found.fault.reaction is not Reaction.ALERT
