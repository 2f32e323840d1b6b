"""How large the paper's three nested sets are, as shares of the radii of what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from workbench.errors import InputError
from workbench.simulation.paper.replayed import ReplayedRun

THIRDS: Final = (1.0, 2.0 / 3.0, 1.0 / 3.0)
"""The sets of a bundle that says nothing else. Nothing makes the smaller ones hold the car."""
TRIED: Final = tuple(1.0 - 0.02 * k for k in range(41))
"""Shares among which `fitted` chooses, the whole set first."""


def fitted(runs: Sequence[ReplayedRun]) -> tuple[float, float, float]:
    """High, medium and low: the whole set; the smallest of `TRIED` whose sets held the car's place
    at every decision of `runs` (replayed with these shares), for low; and the middle of the two.

    What is fitted so says that it held, on these runs. Raises InputError where they decided nothing
    or the whole set did not hold the car, since then no share of it is worth anything.
    """
    held = [_held(run, level) for run in runs for level in range(len(TRIED)) if run.asked]
    if not held:
        raise InputError("expected runs with decisions to fit the nested sets to, got none")
    of_level = np.asarray(np.array(held).reshape(-1, len(TRIED)).all(axis=0))
    if not of_level[0]:
        raise InputError(
            "expected the whole measured set to hold the car in every run, and in one it did not; "
            "check the errors that the sensors claim"
        )
    # The first that fails ends it: a smaller set that held again did so by chance.
    low = TRIED[int(np.argmin(of_level)) - 1] if not of_level.all() else TRIED[-1]
    return 1.0, 0.5 * (1.0 + low), low


def _held(run: ReplayedRun, level: int) -> bool:
    """Whether the set of this level held the car's place at every decision."""
    turns = [asked.turn for asked in run.asked]
    sides = np.array([[asked.sets[level].interval(name) for name in _PLACE] for asked in run.asked])
    return bool(np.all((run.lower[turns] >= sides[:, :, 0]) & (run.upper[turns] <= sides[:, :, 1])))


_PLACE: Final = ("station", "offset")
