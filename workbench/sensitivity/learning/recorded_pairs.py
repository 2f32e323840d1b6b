"""Pairs of recorded runs: two recordings each, and no recording in two pairs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Self, final

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.learning.pairs import PairRuns
from workbench.sensitivity.vectorised import Array

# Relative: radii are given in decimals.
_ROUNDING: Final = 1e-9


@final
@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """A run cut from a recording. place: what both runs of a pair must have in common, such as the
    path that is followed; states (K+1, n) at the instants."""

    recording: str
    place: str
    states: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class RecordedPairs:
    """Pairs of stretches; made by `matched`.

    The recording is the independent unit. Recordings of one place are put in random order and taken
    two by two; of each two, one pair of stretches whose starts lie within the radius of each other
    is drawn at random, and two recordings without such stretches give no pair. The pairs are put in
    random order, so that those held out are not of other places than those learned from. Nothing of
    this looks at what came after the starts. Where recordings are independent and alike, the pairs
    are independent draws of one distribution, which `distribution` names.
    """

    names: tuple[str, ...]
    times: Array
    radius: tuple[float, ...]
    what: str
    recordings: int
    runs: PairRuns

    @classmethod
    def matched(
        cls,
        stretches: Iterable[Stretch],
        *,
        names: Sequence[str],
        times: Array,
        radius: Sequence[float],
        seed: int,
        what: str,
    ) -> Self:
        """radius (n,): both starts lie in one box of these half widths, so |e_j(0)| <= 2 radius_j;
        what: whose runs they are. Raises InputError where no two recordings give a pair."""
        if len(radius) != len(names) or min(radius) < 0.0:
            raise InputError(f"expected a radius >= 0 for each of {names}, got {radius}")
        found: dict[str, dict[str, list[Array]]] = {}
        for each in stretches:
            found.setdefault(each.place, {}).setdefault(each.recording, []).append(each.states)
        rng = np.random.default_rng(seed)
        reach = 2.0 * np.array(radius, dtype=np.float64) * (1.0 + _ROUNDING)
        pairs = []
        for place in sorted(found):
            runs = found[place]
            order = rng.permutation(np.array(sorted(runs))).tolist()
            for one, other in zip(order[::2], order[1::2], strict=False):
                pair = _near(np.array(runs[one]), np.array(runs[other]), reach, rng)
                if pair is not None:
                    pairs.append(pair)
        count = sum(map(len, found.values()))
        if not pairs:
            raise InputError(
                f"expected two recordings with runs of {times[-1]:g} s whose starts are within "
                f"{_said(names, radius)} of a common state, got {count} recordings and no such "
                "pair; widen --radius, shorten --horizon or record more"
            )
        rng.shuffle(pairs)
        both = PairRuns(np.array([a for a, _ in pairs]), np.array([b for _, b in pairs]))
        return cls(tuple(names), times, tuple(map(float, radius)), what, count, both)

    @property
    def scale(self) -> Array:
        """The radius (n,)."""
        return np.array(self.radius)

    @property
    def distribution(self) -> str:
        """What a further pair would be drawn from."""
        return (
            f"{self.what}; of two further recordings of one place, drawn as the {self.recordings} "
            "were, a random pair of runs whose starts are within "
            f"{_said(self.names, self.radius)} of a common state; unit: the recording"
        )

    @property
    def most(self) -> int | None:
        """Pairs there are."""
        return len(self.runs.first)

    def block(self, start: int, count: int) -> PairRuns:
        """As `PairSource` says."""
        if start < 0 or count < 1 or start + count > len(self.runs.first):
            raise InputError(
                f"expected at most the {len(self.runs.first)} pairs that {self.recordings} "
                f"recordings give, got {start + count}; ask for fewer or record more"
            )
        stop = start + count
        return PairRuns(self.runs.first[start:stop], self.runs.second[start:stop])


def _near(
    one: Array, other: Array, reach: Array, rng: np.random.Generator
) -> tuple[Array, Array] | None:
    """A random pair of runs whose starts are within reach of each other."""
    apart = np.abs(one[:, None, 0] - other[None, :, 0])
    choices = np.argwhere((apart <= reach).all(axis=-1))
    if not len(choices):
        return None
    a, b = choices[rng.integers(len(choices))]
    return one[a], other[b]


def _said(names: Sequence[str], radius: Sequence[float]) -> str:
    return ", ".join(f"{name} {r:g}" for name, r in zip(names, radius, strict=True))
