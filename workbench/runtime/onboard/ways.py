"""What people may want: the last set of ways that fits a set of people, and how others fared."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.onboard.counting import NEVER, Count
from workbench.runtime.onboard.set_streams import SetSeen, fault_between
from workbench.runtime.onboard.stamps import Instants
from workbench.runtime.protocols import (
    Decoded,
    IntentSet,
    IntentsSeen,
    NoSet,
    PeopleSeen,
    Refusal,
    SetFault,
    Way,
)


@final
@dataclass(frozen=True, slots=True)
class WaysSeen:
    """Ways by track number, in the frame of people; the numbers are those of the frames.

    stamp_us: holds the instant of knot 0 on our clock; period_us: between two knots.
    """

    stamp_us: Instants
    period_us: int
    ways: Mapping[int, tuple[Way, ...]]


@final
@dataclass(frozen=True, slots=True)
class WayCounts:
    """How the sets fared. whole: how many were, and fitted; incomplete: how many of these left
    somebody out (MORE); faults: how often which one, sets of other people among them."""

    whole: int = 0
    incomplete: Count = NEVER
    faults: Mapping[SetFault, Count] = dataclasses.field(default_factory=dict)


_NONE_YET: Final = NoSet(SetFault.NOTHING_YET)


@final
class WayStream:
    """Takes frames in the order of their arrival.

    seen: the last whole set that belongs to the people who were the newest when it was whole,
    however old, or that there is none yet. Its clock is theirs: SET and STAMP are the same, so that
    the time it took to find the ways does not count as a delay of the stamp. heard: whether a
    header ever came. A set that fails takes nothing away from the one before, as its ways still
    claim what they claimed.
    """

    def __init__(self) -> None:
        self._collected = IntentSet()
        self.seen: WaysSeen | NoSet = _NONE_YET
        self.counts = WayCounts()

    @property
    def heard(self) -> bool:
        """Whether anybody sends ways."""
        return self._collected.frames.last is not None

    def take(
        self, frame: Decoded | Refusal, at_us: int, people: SetSeen[PeopleSeen] | NoSet
    ) -> None:
        """One more frame, of whatever message; people: the newest by now."""
        before = self._collected.frames
        self._collected = self._collected.taking(frame)
        after = self._collected.frames
        self._count(fault_between(before, after), at_us)
        if after.completed > before.completed:
            self._complete(at_us, people)

    def _count(self, fault: SetFault | None, at_us: int) -> None:
        if fault is not None:
            count = self.counts.faults.get(fault, NEVER).more(at_us)
            faults = {**self.counts.faults, fault: count}
            self.counts = dataclasses.replace(self.counts, faults=faults)

    def _complete(self, at_us: int, people: SetSeen[PeopleSeen] | NoSet) -> None:
        outcome = self._collected.outcome
        if isinstance(outcome, NoSet):
            self._count(outcome.fault, at_us)
            return
        seen = _fitted(outcome, people)
        if seen is None:
            self._count(SetFault.OTHER_PEOPLE, at_us)
            return
        self.seen, counts = seen, self.counts
        left = counts.incomplete.more(at_us) if outcome.more else counts.incomplete.ended()
        self.counts = dataclasses.replace(counts, whole=counts.whole + 1, incomplete=left)


def _fitted(found: IntentsSeen, people: SetSeen[PeopleSeen] | NoSet) -> WaysSeen | None:
    """The ways of these people; None where they are of others."""
    if isinstance(people, NoSet):
        return None
    of = people.value
    same = (found.number, found.stamp_s) == (of.number, of.stamp_s)
    if not same or any(way.index >= len(of.people) for way in found.ways):
        return None
    ways: dict[int, tuple[Way, ...]] = {}
    for way in found.ways:
        person = of.people[way.index]
        knots = tuple((person.x_m + x, person.y_m + y, radius) for x, y, radius in way.knots)
        ways[person.track] = (*ways.get(person.track, ()), knots)
    return WaysSeen(people.stamp_us, round(found.knot_period_s * 1e6), ways)
