"""What came from the buses: last reports, last whole sets, and everything that was wrong."""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime.onboard.counting import NEVER, Count, FrameRate
from workbench.runtime.onboard.report_names import report_names
from workbench.runtime.onboard.set_streams import SetCounts, SetSeen, SetStream
from workbench.runtime.onboard.stamps import StampBounds
from workbench.runtime.onboard.ways import WayStream
from workbench.runtime.protocols import (
    PROTOCOLS,
    Decoded,
    LocalisationSet,
    Localised,
    NoSet,
    PeopleSeen,
    PersonSet,
    Protocol,
    Refusal,
    counter_step,
    decode,
    load_protocol,
)
from workbench.runtime.protocols.tables import Message, Role

OURS: Final = "WORKBENCH"
"""Who sends commands, heartbeat and decision: nobody else may."""
MOST_SAMPLES: Final = 128
SAMPLE_GAP_US: Final = 10_000
"""Samples are kept no denser, so that a flood cannot push the earlier ones out."""


class BusError(enum.Enum):
    """What a bus or its controller reports instead of a frame."""

    ERROR_FRAME = "error frame"
    ERROR_PASSIVE = "the controller is error passive"
    BUS_OFF = "the controller is off the bus"
    OVERFLOW = "frames were lost before they were read"
    RECEIVE = "a frame could not be read"
    SEND = "a frame could not be sent"
    LATE = "frames could not be sent in time"
    CLOSED = "the bus is closed"


@final
@dataclass(frozen=True, slots=True)
class Report:
    """The last accepted frame of a message; same_since_us: when the first of all frames up to this
    one came that equal it in every bit."""

    values: Mapping[str, float]
    at_us: int
    data: bytes
    same_since_us: int


@final
@dataclass(frozen=True, slots=True)
class Sample:
    """One value of a report, and when it came."""

    value: float
    at_us: int


@final
class Intake:
    """Everything received, with fixed bounds on what is kept; all calls from one thread.

    vehicle, own: protocols, whose identifiers must differ; stamps: see `StampBounds`. An at_us is
    any instant at or after the frame's arrival, so a clock that is read rounds up. Nothing here
    raises once it is made, whatever the numbers are.

    reports: last accepted frame by message, of the vehicle; a frame whose counter does not move on
    is dropped. commands: the same of identifiers that only we send. localisation, people: the last
    whole set, however old, or why there is none: nothing whole yet, or, of people, that the newest
    set says that they cannot be judged. ways: those that people may take. refusals, last_refusal:
    by message; accepted frames end a row. counter_faults: reports dropped for their counter.
    spoofed: identifiers of our own frames, and of our commands, from outside. foreign: reports of
    another protocol, by its name. unknown: identifiers that nobody defines; backwards: frames
    dropped because their instant lies before the last one. frames, arrivals: how often frames come,
    all and by message.
    """

    def __init__(self, vehicle: Protocol, own: Protocol, *, stamps: StampBounds) -> None:
        shared = sorted(vehicle.by_id.keys() & own.by_id.keys())
        if shared:
            raise InputError(
                f"expected protocols without a common identifier, {vehicle.name} and {own.name} "
                f"share {[hex(identifier) for identifier in shared]}"
            )
        self.vehicle, self.own = vehicle, own
        self.names = report_names(vehicle)
        self._foreign = _foreign_reports(vehicle, own)
        self._stamps = stamps
        self._localisation: SetStream[Localised] = SetStream(LocalisationSet(), stamps)
        self._people: SetStream[PeopleSeen] = SetStream(PersonSet(), stamps)
        self.ways = WayStream()
        places = (self.names.speed, self.names.steering.output, self.names.yaw_rate)
        self._sampled = {place.message: place for place in places if place is not None}
        self.samples = {name: deque[Sample](maxlen=MOST_SAMPLES) for name in self._sampled}
        self.reports: dict[str, Report] = {}
        self.commands: dict[str, Report] = {}
        self.refusals: dict[str, Count] = {}
        self.last_refusal: dict[str, Refusal] = {}
        self.counter_faults: dict[str, Count] = {}
        self.spoofed: dict[str, Count] = {}
        self.foreign: dict[str, Count] = {}
        self.bus_errors: dict[BusError, Count] = {}
        self.unknown = NEVER
        self.backwards = NEVER
        self.frames = FrameRate()
        self.arrivals: dict[str, FrameRate] = {}
        self.last_us: int | None = None

    @property
    def localisation(self) -> SetSeen[Localised] | NoSet:
        """The last whole localisation."""
        return self._localisation.seen

    @property
    def people(self) -> SetSeen[PeopleSeen] | NoSet:
        """The last whole set of people, or that the newest one cannot be judged."""
        return self._people.seen

    @property
    def localisations(self) -> tuple[SetSeen[Localised], ...]:
        """Earlier localisations, at least SET_GAP_US apart, the oldest first."""
        return tuple(self._localisation.history)

    @property
    def localisation_counts(self) -> SetCounts:
        """How the localisations fared."""
        return self._localisation.counts

    @property
    def people_counts(self) -> SetCounts:
        """How the sets of people fared."""
        return self._people.counts

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        """One frame from outside; never raises."""
        if self.last_us is not None and at_us < self.last_us:
            self.backwards = self.backwards.more(at_us)
            return
        self.last_us = at_us
        self.frames.take(at_us)
        for protocol in (self.vehicle, self.own):
            message = protocol.by_id.get(identifier)
            if message is not None:
                self._known(protocol, message, data, at_us)
                return
        other = self._foreign.get(identifier)
        if other is None:
            self.unknown = self.unknown.more(at_us)
        else:
            _add(self.foreign, other, at_us)

    def forget_sets(self) -> None:
        """Begin anew with sets, their counts and their senders' clocks, as a sender that was
        started again needs; for a person to ask for, with the car at standstill."""
        self._localisation = SetStream(LocalisationSet(), self._stamps)
        self._people = SetStream(PersonSet(), self._stamps)
        self.ways = WayStream()

    def bus_error(self, kind: BusError, at_us: int) -> None:
        """An error instead of a frame."""
        self.bus_errors[kind] = self.bus_errors.get(kind, NEVER).more(at_us)

    def _known(self, protocol: Protocol, message: Message, data: bytes, at_us: int) -> None:
        name = message.name
        self.arrivals.setdefault(name, FrameRate()).take(at_us)
        frame = decode(protocol, message.frame_id, data)
        if isinstance(frame, Refusal):
            _add(self.refusals, name, at_us)
            self.last_refusal[name] = frame
        elif name in self.refusals:
            self.refusals[name] = self.refusals[name].ended()
        if message.sender == OURS:
            _add(self.spoofed, name, at_us)
            if isinstance(frame, Decoded):
                self.commands[name] = _report(self.commands.get(name), frame, data, at_us)
        elif protocol is self.own:
            self._localisation.take(frame, at_us)
            self._people.take(frame, at_us)
            self.ways.take(frame, at_us, self.people)
        elif isinstance(frame, Decoded):
            self._reported(message, frame, data, at_us)

    def _reported(self, message: Message, frame: Decoded, data: bytes, at_us: int) -> None:
        name, before = message.name, self.reports.get(message.name)
        if before is not None and not _moves_on(message, before.values, frame.values):
            _add(self.counter_faults, name, at_us)
            return
        self.reports[name] = _report(before, frame, data, at_us)
        place = self._sampled.get(name)
        if place is None:
            return
        kept = self.samples[name]
        if not kept or at_us - kept[-1].at_us >= SAMPLE_GAP_US:
            kept.append(Sample(frame.values[place.signal], at_us))


def _report(before: Report | None, frame: Decoded, data: bytes, at_us: int) -> Report:
    same = before is not None and before.data == data
    since_us = before.same_since_us if before is not None and same else at_us
    return Report(frame.values, at_us, data, since_us)


def _moves_on(message: Message, before: Mapping[str, float], now: Mapping[str, float]) -> bool:
    counter = message.with_role(Role.COUNTER)
    if counter is None:
        return True
    was, stands = int(before[counter.name]), int(now[counter.name])
    return counter_step(was, stands, bits=counter.length) > 0


def _add(counts: dict[str, Count], name: str, at_us: int) -> None:
    counts[name] = counts.get(name, NEVER).more(at_us)


def _foreign_reports(vehicle: Protocol, own: Protocol) -> Mapping[int, str]:
    """Identifiers of reports that other vehicles' protocols define and neither of these does."""
    others = (load_protocol(name) for name in PROTOCOLS if name not in (vehicle.name, own.name))
    return {
        identifier: other.name
        for other in others
        for identifier, message in other.by_id.items()
        if message.sender != OURS
        and identifier not in vehicle.by_id
        and identifier not in own.by_id
    }
