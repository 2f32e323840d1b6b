"""What a protocol's frames hold: messages and signals, from tables that were made of DBC files."""

from __future__ import annotations

import enum
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, final

from workbench.errors import InputError

PROTOCOLS: Final = ("pacmod2", "pacmod3", "pacmod3_3_4", "workbench")
RANGES: Final = "ranges"
"""Frames of a sensor that only the localiser hears, so none of those that the monitor tells apart.
"""
FORMAT: Final = 1
LARGEST_ID: Final = 0x7FF


class Role(enum.Enum):
    """What a signal is for.

    VALUE: a quantity; VALIDITY: 1 where the frame's quantities may be used; COUNTER: counts frames;
    COMPLEMENT: the counter's bits inverted; SUM: (identifier + counter) mod 256; CRC: CRC-8 of the
    identifier and all other bytes. The codec computes the last three itself.
    """

    VALUE = "value"
    VALIDITY = "validity"
    COUNTER = "counter"
    COMPLEMENT = "complement"
    SUM = "sum"
    CRC = "crc"


COMPUTED: Final = (Role.COMPLEMENT, Role.SUM, Role.CRC)


@final
@dataclass(frozen=True, slots=True)
class Signal:
    """One field of a frame; value = (factor * raw + offset) / divisor, in integers until the `/`.

    shift, length: the field's place as bits above the frame's last one (the frame read as one
    big-endian number); raw_min, raw_max: the range that the protocol states, in raw counts;
    choices: every legal raw value with its name, or nothing for a quantity; sentinels: raw values
    that stand for ERROR or NOT_AVAILABLE; note: what a reader must know.
    """

    name: str
    shift: int
    length: int
    signed: bool
    factor: int
    offset: int
    divisor: int
    raw_min: int
    raw_max: int
    unit: str
    role: Role
    choices: Mapping[int, str]
    sentinels: Mapping[int, str]
    note: str

    @property
    def mask(self) -> int:
        """The field's bits within the frame."""
        return ((1 << self.length) - 1) << self.shift

    def raw_in(self, word: int) -> int:
        """The field of a frame, sign included."""
        raw = (word & self.mask) >> self.shift
        return raw - (1 << self.length) if self.signed and raw >> (self.length - 1) else raw

    def placed(self, raw: int) -> int:
        """A raw value at the field's place, all other bits 0; expects one that fits."""
        return (raw << self.shift) & self.mask

    def value_of(self, raw: int) -> float:
        """Physical value: an int where no division is needed, else the nearest double."""
        scaled = self.factor * raw + self.offset
        return scaled if self.divisor == 1 else scaled / self.divisor


@final
@dataclass(frozen=True, slots=True)
class Message:
    """One kind of frame: standard identifier, length in bytes, who sends it, signals.

    zero_mask: bits that must be 0; cycle_ms: period that the protocol states, 0 where it states
    none.
    """

    name: str
    frame_id: int
    length: int
    sender: str
    zero_mask: int
    cycle_ms: int
    note: str
    signals: tuple[Signal, ...]

    def signal(self, name: str) -> Signal:
        """The signal of that name. Raises KeyError where there is none."""
        for signal in self.signals:
            if signal.name == name:
                return signal
        raise KeyError(name)

    def with_role(self, role: Role) -> Signal | None:
        """The first signal with a role, or None."""
        return next((signal for signal in self.signals if signal.role is role), None)


@final
@dataclass(frozen=True, slots=True)
class Protocol:
    """All messages of one protocol by identifier and by name, and the SHA-256 of their DBC file."""

    name: str
    title: str
    dbc_sha256: str
    by_id: Mapping[int, Message]
    by_name: Mapping[str, Message]


def protocol_of(name: str, title: str, dbc_sha256: str, messages: Iterable[Message]) -> Protocol:
    """A protocol of its messages, which must differ in identifiers and names."""
    found = tuple(messages)
    by_id = {message.frame_id: message for message in found}
    by_name = {message.name: message for message in found}
    if not len(found) == len(by_id) == len(by_name):
        raise InputError(
            f"{name}: expected messages that differ in identifier and in name, got "
            f"{[(hex(m.frame_id), m.name) for m in found]}"
        )
    return Protocol(name, title, dbc_sha256, by_id, by_name)


@cache
def load_protocol(name: str) -> Protocol:
    """The protocol of that name, of `PROTOCOLS` or `RANGES`, from the table shipped beside this.

    Raises InputError for another name, and for a table of another format.

    >>> load_protocol("pacmod2").by_id[0x6B].name
    'BRAKE_CMD'
    """
    if name not in (*PROTOCOLS, RANGES):
        known = ", ".join((*PROTOCOLS, RANGES))
        raise InputError(f"expected a protocol out of {known}, got {name!r}")
    text = Path(__file__).with_name(f"{name}.json").read_text(encoding="utf-8")
    return protocol_from_table(json.loads(text))


def protocol_from_table(table: Mapping[str, Any]) -> Protocol:
    """The protocol that a table holds; the table is the package's own and is trusted otherwise."""
    if table["format"] != FORMAT:
        raise InputError(
            f"{table['name']}: expected a table of format {FORMAT}, got {table['format']!r}; make "
            "it again with `python -m workbench.codegen.can_tables`"
        )
    messages = (
        Message(
            name, frame_id, length, sender, zero_mask, cycle_ms, note,
            tuple(_signal(*row) for row in signals),
        )
        for name, frame_id, length, sender, zero_mask, cycle_ms, note, signals in table["messages"]
    )  # fmt: skip
    return protocol_of(table["name"], table["title"], table["dbc_sha256"], messages)


def _signal(*row: Any) -> Signal:
    *plain, role, choices, sentinels, note = row
    return Signal(*[*plain, Role(role), dict(choices), dict(sentinels), note])


def table_of(protocol: Protocol) -> dict[str, Any]:
    """What `protocol_from_table` reads."""
    return {
        "format": FORMAT,
        "name": protocol.name,
        "title": protocol.title,
        "dbc_sha256": protocol.dbc_sha256,
        "messages": [_message_row(message) for message in protocol.by_id.values()],
    }


def _message_row(message: Message) -> list[Any]:
    m = message
    signals = [_signal_row(signal) for signal in m.signals]
    return [m.name, m.frame_id, m.length, m.sender, m.zero_mask, m.cycle_ms, m.note, signals]


def _signal_row(signal: Signal) -> list[Any]:
    s = signal
    numbers = [s.shift, s.length, s.signed, s.factor, s.offset, s.divisor, s.raw_min, s.raw_max]
    pairs = [[[raw, text] for raw, text in each.items()] for each in (s.choices, s.sentinels)]
    return [s.name, *numbers, s.unit, s.role.value, *pairs, s.note]
