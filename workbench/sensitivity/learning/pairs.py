"""Independent pairs of runs, wherever they come from: what every learned form is fitted to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, final

from workbench.sensitivity.learning.draws import Words
from workbench.sensitivity.vectorised import Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class PairRuns:
    """A block of N pairs: first, second (N, K+1, n), in the states' units, at common instants."""

    first: Array
    second: Array

    @property
    def distances(self) -> Array:
        """|second - first| (N, K+1, n)."""
        return abs(self.second - self.first)


class PairSource(Protocol):
    """Pairs by number: pair i is the same whoever asks and whatever was asked before.

    names: the n states. times (K+1,): instants in s, from 0. scale (n,): half widths of the set
    that both ends are drawn from, 0 for a state that does not vary. distribution: in words, what a
    further pair would be drawn from. most: number of pairs there are; None where more can be made.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """The n states."""

    @property
    def times(self) -> Array:
        """Instants (K+1,), s."""

    @property
    def scale(self) -> Array:
        """Half widths (n,)."""

    @property
    def distribution(self) -> str:
        """What a further pair would be drawn from."""

    @property
    def most(self) -> int | None:
        """Number of pairs there are, or None."""

    def block(self, start: int, count: int) -> PairRuns:
        """Pairs number start .. start + count - 1. InputError where a run is not finite."""


class Simulator(Protocol):
    """A black box: initial states in, states at the instants out.

    names: the n states. times (K+1,): instants in s. what: a few words for statements, such as
    "single-track plant". A simulator with noise of its own draws it from the row's seed alone.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """The n states."""

    @property
    def times(self) -> Array:
        """Instants (K+1,), s."""

    @property
    def what(self) -> str:
        """A few words for statements."""

    def runs(self, initial_states: Array, seeds: Words) -> Array:
        """Runs (N, K+1, n) from initial_states (N, n); seeds (N,) of unsigned 64-bit integers.

        The two runs of one pair are given the same seed: what they share (parameters, noise) is
        drawn from it.
        """
