"""From sample time to absolute time, where samples drift.

At the sample time s a trajectory has really been under way for a time c that is known up to s
stretch only, and its state x is known together with c. At the absolute time s it was or will be at
    x + (s - c) f,   f a mean of its rates in between,
which is narrow in x - rho (c - s) for a rate rho near f, although x by itself is wide.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.reach.sampled_data.held_loop import HeldLoop
from workbench.reach.switching.exact_times import Ticks, seconds
from workbench.reach.tube import Array
from workbench.reach.validated.algebra import UNIT, upward
from workbench.reach.validated.bounds import BatchInclusion, Range
from workbench.reach.validated.sets import PolynomialSet


@final
class PlantRates:
    """Ranges of the rates (per real time) of the rows that move without jumps (`pose_rows`)."""

    def __init__(self, held: HeldLoop) -> None:
        ode = held.free()
        self._held = held
        self._field = BatchInclusion.of([ode.x, ode.p, ode.w], [ode.field])
        self._p = np.array([ode.parameter_values()]).reshape(1, -1)
        felt = [(1.0, 1.0), *((d.lower, d.upper) for d in ode.disturbances[1:-2])]
        self._w = np.array(felt).T

    def __call__(self, box: Range, *, opening: bool) -> Range | None:
        """(m,) over a box (n,) of all rows, under what holds or, while opening, begins to act."""
        low, high = (end[list(self._held.pair(0))] for end in box)
        if opening:
            jump = list(self._held.pair(self._held.slots + 1))
            low = np.minimum(low, np.nextafter(low + box[0][jump], -np.inf))
            high = np.maximum(high, np.nextafter(high + box[1][jump], np.inf))
        w = [
            np.concatenate([own, end])[None] for own, end in zip(self._w, (low, high), strict=True)
        ]
        with np.errstate(all="ignore"):
            (rates,), valid = self._field(
                [(box[0][None], box[1][None]), (self._p, self._p), (w[0], w[1])]
            )
        rows = self._held.pose_rows
        return (rates[0][0, rows], rates[1][0, rows]) if valid.all() else None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """x - rho (c - s) of some rows in `box` (m,) at the sample time s, and |c - s| <= away_s.

    rate (m,): rho.
    """

    rows: list[int]
    box: Range
    rate: Array
    away_s: float

    @classmethod
    def of(cls, source: PolynomialSet, rows: list[int], time: Ticks, rates: Range) -> Anchor:
        """For one set whose last row is c; rho from the middle of `rates` (m,)."""
        rate, s = 0.5 * rates[0] + 0.5 * rates[1], seconds(time)
        coef, generators = source.coef[0, rows], source.generators[0, rows]
        clock, moves = source.coef[0, -1].copy(), source.generators[0, -1]
        clock[0] -= s
        away = float(upward(np.abs(clock).sum() + np.abs(moves).sum() + 8.0 * UNIT * s))
        mixed = coef - rate[:, None] * clock
        spread = np.abs(generators - rate[:, None] * moves).sum(axis=1)
        size = np.abs(coef).sum(axis=1) + np.abs(generators).sum(axis=1)
        slack = 8.0 * UNIT * (size + np.abs(rate) * (away + s))
        box = source.algebra.bounds(mixed, upward(spread + slack))
        return cls(rows, box, rate, away)

    def at(self, rates: Range) -> Range:
        """These rows at the absolute time s, where `rates` (m,) hold between s and c."""
        off = np.maximum(rates[1] - self.rate, self.rate - rates[0])
        reach = upward(self.away_s * off * (1.0 + 4.0 * UNIT))
        low, high = self.box[0] - reach, self.box[1] + reach
        return np.nextafter(low, -np.inf), np.nextafter(high, np.inf)


def within(start: Range, rates: Range, time_s: float) -> Range:
    """All states in the `time_s` after `start`, under rates in a range."""
    low = start[0] + np.minimum(time_s * rates[0], 0.0) * (1.0 + 8.0 * UNIT) - 1e-300
    high = start[1] + np.maximum(time_s * rates[1], 0.0) * (1.0 + 8.0 * UNIT) + 1e-300
    return np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
