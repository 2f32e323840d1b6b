"""The instants of a tube over a switch, in ticks."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.reach.switching.exact_times import (
    Ticks,
    nearest_ticks,
    seconds,
    ticks_down,
    ticks_up,
)
from workbench.reach.tube import Array


@final
@dataclass(frozen=True, slots=True)
class SwitchingTimes:
    """Instants before t1, the pieces of [t1, t2], and what follows; all in ticks.

    before: 0 .. t1; pieces: how many of length `piece` fill [t1, t2] (0 where t1 = t2); beyond:
    instants after t2, up to the horizon. A group of trajectories is what switches in one piece; it
    is together from the end of its piece on.
    """

    before: tuple[Ticks, ...]
    pieces: int
    piece: Ticks
    beyond: tuple[Ticks, ...]

    @classmethod
    def of(
        cls, between_s: tuple[float, float], *, horizon_s: float, step_s: float
    ) -> SwitchingTimes:
        """Raises InputError where the switch may come after the horizon."""
        first, last, horizon = ticks_down(between_s[0]), ticks_up(between_s[1]), ticks_up(horizon_s)
        if not (horizon_s > 0.0 and last <= horizon):
            raise InputError(
                f"expected the switch within the horizon, got {between_s[1]!r} s and {horizon_s!r} "
                "s; lengthen the horizon"
            )
        step = max(1, nearest_ticks(step_s))
        pieces = -((first - last) // step)
        piece = -((first - last) // pieces) if pieces else 0
        last = first + pieces * piece
        horizon = max(horizon, last)
        # With several pieces the groups follow one another by `piece` and share their instants.
        spacing = piece if pieces > 1 else step
        beyond = (*range(last + spacing, horizon, spacing), horizon) if last < horizon else ()
        count = -(-first // step)
        before = tuple(first * k // count for k in range(count + 1)) if count else (0,)
        return cls(before, pieces, piece, beyond)

    @property
    def all(self) -> tuple[Ticks, ...]:
        """Every instant of the tube."""
        return (*self.before, *(self.begin(k + 1) for k in range(self.pieces)), *self.beyond)

    def begin(self, k: int) -> Ticks:
        """Where piece k begins."""
        return self.before[-1] + k * self.piece

    def together(self, group: int) -> Ticks:
        """From when on all of a group have switched."""
        return self.begin(group + 1)

    def after(self, groups: int) -> tuple[Ticks, ...]:
        """Times since a group is together that its rows need, for all groups in common."""
        starts = [self.together(group) for group in range(groups)]
        return tuple(sorted({t - s for t, s in itertools.product(self.all, starts) if t >= s}))

    @property
    def rows_run(self) -> int:
        """How many rows there are to compute, groups side by side counted once."""
        switching = self.pieces + 2 if self.pieces else 0
        after = self.after(max(1, self.pieces))
        return len(self.before) - 1 + switching + len(after) - 1


def in_seconds(ticks: Sequence[Ticks]) -> Array:
    """Instants in s, exact."""
    return np.array([seconds(each) for each in ticks])
