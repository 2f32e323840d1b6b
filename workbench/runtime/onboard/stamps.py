"""When a sender's stamp was, on our own clock, from the delays of its frames."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime.protocols import worst_rounding

MOST_PAIRS: Final = 32
_COUNTS_US: Final = 1e6
# The frames round a stamp to 0.1 ms, and all three kinds alike.
ROUNDING_US: Final = math.ceil(worst_rounding()[("LOC_STAMP", "STAMP")] * _COUNTS_US)

Instants = tuple[int, int]
"""From the one to the other instant of our clock, in us."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class StampBounds:
    """What is known of a sender's clock and of the way to us.

    delay_us: (least, most) time from the instant of a stamp to the one that the first frame that
    carries it is received with (the longest that our loop leaves frames unread among it); the least
    holds of every frame, the most of at least one out of those that are compared. drift_ppm: how
    much faster or slower than ours a sender's clock runs at most. window_us: frames older than this
    are not compared, unless there is no other. Raises InputError for times that are negative or out
    of order.
    """

    delay_us: Instants
    drift_ppm: int
    window_us: int

    def __post_init__(self) -> None:
        least, most = self.delay_us
        if not 0 <= least <= most:
            raise InputError(f"delay_us: expected 0 <= least <= most, got {self.delay_us!r}")
        if not (0 <= self.drift_ppm <= 10_000 and self.window_us > 0):
            raise InputError(
                "expected drift_ppm from 0 to 10000 and window_us above 0, got "
                f"{self.drift_ppm!r} and {self.window_us!r}"
            )

    def drifted_us(self, after_us: int) -> int:
        """How much the offset of the two clocks changes within a time of either, at most, rounded
        up: a clock slow by d takes s / (1 - d) for s of its own."""
        return -(-after_us * self.drift_ppm // (1_000_000 - self.drift_ppm))


@final
@dataclass(frozen=True, slots=True)
class Stamped:
    """One stamp on our clock.

    within_us: holds its instant. late_us: by how much, at least, the frame's delay exceeds the most
    that is stated, 0 where it may not. jumped: no clock that drifts as stated gives this stamp and
    the ones before: the sender's clock was set, or all earlier frames were late.
    """

    within_us: Instants
    late_us: int
    jumped: bool


@final
@dataclass(frozen=True, slots=True)
class Stamps:
    """Compares stamps with arrivals; `taking` returns the next value and what it found.

    With offset o(t) = our clock - sender's clock, |o(t) - o(t')| <= D |t - t'|, a frame k that is
    stamped s_k and arrives at r_k, its delay in [d, e], shows d_k = r_k - s_k = o + delay. Hence at
    every t, with a_k = |t - r_k|,
        o(t) <= min_k (d_k + D a_k) - d   (of every frame: the lower envelope),
        o(t) >= min_k (d_k - D a_k) - e   (as some frame k had a delay of at most e),
    each widened by what the frames round a stamp by. The stamp was at s + o, and s is rounded too.
    The most delayed frame says nothing, and the newest nothing special: an offset taken from either
    would move the instant by its delay.

    A frame proved to be later than e is not compared with later ones, so that a line that has grown
    slow is named for as long as drift cannot explain it. A jump begins anew with its own frame.
    What no receiver can tell: a delay of more than e that every frame has had from the start on, a
    clock set back by less than e, lateness that drift may explain. Rigor: exact integers, given
    the bounds.
    """

    bounds: StampBounds
    pairs: tuple[Instants, ...] = ()

    def taking(self, stamp_s: float, at_us: int) -> tuple[Stamps, Stamped]:
        """One stamp more, whose first frame arrived by at_us (not before the ones before)."""
        stamp_us = round(stamp_s * _COUNTS_US)
        apart_us = at_us - stamp_us
        least_us, most_us = self.bounds.delay_us
        alone = dataclasses.replace(self, pairs=((at_us, apart_us),))
        if not self.pairs:
            return alone, alone._found(stamp_us, at_us, late_us=0, jumped=False)
        low, high = self._offset_us(at_us)
        if apart_us - least_us + ROUNDING_US < low:
            return alone, alone._found(stamp_us, at_us, late_us=0, jumped=True)
        late_us = apart_us - ROUNDING_US - high - most_us
        if late_us > 0:
            return self, self._found(stamp_us, at_us, late_us=late_us, jumped=False)
        begins_us = at_us - self.bounds.window_us
        young = tuple(pair for pair in self.pairs if pair[0] >= begins_us)
        taken = dataclasses.replace(self, pairs=(*young, (at_us, apart_us))[-MOST_PAIRS:])
        return taken, taken._found(stamp_us, at_us, late_us=0, jumped=False)

    def _offset_us(self, at_us: int) -> Instants:
        """Our clock minus the sender's, at an instant of ours."""
        least_us, most_us = self.bounds.delay_us
        changes = [(apart, self.bounds.drifted_us(at_us - then)) for then, apart in self.pairs]
        low = min(apart - change for apart, change in changes) - most_us - ROUNDING_US
        high = min(apart + change for apart, change in changes) - least_us + ROUNDING_US
        return low, high

    def _found(self, stamp_us: int, at_us: int, *, late_us: int, jumped: bool) -> Stamped:
        """The stamp's instant; nothing arrives before it was sent."""
        low, high = self._offset_us(at_us)
        within_us = (stamp_us - ROUNDING_US + low, min(stamp_us + ROUNDING_US + high, at_us))
        return Stamped(within_us, late_us, jumped)
