"""The linear programs behind the matrix form, with their rows generated as they are needed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, final

import numpy as np
import numpy.typing as npt

from workbench.sensitivity.learning.form import Progress, common_distance, distance_blocks
from workbench.sensitivity.learning.largest import largest_in_common
from workbench.sensitivity.learning.log_lines import hats
from workbench.sensitivity.learning.pairs import PairSource
from workbench.sensitivity.learning.program import Program, solved
from workbench.sensitivity.vectorised import Array

# In units of each state's largest distance.
_VIOLATED: Final = 1e-7
# Above the accuracy of the solver.
_MARGIN: Final = 1e-7
_MOST_ROUNDS: Final = 100


@final
@dataclass(slots=True, eq=False)
class _State:
    """One state's program: rows (R, P m) >= heights so far, their pairs, and its entries b >= 0."""

    entries: Array
    rows: list[Array] = field(default_factory=list)
    heights: list[float] = field(default_factory=list)
    pairs: list[int] = field(default_factory=list)
    known: set[tuple[int, int]] = field(default_factory=set)
    support: set[int] = field(default_factory=set)

    def solve(self, linear: Array) -> None:
        """The entries of the smallest cost under the rows so far, and the pairs that carry them."""
        size = len(linear)
        found = solved(
            Program(
                linear=linear,
                rows=np.concatenate([np.array(self.rows), np.eye(size)]),
                heights=np.concatenate([np.array(self.heights), np.zeros(size)]),
            )
        )
        self.entries = np.maximum(found.x, 0.0)
        self.support = {self.pairs[row] for row in found.carrying if row < len(self.pairs)}


@final
@dataclass(slots=True, eq=False)
class _Worst:
    """Per instant and state (K, n): the largest gap, its pair, height and distances (K, n, m)."""

    gap: Array
    pair: npt.NDArray[np.int64]
    height: Array
    initial: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class MatrixFit:
    """A fit of matrices at `nodes` (P + 1,) to pairs number 0 .. count - 1 of a source.

    Normalised: u_j = |e_j(0)| / (scale_j rho) for the varied states j, heights in units of each
    state's largest distance / rho, entries b_j = B_ij scale_j / that unit.
    """

    pairs: PairSource
    count: int
    nodes: Array

    def solved(self, progress: Progress | None) -> tuple[Array, tuple[int, ...]]:
        """Matrices (P + 1, n, n), the first the identity, and the pairs that carry them.

        Raises RuntimeError if a program does not solve or the rows do not end.
        """
        peak = largest_in_common(self.pairs, self.count, progress=progress).ratio.max(axis=0)
        varied = np.flatnonzero(self.pairs.scale > 0.0)
        size = (len(self.nodes) - 1) * len(varied)
        linear = np.repeat(self._weights().mean(axis=0), len(varied))
        states = {int(i): _State(np.zeros(size)) for i in np.flatnonzero(peak > 0.0)}
        for _ in range(_MOST_ROUNDS):
            worst = self._worst(states, peak)
            fresh = [state for i, state in states.items() if self._extended(state, worst, i)]
            if not fresh:
                support = set[int]().union(*(state.support for state in states.values()))
                return self._matrices(states, worst, peak), tuple(sorted(support))
            for state in fresh:
                state.solve(linear)
        raise RuntimeError(f"the matrix bound still left out pairs after {_MOST_ROUNDS} rounds")

    def _weights(self) -> Array:
        """Of the nodes after the first, at the instants after the first: (K, P)."""
        return hats(self.pairs.times, self.nodes)[1:, 1:]

    def _worst(self, states: dict[int, _State], peak: Array) -> _Worst:
        """Where the present entries fall short most, over all pairs."""
        scale = self.pairs.scale
        varied = np.flatnonzero(scale > 0.0)
        weights = self._weights()
        identity = hats(self.pairs.times, self.nodes)[1:, :1]
        unit = np.where(peak > 0.0, peak, 1.0)
        shape = (len(weights), len(scale))
        table = np.zeros((*shape, len(varied)))
        for i, state in states.items():
            table[:, i] = weights @ state.entries.reshape(-1, len(varied))
        flat = table.reshape(-1, len(varied)).T
        worst = _Worst(
            np.full(shape, -np.inf),
            np.zeros(shape, dtype=np.int64),
            np.zeros(shape),
            np.zeros(table.shape),
        )
        for first, distances in distance_blocks(self.pairs, self.count):
            rho = common_distance(distances[:, 0], scale)
            rho = np.where(rho > 0.0, rho, 1.0)
            initial = distances[:, 0, varied] / (scale[varied] * rho[:, None])
            known = identity * distances[:, :1]
            heights = (distances[:, 1:] - known) / (unit * rho[:, None, None])
            gaps = heights - (initial @ flat).reshape(heights.shape)
            _update(worst, gaps, heights, initial, first)
        return worst

    def _extended(self, state: _State, worst: _Worst, i: int) -> bool:
        """Add the violated pairs of state i; whether there is a new one."""
        before = len(state.rows)
        weights = self._weights()
        for k in np.flatnonzero(worst.gap[:, i] > _VIOLATED):
            key = (int(worst.pair[k, i]), int(k))
            if key in state.known:
                continue
            state.known.add(key)
            state.rows.append(np.outer(weights[k], worst.initial[k, i]).ravel())
            state.heights.append(float(worst.height[k, i]))
            state.pairs.append(key[0])
        return len(state.rows) > before

    def _matrices(self, states: dict[int, _State], worst: _Worst, peak: Array) -> Array:
        """In the states' units, lifted until no pair at any instant is left out."""
        scale = self.pairs.scale
        varied = np.flatnonzero(scale > 0.0)
        matrices = np.zeros((len(self.nodes), len(scale), len(scale)))
        matrices[0] = np.eye(len(scale))
        # What the nodes after the first weigh together; some u_j is 1, so that a lift of all
        # entries lifts the bound by no less.
        weight = self._weights().sum(axis=1)
        for i, state in states.items():
            lift = max(0.0, float((worst.gap[:, i] / weight).max())) + _MARGIN
            entries = state.entries.reshape(-1, len(varied)) + lift
            matrices[1:, i, varied] = entries * (peak[i] / scale[varied])
        return matrices


def _update(worst: _Worst, gaps: Array, heights: Array, initial: Array, first: int) -> None:
    best = np.argmax(gaps, axis=0)
    top = np.take_along_axis(gaps, best[None], axis=0)[0]
    higher = top > worst.gap
    worst.gap[higher] = top[higher]
    worst.pair[higher] = first + best[higher]
    worst.height[higher] = np.take_along_axis(heights, best[None], axis=0)[0][higher]
    worst.initial[higher] = initial[best[higher]]
