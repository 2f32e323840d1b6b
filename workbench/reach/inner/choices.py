"""One choice of everything a trajectory depends on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.reach.tube import Array
from workbench.sensitivity.vectorised import Index


@final
@dataclass(frozen=True, slots=True, eq=False)
class Choices:
    """N trajectories, each by its initial state, unknown constants and disturbance.

    states (N, n); constants (N, m): the parameters with lower < upper, in order; signals (N, K,
    n_w): disturbances, row k held on [t_k, t_k+1).
    """

    states: Array
    constants: Array
    signals: Array

    def __len__(self) -> int:
        return len(self.states)

    def take(self, rows: Index) -> Choices:
        """The chosen rows."""
        return Choices(self.states[rows], self.constants[rows], self.signals[rows])

    def replaced(self, rows: Index, others: Choices) -> Choices:
        """The same with `rows` taken from `others` (one row each)."""
        parts = []
        for mine, new in zip(self._parts(), others._parts(), strict=True):
            copy = mine.copy()
            copy[rows] = new
            parts.append(copy)
        return Choices(*parts)

    def without_repeats(self) -> Choices:
        """Every different choice once."""
        flat = np.concatenate([part.reshape(len(self), -1) for part in self._parts()], axis=1)
        return self.take(np.unique(flat, axis=0, return_index=True)[1])

    def _parts(self) -> tuple[Array, Array, Array]:
        return self.states, self.constants, self.signals


def joined(parts: list[Choices]) -> Choices:
    """All rows of all parts."""
    return Choices(
        np.concatenate([part.states for part in parts]),
        np.concatenate([part.constants for part in parts]),
        np.concatenate([part.signals for part in parts]),
    )
