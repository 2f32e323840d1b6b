"""The matrix that takes the distance of two trajectories to the difference of their fields."""

from __future__ import annotations

import numpy as np

from workbench.reach.validated.bounds import Range
from workbench.sensitivity.interval_arrays import Interval, add, multiply, point
from workbench.sensitivity.jacobian import IntervalJacobian

# A power of two: its inverse is exact.
_SLABS = 8


def mean_jacobian(jacobian: IntervalJacobian, *, near: Range, box: Range) -> Interval | None:
    """M = int_0^1 J(z* + s (z - z*)) ds for z* in `near`, z in `box`, two (1, n) each: (n, n) ends.

    f(z) - f(z*) = M (z - z*). near lies in the box, hence for s in [(i - 1) / k, i / k] the point
    between lies in (1 - i / k) near + (i / k) box, and M in the mean of k hulls of J: not much more
    than half as wide as J over the box. Across kinks J encloses the generalised Jacobian, which the
    derivative along the segment is in at almost every s. None where a hull is not finite. Source:
    Harapanahalli and Coogan, arXiv 2411.11587 (the linear inclusion about a known trajectory).
    """
    share = (np.arange(1, _SLABS + 1) / _SLABS)[:, None]
    # Three roundings move the ends by less than 2^-50 of their size.
    slack = 2.0**-50 * np.maximum(np.abs(box[0]), np.abs(box[1])) + 1e-300
    low = np.maximum((1.0 - share) * near[0] + share * box[0] - slack, box[0])
    high = np.minimum((1.0 - share) * near[1] + share * box[1] + slack, box[1])
    cells = jacobian.on(low, high)
    hulls = cells.jacobian_lower, cells.jacobian_upper
    if not (np.isfinite(hulls[0]).all() and np.isfinite(hulls[1]).all()):
        return None
    total: Interval = hulls[0][0], hulls[1][0]
    for i in range(1, _SLABS):
        total = add(total, (hulls[0][i], hulls[1][i]))
    mean = multiply(point(np.array(1.0 / _SLABS)), total)
    # Outward rounding would make the zeros of the structure feed each other.
    some = np.any((hulls[0] != 0.0) | (hulls[1] != 0.0), axis=0)
    return np.where(some, mean[0], 0.0), np.where(some, mean[1], 0.0)
