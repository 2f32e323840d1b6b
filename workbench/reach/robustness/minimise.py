"""Branch and bound: a proved lower bound on a function over boxes, as good as the cap allows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Boxes (n x k twice) -> lower bounds (n,), infinite where nothing in the box counts, and how much
# splitting each axis may gain (n x k).
Bounds = Callable[[Array, Array], tuple[Array, Array]]

_AT_ONCE: Final = 1024


@final
@dataclass(frozen=True, slots=True)
class Bounded:
    """value: lower bound over all boxes, as rigorous as the bounds; boxes: how many were judged."""

    value: float
    boxes: int


def lower_bound(bounds: Bounds, boxes: tuple[Array, Array], *, aim: float, most: int) -> Bounded:
    """Split the boxes with the least bounds until all reach `aim`, or `most` boxes were judged.

    The halves of a box cover it, and a half keeps its parent's bound where its own is worse, so
    that the least bound among the remaining boxes holds at any time.
    """
    lower, upper = boxes
    value, gain = bounds(lower, upper)
    judged = len(lower)
    while judged < most:
        open_ones = np.flatnonzero(value < aim)
        if not len(open_ones):
            break
        room = min(_AT_ONCE, max(1, (most - judged) // 2))
        chosen = open_ones[np.argsort(value[open_ones], kind="stable")[:room]]
        halves = _halved(lower[chosen], upper[chosen], gain[chosen])
        if halves is None:
            break
        new_value, new_gain = bounds(*halves)
        new_value = np.maximum(new_value, np.tile(value[chosen], 2))
        judged += len(new_value)
        kept = np.setdiff1d(np.arange(len(value)), chosen)
        counts = np.isfinite(new_value) | (new_value < 0.0)
        lower = np.concatenate([lower[kept], halves[0][counts]])
        upper = np.concatenate([upper[kept], halves[1][counts]])
        value = np.concatenate([value[kept], new_value[counts]])
        gain = np.concatenate([gain[kept], new_gain[counts]])
    return Bounded(float(value.min(initial=np.inf)), judged)


def _halved(lower: Array, upper: Array, gain: Array) -> tuple[Array, Array] | None:
    """First halves, then second halves; None where a box is too thin to halve."""
    width = upper - lower
    middle = lower + 0.5 * width
    splits = (lower < middle) & (middle < upper)
    if not splits.any(axis=1).all():
        return None
    # Where slopes have no bound, the axis that is longest for its size is split.
    plain = width / np.maximum(np.maximum(np.abs(lower), np.abs(upper)), 1e-300)
    score = np.where(np.isfinite(gain).all(axis=1, keepdims=True), gain, plain)
    score = np.where(splits, score + 1e-9 * plain, -1.0)
    axis, rows = score.argmax(axis=1), np.arange(len(lower))
    first, second = upper.copy(), lower.copy()
    first[rows, axis] = second[rows, axis] = middle[rows, axis]
    return np.concatenate([lower, second]), np.concatenate([first, upper])
