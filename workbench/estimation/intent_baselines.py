"""What a filter must beat: how often goals are taken, and which way a person is going now."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from workbench.estimation.goals import Goal, centres_m
from workbench.estimation.intent_cloud import Values
from workbench.estimation.people_data import PersonTrack

_STEEPEST = 30.0
_PAUSE_S = 0.5


def trail_begin(t_s: Values) -> int:
    """Index of the last of the times at least 0.5 s before the newest one, -1 where there is none.

    t_s: (n,), increasing, n >= 1.
    """
    return int(np.searchsorted(t_s, t_s[-1] - _PAUSE_S + 1e-9)) - 1


def cosines(history: PersonTrack, goals: Sequence[Goal]) -> Values:
    """(goals,), cosine of the angle between the way a person goes and the way to each goal.

    The way that they go leads from the last measurement at least 0.5 s before the newest one to
    the newest one. Zeros where there is no such measurement or no motion.
    """
    before = trail_begin(history.t_s) if len(history.t_s) else -1
    if before < 0:
        return np.zeros(len(goals))
    return cosines_of(history.xy_m[-1], history.xy_m[-1] - history.xy_m[before], goals)


def cosines_of(place_m: Values, way_m: Values, goals: Sequence[Goal]) -> Values:
    """(goals,), for a person at place_m (2,) who came there by way_m (2,); zeros without motion."""
    to_goal = centres_m(goals) - place_m
    size = math.hypot(*way_m) * np.hypot(*to_goal.T)
    out: Values = np.where(size > 1e-9, to_goal @ way_m / np.maximum(size, 1e-9), 0.0)
    return out


def bearing_answer(cosine: Values, concentration: float, prior: Values) -> Values:
    """p_g proportional to prior_g exp(concentration cos_g), (goals,)."""
    weight = prior * np.exp(concentration * (cosine - 1.0))
    out: Values = weight / weight.sum()
    return out


def fitted_concentration(cases: Sequence[tuple[Values, Values, int]]) -> float:
    """The concentration in [0, 30] with the least mean log-loss over (cosines, prior, goal)."""

    def loss(concentration: float) -> float:
        return -float(np.mean([
            math.log(max(bearing_answer(cosine, concentration, prior)[goal], 1e-12))
            for cosine, prior, goal in cases
        ]))  # fmt: skip

    return float(minimize_scalar(loss, bounds=(0.0, _STEEPEST), method="bounded").x)
