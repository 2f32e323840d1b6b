"""RANGE frames in the order of their arrival: which can be used, and when each was measured."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.onboard.stamps import StampBounds, Stamps
from workbench.runtime.protocols import Decoded, Reason, Refusal, counter_step
from workbench.runtime.protocols.ranges import (
    COUNTER_BITS,
    STAMP_BITS,
    STAMP_COUNTS,
    SentRange,
    received_range,
)

# Within this, a sender of up to 250 frames a second has not gone half round its counter.
_COUNTED_US: Final = 500_000
# Before its stamp has gone half round, 838 s.
_FORGOTTEN_US: Final = 800_000_000


class RangeFault(enum.Enum):
    """Why a RANGE frame is not used."""

    REFUSED = "its length, CRC or a value is wrong"
    NO_RANGE = "the sender says that there is none"
    UNKNOWN_BEACON = "the site has no beacon of that number"
    REPEATED = "its counter repeats the one before"
    REGRESSED = "its counter or stamp goes backwards"
    JUMPED = "its stamp lies before no arrival that its sender's clock allows"
    LATE = "it came later than a range may"


@final
@dataclass(frozen=True, slots=True)
class RangeSeen:
    """A range (m) that can be used, and when, on our clock, it was measured."""

    beacon: int
    range_m: float
    at_us: int


@final
class RangeStream:
    """Takes the frames of one sender; `take` gives the range or why there is none.

    A frame counts if its stamp does not go back, and its counter moves on, by less than half of its
    range: COUNTER counts modulo 256, STAMP modulo 2^24 counts of 0.1 ms. Frames that say nothing
    are not counted along, so after half a second without a range the stamp alone must move on; and
    after 800 s, when it may have wrapped, the stream begins anew. When it was measured
    follows from its stamp, with the quickest of the last frames taken to have had the least delay
    (`Stamps`). What comes later than the most delay allows, as a recorded frame does whose counter
    and stamp happen to fit, is refused, and so is a stamp in the future. A refused frame changes
    nothing. So a sender that starts anew is refused until this is begun anew.
    """

    def __init__(self, bounds: StampBounds, *, beacons: int) -> None:
        self._stamps, self._beacons = Stamps(bounds), beacons
        self._bounds = bounds
        # The last frame that was used, its stamp as counts that do not wrap, and its arrival.
        self._last: tuple[SentRange, int, int] | None = None
        self.counts: dict[RangeFault, int] = dict.fromkeys(RangeFault, 0)
        self.used = 0

    def take(self, frame: Decoded | Refusal, at_us: int) -> RangeSeen | RangeFault:
        """One more frame, received by at_us (not before the ones before)."""
        found = self._taken(frame, at_us)
        if isinstance(found, RangeFault):
            self.counts[found] += 1
        else:
            self.used += 1
        return found

    def _taken(self, frame: Decoded | Refusal, at_us: int) -> RangeSeen | RangeFault:
        if isinstance(frame, Refusal):
            none = frame.reason is Reason.SAID_INVALID
            return RangeFault.NO_RANGE if none else RangeFault.REFUSED
        sent = received_range(frame)
        if sent.beacon >= self._beacons or sent.range_m is None:
            return RangeFault.UNKNOWN_BEACON
        if self._last is not None and at_us - self._last[2] > _FORGOTTEN_US:
            self._last, self._stamps = None, Stamps(self._bounds)
        counts = sent.stamp
        if self._last is not None:
            last, before, last_us = self._last
            moved = counter_step(last.number, sent.number, bits=COUNTER_BITS)
            later = counter_step(last.stamp, sent.stamp, bits=STAMP_BITS)
            counted = moved > 0 or (later > 0 and at_us - last_us > _COUNTED_US)
            if not counted or later < 0:
                return RangeFault.REGRESSED if moved else RangeFault.REPEATED
            counts = before + later
        stamps, found = self._stamps.taking(counts / STAMP_COUNTS, at_us)
        if found.jumped:
            return RangeFault.JUMPED
        if found.late_us:
            return RangeFault.LATE
        self._stamps, self._last = stamps, (sent, counts, at_us)
        return RangeSeen(sent.beacon, sent.range_m, found.within_us[1])
