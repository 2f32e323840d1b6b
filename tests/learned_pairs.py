"""Pairs of runs given as arrays, for the tests of learned forms and statements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from workbench.sensitivity.learning.pairs import PairRuns

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GivenPairs:
    """Distances (N, K+1, n) at `times`, as runs beside a run that stays at 0."""

    distances: Array
    times: Array
    scale: Array
    distribution: str = "as the test drew them"

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"state{i}" for i in range(self.distances.shape[2]))

    @property
    def most(self) -> int | None:
        return len(self.distances)

    def block(self, start: int, count: int) -> PairRuns:
        second = self.distances[start : start + count]
        return PairRuns(np.zeros_like(second), second)

    def only(self, chosen: tuple[int, ...]) -> GivenPairs:
        return GivenPairs(self.distances[list(chosen)], self.times, self.scale)


def random_pairs(seed: int, *, count: int, steps: int, scale: tuple[float, ...]) -> GivenPairs:
    """Smooth random distances: states that vary, that are moved by the others, and noise."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, 0.25 * steps, steps + 1)
    width = np.array(scale)
    size = len(scale)
    start = np.abs(rng.uniform(-1.0, 1.0, (count, size)) - rng.uniform(-1.0, 1.0, (count, size)))
    start *= width
    coupling = rng.uniform(0.0, 0.5, (size, size))
    reached = start[:, None] + times[:, None] * (start @ coupling.T)[:, None]
    wobble = np.exp(0.3 * rng.standard_normal((count, steps + 1, size)))
    wobble[:, 0] = 1.0
    return GivenPairs(reached * wobble, times, width)
