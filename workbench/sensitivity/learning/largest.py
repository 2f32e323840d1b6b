"""The largest normalised distances over all pairs, and which pair made each of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np
import numpy.typing as npt

from workbench.errors import InputError
from workbench.sensitivity.learning.form import Progress, common_distance, distance_blocks
from workbench.sensitivity.learning.pairs import PairSource
from workbench.sensitivity.vectorised import Array

# Of a half width: what is fitted stays far from where doubles lose digits or end.
_SMALLEST: Final = 1e-100


@final
@dataclass(frozen=True, slots=True, eq=False)
class Largest:
    """ratio (K+1, n): max over the pairs; pair (K+1, n): the first pair that has it."""

    ratio: Array
    pair: npt.NDArray[np.int64]


def largest_in_common(pairs: PairSource, count: int, *, progress: Progress | None) -> Largest:
    """Of |e_i(t_k)| / rho, rho = max_j |e_j(0)| / scale_j.

    Raises InputError for a pair that starts in one state and separates, and for a set of a width
    that doubles do not carry.
    """
    found = _none_yet(pairs)
    for first, distances in distance_blocks(pairs, count, progress=progress):
        rho = common_distance(distances[:, 0], pairs.scale)
        ratios = _ratios(distances, rho[:, None, None])
        if np.isinf(ratios).any():
            pair = first + int(np.flatnonzero(np.isinf(ratios).any(axis=(1, 2)))[0])
            raise InputError(
                f"the two runs of pair number {pair} start in the same state and separate, which "
                "no bound by initial distances contains; let the runs of a pair share their noise, "
                "or leave such pairs out"
            )
        found = _with(found, ratios, first)
    return found


def largest_per_state(pairs: PairSource, count: int, *, progress: Progress | None) -> Largest:
    """Of |e_i(t_k)| / |e_i(0)|.

    Raises InputError for a state that separates although it starts with distance 0.
    """
    found = _none_yet(pairs)
    for first, distances in distance_blocks(pairs, count, progress=progress):
        ratios = _ratios(distances, distances[:, :1])
        if np.isinf(ratios).any():
            moved = np.flatnonzero(np.isinf(ratios).any(axis=(0, 1)))
            raise InputError(
                f"the states {[pairs.names[i] for i in moved]} separate although their initial "
                "distance is 0, and this form bounds a state by its own initial distance alone; "
                "use a form that couples the states (set, piecewise, matrix)"
            )
        found = _with(found, ratios, first)
    return found


def _none_yet(pairs: PairSource) -> Largest:
    width = pairs.scale[pairs.scale > 0.0]
    if np.any((width < _SMALLEST) | (width > 1.0 / _SMALLEST)):
        raise InputError(
            f"expected half widths of the initial set that are 0 or between {_SMALLEST:g} and "
            f"{1.0 / _SMALLEST:g} in the states' units, got {pairs.scale.tolist()}; use other units"
        )
    shape = (len(pairs.times), len(pairs.names))
    return Largest(np.zeros(shape), np.zeros(shape, dtype=np.int64))


def _ratios(distances: Array, unit: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(np.where(distances > 0.0, distances / unit, 0.0))


def _with(found: Largest, ratios: Array, first: int) -> Largest:
    best = np.argmax(ratios, axis=0)
    top = np.take_along_axis(ratios, best[None], axis=0)[0]
    higher = top > found.ratio
    return Largest(np.where(higher, top, found.ratio), np.where(higher, first + best, found.pair))
