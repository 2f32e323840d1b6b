"""Ranges from fixed beacons on the bus: one frame each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.protocols.codec import Decoded, Refusal, encode
from workbench.runtime.protocols.tables import RANGES, Protocol, load_protocol

COUNTER_BITS: Final = 8
STAMP_BITS: Final = 24
STAMP_COUNTS: Final = 10_000
"""Counts of STAMP per second."""


@final
@dataclass(frozen=True, slots=True)
class SentRange:
    """One range (m) to a beacon, None where it was due and did not come.

    number: counts the sender's frames, modulo 256; beacon: number in the site's list; stamp: of the
    sender's clock, in counts of 0.1 ms modulo 2^24.
    """

    number: int
    beacon: int
    range_m: float | None
    stamp: int


def ranges_protocol() -> Protocol:
    """The protocol whose one message is RANGE."""
    return load_protocol(RANGES)


def range_frame(sent: SentRange) -> tuple[int, bytes] | Refusal:
    """Identifier and bytes of a range, or why it cannot be sent."""
    protocol, there = ranges_protocol(), sent.range_m is not None
    values = {
        "COUNTER": sent.number, "BEACON": sent.beacon, "RANGE_VALID": int(there),
        "RANGE": sent.range_m if sent.range_m is not None else 0.0,
        "STAMP": sent.stamp / STAMP_COUNTS,
    }  # fmt: skip
    data = encode(protocol, "RANGE", values)
    return data if isinstance(data, Refusal) else (protocol.by_name["RANGE"].frame_id, data)


def received_range(frame: Decoded) -> SentRange:
    """What a RANGE frame says; one that is said invalid is no `Decoded`."""
    v = frame.values
    return SentRange(
        number=int(v["COUNTER"]), beacon=int(v["BEACON"]), range_m=v["RANGE"],
        stamp=round(v["STAMP"] * STAMP_COUNTS),
    )  # fmt: skip
