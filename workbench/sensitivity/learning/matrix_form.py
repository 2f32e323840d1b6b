"""Which initial coordinate moves which state, and how much: a matrix over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.learning.form import Fit, Progress, common_distance
from workbench.sensitivity.learning.log_lines import hats
from workbench.sensitivity.learning.matrix_fit import MatrixFit
from workbench.sensitivity.learning.pairs import PairSource
from workbench.sensitivity.learning.piecewise import equal_nodes
from workbench.sensitivity.vectorised import Array


@final
@dataclass(frozen=True, slots=True)
class MatrixEnvelope:
    """|e_i(t)| <= sum_j B_ij(t) |e_j(0)|, B >= 0 linear between nodes and the identity at 0.

    scale: half widths of the initial set it was learned on, in the states' units; 0: never varied,
    so its initial distance must be 0. nodes_s: from 0 to the horizon. matrices: B at each node, in
    the states' units.
    """

    scale: tuple[float, ...]
    nodes_s: tuple[float, ...]
    matrices: tuple[tuple[tuple[float, ...], ...], ...]

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """Bound on |e_i(t)|; InputError for a distance along an axis that was never varied."""
        return tuple(self.bounds(np.array([initial]), np.array([t_s]))[0, 0].tolist())

    def bounds(self, initial: Array, times: Array) -> Array:
        """The same for many, (N, K+1, n)."""
        common_distance(initial, np.array(self.scale))
        weights = hats(times, np.array(self.nodes_s))
        at_times = np.tensordot(weights, np.array(self.matrices), axes=1)
        return np.asarray(np.einsum("kij,pj->pki", at_times, initial))


@final
@dataclass(frozen=True, slots=True)
class MatrixForm:
    """The matrix bound with the smallest half widths over the whole set, by LP per state.

    Minimises the mean over the instants of sum_j B_ij(t_k) r_j, r half widths of the set, B >= 0
    linear in `pieces` equal parts of the horizon. Parameters: states times varied states times
    pieces. Rows of the LP are generated until every pair satisfies every one.
    """

    pieces: int

    def __post_init__(self) -> None:
        if self.pieces < 1:
            raise InputError(f"expected at least 1 piece, got {self.pieces}")

    @property
    def name(self) -> str:
        """The form's word."""
        return "matrix"

    def parameters(self, scale: Array) -> int:
        """Every entry of every matrix after the first, for the states that vary."""
        return self.pieces * len(scale) * int(np.sum(np.asarray(scale) > 0.0))

    def fit(self, pairs: PairSource, count: int, *, progress: Progress | None = None) -> Fit:
        """As `Form` says."""
        nodes = equal_nodes(pairs.times, self.pieces)
        fitted = MatrixFit(pairs, count, nodes)
        matrices, support = fitted.solved(progress)
        return Fit(
            MatrixEnvelope(
                tuple(pairs.scale.tolist()),
                tuple(nodes.tolist()),
                tuple(tuple(tuple(row) for row in matrix) for matrix in matrices.tolist()),
            ),
            "learned: |e_i(t)| <= sum_j B_ij(t) |e_j(0)|, B linear in time in "
            f"{self.pieces} pieces from the identity",
            self.parameters(pairs.scale),
            support,
        )
