"""Search for a trajectory that comes too close to a person, and its proof."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.reach.findings.encounter import Encounter, distance_from_body, gap, in_disc
from workbench.reach.inner.choice_flow import ChoiceFlow
from workbench.reach.inner.choices import Choices, joined
from workbench.reach.inner.extremes import Admissible, Best, SearchEffort, aimed_instants, climb
from workbench.reach.inner.hull import Witness, witness_of_choice
from workbench.reach.inner.point_runs import PointRuns, validated_runs
from workbench.reach.tube import Array
from workbench.sets import Box

# Candidates whose trajectories are enclosed at once, the closest ones.
_VALIDATED = 8
_STARTS_FROM_CELLS = 64
# Central difference of the distance by the pose, in m and rad.
_DIFFERENCE = 1e-5


@final
@dataclass(frozen=True, slots=True)
class SeparationWitness:
    """A validated trajectory that comes too close to a person.

    trajectory: its initial state, parameters and disturbance; time_s: when; state_lower,
    state_upper: boxes of its state then; person, person_x_m, person_y_m: who, and a position inside
    the disc then (checked in rational arithmetic); distance_m: proved upper bound of the signed
    distance of that position from the body, negative inside it; shortfall_m: required minus this.
    """

    trajectory: Witness
    time_s: float
    state_lower: dict[str, float]
    state_upper: dict[str, float]
    person: str
    person_x_m: float
    person_y_m: float
    distance_m: float
    shortfall_m: float


def refutation(
    flow: ChoiceFlow,
    admissible: Admissible,
    encounter: Encounter,
    effort: SearchEffort,
    cells: Sequence[Box],
) -> SeparationWitness | None:
    """The deepest validated violation among the closest float runs, or None; starts in `cells`."""
    if not encounter.people:
        return None
    best = _closest(flow, admissible, encounter, effort, cells)
    order = np.argsort(-best.values)[: 4 * _VALIDATED]
    order = order[-best.values[order] < encounter.clearance_required_m]
    if not len(order):
        return None
    choices = best.choices.take(order).without_repeats()
    choices = choices.take(np.arange(min(len(choices), _VALIDATED)))
    found = validated_runs(flow.ode, choices, flow.times_s[: _last(best, encounter) + 1])
    return _deepest(flow, choices, found, encounter)


def _last(best: Best, encounter: Encounter) -> int:
    """The last instant at which a float run comes too close, at least 1."""
    return max(1, int(np.flatnonzero(-best.values < encounter.clearance_required_m).max()))


def _closest(
    flow: ChoiceFlow,
    admissible: Admissible,
    encounter: Encounter,
    effort: SearchEffort,
    cells: Sequence[Box],
) -> Best:
    """For each instant the choice that comes closest to anybody, on float runs."""
    columns = [flow.ode.names.index(name) for name in encounter.ground.names]

    def goals(runs: Array) -> Array:
        distances = encounter.distances(runs[..., columns], flow.times_s)
        return np.asarray(-distances.min(axis=-1))

    start = admissible.starts(effort)
    if cells:
        centres = np.array([cell.center for cell in cells[:_STARTS_FROM_CELLS]])
        rows = np.arange(len(centres)) % len(start)
        more = start.take(rows)
        start = joined([start, Choices(centres, more.constants, more.signals)])
    best = Best(goals, flow, start)
    aimed = aimed_instants(len(flow.times_s) - 1, effort.every)

    def slopes(base: Choices) -> Choices:
        at = flow.runs(base)[np.arange(len(aimed)), aimed][:, columns]
        weights = np.zeros((len(aimed), len(flow.ode.states)))
        weights[:, columns] = -_slope(encounter, at, flow.times_s[aimed])
        return flow.gradients(base, aimed, weights)

    climb(best, admissible, effort, aimed=aimed, slopes=slopes)
    return best


def _slope(encounter: Encounter, states: Array, times_s: Array) -> Array:
    """d (smallest distance) / d state (M, 3), by central differences."""
    found = []
    for shift in _DIFFERENCE * np.eye(3):
        ahead, behind = (
            encounter.distances(states + sign * shift, times_s).min(axis=-1) for sign in (1, -1)
        )
        found.append((ahead - behind) / (2.0 * _DIFFERENCE))
    return np.asarray(np.nan_to_num(np.stack(found, axis=-1)))


def _deepest(
    flow: ChoiceFlow, choices: Choices, found: PointRuns, encounter: Encounter
) -> SeparationWitness | None:
    names = flow.ode.names
    columns = [names.index(name) for name in encounter.ground.names]
    middle = 0.5 * (found.lower + found.upper)[..., columns]
    gaps = encounter.distances(middle, found.times[:, None])
    for flat in np.argsort(gaps, axis=None)[:_VALIDATED]:
        k, row, who = np.unravel_index(flat, gaps.shape)
        person, time_s = encounter.people[who], float(found.times[k])
        poses = encounter.ground.poses(middle[k, row])
        _, x, y = (float(value) for value in gap(poses, encounter.body, person, time_s))
        low, high = (
            dict(zip(names, end[k, row].tolist(), strict=True))
            for end in (found.lower, found.upper)
        )
        distance = distance_from_body(encounter, (low, high), (x, y))
        shortfall = math.nextafter(encounter.clearance_required_m - distance, -math.inf)
        if shortfall > 0.0 and in_disc(person, (x, y), time_s):
            trajectory = witness_of_choice(flow.ode, choices.take(np.array([row])))
            return SeparationWitness(
                trajectory, time_s, low, high, person.name, x, y, distance, shortfall
            )
    return None
