"""DBC files as this project writes them: one statement per line, big-endian, everything checked."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Final, NoReturn, final

from workbench.errors import InputError
from workbench.runtime.protocols.tables import (
    COMPUTED,
    LARGEST_ID,
    Message,
    Protocol,
    Role,
    Signal,
    protocol_of,
)

SENTINELS: Final = frozenset({"ERROR", "NOT_AVAILABLE"})
_LONGEST: Final = 8
_NUMBER = r"-?\d+(?:\.\d+)?"
_STATEMENTS: Final = {
    "message": re.compile(r"BO_ (\d+) (\w+): (\d+) (\w+)"),
    "signal": re.compile(
        rf"SG_ (\w+) : (\d+)\|(\d+)@0([+-]) \(({_NUMBER}),({_NUMBER})\) "
        rf'\[({_NUMBER})\|({_NUMBER})\] "([^"]*)" \w+'
    ),
    "title": re.compile(r'VERSION "([^"]+)"'),
    "message_note": re.compile(r'CM_ BO_ (\d+) "([^"]*)";'),
    "signal_note": re.compile(r'CM_ SG_ (\d+) (\w+) "([^"]*)";'),
    "zero": re.compile(r'BA_ "UndefinedBits" BO_ (\d+) ([01]);'),
    "cycle": re.compile(r'BA_ "GenMsgCycleTime" BO_ (\d+) (\d+);'),
    "role": re.compile(r'BA_ "Role" SG_ (\d+) (\w+) (\d+);'),
    "choices": re.compile(r'VAL_ (\d+) (\w+)((?: -?\d+ "\w+")+) ;'),
    "skipped": re.compile(r'(?:NS_ :|BS_:|BU_:.*|CM_ "[^"]*";|BA_DEF_(?:DEF_)? .*;|)'),
}
_CHOICE: Final = re.compile(r'(-?\d+) "(\w+)"')
_ROLES: Final = tuple(Role)


@final
@dataclass(slots=True)
class _File:
    """What was read so far: rows by message identifier, and by identifier and signal."""

    where: str
    title: str = ""
    messages: dict[int, Sequence[str]] = field(default_factory=dict)
    signals: dict[int, list[Sequence[str]]] = field(default_factory=dict)
    notes: dict[tuple[int, str], str] = field(default_factory=dict)
    numbers: dict[tuple[int, str], int] = field(default_factory=dict)
    choices: dict[tuple[int, str], dict[int, str]] = field(default_factory=dict)
    current: int = -1

    def refuse(self, what: str) -> NoReturn:
        raise InputError(f"{self.where}: {what}; mend the DBC file")

    def take(self, kind: str, found: Sequence[str]) -> None:
        """Keep one statement."""
        if kind == "title":
            self.title = found[0]
        elif kind == "message":
            self.current = int(found[0])
            if self.current in self.messages:
                self.refuse(f"expected different identifiers, got {self.current} twice")
            self.messages[self.current] = found
            self.signals[self.current] = []
        elif kind == "signal":
            if self.current < 0:
                self.refuse(f"expected a message before the signal {found[0]}")
            self.signals[self.current].append(found)
        elif kind != "skipped":
            self._take_about(kind, found)

    def _take_about(self, kind: str, found: Sequence[str]) -> None:
        """Keep a statement about a message or a signal, which must exist."""
        frame_id = int(found[0])
        names = [row[0] for row in self.signals.get(frame_id, ())]
        about_signal = kind in ("signal_note", "role", "choices")
        if frame_id not in self.messages or (about_signal and found[1] not in names):
            self.refuse(f"expected a statement about something that exists, got {kind} {found}")
        if kind == "message_note":
            self.notes[frame_id, ""] = found[1]
        elif kind == "signal_note":
            self.notes[frame_id, found[1]] = found[2]
        elif kind == "choices":
            pairs = _CHOICE.findall(found[2])
            self.choices[frame_id, found[1]] = {int(raw): text for raw, text in pairs}
        elif kind == "role":
            self.numbers[frame_id, found[1]] = int(found[2])
        else:
            self.numbers[frame_id, f"<{kind}>"] = int(found[1])


def read_dbc(text: str, *, name: str) -> Protocol:
    """The protocol that a DBC file describes.

    Only what this project's files hold is understood: standard identifiers, up to 8 bytes, signals
    in Motorola order with a positive scale, one statement per line; the attributes UndefinedBits
    and GenMsgCycleTime of messages and Role of signals. Values named ERROR or NOT_AVAILABLE are
    sentinels of a quantity; other names are choices, of which a signal then has no others. Raises
    InputError for everything else, for signals that overlap or leave their frame, and for ranges
    that their bits cannot hold.
    """
    file = _File(where=name)
    for number, line in enumerate(text.splitlines(), start=1):
        for kind, pattern in _STATEMENTS.items():
            found = pattern.fullmatch(line.strip())
            if found:
                file.take(kind, found.groups())
                break
        else:
            raise InputError(f"{name}: line {number}: expected a DBC statement, got {line!r:.80}")
    if not file.title or not file.messages:
        file.refuse("expected a VERSION with a title, and at least one message")
    sha256 = hashlib.sha256(text.encode()).hexdigest()
    messages = [_message(file, frame_id) for frame_id in file.messages]
    return protocol_of(name, file.title, sha256, messages)


def _message(file: _File, frame_id: int) -> Message:
    _, name, length_text, sender = file.messages[frame_id]
    length = int(length_text)
    if frame_id > LARGEST_ID or not 1 <= length <= _LONGEST:
        file.refuse(f"{name}: expected a standard identifier and 1 to 8 bytes")
    signals = tuple(_signal(file, frame_id, row, length) for row in file.signals[frame_id])
    defined = 0
    for signal in signals:
        if defined & signal.mask:
            file.refuse(f"{name}.{signal.name}: expected signals that do not overlap")
        defined |= signal.mask
    zero = file.numbers.get((frame_id, "<zero>"), 0)
    message = Message(
        name, frame_id, length, sender,
        zero_mask=~defined & ((1 << 8 * length) - 1) if zero else 0,
        cycle_ms=file.numbers.get((frame_id, "<cycle>"), 0),
        note=file.notes.get((frame_id, ""), ""),
        signals=signals,
    )  # fmt: skip
    _check_roles(message, file.refuse)
    return message


def _check_roles(message: Message, refuse: Callable[[str], NoReturn]) -> None:
    names = {signal.name for signal in message.signals}
    computed = [signal for signal in message.signals if signal.role in COMPUTED]
    counter = message.with_role(Role.COUNTER)
    if not names or len(names) != len(message.signals):
        refuse(f"{message.name}: expected at least one signal, with names that differ")
    if len(computed) > 1:
        refuse(f"{message.name}: expected at most one computed signal")
    for signal in computed:
        last = signal.shift == 0 and signal.length == 8
        same = counter is not None and counter.length == signal.length
        if not (last if signal.role is Role.CRC else same):
            refuse(
                f"{message.name}.{signal.name}: expected a CRC in the last byte, or a counter of "
                "the same length beside a complement or a sum"
            )


def _signal(file: _File, frame_id: int, row: Sequence[str], length: int) -> Signal:
    name, start, size, sign, scale, offset, low, high, unit = row
    where = f"{file.messages[frame_id][1]}.{name}"
    # A DBC file numbers bits within bytes from the least significant one, and names the first.
    byte, bit = divmod(int(start), 8)
    shift = 8 * length - (8 * byte + 7 - bit) - int(size)
    if int(size) < 1 or shift < 0:
        file.refuse(f"{where}: expected a field within {length} bytes, got {start}|{size}")
    factor, addend = Fraction(scale), Fraction(offset)
    if factor <= 0:
        file.refuse(f"{where}: expected a scale > 0, got {scale}")
    divisor = math.lcm(factor.denominator, addend.denominator)
    raw_min, raw_max = ((Fraction(end) - addend) / factor for end in (low, high))
    signed = sign == "-"
    least = -(1 << int(size) - 1) if signed else 0
    most = least + (1 << int(size)) - 1
    whole = raw_min.denominator == raw_max.denominator == 1
    if not (whole and least <= raw_min <= raw_max <= most):
        file.refuse(
            f"{where}: expected a range of whole counts within {size} bits, got [{low}|{high}]"
        )
    named = file.choices.get((frame_id, name), {})
    sentinels = bool(named) and set(named.values()) <= SENTINELS
    if not all(least <= raw <= most for raw in named):
        file.refuse(f"{where}: expected named values within {size} bits, got {named}")
    return Signal(
        name, shift, int(size), signed, int(factor * divisor), int(addend * divisor), divisor,
        int(raw_min), int(raw_max), unit, _role(file, (frame_id, name)),
        choices={} if sentinels else named,
        sentinels=named if sentinels else {},
        note=file.notes.get((frame_id, name), ""),
    )  # fmt: skip


def _role(file: _File, place: tuple[int, str]) -> Role:
    number = file.numbers.get(place, 0)
    if number >= len(_ROLES):
        file.refuse(f"{place}: expected a role from 0 to {len(_ROLES) - 1}, got {number}")
    return _ROLES[number]
