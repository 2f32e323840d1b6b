"""What a log holds: frames of the bus, marks that only a log knows, and turns as plain values."""

from __future__ import annotations

import enum
import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, final

from workbench.runtime.bundle import Rows
from workbench.runtime.protocols import load_protocol

if TYPE_CHECKING:
    from workbench.runtime.onboard.core import TurnResult

FRAMES: Final = 0
TURN: Final = 1
"""Kinds of entries: (FRAMES, frames' values), (TURN, record of a turn)."""
EXTENDED: Final = 1 << 31
"""Set in the identifier of an extended frame, as the core is given it; see bus.py."""
MARK_ID: Final = EXTENDED | 0x1FFFFFFE
"""Identifier of marks: extended, as no frame of ours is, and never sent."""
HEARTBEAT_ID: Final = load_protocol("workbench").by_name["HEARTBEAT"].frame_id
DECISION_ID: Final = load_protocol("workbench").by_name["DECISION"].frame_id

# What a decision is made of beside its numbers' rows; elapsed_s, which no replay can repeat, and
# the assumptions, which never change, are left out.
_SCALARS: Final = (
    "verdict", "action", "reason", "brake_from_s", "look_ahead", "fail_safe", "violations", "alert",
    "clearance_m", "clearance_time_s", "clearance_person", "level_verdicts", "deciding_level",
    "rigor",
)  # fmt: skip
_ROWS: Final = ("occupancy", "stop_occupancy", "tube_lower", "tube_upper")
_AS_THEY_ARE: Final = frozenset({type(None), bool, int, float, str, bytes})


class Mark(enum.IntEnum):
    """What happened beside the bus; number: what comes with it.

    REQUEST: the operator asked (place in the enumeration of requests); BUS_ERROR: the driver
    reported a fault (place in the enumeration of bus errors); LOST: so many entries are missing
    before this one; DECIDED: a decision that made no DECISION frame ended then (us); START: the
    first entry of every log that a recorder wrote (the format's number): its times are the core's.
    """

    REQUEST = 1
    BUS_ERROR = 2
    LOST = 3
    DECIDED = 4
    START = 5


@final
@dataclass(frozen=True, slots=True)
class LoggedFrame:
    """One frame of the log: when, the identifier as the core takes it, the bytes.

    made: by the monitor itself, and handed to the bus where its mode sends at all; at_us is then
    that of the turn. Otherwise it was received, from the vehicle's bus or (upstream) from that of
    the upstream controller.
    """

    at_us: int
    identifier: int
    data: bytes
    made: bool
    upstream: bool = False

    @classmethod
    def mark(cls, mark: Mark, number: int, *, at_us: int) -> LoggedFrame:
        """A mark as a frame, so that every form of log can hold it; number: 0 to 2^56 - 1."""
        data = bytes([mark]) + max(0, min(number, 2**56 - 1)).to_bytes(7, "big")
        return cls(at_us, MARK_ID, data, True)

    @property
    def meant(self) -> tuple[Mark, int] | None:
        """The mark and its number; None for every frame that is no mark."""
        if not self.made or self.identifier != MARK_ID or len(self.data) != 8:
            return None
        if self.data[0] not in tuple(Mark):
            return None
        return Mark(self.data[0]), int.from_bytes(self.data[1:], "big")


@final
class ReadClock:
    """A clock that remembers what it said first; said_us: None until it is read."""

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self.said_us: int | None = None

    def __call__(self) -> int:
        """What the clock says."""
        now_us = self._clock()
        self.said_us = now_us if self.said_us is None else self.said_us
        return now_us


def turn_frames(result: TurnResult, ended_us: int | None) -> tuple[LoggedFrame, ...]:
    """The frames that a turn made, HEARTBEAT first: in a log it opens the turn.

    ended_us: what the turn's clock said, None where it was not read. HEARTBEAT carries the turn's
    instant, all others ended_us; without a DECISION among them a mark says it.
    """
    at_us = result.at_us if ended_us is None else ended_us
    beats = [f for f in result.frames if f.identifier == HEARTBEAT_ID]
    rest = [f for f in result.frames if f.identifier != HEARTBEAT_ID]
    frames = [LoggedFrame(result.at_us, f.identifier, bytes(f.data), True) for f in beats]
    frames += [LoggedFrame(at_us, f.identifier, bytes(f.data), True) for f in rest]
    if ended_us is not None and all(f.identifier != DECISION_ID for f in rest):
        frames.append(LoggedFrame.mark(Mark.DECIDED, ended_us, at_us=at_us))
    return tuple(frames)


def turn_record(result: TurnResult) -> dict[str, Any]:
    """A turn as values that any process can read: state, faults, events, and the decision with
    everything that it rests on and drew."""
    decision = result.decision
    record: dict[str, Any] = {
        "at_us": result.at_us,
        "decided_us": result.decided_us,
        "state": plain(result.state),
        "faults": plain(result.faults),
        "events": plain(result.events),
        "decision": None,
    }
    if decision is not None:
        record["decision"] = {name: plain(getattr(decision, name)) for name in _SCALARS}
        record["rows"] = {name: _tuples(getattr(decision, name)) for name in _ROWS}
        record["observation"] = plain(result.observation)
        record["elapsed_s"] = decision.elapsed_s
    return record


def digest(record: Mapping[str, Any]) -> str:
    """SHA-256 over every bit of a turn's record but the time that the decision took.

    Floats count by their shortest exact digits, so that equal digests mean equal bits (NaN: equal
    to NaN).
    """
    content = {name: value for name, value in record.items() if name != "elapsed_s"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def decision_of(record: Mapping[str, Any]) -> dict[str, Any]:
    """What the log's `/decision` says of a turn that decided; numbers that JSON lacks as words."""
    kept = ("at_us", "decided_us", "state", "events", "faults", "elapsed_s")
    said = {name: record[name] for name in kept} | dict(record["decision"])
    return {name: _sayable(value) for name, value in said.items()} | {"digest": digest(record)}


def plain(value: object) -> Any:
    """Nested dataclasses, mappings, sequences and enumeration members (by name) as dicts, tuples
    and plain values; floats as they are."""
    kind = type(value)
    if kind in _AS_THEY_ARE:
        return value
    if kind is tuple:
        return _plain_items(value)  # type: ignore[arg-type]
    fields = getattr(kind, "__dataclass_fields__", None)
    if fields is not None:
        return {name: plain(getattr(value, name)) for name in fields}
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, Mapping):
        return {str(plain(key)): plain(item) for key, item in value.items()}
    if isinstance(value, Set):
        return tuple(sorted(map(str, map(plain, value))))
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return _plain_items(tuple(value))
    if isinstance(value, int | float):
        # Subclasses would not pass the pipe.
        return int(value) if isinstance(value, int) else float(value)
    return str(value)


def _plain_items(items: tuple[object, ...]) -> tuple[Any, ...]:
    # Most are pairs or rows of floats.
    return items if all(type(item) is float for item in items) else tuple(map(plain, items))


def _tuples(rows: Sequence[tuple[float, ...]]) -> Any:
    """Rows as tuples; those of a kernel's result at once, as reading them one by one takes long."""
    if not isinstance(rows, Rows) or not rows:
        return plain(rows)
    numbers = rows.numbers.tolist()
    return tuple(zip(*[iter(numbers)] * (len(numbers) // len(rows)), strict=True))


def _sayable(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else repr(value)
    if isinstance(value, dict):
        return {key: _sayable(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_sayable(item) for item in value]
    return value
