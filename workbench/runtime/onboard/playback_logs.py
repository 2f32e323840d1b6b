"""From a log file to what the core got: MCAP, BLF, ASC and candump logs."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, final

from workbench.errors import InputError
from workbench.runtime.onboard.core import Request
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.mcap_reader import (
    BrokenOff,
    McapMessage,
    McapMetadata,
    read_mcap,
)
from workbench.runtime.onboard.mcap_schemas import CAN_TOPIC, DECISION_TOPIC
from workbench.runtime.onboard.playback import (
    BusErrorSeen,
    DecisionLogged,
    EntriesLost,
    Event,
    Received,
    RequestSeen,
    Turn,
)
from workbench.runtime.onboard.recorder_entries import (
    DECISION_ID,
    HEARTBEAT_ID,
    LoggedFrame,
    Mark,
)
from workbench.runtime.onboard.recorder_header import FORMAT, HEADER_FILE, LogHeader
from workbench.runtime.onboard.recorder_log import HEADER_METADATA
from workbench.runtime.protocols import Refusal, decode, load_protocol

MCAP_SUFFIX: Final = ".mcap"
_OWN: Final = load_protocol("workbench")
_OUR_IDS: Final = frozenset(
    message.frame_id for message in _OWN.by_name.values() if message.sender == "WORKBENCH"
)


@final
@dataclass(frozen=True, slots=True)
class BusErrorLine:
    """An error frame of a log."""

    kind: BusError
    at_us: int


@final
@dataclass(frozen=True, slots=True)
class EndOfLog:
    """whole: the log says itself that nothing comes after this."""

    whole: bool


Line = LoggedFrame | BusErrorLine | DecisionLogged | EndOfLog


@final
@dataclass(frozen=True, slots=True)
class PlayedLog:
    """A log to be read once: what is known of it before, and its events.

    exact: a recorder wrote it, so that its times are the core's own, and frames that we made are
    told from those we received. header: None where the file has none and none lies beside it.
    """

    path: Path
    exact: bool
    header: LogHeader | None
    events: Iterator[Event]


def open_log(path: Path, *, header: Path | None = None) -> PlayedLog:
    """The log at `path` (.mcap, .blf, .asc or .log), with the run's header from `header`, from the
    MCAP file itself or from the `run.json` beside it.

    Another node's log holds HEARTBEAT frames among those that it received, at its own times. It is
    shifted so that the first of them lies at its STAMP; its turns are then up to some milliseconds
    off, and frames that we sent besides our own identifiers cannot be told from others'. Raises
    InputError for what is no log, or holds no HEARTBEAT.
    """
    if path.suffix.lower() == MCAP_SUFFIX:
        inside, lines = _mcap(path)
    else:
        inside, lines = None, _raw(path)
    first = next(lines, EndOfLog(True))
    exact = _is_own(first, path) or inside is not None
    lines = itertools.chain([first], lines)
    if not exact:
        lines = _of_another_node(lines)
    beside = path.parent / HEADER_FILE
    if header is not None or (inside is None and beside.is_file()):
        inside = LogHeader.read(header or beside)
    return PlayedLog(path, exact, inside, _counted(events_of(lines), path))


def _is_own(first: Line, path: Path) -> bool:
    """Does a log that begins like this come from a recorder? Raises InputError for another
    version's."""
    meant = first.meant if isinstance(first, LoggedFrame) else None
    if meant is None or meant[0] is not Mark.START:
        return False
    if meant[1] != FORMAT:
        raise InputError(
            f"{path}: expected a log of format {FORMAT}, got {meant[1]}; replay it with the "
            "workbench that recorded it"
        )
    return True


def events_of(lines: Iterable[Line]) -> Iterator[Event]:
    """What the core got, and its turns with the frames that they made.

    A turn is a HEARTBEAT of ours and what we made right after it. The last one of a log that may
    have broken off in it is left out.
    """
    turn: list[LoggedFrame] = []
    for line in lines:
        frame = line if isinstance(line, LoggedFrame) and line.made else None
        opens = _is_beat(line)
        if frame is not None and turn and not opens and _made_in_turn(frame):
            turn.append(frame)
            continue
        if isinstance(line, EndOfLog) and not line.whole:
            return
        if turn:
            yield _turn(turn)
        turn = [frame] if frame is not None and opens else []
        if not turn:
            yield from _event(line)


def _made_in_turn(frame: LoggedFrame) -> bool:
    return frame.meant is None or frame.meant[0] is Mark.DECIDED


def _turn(frames: list[LoggedFrame]) -> Turn:
    decided_us = next((f.at_us for f in frames if f.identifier == DECISION_ID), None)
    for frame in frames:
        if frame.meant is not None:
            decided_us = frame.meant[1]
    return Turn(frames[0].at_us, decided_us, tuple(frames))


def _event(line: Line) -> Iterator[Event]:
    match line:
        case BusErrorLine(kind, at_us):
            yield BusErrorSeen(kind, at_us)
        case DecisionLogged():
            yield line
        case LoggedFrame(at_us, identifier, data, False, upstream):
            yield Received(identifier, data, at_us, upstream)
        case LoggedFrame():
            # What we made before the first HEARTBEAT belongs to a turn that is not in the log.
            yield from _marked(line)


def _marked(frame: LoggedFrame) -> Iterator[Event]:
    try:
        match frame.meant:
            case (Mark.REQUEST, number):
                yield RequestSeen(list(Request)[number], frame.at_us)
            case (Mark.BUS_ERROR, number):
                yield BusErrorSeen(list(BusError)[number], frame.at_us)
            case (Mark.LOST, number):
                yield EntriesLost(number, frame.at_us)
    except IndexError as error:
        raise InputError(
            f"expected marks of this version in the log, got {frame.data.hex()} at "
            f"{frame.at_us} us; replay it with the workbench that recorded it"
        ) from error


def _counted(events: Iterator[Event], path: Path) -> Iterator[Event]:
    turns = 0
    for event in events:
        turns += isinstance(event, Turn)
        yield event
    if not turns:
        raise InputError(
            f"{path}: expected HEARTBEAT frames of the monitor, whose instants are its turns, got "
            "none that is followed by anything; replay a log of a drive on which it ran"
        )


def _of_another_node(lines: Iterable[Line]) -> Iterator[Line]:
    """The lines with our own identifiers as ours, on the core's time as near as it is known.

    Others' frames lie between those of one turn there; here they follow it. The last turn, of which
    something may be missing, is left out.
    """
    frames = [line for line in lines if isinstance(line, LoggedFrame | BusErrorLine)]
    shift_us = _shift_us(frames)
    if shift_us is None:
        return
    turn: list[Line] = []
    others: list[Line] = []
    for line in frames:
        moved = _moved(line, shift_us)
        if _is_beat(moved):
            yield from turn
            yield from others
            turn, others = [moved], []
        else:
            ours = isinstance(moved, LoggedFrame) and moved.made
            (turn if ours and turn else others).append(moved)


def _shift_us(lines: Iterable[Line]) -> int | None:
    """From the log's times to the core's, by the first HEARTBEAT's STAMP; None without one."""
    for line in lines:
        if isinstance(line, LoggedFrame) and line.identifier == HEARTBEAT_ID:
            said = decode(_OWN, line.identifier, line.data)
            if not isinstance(said, Refusal):
                return round(said.values["STAMP"] * 1e6) - line.at_us
    return None


def _moved(line: LoggedFrame | BusErrorLine, shift_us: int) -> LoggedFrame | BusErrorLine:
    if isinstance(line, BusErrorLine):
        return replace(line, at_us=line.at_us + shift_us)
    made = line.made or line.identifier in _OUR_IDS
    return replace(line, at_us=line.at_us + shift_us, made=made, upstream=False)


def _is_beat(line: Line) -> bool:
    return isinstance(line, LoggedFrame) and line.made and line.identifier == HEARTBEAT_ID


def _raw(path: Path) -> Iterator[Line]:
    from workbench.runtime.onboard.recorder_can import read_can

    before: Line | None = None
    for at_us, entry in read_can(path):
        if before is not None:
            yield before
        before = entry if isinstance(entry, LoggedFrame) else BusErrorLine(entry, at_us)
    # None of these forms says where it ends: the last line may be half of one.
    yield EndOfLog(False)


def _mcap(path: Path) -> tuple[LogHeader | None, Iterator[Line]]:
    records = read_mcap(path)
    header = None
    for record in records:
        if isinstance(record, McapMetadata) and record.name == HEADER_METADATA:
            header = LogHeader.from_json(record.values.get("header", ""), source=str(path))
            break
        if not isinstance(record, McapMetadata):
            raise InputError(
                f"{path}: expected a log of workbench-monitor, got an MCAP file that says nothing "
                "of its run; name another file"
            )
    return header, _mcap_lines(records, path)


def _mcap_lines(
    records: Iterable[McapMessage | McapMetadata | BrokenOff], path: Path
) -> Iterator[Line]:
    whole = True
    for record in records:
        if isinstance(record, BrokenOff):
            whole = False
        elif isinstance(record, McapMessage) and record.topic in (CAN_TOPIC, DECISION_TOPIC):
            try:
                yield _mcap_line(record.topic, json.loads(record.data))
            except (KeyError, TypeError, ValueError) as error:
                raise InputError(
                    f"{path}: expected a message of {record.topic}, got {record.data[:80]!r}; name "
                    "a log that workbench-monitor wrote"
                ) from error
    yield EndOfLog(whole)


def _mcap_line(topic: str, content: dict[str, Any]) -> Line:
    if topic == DECISION_TOPIC:
        return DecisionLogged(int(content["at_us"]), content)
    data = bytes.fromhex(content["data"])
    made, upstream = bool(content["made"]), bool(content["upstream"])
    return LoggedFrame(int(content["at_us"]), int(content["id"]), data, made, upstream)
