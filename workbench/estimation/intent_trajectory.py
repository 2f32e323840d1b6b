"""The way to each likely goal as pairs of place and time, for pictures and for the decision."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.goals import centres_m
from workbench.estimation.intent_cloud import SOFTENING_M, FilterSettings, Values
from workbench.estimation.intent_filter import Belief

_ARRIVED_M = 0.3


@final
@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """One intent's future: goal (None: the unknown one), its probability, times t_s (k,) from the
    last measurement on and places xy_m (k, 2)."""

    goal: str | None
    probability: float
    t_s: Values
    xy_m: Values


def trajectories(
    belief: Belief,
    probability: Values,
    settings: FilterSettings,
    *,
    least: float,
    horizon_s: float,
    step_s: float,
) -> tuple[Trajectory, ...]:
    """Ways of the intents with probability of at least `least`, the likeliest first.

    probability: (goals + 1,), the unknown one last; with `least` above one half this is the paper's
    single intent, with 0 every one. Each way starts at the last measurement with the mean velocity
    of the intent's particles, turns to the goal as they do at their mean speed, and ends at the
    goal or after horizon_s. The unknown goal keeps its velocity. No rigor is claimed: a mean way,
    around which people spread. Raises InputError on a horizon or step not above zero.
    """
    if not (0.0 < step_s <= horizon_s < math.inf):
        raise InputError(
            f"expected 0 < step <= horizon, got step {step_s:g} s and horizon {horizon_s:g} s"
        )
    if probability.shape != belief.weights.shape:
        raise InputError(
            f"expected a probability per goal and the unknown one last, {belief.weights.shape}, "
            f"got {probability.shape}"
        )
    order = sorted(range(len(probability)), key=lambda index: -probability[index])
    return tuple(
        _way(belief, index, float(probability[index]), settings, horizon_s, step_s)
        for index in order
        if probability[index] >= least
    )


def _way(
    belief: Belief,
    index: int,
    probability: float,
    settings: FilterSettings,
    horizon_s: float,
    step_s: float,
) -> Trajectory:
    known = index < len(belief.intents.goals)
    goal = centres_m(belief.intents.goals)[index] if known else np.zeros(2)
    velocity = belief.cloud.velocity[index].mean(axis=0)
    speed = float(belief.cloud.speed[index].mean())
    keep = math.exp(-step_s / settings.relax_s)
    places = [belief.place_m]
    for _ in range(math.floor(horizon_s / step_s + 1e-9)):
        way = goal - places[-1]
        distance = math.hypot(*way)
        if known and distance < _ARRIVED_M:
            break
        wanted = speed * way / math.hypot(distance, SOFTENING_M) if known else velocity
        turned = wanted + keep * (velocity - wanted)
        places.append(places[-1] + 0.5 * step_s * (velocity + turned))
        velocity = turned
    t_s = belief.t_s + step_s * np.arange(len(places), dtype=np.float64)
    name = belief.intents.goals[index].name if known else None
    return Trajectory(name, probability, t_s, np.array(places))
