"""What a drive in real time keeps: the truth at every turn of a monitor that is elsewhere, joined
with what the monitor decided once its log has been read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

from workbench.estimation.people_estimator import PeopleNow, Wanted
from workbench.runtime.decision import Action
from workbench.runtime.onboard.core import Core, Request
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.states import State
from workbench.runtime.onboard.turns import TurnResult
from workbench.runtime.policies import Turn
from workbench.simulation.bus_drive import BusDrive, Instant, Recorded, entry_of, names_and_details
from workbench.simulation.bus_world import BusWorld
from workbench.simulation.measures import Drawing, Moment
from workbench.simulation.objections import Objections
from workbench.simulation.people import PeopleModel
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.recorded_path import corners
from workbench.simulation.recording import PersonSample, Track
from workbench.simulation.runlog import Entry
from workbench.simulation.walkers.pedestrian import CarNow, PersonNow


@final
class PlayedAgain:
    """A core whose every turn is kept; `PlayedCore` of the playback."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self.results: list[TurnResult] = []

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        """As `Core.receive`."""
        self._core.receive(identifier, data, at_us)

    def receive_upstream(self, identifier: int, data: bytes, at_us: int) -> None:
        """As `Core.receive_upstream`."""
        self._core.receive_upstream(identifier, data, at_us)

    def bus_error(self, kind: BusError, at_us: int) -> None:
        """As `Core.bus_error`."""
        self._core.bus_error(kind, at_us)

    def request(self, request: Request, at_us: int) -> None:
        """As `Core.request`."""
        self._core.request(request, at_us)

    def turn(self, at_us: int, clock: Callable[[], int]) -> TurnResult:
        """As `Core.turn`."""
        self.results.append(self._core.turn(at_us, clock))
        return self.results[-1]


@final
@dataclass(frozen=True, slots=True)
class _Beat:
    """The truth when a HEARTBEAT came: its bytes say whose turn it was."""

    data: bytes
    t_s: float
    state: State
    car: CarNow
    motion: Motion
    people: tuple[PersonNow, ...]
    wanted: Mapping[str, tuple[Wanted, ...]]


@final
class LiveStory:
    """Keeps the truth beat by beat, from the scenario's beginning to its end."""

    def __init__(self, world: BusWorld, recorded: Recorded) -> None:
        self._world, self._recorded = world, recorded
        self._beats: list[_Beat] = []
        self._over = False

    def beat(self, data: bytes, state: State) -> None:
        """A HEARTBEAT came, with these bytes."""
        world, scene = self._world, self._world.scene
        if world.scenario_s >= 0.0 and not self._over:
            self._beats.append(
                _Beat(
                    data, world.scenario_s, state, scene.car_now(), scene.car.motion, scene.people,
                    world.wanted,
                )
            )  # fmt: skip

    def ends(self) -> None:
        """The scenario is over; what comes now belongs to no page."""
        self._over = True

    def told(self, results: Sequence[TurnResult]) -> BusDrive:
        """The drive, with what the turns of the same HEARTBEAT found and decided."""
        found = {frame.data: result for result in results for frame in result.frames}
        drawing = Drawing(self._recorded.horizon_s, 0.5, corners(self._world.scene.setting.path))
        tracks = self._tracks()
        objections, instants = Objections(), list[Instant]()
        entries: list[Entry] = []
        for beat in self._beats:
            result = found.get(beat.data)
            instants.append(_instant(beat, result, objections))
            if self._recorded.pages and result is not None and result.decision is not None:
                entries.append(entry_of(_moment(beat), result, tracks, drawing))
        return BusDrive(tuple(instants), tuple(entries), self._world.scene.nearness)

    def _tracks(self) -> tuple[Track, ...]:
        samples: dict[str, tuple[str, list[PersonSample]]] = {}
        for beat in self._beats:
            for person in beat.people:
                known = samples.setdefault(person.name, (person.kind, []))
                known[1].append(PersonSample(beat.t_s, person.x_m, person.y_m))
        return tuple(Track(name, kind, tuple(those)) for name, (kind, those) in samples.items())


def _instant(beat: _Beat, result: TurnResult | None, objections: Objections) -> Instant:
    tracks = beat.state is State.TRACKING
    faults, details = names_and_details(() if result is None else result.faults)
    observation = None if result is None else result.observation
    decision = None if result is None else result.decision
    return Instant(
        beat.t_s, beat.motion, beat.car.station_m, beat.state, tracks, beat.people, faults,
        observation, objections.after(decision, blind=bool(faults)), details,
    )  # fmt: skip


def _moment(beat: _Beat) -> Moment:
    action = Action.TRACK if beat.state is State.TRACKING else Action.BRAKE
    return Moment(
        beat.t_s, (Turn(action, None),), beat.car.body, beat.car.speed_mps, (),
        PeopleModel.assumed(), PeopleNow((), beat.wanted),
    )  # fmt: skip
