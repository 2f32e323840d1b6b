"""Affine relaxations of the kinks over one step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import numpy.typing as npt

from workbench.reach.validated.algebra import UNIT, Array, upward
from workbench.reach.validated.bounds import Range


@final
@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """clip(d) in slope d + offset +- gap for every kink, arrays (B, n_kinks).

    decided: -1 at the floor, 1 at the ceiling, 2 not beyond either, 3 the same of a kink that is
    no limit of the model, 0 undecided; all of the step. limited: which kinks are such limits.
    motion: by how much the driver's range grows within the step, as a share of the range; 0 where
    decided.
    """

    slope: Array
    offset: Array
    gap: Array
    decided: npt.NDArray[np.int8]
    motion: Array
    limited: tuple[bool, ...]

    @classmethod
    def none(cls, batch: int, limited: tuple[bool, ...]) -> Lines:
        """All zero, to be filled."""
        blank = np.zeros((batch, len(limited)))
        decided = np.zeros(blank.shape, dtype=np.int8)
        return cls(blank, blank.copy(), blank.copy(), decided, blank.copy(), limited)

    def set(self, i: int, driver: Range, moved: Array, *, floor: Range, ceiling: Range) -> None:
        """Choose the line of kink i for a driver in the range (B,); `moved`: part of its width.

        Limits that are known up to rounding shift the clip by at most that much.
        """
        low, high = driver
        # min(max(d, floor), ceiling) is the ceiling everywhere where the limits are crossed.
        floor = np.minimum(floor[0], ceiling[0]), np.minimum(floor[1], ceiling[1])
        line = chebyshev_line(low, high, floor[0], ceiling[1])
        self.slope[:, i], self.offset[:, i], self.gap[:, i] = line
        for limit in (floor, ceiling):
            self.gap[:, i] += np.where(limit[1] > limit[0], upward(limit[1] - limit[0]), 0.0)
        self.decided[:, i] = np.select(
            [(low >= floor[1]) & (high <= ceiling[0]), high <= floor[0], low >= ceiling[1]],
            [2 if self.limited[i] else 3, -1, 1],
            0,
        )
        width = high - low
        share = np.where(width > 0.0, moved / np.where(width > 0.0, width, 1.0), 0.0)
        self.motion[:, i] = np.where(self.decided[:, i] == 0, share, 0.0)


def chebyshev_line(
    low: Array, high: Array, floor: Array, ceiling: Array
) -> tuple[Array, Array, Array]:
    """Slope, offset and gap of the best line through min(max(d, floor), ceiling), low <= d <= high.

    For a slope in [0, 1] the deviation clip(d) - slope d is extreme at the range's ends and at the
    knees inside it; its half range, convex and piecewise linear in the slope, is least where two of
    these values meet: the two secants tried here. Any slope is sound; the gap covers rounding.
    """
    floor = np.minimum(floor, ceiling)
    knees = np.clip(floor, low, high), np.clip(ceiling, low, high)
    best = np.full_like(low, np.inf)
    slope, offset, gap = np.zeros_like(low), np.zeros_like(low), best
    for left, right in ((low, knees[1]), (knees[0], high)):
        spread = right - left
        rise = np.clip(right, floor, ceiling) - np.clip(left, floor, ceiling)
        tried = np.clip(
            np.where(spread > 0.0, rise / np.where(spread > 0.0, spread, 1.0), 0.0), 0, 1
        )
        points = (low, knees[0], knees[1], high)
        clipped = [np.clip(d, floor, ceiling) for d in points]
        values = [c - tried * d for c, d in zip(clipped, points, strict=True)]
        top, bottom = np.max(values, axis=0), np.min(values, axis=0)
        size = np.max(np.abs([*clipped, tried * low, tried * high]), axis=0)
        half = upward(0.5 * (top - bottom) + 8.0 * UNIT * size)
        better = half < best
        best = np.where(better, half, best)
        slope = np.where(better, tried, slope)
        offset = np.where(better, 0.5 * (top + bottom), offset)
        gap = np.where(better, half, gap)
    linear = (low >= floor) & (high <= ceiling)
    flat = [(high <= floor, floor), (low >= ceiling, ceiling)]
    slope, offset, gap = (
        np.where(linear, value, found)
        for value, found in zip((1.0, 0.0, 0.0), (slope, offset, gap), strict=True)
    )
    for where, limit in flat:
        taken = where & ~linear
        slope, gap = np.where(taken, 0.0, slope), np.where(taken, 0.0, gap)
        offset = np.where(taken, limit, offset)
    return slope, offset, gap
