"""A simulator whose runs are made by other processes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.sensitivity.learning.drawing import Drawing, Workforce
from workbench.sensitivity.learning.draws import Words
from workbench.sensitivity.learning.pairs import PairRuns, Simulator
from workbench.sensitivity.vectorised import Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class ByWorkers:
    """The same runs as `simulator`, for an even number of states, made as `workforce` says.

    ran(n): called after n more pairs.
    """

    simulator: Simulator
    workforce: Workforce
    ran: Callable[[int], None] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the simulator."""
        return tuple(self.simulator.names)

    @property
    def times(self) -> Array:
        """Of the simulator."""
        return self.simulator.times

    @property
    def what(self) -> str:
        """Of the simulator."""
        return self.simulator.what

    def runs(self, initial_states: Array, seeds: Words) -> Array:
        """As `Simulator` says."""
        half = len(initial_states) // 2
        if not half:
            return np.empty((0, len(self.times), len(self.names)))
        listed = _Listed(self.simulator, initial_states, seeds)
        with Drawing(listed, half, self.workforce, drawn=self.ran) as pairs:
            found = pairs.block(0, half)
        return np.concatenate([found.first, found.second])


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Listed:
    """Runs in two halves of given states, as a source of pairs: who draws them is decided there."""

    simulator: Simulator
    states: Array
    seeds: Words

    @property
    def names(self) -> tuple[str, ...]:
        """Of the simulator."""
        return self.simulator.names

    @property
    def times(self) -> Array:
        """Of the simulator."""
        return self.simulator.times

    @property
    def scale(self) -> Array:
        """Of no meaning here."""
        return np.zeros(len(self.names))

    @property
    def distribution(self) -> str:
        """None: the states are chosen."""
        return "chosen pairs"

    @property
    def most(self) -> int | None:
        """All there are."""
        return len(self.states) // 2

    def block(self, start: int, count: int) -> PairRuns:
        """As `PairSource` says; runs that leave the finite numbers are passed on."""
        half = len(self.states) // 2
        rows = np.arange(start, start + count)
        both = np.concatenate([rows, rows + half])
        runs = self.simulator.runs(self.states[both], self.seeds[both])
        return PairRuns(runs[:count], runs[count:])
