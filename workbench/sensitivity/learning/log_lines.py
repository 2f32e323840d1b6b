"""The lowest piecewise linear curve above points, and the few points that carry it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np
import numpy.typing as npt

from workbench.sensitivity.learning.program import Program, solved
from workbench.sensitivity.vectorised import Array

# Weight of the heights' total change beside their mean: of two equally low curves the flatter wins,
# and the earlier change. No simple fractions, so that they make no tie where there was none.
_FLATTER: Final = 6.18e-4
_LATER: Final = 0.137
# Far above the program's accuracy, far below what matters in a logarithm.
_LIFT: Final = 1e-7


@final
@dataclass(frozen=True, slots=True, eq=False)
class LogLines:
    """heights (M, n): at the nodes. carried (K+1, n): the points that alone give these heights."""

    heights: Array
    carried: npt.NDArray[np.bool_]


def fit_log_lines(times: Array, logs: Array, *, nodes: Array) -> LogLines:
    """Curves linear between `nodes` (M,), above logs[k, i] at t_k, with the smallest mean over k.

    times (K+1,); logs (K+1, n) finite, or -inf at the first instant where nothing is known there.
    Each curve is one linear program. It is lifted by 1e-7, and until it is above
    every point. Raises RuntimeError if the solver fails.
    """
    basis = hats(times, nodes)
    heights = np.empty((len(nodes), logs.shape[1]))
    carried = np.zeros(logs.shape, dtype=bool)
    for i in range(logs.shape[1]):
        rows = np.flatnonzero(np.isfinite(logs[:, i]))
        points = logs[rows, i]
        # About their middle and per unit of height: tolerances then mean the same for all curves.
        middle = float(points.mean())
        unit = max(1.0, float(np.abs(points - middle).max()))
        found = solved(_program(basis[rows], (points - middle) / unit))
        carried[rows[found.carrying[found.carrying < len(rows)]], i] = True
        curve = middle + unit * found.x[: len(nodes)]
        # A constant lifts every hat alike, as they add up to one.
        short = max(0.0, float(np.max(points - basis[rows] @ curve)))
        heights[:, i] = curve + short + _LIFT
    return LogLines(heights, carried)


def _program(basis: Array, points: Array) -> Program:
    """Heights (M,) above the points, then the sizes (M-1,) of their changes."""
    count = basis.shape[1]
    change = np.diff(np.eye(count), axis=0)
    size = np.eye(count - 1)
    return Program(
        linear=np.concatenate(
            [basis.mean(axis=0), _FLATTER * (1.0 + _LATER * np.arange(count - 1) ** 2)]
        ),
        rows=np.block(
            [[basis, np.zeros((len(basis), count - 1))], [change, size], [-change, size]]
        ),
        heights=np.concatenate([points, np.zeros(2 * (count - 1))]),
    )


def hats(times: Array, nodes: Array) -> Array:
    """Weights (K+1, M) of the values at `nodes` in the linear interpolation at `times`."""
    return np.stack([np.interp(times, nodes, unit) for unit in np.eye(len(nodes))], axis=1)
