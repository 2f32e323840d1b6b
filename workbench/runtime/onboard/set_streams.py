"""The sets of one sender: the last whole one, when it was stamped, and how the others fared."""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Generic, Protocol, TypeVar, final

from workbench.runtime.onboard.counting import NEVER, NO_STRIKES, Count, Strike, Strikes
from workbench.runtime.onboard.stamps import Instants, StampBounds, Stamps
from workbench.runtime.protocols import Decoded, NoSet, Reason, Refusal, SetFault
from workbench.runtime.protocols.frame_sets import FrameSet

MOST_SETS: Final = 8
SET_GAP_US: Final = 250_000
"""Earlier sets are kept no denser, so that they reach back far enough to show motion."""


class Timed(Protocol):
    """Whatever a sender stamps."""

    @property
    def stamp_s(self) -> float:
        """Instant on the sender's clock."""


Value = TypeVar("Value", bound=Timed)
Value_co = TypeVar("Value_co", bound=Timed, covariant=True)


class Collected(Protocol[Value_co]):
    """`LocalisationSet` and `PersonSet`: frames in, values out."""

    @property
    def frames(self) -> FrameSet:
        """What was received of the set."""

    @property
    def outcome(self) -> Value_co | NoSet:
        """What a whole set says."""

    def taking(self, frame: Decoded | Refusal) -> Collected[Value_co]:
        """The collection after one more frame."""


@final
@dataclass(frozen=True, slots=True)
class SetSeen(Generic[Value]):
    """A whole set: its header came by first_us, its last frame by last_us; stamp_us holds the
    instant of its stamp on our clock; late_us: as `Stamped` has it."""

    value: Value
    first_us: int
    last_us: int
    stamp_us: Instants
    late_us: int


@final
@dataclass(frozen=True, slots=True)
class SetCounts:
    """How a sender's sets fared. whole: how many were; faults: how often which one; duplicates:
    frames that repeated the one before; late, jumps: sets that `Stamped` calls so."""

    whole: int = 0
    faults: Mapping[SetFault, Count] = dataclasses.field(default_factory=dict)
    duplicates: Count = NEVER
    strikes: Strikes = NO_STRIKES
    late: Count = NEVER
    jumps: Count = NEVER


_STRIKES: Final = {
    SetFault.REFUSED: Strike.INTEGRITY,
    SetFault.OUT_OF_ORDER: Strike.INTEGRITY,
    SetFault.REPEATED: Strike.REPLAYED,
    SetFault.REGRESSED: Strike.REPLAYED,
}
# These say of the people themselves that they cannot be judged: no earlier set stands for them.
_UNUSABLE: Final = (SetFault.OVER_CAPACITY, SetFault.TRACK_TWICE)


@final
class SetStream(Generic[Value]):
    """Takes frames in the order of their arrival.

    seen: the last whole set, however old, or why there is none: nothing whole yet, or the newest
    one says that people cannot be judged. history: earlier ones, the oldest first.
    """

    def __init__(self, empty: Collected[Value], bounds: StampBounds) -> None:
        self._collected = empty
        self._stamps = Stamps(bounds)
        self._first_us = 0
        self.seen: SetSeen[Value] | NoSet = NoSet(SetFault.NOTHING_YET)
        self.counts = SetCounts()
        self.history: deque[SetSeen[Value]] = deque(maxlen=MOST_SETS)

    def take(self, frame: Decoded | Refusal, at_us: int) -> None:
        """One more frame, of whatever message."""
        before = self._collected.frames
        self._collected = self._collected.taking(frame)
        after = self._collected.frames
        if after.last != before.last:
            self._first_us = at_us
        if after.duplicates > before.duplicates:
            self.counts = dataclasses.replace(
                self.counts,
                duplicates=self.counts.duplicates.more(at_us),
                strikes=self.counts.strikes.with_one(Strike.DUPLICATE, at_us),
            )
        fault = fault_between(before, after)
        if fault is not None:
            # A sender that says it does not know is whole: its last set ages, and that is told.
            honest = isinstance(frame, Refusal) and frame.reason is Reason.SAID_INVALID
            self.counts = _faulted(self.counts, fault, at_us, strikes=not honest)
        if after.completed > before.completed:
            self._complete(at_us)
        elif isinstance(after.outcome, NoSet) and after.outcome.fault in _UNUSABLE:
            self.seen = after.outcome

    def _complete(self, at_us: int) -> None:
        outcome = self._collected.outcome
        if isinstance(outcome, NoSet):
            self.counts = _faulted(self.counts, outcome.fault, at_us, strikes=True)
            self.seen = outcome
            return
        self._stamps, found = self._stamps.taking(outcome.stamp_s, self._first_us)
        seen = SetSeen(outcome, self._first_us, at_us, found.within_us, found.late_us)
        self.seen, counts = seen, self.counts
        self.counts = dataclasses.replace(
            counts,
            whole=counts.whole + 1,
            strikes=counts.strikes.with_a_whole_set(),
            late=counts.late.more(at_us) if found.late_us else counts.late.ended(),
            jumps=counts.jumps.more(at_us) if found.jumped else counts.jumps.ended(),
        )
        if not self.history or at_us - self.history[-1].last_us >= SET_GAP_US:
            self.history.append(seen)


def fault_between(before: FrameSet, after: FrameSet) -> SetFault | None:
    """What the last frame broke; a header that comes while a set is open loses that one."""
    outcome = after.outcome
    broken = isinstance(outcome, NoSet) and outcome is not before.outcome
    if broken and isinstance(outcome, NoSet) and outcome.fault is not SetFault.UNFINISHED:
        return outcome.fault
    return SetFault.OUT_OF_ORDER if after.lost > before.lost else None


def _faulted(counts: SetCounts, fault: SetFault, at_us: int, *, strikes: bool) -> SetCounts:
    strike = _STRIKES.get(fault) if strikes else None
    return dataclasses.replace(
        counts,
        faults={**counts.faults, fault: counts.faults.get(fault, NEVER).more(at_us)},
        strikes=counts.strikes if strike is None else counts.strikes.with_one(strike, at_us),
    )
