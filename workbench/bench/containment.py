"""Whether trajectories stay in a tube, at its instants and between them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from workbench.reach.tube import Array, ReachTube

# Times closer than this to an instant of the tube are that instant.
_SAME_TIME_S = 1e-9


def bounds_at(tube: ReachTube, times: Array) -> tuple[Array, Array]:
    """What the tube says at each of `times` (m,), in s: lower and upper ends (m, n).

    At an instant: the set there, cut with the segments on both sides. Between: the segment.
    Where the proof has ended (or has not begun) the tube says nothing: -inf and inf.
    """
    lower = np.full((len(times), len(tube.names)), -np.inf)
    upper = np.full_like(lower, np.inf)
    for row, (start, end) in enumerate(zip(tube.times[:-1], tube.times[1:], strict=True)):
        inside = (times > start - _SAME_TIME_S) & (times < end + _SAME_TIME_S)
        lower[inside] = np.maximum(lower[inside], tube.lower[row])
        upper[inside] = np.minimum(upper[inside], tube.upper[row])
    for row, instant in enumerate(tube.times):
        there = np.abs(times - instant) <= _SAME_TIME_S
        lower[there] = np.maximum(lower[there], tube.lower_at[row])
        upper[there] = np.minimum(upper[there], tube.upper_at[row])
    return lower, upper


def escaping(
    tube: ReachTube, times: Array, runs: Array, *, allowance: float
) -> npt.NDArray[np.bool_]:
    """Which runs (N, m, n) are outside the tube by more than `allowance`, per time (m,): (N, m).

    allowance: error of the runs themselves, in the states' units. NaN is outside.
    """
    lower, upper = bounds_at(tube, times)
    inside = (runs >= lower - allowance) & (runs <= upper + allowance)
    return np.asarray(~inside.all(axis=2))
