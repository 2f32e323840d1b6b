"""What happens when in a sampled loop, in sample time."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from fractions import Fraction
from typing import final

from workbench.controllers.sampling import Sampling, Window
from workbench.reach.switching.exact_times import (
    Ticks,
    nearest_ticks,
    seconds,
    ticks_down,
    ticks_up,
)


class Kind(enum.IntEnum):
    """What happens at an instant, in the order in which it does where instants coincide.

    CLOSE: the last instant at which a command can begin to act; OPEN: the first; SAMPLE: a
    measurement at its earliest, with all that follows from it; OPEN_OWN: OPEN for a command of a
    sample at this very instant.
    """

    CLOSE = 0
    OPEN = 1
    SAMPLE = 2
    OPEN_OWN = 3


@final
@dataclass(frozen=True, slots=True, order=True)
class Event:
    """Something that happens at `time` (>= 0) to the command of sample `sample` (< 0: sent before
    t = 0). known: it opens and closes at once, there is no CLOSE."""

    time: Ticks
    kind: Kind
    sample: int
    known: bool


@final
@dataclass(frozen=True, slots=True)
class Schedule:
    """Period in s, and the windows in which a measurement and the begin of a command lie.

    A sample is the tick next to its multiple of the period. read: width of the measurement's
    window, which begins there; act: begin and end of the command's window after it. ahead: by how
    much earlier the windows of the commands under way begin, which were sent before t = 0 and have
    not begun to act; the last one sent comes first. slots: how many commands wait at once.
    """

    period_s: Fraction
    read: Ticks
    act: tuple[Ticks, Ticks]
    ahead: tuple[Ticks, ...]
    slots: int

    @classmethod
    def of(cls, sampling: Sampling) -> Schedule:
        """Windows are rounded outward, known instants to the nearest tick."""
        period, act = Fraction(sampling.period_s), _window(sampling.act)
        # One slot more where waiting ends so close to a sample that rounding could swap the two.
        slots = math.floor((sampling.act[0] + Fraction(1, 10**9)) / period) + 1
        under_way = range(1, sampling.commands_sent)
        ahead = tuple(ticks_up(sampling.ahead(before)) for before in under_way)
        return cls(period, _window(sampling.read)[1], act, ahead, max(slots, len(ahead)))

    @property
    def under_way(self) -> int:
        """Number of commands under way at t = 0."""
        return len(self.ahead)

    @property
    def instant(self) -> bool:
        """Whether it is known when any command begins to act."""
        return self.act[0] == self.act[1] and not any(self.ahead)

    def slot(self, sample: int) -> int:
        """Where the command of a sample waits."""
        return sample % self.slots

    def events(self, until: Ticks) -> list[Event]:
        """All that happens in [0, until], in order."""
        samples = range(self._count(until))
        found = [Event(self._due(k), Kind.SAMPLE, k, known=True) for k in samples]
        own = Kind.OPEN_OWN if self.act[0] == 0 else Kind.OPEN
        for k in (*range(-self.under_way, 0), *samples):
            opens, closes = (self._due(k) + offset for offset in self.act)
            opens -= self.ahead[-1 - k] if k < 0 else 0
            found.append(Event(max(0, opens), own, k, known=opens == closes))
            if opens < closes:
                found.append(Event(closes, Kind.CLOSE, k, known=False))
        return sorted(event for event in found if event.time <= until)

    def dues(self, until: Ticks) -> list[Ticks]:
        """The samples' instants in [0, until)."""
        return [due for k in range(self._count(until)) if (due := self._due(k)) < until]

    def _count(self, until: Ticks) -> int:
        """Samples 0 .. count - 1 hold all that are due in [0, until]."""
        return math.floor((seconds(until) + 1e-9) / self.period_s) + 2

    def _due(self, sample: int) -> Ticks:
        due = nearest_ticks(abs(sample) * self.period_s)
        return due if sample >= 0 else -due


def _window(window: Window) -> tuple[Ticks, Ticks]:
    low, high = window
    if low == high:
        return nearest_ticks(low), nearest_ticks(low)
    return ticks_down(low), ticks_up(high)
