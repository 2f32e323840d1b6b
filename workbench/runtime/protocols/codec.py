"""Frames to named values and back; whatever cannot be believed is a refusal with a name."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from workbench.errors import InputError
from workbench.runtime.protocols.integrity import frame_crc, frame_sum
from workbench.runtime.protocols.tables import COMPUTED, Message, Protocol, Role, Signal

if TYPE_CHECKING:
    import can


class Reason(enum.Enum):
    """Why a frame, or a value that was to be sent, is refused."""

    NOT_A_DATA_FRAME = "no classic data frame with a standard identifier"
    UNKNOWN_ID = "unknown identifier"
    WRONG_LENGTH = "wrong length"
    WRONG_CHECKSUM = "wrong checksum"
    WRONG_COMPLEMENT = "counter and complement disagree"
    UNDEFINED_BITS = "undefined bits are not 0"
    SAID_INVALID = "the sender calls it invalid"
    ERROR = "the sender reports ERROR"
    NOT_AVAILABLE = "the sender reports NOT_AVAILABLE"
    NOT_A_CHOICE = "no such choice"
    OUT_OF_RANGE = "out of range"
    NOT_FINITE = "not finite"


@final
@dataclass(frozen=True, slots=True)
class Refusal:
    """A frame that is not used, or a value that is not sent; message and signal where known."""

    reason: Reason
    frame_id: int
    message: str | None
    signal: str | None
    detail: str

    def __str__(self) -> str:
        place = ".".join(name for name in (self.message, self.signal) if name)
        where = f"{place}: " if place else ""
        return f"{where}{self.reason.value}{f' ({self.detail})' if self.detail else ''}"


@final
@dataclass(frozen=True, slots=True)
class Decoded:
    """A frame that can be used: its message's name and every value by its signal's name.

    Counts, flags and choices are ints, scaled quantities floats, the nearest to raw times scale.
    """

    message: str
    frame_id: int
    values: Mapping[str, float]


def decode(protocol: Protocol, frame_id: int, data: bytes | bytearray) -> Decoded | Refusal:
    """The values of a standard data frame, or why it is refused; never an exception.

    A frame with one value that cannot be used is refused whole. Length, checksum, complement and
    undefined bits come first, then every signal: validity flag, ERROR and NOT_AVAILABLE, choices,
    stated range. It does not see whether the values are true, nor whether the frame is new.
    """
    message = protocol.by_id.get(frame_id)
    if message is None:
        return Refusal(Reason.UNKNOWN_ID, frame_id, None, None, f"0x{frame_id:X}")
    if len(data) != message.length:
        detail = f"{len(data)} bytes, expected {message.length}"
        return Refusal(Reason.WRONG_LENGTH, frame_id, message.name, None, detail)
    word = int.from_bytes(data, "big")
    refusal = _fault_in_frame(message, word)
    if refusal is not None:
        return refusal
    values: dict[str, float] = {}
    for signal in message.signals:
        raw = signal.raw_in(word)
        refusal = _fault_in_field(message, signal, raw)
        if refusal is not None:
            return refusal
        values[signal.name] = signal.value_of(raw)
    return Decoded(message.name, frame_id, values)


def decode_received(protocol: Protocol, received: can.Message) -> Decoded | Refusal:
    """As `decode`, of what python-can receives: only a classic standard data frame counts."""
    kinds = {
        "error frame": received.is_error_frame,
        "remote frame": received.is_remote_frame,
        "extended identifier": received.is_extended_id,
        "CAN FD": received.is_fd,
    }
    wrong = ", ".join(kind for kind, holds in kinds.items() if holds)
    if wrong:
        return Refusal(Reason.NOT_A_DATA_FRAME, received.arbitration_id, None, None, wrong)
    return decode(protocol, received.arbitration_id, received.data)


def encode(protocol: Protocol, name: str, values: Mapping[str, float]) -> bytes | Refusal:
    """The bytes of a message, or why a value is refused; all bits without a signal are 0.

    values: one number for every signal whose role is not COMPLEMENT, SUM or CRC (these are
    computed). A number is rounded to the nearest raw count, ties to even, exactly; one that is not
    finite, outside the stated range, a sentinel or no choice is refused, never clipped. Raises
    InputError for a message or a set of signals that do not exist, and for what is no number.
    """
    message = protocol.by_name.get(name)
    if message is None:
        raise InputError(f"expected a message of {protocol.name}, got {name!r}")
    wanted = {signal.name for signal in message.signals if signal.role not in COMPUTED}
    if set(values) != wanted:
        raise InputError(f"{name}: expected values of {sorted(wanted)}, got {sorted(values)}")
    word = 0
    for signal in message.signals:
        if signal.role in COMPUTED:
            continue
        raw = _raw_of(message, signal, values[signal.name])
        if isinstance(raw, Refusal):
            return raw
        word |= signal.placed(raw)
    for signal in message.signals:
        if signal.role in COMPUTED:
            word |= signal.placed(_computed(message, signal, word))
    return word.to_bytes(message.length, "big")


def _fault_in_frame(message: Message, word: int) -> Refusal | None:
    for signal in message.signals:
        if signal.role in COMPUTED:
            stands, expected = signal.raw_in(word), _computed(message, signal, word)
            if stands != expected:
                inverse = signal.role is Role.COMPLEMENT
                reason = Reason.WRONG_COMPLEMENT if inverse else Reason.WRONG_CHECKSUM
                return _refused(reason, message, signal, f"0x{stands:X}, expected 0x{expected:X}")
    undefined = word & message.zero_mask
    if undefined:
        detail = f"0x{undefined:0{2 * message.length}X}"
        return Refusal(Reason.UNDEFINED_BITS, message.frame_id, message.name, None, detail)
    return None


def _computed(message: Message, signal: Signal, word: int) -> int:
    """What a signal with a computed role must hold, given the rest of the frame."""
    if signal.role is Role.CRC:
        return frame_crc(message.frame_id, word.to_bytes(message.length, "big")[:-1])
    counter = message.with_role(Role.COUNTER)
    assert counter is not None, "tables with such a signal have a counter"
    count = counter.raw_in(word)
    if signal.role is Role.SUM:
        return frame_sum(message.frame_id, count)
    return ~count & ((1 << signal.length) - 1)


def _fault_in_field(message: Message, signal: Signal, raw: int) -> Refusal | None:
    if signal.role is Role.VALIDITY and raw != 1:
        return _refused(Reason.SAID_INVALID, message, signal, "")
    return _fault_in_raw(message, signal, raw)


def _fault_in_raw(message: Message, signal: Signal, raw: int) -> Refusal | None:
    if raw in signal.sentinels:
        return _refused(Reason[signal.sentinels[raw]], message, signal, f"raw {raw}")
    if signal.choices and raw not in signal.choices:
        return _refused(Reason.NOT_A_CHOICE, message, signal, f"raw {raw}")
    if not signal.raw_min <= raw <= signal.raw_max:
        return _out_of_range(message, signal, signal.value_of(raw))
    return None


def _raw_of(message: Message, signal: Signal, value: object) -> int | Refusal:
    if not isinstance(value, int | float):
        raise InputError(f"{message.name}.{signal.name}: expected a number, got {value!r}")
    if isinstance(value, float) and not math.isfinite(value):
        return _refused(Reason.NOT_FINITE, message, signal, repr(value))
    if not signal.value_of(signal.raw_min) <= value <= signal.value_of(signal.raw_max):
        return _out_of_range(message, signal, value)
    above, below = value.as_integer_ratio()
    raw = _nearest(above * signal.divisor - signal.offset * below, below * signal.factor)
    return _fault_in_raw(message, signal, raw) or raw


def _nearest(above: int, below: int) -> int:
    """above / below to the nearest integer, ties to even; below > 0."""
    whole, rest = divmod(above, below)
    return whole + (2 * rest > below or (2 * rest == below and whole % 2))


def _out_of_range(message: Message, signal: Signal, value: float) -> Refusal:
    low, high = signal.value_of(signal.raw_min), signal.value_of(signal.raw_max)
    detail = f"{value!r:.30}, expected {low:.12g} to {high:.12g} {signal.unit}".rstrip()
    return _refused(Reason.OUT_OF_RANGE, message, signal, detail)


def _refused(reason: Reason, message: Message, signal: Signal, detail: str) -> Refusal:
    return Refusal(reason, message.frame_id, message.name, signal.name, detail)
