"""Replay of a log: a core is given what the one on the vehicle got, at the same microseconds.

Turns take place at the instants of our own HEARTBEAT frames; the clock that a turn reads when its
decision ends shows the time of the DECISION frame. So a core with the same bundle, path and
settings makes the same frames and decisions, bit for bit, of a log that a recorder wrote.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Protocol, final

from workbench.runtime.onboard.core import Request
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.recorder_entries import (
    LoggedFrame,
    ReadClock,
    decision_of,
    turn_frames,
    turn_record,
)
from workbench.runtime.protocols import Refusal, decode, load_protocol

if TYPE_CHECKING:
    from workbench.runtime.onboard.core import TurnResult

_OWN: Final = load_protocol("workbench")
_JUDGED: Final = ("ACTION", "VERDICT", "ALERT")
_NOTHING: Final = ("nothing", "")


class Listening(Protocol):
    """What is told of the buses."""

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        """One frame that came."""
        ...

    def receive_upstream(self, identifier: int, data: bytes, at_us: int) -> None:
        """One frame that came from the upstream controller's bus."""
        ...

    def bus_error(self, kind: BusError, at_us: int) -> None:
        """The bus failed."""
        ...


class PlayedCore(Listening, Protocol):
    """What is fed: `workbench.runtime.onboard.core.Core`, or anything with its verbs."""

    def request(self, request: Request, at_us: int) -> None:
        """The operator asked."""
        ...

    def turn(self, at_us: int, clock: Callable[[], int]) -> TurnResult:
        """One turn."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Received:
    """A frame that was given to the core."""

    identifier: int
    data: bytes
    at_us: int
    upstream: bool = False


@final
@dataclass(frozen=True, slots=True)
class BusErrorSeen:
    """A fault of the bus that was reported to the core."""

    kind: BusError
    at_us: int


@final
@dataclass(frozen=True, slots=True)
class RequestSeen:
    """What the operator asked."""

    request: Request
    at_us: int


@final
@dataclass(frozen=True, slots=True)
class Turn:
    """A turn: when it began, what its clock said (None: it was not read), what it made."""

    at_us: int
    decided_us: int | None
    frames: tuple[LoggedFrame, ...]


@final
@dataclass(frozen=True, slots=True)
class DecisionLogged:
    """What the log says of the decision of the turn that began then; MCAP only."""

    at_us: int
    said: Mapping[str, Any]


@final
@dataclass(frozen=True, slots=True)
class EntriesLost:
    """So many entries are missing here; nothing is claimed of what follows."""

    count: int
    at_us: int


Event = Received | BusErrorSeen | RequestSeen | Turn | DecisionLogged | EntriesLost


@final
@dataclass(frozen=True, slots=True)
class Mismatch:
    """Something that the replay made otherwise than the vehicle; what: frame or field, by name."""

    at_us: int
    what: str
    logged: str
    replayed: str

    def __str__(self) -> str:
        return (
            f"{self.at_us / 1e6:.6f} s, {self.what}: the log says {self.logged}, "
            f"the replay {self.replayed}"
        )


@final
@dataclass(frozen=True, slots=True)
class Compared:
    """How a replay went.

    turns, decisions: replayed; compared: decisions of which the log holds every bit; mismatches:
    all of them; lost: entries that the log itself calls missing.
    """

    turns: int
    decisions: int
    compared: int
    mismatches: tuple[Mismatch, ...]
    lost: int


@final
@dataclass(frozen=True, slots=True)
class _Played:
    """A turn again: what the core made of it, as frames of a log as well."""

    result: TurnResult
    frames: tuple[LoggedFrame, ...]


def play(core: PlayedCore, events: Iterable[Event]) -> Iterator[TurnResult]:
    """Give the core everything in the log's order; what it answers, turn by turn."""
    for _, played in _turns(core, events):
        if played is not None:
            yield played.result


def compare(
    core: PlayedCore, events: Iterable[Event], *, exact: bool, most: int = 1000
) -> Compared:
    """Replay and hold every turn against the log.

    exact: the log's times are the core's own; all frames and decisions must then be the same, bit
    for bit. Otherwise only ACTION, VERDICT and ALERT of the DECISION frames are held against each
    other. Mismatches after the first `most` are counted in one more that says so.
    """
    turns = decisions = compared = lost = unnamed = 0
    found: list[Mismatch] = []
    made: dict[int, dict[str, Any]] = {}
    for event, played in _turns(core, events):
        new: Iterator[Mismatch] = iter(())
        if isinstance(event, Turn) and played is not None:
            turns += 1
            decisions += played.result.decision is not None
            new = (_frames if exact else _verdicts)(event, played.frames)
            if played.result.decision is not None:
                made = {event.at_us: decision_of(turn_record(played.result))}
        elif isinstance(event, DecisionLogged) and exact:
            compared += 1
            new = _fields(event, made.get(event.at_us))
        elif isinstance(event, EntriesLost):
            lost += event.count
        for mismatch in new:
            if len(found) < most:
                found.append(mismatch)
            else:
                unnamed += 1
    if unnamed:
        found.append(Mismatch(found[-1].at_us, "after this", f"{unnamed} more", "otherwise"))
    return Compared(turns, decisions, compared, tuple(found), lost)


def _turns(core: PlayedCore, events: Iterable[Event]) -> Iterator[tuple[Event, _Played | None]]:
    """Turns with what the core answered, and events that it has no part in."""
    for event in events:
        match event:
            case Received(identifier, data, at_us, True):
                core.receive_upstream(identifier, data, at_us)
            case Received(identifier, data, at_us):
                core.receive(identifier, data, at_us)
            case BusErrorSeen(kind, at_us):
                core.bus_error(kind, at_us)
            case RequestSeen(request, at_us):
                core.request(request, at_us)
            case Turn():
                clock = ReadClock(_clock(event))
                result = core.turn(event.at_us, clock)
                yield event, _Played(result, turn_frames(result, clock.said_us))
            case _:
                yield event, None


def _clock(turn: Turn) -> Callable[[], int]:
    # Where the vehicle read no clock, a core that does shows it by its frames, whatever it is told.
    ended_us = turn.at_us if turn.decided_us is None else turn.decided_us
    return lambda: ended_us


def _frames(turn: Turn, again: Iterable[LoggedFrame]) -> Iterator[Mismatch]:
    """Frames whose bytes differ, or that one of the two lacks."""
    logged, replayed = ([_said(frame) for frame in frames] for frames in (turn.frames, again))
    if logged == replayed:
        return
    for k in range(max(len(logged), len(replayed))):
        a, b = (said[k] if k < len(said) else _NOTHING for said in (logged, replayed))
        if a != b:
            name = b[0] if a is _NOTHING else a[0]
            yield Mismatch(turn.at_us, name, " ".join(a).strip(), " ".join(b).strip())


def _said(frame: LoggedFrame) -> tuple[str, str]:
    """Name and bytes of a frame that we made."""
    if frame.meant is not None:
        return frame.meant[0].name, frame.data.hex()
    message = _OWN.by_id.get(frame.identifier)
    return message.name if message else f"0x{frame.identifier:X}", frame.data.hex()


def _verdicts(turn: Turn, again: Iterable[LoggedFrame]) -> Iterator[Mismatch]:
    """Of DECISION what it says, and nothing that rests on the exact time."""
    logged, replayed = _judged(turn.frames), _judged(again)
    for name in _JUDGED:
        a, b = (said.get(name, "nothing") for said in (logged, replayed))
        if a != b:
            yield Mismatch(turn.at_us, f"DECISION.{name}", a, b)


def _judged(frames: Iterable[LoggedFrame]) -> dict[str, str]:
    """What the DECISION among the frames says, by the names of its choices."""
    message = _OWN.by_name["DECISION"]
    for frame in frames:
        said = decode(_OWN, frame.identifier, frame.data)
        if not isinstance(said, Refusal) and said.message == message.name:
            return {n: message.signal(n).choices[int(said.values[n])] for n in _JUDGED}
    return {}


def _fields(event: DecisionLogged, made: Mapping[str, Any] | None) -> Iterator[Mismatch]:
    """Fields of `/decision` that differ; the digest among them stands for all that is not there."""
    if made is None:
        yield Mismatch(event.at_us, "decision", "a decision", "none")
        return
    # As the log holds it: JSON keeps all bits of a float, but knows no tuples.
    again = json.loads(json.dumps(made))
    for name in sorted((event.said.keys() | again.keys()) - {"elapsed_s"}):
        a, b = (json.dumps(said.get(name)) for said in (event.said, again))
        if a != b:
            yield Mismatch(event.at_us, f"decision, {name}", a[:200], b[:200])
