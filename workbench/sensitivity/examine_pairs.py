"""The pairs of initial states that a bound is tried on, group by group."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.models.signals import Ranged
from workbench.sensitivity.ascent import Pairs, Runs, joined
from workbench.sensitivity.examination import Examiner
from workbench.sensitivity.sampling import face_states, uniform_states, vertex_states
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box

CLOSER = "closer pairs"
# Shares of the set's half widths to which closer pairs are drawn together.
_CLOSER = (0.5, 0.1, 0.01)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """What is on trial: runs from `box` (axes in the states' order) at `times` (K+1,), s.

    shared: draws rows of what the two runs of a pair share, from a count and a generator. ranges:
    of these columns where their ends may be tried; empty otherwise.
    """

    flow: Runs
    box: Box
    times: Array
    shared: Callable[[int, np.random.Generator], Array]
    ranges: tuple[Ranged, ...]


def trial_groups(trial: Trial, method: Examiner) -> dict[str, Pairs]:
    """Pairs with the middle of the set at one end, and other ones where `any_centre` asks."""
    rng = np.random.default_rng(method.seed)
    count, box = method.samples, trial.box
    groups = {
        "interior": _about_centre(trial, uniform_states(box, count, rng), rng),
        "faces": _about_centre(trial, face_states(box, count, rng), rng),
        "vertices": _about_centre(trial, vertex_states(box, most=count, rng=rng), rng),
    }
    if method.any_centre:
        half = np.array(box.radius)
        first = face_states(box, count, rng)
        shift = np.where(rng.random((count, 1)) < 0.5, 1.0, rng.random((count, len(half))))
        shift = shift * rng.choice([-1.0, 1.0], size=(count, len(half))) * half
        second = np.clip(first + shift, np.array(box.lower), np.array(box.upper))
        groups["other centres"] = Pairs(first, second, trial.shared(count, rng))
    return groups


def closer_pairs(trial: Trial, method: Examiner) -> Pairs:
    """Pairs that differ by less than the half widths: along one axis alone, and drawn together.

    A bound is a function of the initial distances; these hold it to its word for smaller ones.
    """
    rng = np.random.default_rng(method.seed + 1)
    centre, half = np.array(trial.box.center), np.array(trial.box.radius)
    axes = np.flatnonzero(half)
    lower, upper = np.array(trial.box.lower), np.array(trial.box.upper)
    alone = np.array([np.where(np.arange(len(half)) == i, end, centre)
                      for i in axes for end in (lower, upper)]).reshape(-1, len(half))  # fmt: skip
    few = max(1, method.samples // 20)
    wide = np.concatenate(
        [face_states(trial.box, few, rng), vertex_states(trial.box, most=few, rng=rng)]
    )
    together = [alone, *(centre + share * (wide - centre) for share in _CLOSER)]
    about = [_about_centre(trial, states, rng) for states in together]
    if not method.any_centre:
        return joined(about)
    first = uniform_states(trial.box, few, rng)
    shift = rng.choice(_CLOSER, size=(few, 1)) * rng.choice([-1.0, 1.0], size=first.shape) * half
    elsewhere = Pairs(first, np.clip(first + shift, lower, upper), trial.shared(few, rng))
    return joined([*about, elsewhere])


def own_distances(pairs: Pairs) -> Array:
    """|second - first| at the start (N, n), not below the exact difference."""
    gaps = np.abs(pairs.second - pairs.first)
    return np.where(gaps > 0.0, np.nextafter(gaps, np.inf), 0.0)


def _about_centre(trial: Trial, states: Array, rng: np.random.Generator) -> Pairs:
    first = np.tile(np.array(trial.box.center), (len(states), 1))
    return Pairs(first, states, trial.shared(len(states), rng))
