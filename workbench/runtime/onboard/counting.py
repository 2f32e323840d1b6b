"""Counts of what goes wrong, in a few numbers each, however long it goes on."""

from __future__ import annotations

import dataclasses
import enum
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

ENOUGH: Final = 5
"""So many strikes mean that a sender is not believed; there are no more."""
_BUCKET_US: Final = 100_000
_BUCKETS: Final = 11


@final
@dataclass(frozen=True, slots=True)
class Count:
    """How often something happened: in all, without an end of the row since; when the first of the
    row and the last one did (us, None: never)."""

    total: int = 0
    in_a_row: int = 0
    row_since_us: int | None = None
    last_us: int | None = None

    def more(self, at_us: int) -> Count:
        """Once more."""
        since_us = at_us if self.in_a_row == 0 else self.row_since_us
        return Count(self.total + 1, self.in_a_row + 1, since_us, at_us)

    def ended(self) -> Count:
        """The row has an end."""
        return dataclasses.replace(self, in_a_row=0, row_since_us=None) if self.in_a_row else self


NEVER: Final = Count()


class Strike(enum.Enum):
    """What speaks against a sender of sets."""

    DUPLICATE = "a frame repeats the one before"
    REPLAYED = "a set's counter or stamp repeats or goes backwards"
    INTEGRITY = "a frame is refused, missing, out of order or of another set"


@final
@dataclass(frozen=True, slots=True)
class Strikes:
    """Saturating counters: each strike adds one of its kind, each whole set takes one of each.

    against: how many, from 0 to ENOUGH; enough_since_us: when a kind reached ENOUGH, for as long as
    it stays there. With every set struck once and whole otherwise, none is ever reached: sets that
    are whole are what counts.
    """

    against: Mapping[Strike, int] = dataclasses.field(default_factory=dict)
    enough_since_us: Mapping[Strike, int] = dataclasses.field(default_factory=dict)

    def with_one(self, strike: Strike, at_us: int) -> Strikes:
        """One more of a kind."""
        count = min(self.against.get(strike, 0) + 1, ENOUGH)
        since = dict(self.enough_since_us)
        if count == ENOUGH:
            since.setdefault(strike, at_us)
        return Strikes({**self.against, strike: count}, since)

    def with_a_whole_set(self) -> Strikes:
        """One less of each kind."""
        left = {strike: count - 1 for strike, count in self.against.items() if count > 1}
        return Strikes(left, {})


NO_STRIKES: Final = Strikes()


@final
class FrameRate:
    """Frames of the last second, counted in tenths of it."""

    def __init__(self) -> None:
        self._buckets: deque[list[int]] = deque(maxlen=_BUCKETS)

    def take(self, at_us: int) -> None:
        """One more frame."""
        bucket = at_us // _BUCKET_US
        if self._buckets and self._buckets[-1][0] == bucket:
            self._buckets[-1][1] += 1
        else:
            self._buckets.append([bucket, 1])

    def within_us(self, now_us: int, *, back_us: int) -> int:
        """Frames that came less than back_us (up to 1 s) before now, and up to 0.1 s longer ago."""
        oldest = (now_us - back_us) // _BUCKET_US
        return sum(count for bucket, count in self._buckets if bucket >= oldest)
