"""A form: the shape of bound that is fitted to pairs of runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, Protocol, final

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.learning.pairs import PairSource
from workbench.sensitivity.vectorised import Array

# Called with the number of pairs seen and the number there are to see.
Progress = Callable[[int, int], None]

_BLOCK: Final = 512


class LearnedGrowth(Protocol):
    """The formula of a learned bound: plain numbers, and never smaller for larger distances."""

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """Bound on |e_i(t)| for every i, given |e_j(0)| <= initial_j."""

    def bounds(self, initial: Array, times: Array) -> Array:
        """The same for many: (N, K+1, n) for distances `initial` (N, n) and instants (K+1,), s."""


@final
@dataclass(frozen=True, slots=True)
class Fit:
    """A bound that every pair it was fitted to obeys at every instant.

    norm: the formula in words. parameters: all numbers that were fitted. support: numbers of the
    pairs that alone would have given the same bound.
    """

    growth: LearnedGrowth
    norm: str
    parameters: int
    support: tuple[int, ...]


class Form(Protocol):
    """A shape of bound, and how it is fitted."""

    @property
    def name(self) -> str:
        """One word: "exponential", "set", "piecewise" or "matrix"."""

    def parameters(self, scale: Array) -> int:
        """How many numbers are fitted on a set with the half widths `scale` (n,)."""

    def fit(self, pairs: PairSource, count: int, *, progress: Progress | None = None) -> Fit:
        """The tightest bound of this form over pairs number 0 .. count - 1.

        Raises InputError where a run is not finite or no bound of the form contains the pairs.
        """


def distance_blocks(
    pairs: PairSource, count: int, *, start: int = 0, progress: Progress | None = None
) -> Iterator[tuple[int, Array]]:
    """(number of the first, |e| (N, K+1, n)) for pairs start .. start + count - 1, in order.

    Raises InputError where the source has too few, or a run holds inf or NaN.
    """
    if count < 1:
        raise InputError(f"expected at least 1 pair, got {count}")
    if pairs.most is not None and start + count > pairs.most:
        raise InputError(
            f"expected {start + count} pairs, and there are only {pairs.most} "
            f"({pairs.distribution}); ask for fewer"
        )
    for first in range(start, start + count, _BLOCK):
        size = min(_BLOCK, start + count - first)
        distances = pairs.block(first, size).distances
        bad = np.flatnonzero(~np.isfinite(distances).all(axis=(1, 2)))
        if len(bad):
            raise InputError(
                f"a run of pair number {first + int(bad[0])} left the finite numbers; shorten the "
                "horizon, shrink the initial set or check the gains"
            )
        yield first, distances
        if progress is not None:
            progress(first - start + size, count)


def common_distance(initial: Array, scale: Array) -> Array:
    """rho (N,) = max_j |e_j(0)| / scale_j of distances (N, n).

    Raises InputError for a distance along an axis with scale 0, which no run varied.
    """
    still = scale == 0.0
    unseen = np.flatnonzero(still & (initial > 0.0).any(axis=0)).tolist()
    if unseen:
        raise InputError(
            f"expected initial radius 0 for the states number {unseen}, which the runs did not "
            "vary; learn on a set that is wide along them"
        )
    return np.asarray((initial[:, ~still] / scale[~still]).max(axis=1, initial=0.0))
