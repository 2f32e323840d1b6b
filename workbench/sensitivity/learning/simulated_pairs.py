"""Pairs of runs of a simulator, both ends drawn from one box."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.learning.draws import Words, unit, words
from workbench.sensitivity.learning.pairs import PairRuns, Simulator
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box


@final
@dataclass(frozen=True, slots=True)
class SimulatedPairs:
    """Pair i is drawn from `seed` and i alone: two independent states, uniform on `box`, and one
    64-bit seed that both runs share.

    box: names every state of the simulator. Raises InputError where it does not, and where it is a
    point.
    """

    simulator: Simulator
    box: Box
    seed: int

    def __post_init__(self) -> None:
        if set(self.box.names) != set(self.names):
            raise InputError(
                f"expected the initial set to name the states {self.names}, got "
                f"{self.box.names}; give every state an interval (a point where it is known)"
            )
        if not np.any(self.scale > 0.0):
            raise InputError("expected an initial set with some width, got a point; widen an axis")

    @property
    def names(self) -> tuple[str, ...]:
        """As the simulator names its states."""
        return self.simulator.names

    @property
    def times(self) -> Array:
        """Instants (K+1,), s."""
        return self.simulator.times

    @property
    def scale(self) -> Array:
        """Half widths of the box (n,)."""
        return np.array(self.box.reordered(self.names).radius)

    @property
    def distribution(self) -> str:
        """What a further pair would be drawn from."""
        return f"two independent states uniform on the initial box; {self.simulator.what}"

    @property
    def most(self) -> int | None:
        """As many as are wanted."""
        return None

    def starts(self, start: int, count: int) -> tuple[Array, Array, Words]:
        """Initial states (count, n) of both runs and the seeds (count,) of these pairs."""
        size = len(self.names)
        drawn = words(self.seed, start, (count, 1 + 2 * size))
        box = self.box.reordered(self.names)
        lower, upper = np.array(box.lower), np.array(box.upper)
        states = np.clip(
            lower + unit(drawn[:, 1:]).reshape(count, 2, size) * (upper - lower), lower, upper
        )
        return states[:, 0], states[:, 1], drawn[:, 0]

    def block(self, start: int, count: int) -> PairRuns:
        """As `PairSource` says."""
        first, second, seeds = self.starts(start, count)
        runs = self.simulator.runs(np.concatenate([first, second]), np.concatenate([seeds, seeds]))
        if not np.all(np.isfinite(runs)):
            raise InputError(
                "a run left the finite numbers; shorten the horizon, shrink the initial set "
                "or check the gains"
            )
        return PairRuns(runs[:count], runs[count:])
