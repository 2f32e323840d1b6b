"""The rows of a tube over a switch, from the runs it is made of."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.reach.switching.exact_times import Ticks
from workbench.reach.switching.set_rows import with_values
from workbench.reach.switching.times import SwitchingTimes
from workbench.reach.tube import Array
from workbench.reach.validated.bounds import Range
from workbench.reach.validated.run import Trace


@final
@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A box (n,) for all times of a row; share and linearity of the kinks of both systems."""

    box: Range
    kinks_first: Array
    kinks_then: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class SwitchingRuns:
    """What was computed over a switch; all boxes are over the shared states.

    before: runs without a switch, up to t1 and then one per piece. caught: from the switch to the
    end of its piece, one set per group, in scaled time. after: what follows, one set per group, in
    time since the group is together. Both None where no proof came so far.
    """

    times: SwitchingTimes
    resets: Mapping[int, tuple[float, float]]
    before: Sequence[Trace]
    caught: Trace | None
    after: Trace | None
    groups: int
    known: Mapping[Ticks, int]

    @classmethod
    def of(
        cls,
        times: SwitchingTimes,
        resets: Mapping[int, tuple[float, float]],
        *,
        before: Sequence[Trace],
        caught: Trace | None,
        after: Trace | None,
    ) -> SwitchingRuns:
        """`after` runs over `times.after` of its number of groups."""
        groups = len(after.end.coef) if after is not None else 1
        known = {time: index for index, time in enumerate(times.after(groups))}
        return cls(times, resets, before, caught, after, groups, known)

    def rows(self) -> list[Row]:
        """The rows up to the first that is not proved."""
        rows: list[Row] = []
        for start, end in itertools.pairwise(self.times.all):
            row = self._row(start, end)
            if row is None:
                break
            rows.append(row)
        return rows

    def instant(self, time: Ticks) -> Range:
        """Box (n,) at the end of a proved row, before and after a switch at that very time."""
        times = self.times
        found: list[Range] = []
        if time <= times.before[-1]:
            found.append(_at(self.before[0], times.before.index(time), 0))
        elif time <= times.begin(times.pieces):
            found.append(_at(self.before[self._piece(time)], 1, 0))
        if time == times.before[-1]:
            found.append(self._first_switched())
        for group in range(self.groups):
            since = self.times.together(group)
            if since <= time and self.after is not None:
                found.append(_at(self.after, self.known[time - since], group))
        return _hull(found)

    def _first_switched(self) -> Range:
        """What switches at t1, just after."""
        low, high = with_values(self.before[0].end, self.resets).hull()
        return low[0], high[0]

    def _piece(self, time: Ticks) -> int:
        return (time - self.times.before[-1]) // self.times.piece

    def _together(self, start: Ticks, end: Ticks) -> list[tuple[Trace | None, int, int]]:
        """The rows of `after` between two instants, of every group that is together by then."""
        found: list[tuple[Trace | None, int, int]] = []
        for group in range(self.groups):
            since = self.times.together(group)
            if since <= start:
                first, last = self.known[start - since], self.known[end - since]
                found += [(self.after, index, group) for index in range(first, last)]
        return found

    def _row(self, start: Ticks, end: Ticks) -> Row | None:
        parts: list[tuple[Trace | None, int, int]] = []
        if end <= self.times.before[-1]:
            parts.append((self.before[0], self.times.before.index(start), 0))
        elif end <= self.times.begin(self.times.pieces):
            piece = self._piece(start)
            if piece + 1 >= len(self.before):
                return None
            parts += [(self.before[piece + 1], 0, 0), (self.caught, 0, piece)]
        unswitched = len(parts[:1])
        parts += self._together(start, end)
        proved = [(t, i, g) for t, i, g in parts if t is not None and i < len(t.lower)]
        if len(proved) < len(parts):
            return None
        kinks = [trace.kinks[index] for trace, index, _ in proved]
        boxes = [(trace.lower[index][g], trace.upper[index][g]) for trace, index, g in proved]
        # A row is closed: what jumps at its very end or start belongs to it on both sides.
        if end == self.times.before[-1]:
            boxes.append(self._first_switched())
        if start == self.times.begin(self.times.pieces):
            boxes.append(_at(self.before[-1], -1, 0))
        return Row(_hull(boxes), _mean(kinks[:unswitched]), _mean(kinks[unswitched:]))


def _at(trace: Trace, index: int, group: int) -> Range:
    return trace.lower_at[index][group], trace.upper_at[index][group]


def _hull(boxes: Sequence[Range]) -> Range:
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def _mean(kinks: Sequence[Array]) -> Array:
    """Mean decided share and common linearity, (2, n_kinks); empty where there are no states."""
    if not kinks:
        return np.zeros((2, 0))
    return np.array([np.mean([k[0] for k in kinks], axis=0), np.min([k[1] for k in kinks], axis=0)])
