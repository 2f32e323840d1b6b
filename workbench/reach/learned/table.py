"""A beta as a table over instants: what of a learned bound can be compiled, whatever its form."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.errors import InputError
from workbench.reach.tube import Array
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.sampling import instants

_TRIALS: Final = 32
_SEED: Final = 1
_SAME: Final = 1e-9


class Shares(enum.Enum):
    """How the initial radii act together: their shares are added, or the largest one counts."""

    SUM = "sum"
    MAX = "max"


@final
@dataclass(frozen=True, slots=True, eq=False)
class BetaTable:
    """Half widths b_i(r, t_k) = sum_j (or max_j) entries[k, i, j] r_j at t_k = k step_s.

    entries (K+1, n, n), state i per state j; infinite where initial radii along j were never seen:
    along these only a radius of 0 has an answer.
    """

    step_s: float
    entries: Array
    shares: Shares

    def half_widths(self, radius: Array, k: int) -> Array:
        """At t_k, (n,) for radii (n,); infinite where nothing is known."""
        parts = self.entries[k][:, radius > 0.0] * radius[radius > 0.0]
        if not parts.size:
            return np.zeros(len(radius))
        return np.asarray(
            parts.sum(axis=1) if self.shares is Shares.SUM else parts.max(axis=1), dtype=np.float64
        )


def beta_table(learned: Discrepancy, *, horizon_s: float, step_s: float) -> BetaTable:
    """The table of a bound at 0, step_s, ..., horizon_s.

    Any bound has one whose half widths are sums or maxima of what each initial radius does alone:
    all that `workbench.sensitivity` learns. That they are is tried at every instant, with radii of
    all sizes. InputError for others, and for a horizon beyond the bound's.
    """
    times, n = instants(horizon_s, step_s), len(learned.names)
    seen = _seen(learned)
    entries = np.full((len(times), n, n), np.inf)
    for k, t in enumerate(times.tolist()):
        for j in np.flatnonzero(seen):
            entries[k, :, j] = learned.radius(np.eye(n)[j].tolist(), t)
    for shares in Shares:
        table = BetaTable(step_s, entries, shares)
        if _agrees(table, learned, times, seen):
            return table
    raise InputError(
        "expected a bound whose half widths are sums or maxima of what every initial radius does "
        f"alone, got one ({learned.norm}) that is neither; it has no table to compile"
    )


def _seen(learned: Discrepancy) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Along which states the bound knows initial radii."""
    n = len(learned.names)
    found = np.ones(n, dtype=bool)
    for j in range(n):
        try:
            learned.radius(np.eye(n)[j].tolist(), 0.0)
        except InputError:
            found[j] = False
    return found


def _agrees(
    table: BetaTable, learned: Discrepancy, times: Array,
    seen: np.ndarray[tuple[int], np.dtype[np.bool_]],
) -> bool:  # fmt: skip
    rng = np.random.default_rng(_SEED)
    tried = np.exp(rng.uniform(-7.0, 1.0, (_TRIALS, len(seen))))
    tried *= rng.integers(0, 2, tried.shape) * seen
    for k, t in enumerate(times.tolist()):
        for radius in tried[k % 2 :: 2]:
            expected = np.array(learned.radius(radius.tolist(), t))
            if not np.allclose(table.half_widths(radius, k), expected, rtol=_SAME, atol=0.0):
                return False
    return True
