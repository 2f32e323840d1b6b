"""Where a person will be who goes to one of several goals: half of the way there, half straight on.

The mean place toward goals that are known by probability says where people turn, straight on says
how fast they go; the mean of both is off by less than either. Long after the last measurement most
people have stopped, and straight on alone knows of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.estimation.field_paths import (
    DISC_NUMBERS,
    VEHICLE_NUMBERS,
    Others,
    paths,
    starts,
)
from workbench.estimation.goals import Goal, centres_m, load_goals
from workbench.estimation.intent_cloud import FilterSettings, NumpyUpdate
from workbench.estimation.intent_filter import Intents, answer, follow
from workbench.estimation.intent_labels import Label, learned_prior, load_labels, scenes_of
from workbench.estimation.motion_filter import Estimate, MotionNumbers, estimate
from workbench.estimation.motion_parameters import MotionParameters
from workbench.estimation.motion_queries import HORIZONS_S, Queries
from workbench.estimation.people_data import PersonTrack
from workbench.estimation.prediction import PreferredVelocity
from workbench.estimation.tables import Table

Values = NDArray[np.float64]
SHARE: Final = 0.5
"""Of the goals; the result hardly depends on it."""
_SEED: Final = 1


def between(
    straight_m: Values, toward_m: Values, probability: Values, age_s: Values, numbers: MotionNumbers
) -> Values:
    """(n, h, 2) places: straight on (n, h, 2), toward each goal (n, g, h, 2), of probability (n,
    g), age_s (n,) after the last measurement.

    The goals' share is SHARE / (1 + (age / trusted)^4), as velocities are trusted.
    """
    mean = (probability[..., None, None] * toward_m).sum(axis=1)
    share = (SHARE / (1.0 + (age_s / numbers.trusted_s) ** 4))[:, None, None]
    found: Values = (1.0 - share) * straight_m + share * mean
    return found


@final
@dataclass(frozen=True, slots=True)
class TowardLikelyGoals:
    """The prediction of one person, from what was measured by at_s and what that says of goals."""

    parameters: MotionParameters

    def places_m(
        self, history: PersonTrack, at_s: float, horizons_s: Sequence[float] | Values, *,
        goals: Sequence[Goal], probability: Sequence[float] | Values,
    ) -> Values:  # fmt: skip
        """(h, 2) in m; without goals straight on. InputError as `PreferredVelocity.places_m`."""
        on = PreferredVelocity(self.parameters.numbers)
        straight = on.places_m(history, at_s, horizons_s)
        if not len(goals):
            return straight
        known, many = estimate(history, self.parameters.numbers), len(goals)
        leads = at_s - known.t_s + np.asarray(horizons_s, dtype=np.float64)
        begin = np.repeat(starts([known]), many, axis=0)
        ways = paths(
            self.parameters.field, begin, centres_m(goals), np.tile(leads, (many, 1)),
            others=_nobody(many),
        )  # fmt: skip
        likely = np.array([probability], dtype=np.float64)
        age = np.array([at_s - known.t_s])
        found = between(straight[None], ways[None], likely, age, self.parameters.numbers)
        return np.asarray(found[0])


@final
@dataclass(frozen=True, slots=True, eq=False)
class LikelyGoals:
    """What was known of goals at n questions: probability (n, g), and the goals (n, g, 2) in m.

    Scenes have different numbers of goals: the rest are of probability 0.
    """

    probability: Values
    goals_m: Values


def likely_goals(folder: Path, queries: Queries) -> LikelyGoals | None:
    """The intent filter's answers at each question; None for a folder without a table of goals.

    From measurements by then alone; priors are learned from the other recordings of the scene.
    Raises InputError where nothing says which scene a recording shows.
    """
    if not Table.exists(folder, "goals"):
        return None
    name = "goals.csv.gz" if (folder / "goals.csv.gz").is_file() else "goals.csv"
    scenes, labels = load_goals(folder / name), load_labels(folder)
    shown = scenes_of(folder, list(queries.recordings), list(scenes), given=None)
    most = max(len(goals) for goals in scenes.values())
    probability, places = np.zeros((len(queries.who), most)), np.zeros((len(queries.who), most, 2))
    for who in np.unique(queries.who):
        person = queries.measured[int(who)]
        scene = shown[person.recording]
        goals = scenes[scene]
        rows = np.flatnonzero(queries.who == who)
        answers = _answers(person, goals, labels, scene=scene)
        probability[rows, : len(goals)] = answers[queries.last[rows]]
        places[rows, : len(goals)] = centres_m(goals)
    return LikelyGoals(probability, places)


def likely_goal_errors(
    queries: Queries, known: Sequence[Estimate], straight_m: Values, parameters: MotionParameters,
    likely: LikelyGoals, asked: NDArray[np.intp],
) -> Values:  # fmt: skip
    """Distances (a, h) of the predicted from the true places at the questions `asked` (a,).

    known, straight_m (n, h, 2): of all questions, by the numbers of `parameters`.
    """
    begin, leads = starts([known[k] for k in asked]), queries.leads_s[asked]
    leads = np.minimum(leads, HORIZONS_S[-1] + 2.0)
    nobody = _nobody(len(asked))
    goals = likely.goals_m[asked]
    ways = np.stack([
        paths(parameters.field, begin, goals[:, g], leads, others=nobody)
        for g in range(goals.shape[1])
    ], axis=1)  # fmt: skip
    places = between(
        straight_m[asked], ways, likely.probability[asked], queries.age_s[asked], parameters.numbers
    )
    off = places - queries.truth_m[asked]
    errors: Values = np.hypot(off[..., 0], off[..., 1])
    return errors


def _nobody(people: int) -> Others:
    return Others(np.empty((people, 0, DISC_NUMBERS)), np.empty((people, 0, VEHICLE_NUMBERS)))


def _answers(
    person: PersonTrack, goals: Sequence[Goal], labels: Sequence[Label], *, scene: str
) -> Values:
    """(k, g) after each of k measurements."""
    settings, without = FilterSettings.chosen(), frozenset({person.recording})
    prior = learned_prior(goals, labels, scene=scene, without=without).probability
    intents = Intents.of_person(tuple(goals), person.recording, person.agent, seed=_SEED)
    beliefs = follow(person, intents, settings, NumpyUpdate())
    return np.array([answer(belief, prior, settings) for belief in beliefs])
