"""Where trajectories are likely to go: metrics are chosen by it, nothing is proved by it."""

from __future__ import annotations

import numpy as np

from workbench.reach.local.along import seen_step
from workbench.reach.local.reference import Reference
from workbench.reach.tube import Array
from workbench.reach.validated.bounds import Range
from workbench.sensitivity.jacobian import Cells
from workbench.sensitivity.sampling import rollout, sample_initial_states
from workbench.sets import Box

_RUNS = 64
# Bounds are wider than the runs, and the Jacobian is needed over the bounds.
_WIDER = 1.5
# A state that hardly spreads gets a unit of this share of the widest one's.
_LEAST_SHARE = 1e-3


def likely_spread(reference: Reference) -> Array:
    """Largest distance (K+1, n) of a few runs from the reference at its instants."""
    tube, ode = reference.tube, reference.seen.ode
    ends = zip(ode.names, reference.lower.tolist(), reference.upper.tolist(), strict=True)
    box = Box.from_intervals({name: (low, high) for name, low, high in ends})
    states = sample_initial_states(box, count=_RUNS, seed=1)
    rows = [states]
    for length_s in np.diff(tube.times).tolist():
        states = rollout(reference.seen.ode, states, horizon_s=length_s, step_s=length_s)[:, -1]
        rows.append(states)
    centre = 0.5 * tube.lower_at + 0.5 * tube.upper_at
    spread = np.abs(np.stack(rows, axis=1) - centre).max(axis=0)
    return np.asarray(np.where(np.isfinite(spread), spread, 0.0)[:, : reference.size])


def likely_units(spread: Array) -> Array:
    """Units (n,) in which the states spread alike: largest likely distances; 1 where all are 0."""
    largest = spread.max(axis=0)
    units = np.maximum(largest, _LEAST_SHARE * largest.max())
    return np.where(units > 0.0, units, 1.0)


def likely_box(reference: Reference, spread: Array, k: int) -> Range:
    """The box of states (n,) that is likely to be needed in step k."""
    n = reference.size
    radius = _WIDER * np.maximum(spread[k], spread[k + 1])
    return reference.tube.lower[k, :n] - radius, reference.tube.upper[k, :n] + radius


def likely_region(reference: Reference, spread: Array) -> Box:
    """The hull of the likely boxes."""
    n = reference.size
    boxes = [likely_box(reference, spread, k) for k in range(len(reference.tube.lower))]
    boxes.append((reference.lower[:n], reference.upper[:n]))
    low = np.min([box[0] for box in boxes], axis=0)
    high = np.max([box[1] for box in boxes], axis=0)
    # Every axis gets a width that can be divided by.
    least = _LEAST_SHARE * likely_units(spread)
    low, high = low - least, high + least
    names = reference.system.ode.names
    ends = zip(names, low.tolist(), high.tolist(), strict=True)
    return Box.from_intervals({name: (first, last) for name, first, last in ends})


def likely_hulls(reference: Reference, spread: Array, steps: list[int]) -> Cells:
    """Hulls of the mean Jacobian over the likely boxes of some steps; infinite if none is found."""
    n = reference.size
    boxes = [likely_box(reference, spread, k) for k in steps]
    found = [seen_step(reference, k, box) for k, box in zip(steps, boxes, strict=True)]
    pairs = [(box, step) for box, step in zip(boxes, found, strict=True) if step is not None]
    if not pairs:
        nothing, everything = np.zeros((1, n)), np.full((1, n, n), np.inf)
        return Cells(nothing, nothing, -everything, everything)
    return Cells(
        np.array([box[0] for box, _ in pairs]),
        np.array([box[1] for box, _ in pairs]),
        np.array([step.lower for _, step in pairs]),
        np.array([step.upper for _, step in pairs]),
    )
