"""Exponentials joined in time, over the distance in units of the whole initial set."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.learning.form import Fit, Progress, common_distance
from workbench.sensitivity.learning.largest import Largest, largest_in_common
from workbench.sensitivity.learning.log_lines import LogLines, fit_log_lines, hats
from workbench.sensitivity.learning.pairs import PairSource
from workbench.sensitivity.vectorised import Array, Index

# Ratios below this share of a state's unit count as this much: their logarithm must be finite.
LEAST: Final = 1e-30
# Of a height at a node: its exponential is a normal number.
_LOWEST: Final = -600.0


@final
@dataclass(frozen=True, slots=True)
class PiecewiseEnvelope:
    """|e_i(t)| <= A_i(t) rho, ln A_i linear between nodes, rho = max_j |e_j(0)| / scale_j.

    scale: half widths of the initial set, in the states' units; 0: never varied, so its initial
    distance must be 0. nodes_s: from 0 to the horizon. amplitudes: A at each node, one number per
    state in its unit; 0 throughout for a state that never moved.
    """

    scale: tuple[float, ...]
    nodes_s: tuple[float, ...]
    amplitudes: tuple[tuple[float, ...], ...]

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """Bound on |e_i(t)|; InputError for a distance along an axis that was never varied."""
        return tuple(self.bounds(np.array([initial]), np.array([t_s]))[0, 0].tolist())

    def bounds(self, initial: Array, times: Array) -> Array:
        """The same for many, (N, K+1, n)."""
        rho = common_distance(initial, np.array(self.scale))
        values = np.array(self.amplitudes)
        weights = hats(times, np.array(self.nodes_s))
        logs = np.log(values, where=values > 0.0, out=np.zeros(values.shape))
        curve = np.where(values.min(axis=0) > 0.0, np.exp(weights @ logs), 0.0)
        return np.asarray(rho[:, None, None] * curve)


@final
@dataclass(frozen=True, slots=True)
class PiecewiseExponential:
    """The lowest joined exponentials in `pieces` equal parts of the horizon, by LP per state.

    Minimises the mean over the instants of ln A_i, with A_i(0) >= scale_i. pieces + 1 parameters
    per state. Forms with piecewise rates: Fan, Qi, Mitra, Viswanathan, "DryVR", CAV 2017; the
    common initial distance: Li, Zhu, Braught, Shen, Mitra, "Verse", CAV 2023.
    """

    pieces: int

    def __post_init__(self) -> None:
        if self.pieces < 1:
            raise InputError(f"expected at least 1 piece, got {self.pieces}")

    @property
    def name(self) -> str:
        """The form's word."""
        return "piecewise"

    def parameters(self, scale: Array) -> int:
        """One height per node and state."""
        return (self.pieces + 1) * len(scale)

    def fit(self, pairs: PairSource, count: int, *, progress: Progress | None = None) -> Fit:
        """As `Form` says."""
        nodes = equal_nodes(pairs.times, self.pieces)
        amplitudes, support = fitted_amplitudes(pairs, count, nodes=nodes, progress=progress)
        return Fit(
            PiecewiseEnvelope(
                tuple(pairs.scale.tolist()),
                tuple(nodes.tolist()),
                tuple(tuple(row) for row in amplitudes.tolist()),
            ),
            f"learned: |e_i(t)| <= A_i(t) max_j |e_j(0)|/r_j, ln A_i linear in {self.pieces} "
            "pieces, r half widths",
            self.parameters(pairs.scale),
            support,
        )


def equal_nodes(times: Array, pieces: int) -> Array:
    """pieces + 1 nodes from 0 to the last instant; InputError with more pieces than steps."""
    if pieces > len(times) - 1:
        raise InputError(
            f"expected no more pieces than the {len(times) - 1} steps, got {pieces}; ask for fewer "
            "pieces or more steps"
        )
    return np.linspace(0.0, float(times[-1]), pieces + 1)


def fitted_amplitudes(
    pairs: PairSource, count: int, *, nodes: Array, progress: Progress | None
) -> tuple[Array, tuple[int, ...]]:
    """Amplitudes (M, n) at the nodes, and the pairs that carry them."""
    found = largest_in_common(pairs, count, progress=progress)
    scale = pairs.scale
    units = np.where(scale > 0.0, scale, 1.0)
    moved = np.flatnonzero(found.ratio.max(axis=0) > 0.0)
    logs = np.log(np.maximum(found.ratio[:, moved] / units[moved], LEAST))
    # At first the ratio is at most 1 whatever the pairs: known, not learned.
    logs[0] = np.where(scale[moved] > 0.0, 0.0, -np.inf)
    lines = fit_log_lines(pairs.times, logs, nodes=nodes)
    amplitudes = np.zeros((len(nodes), len(scale)))
    amplitudes[:, moved] = units[moved] * np.exp(np.maximum(lines.heights, _LOWEST))
    return amplitudes, support_pairs(found, lines, moved, logs)


def support_pairs(found: Largest, lines: LogLines, moved: Index, logs: Array) -> tuple[int, ...]:
    """Numbers of the pairs whose points `logs` carry the lines of the states `moved`.

    Without what holds whatever the pairs: the first point, and the least one.
    """
    learned = lines.carried & (logs > math.log(LEAST))
    learned[0] = False
    return tuple(np.unique(found.pair[:, moved][learned]).tolist())
