"""Rows over absolute time, from stretches of sample time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import numpy as np

from workbench.reach.sampled_data.drift import within
from workbench.reach.sampled_data.march import March
from workbench.reach.switching.exact_times import Ticks, seconds
from workbench.reach.tube import Array
from workbench.reach.validated.bounds import Range


def sample_time(horizon: Ticks, stretch: Fraction) -> Ticks:
    """How far sample time has to go for the absolute time `horizon`."""
    return math.ceil(horizon / (1 - stretch))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Boxes (K, n) and (K + 1, n) as in `ReachTube`, and kinks (K, 2, n_kinks)."""

    times: Sequence[Ticks]
    boxes: Sequence[Range]
    instants: Sequence[Range]
    kinks: Sequence[Array]

    @classmethod
    def of(cls, march: March, times: Sequence[Ticks], stretch: Fraction) -> Rows:
        """As many rows as the march covers.

        Where samples drift by the share `stretch`, the time t belongs to sample times from
        t / (1 + stretch) to t / (1 - stretch): a row lies in the hull of all that touches these,
        and so does an instant. Rows without jumps are also read from anchors; both hold.
        """
        boxes, kinks, instants = [], [], [march.instants[0]]
        for start, end in itertools.pairwise(times):
            first, last = _span(start, stretch)[0], _span(end, stretch)[1]
            if not march.stretches or march.stretches[-1].end < last:
                break
            boxes.append(_row(march, start, end, stretch, instants[-1]))
            kinks.append(_kinks(march, first, last))
            instants.append(_instant(march, end, stretch))
        return cls(times[: len(boxes) + 1], boxes, instants, kinks)


def _row(march: March, start: Ticks, end: Ticks, stretch: Fraction, begin: Range) -> Range:
    first, last = _span(start, stretch)[0], _span(end, stretch)[1]
    whole, rates = _hull(march, first, last), _rates(march, first, last)
    if rates is None:
        return whole
    rows = march.anchors[end].rows
    own = within((begin[0][rows], begin[1][rows]), rates, seconds(end - start))
    return _cut(whole, rows, own)


def _instant(march: March, time: Ticks, stretch: Fraction) -> Range:
    first, last = _span(time, stretch)
    whole, rates = _hull(march, first, last), _rates(march, first, last)
    if rates is None:
        return whole
    anchor = march.anchors[time]
    return _cut(whole, anchor.rows, anchor.at(rates))


def _cut(whole: Range, rows: list[int], own: Range) -> Range:
    low, high = whole[0].copy(), whole[1].copy()
    low[rows], high[rows] = np.maximum(low[rows], own[0]), np.minimum(high[rows], own[1])
    return low, high


def _rates(march: March, first: Ticks, last: Ticks) -> Range | None:
    """Ranges of the plant's rates in [first, last] of sample time; None where one is not known."""
    found = [each.rates for each in march.stretches if each.start < last and first < each.end]
    known = [rates for rates in found if rates is not None]
    if not known or len(known) < len(found):
        return None
    return np.min([low for low, _ in known], axis=0), np.max([high for _, high in known], axis=0)


def _span(time: Ticks, stretch: Fraction) -> tuple[Ticks, Ticks]:
    return math.floor(time / (1 + stretch)), math.ceil(time / (1 - stretch))


def _hull(march: March, first: Ticks, last: Ticks) -> Range:
    """All of [first, last] in sample time; what jumps at an end is in it before and after."""
    found = [each.box for each in march.stretches if each.start < last and first < each.end]
    found += [box for time, box in march.instants.items() if first <= time <= last]
    return np.min([low for low, _ in found], axis=0), np.max([high for _, high in found], axis=0)


def _kinks(march: March, first: Ticks, last: Ticks) -> Array:
    """Those of the plant, then those of the law at the samples in between."""
    plant = [each.kinks for each in march.stretches if each.start < last and first < each.end]
    law = [each for time, each in march.decided.items() if first <= time <= last]
    shares = np.mean([each[0] for each in plant], axis=0), np.mean([d != 0 for d in law], axis=0)
    linear = np.min([each[1] for each in plant], axis=0), np.all([d == 2 for d in law], axis=0)
    return np.array([np.concatenate(shares), np.concatenate(linear)])
