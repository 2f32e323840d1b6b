"""How good answers about goals are: accuracy, log-loss, Brier score and calibration, on recordings
other than the ones that anything was fitted to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.goals import Goal
from workbench.estimation.intent_baselines import bearing_answer, cosines, fitted_concentration
from workbench.estimation.intent_cloud import FilterSettings, Update, Values
from workbench.estimation.intent_filter import Intents, answer, follow
from workbench.estimation.intent_labels import Label, Prior, goal_index, learned_prior
from workbench.estimation.people_data import PersonTrack

POINTS = ("1 s", "3 s", "25 %", "50 %", "75 %")
PRIOR, BEARING, BEARING_PRIOR, BEARING_ROOT, FILTER_EQUAL, FILTER = (
    "prior", "bearing", "bearing x prior", "bearing x root of prior", "filter, equal priors",
    "filter, learned priors",
)  # fmt: skip
METHODS = (PRIOR, BEARING, BEARING_PRIOR, BEARING_ROOT, FILTER_EQUAL, FILTER)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """A labelled person: what was measured, when the recording shows them, and their goal."""

    measured: PersonTrack
    begin_s: float
    end_s: float
    scene: str
    goals: tuple[Goal, ...]
    goal: int

    def times_s(self) -> dict[str, float]:
        """When each of POINTS is, from the first sample; points after the last sample are left
        out."""
        last = self.end_s - self.begin_s
        after = (1.0, 3.0, 0.25 * last, 0.5 * last, 0.75 * last)
        return {
            point: self.begin_s + wait
            for point, wait in zip(POINTS, after, strict=True)
            if wait <= last
        }


@final
@dataclass(frozen=True, slots=True, eq=False)
class Answered:
    """One answer: (goals,) probabilities by one method at one point for one walk."""

    method: str
    point: str
    recording: str
    probability: Values
    goal: int


@final
@dataclass(frozen=True, slots=True)
class Score:
    """Of `count` answers: share whose likeliest goal was right, mean of -log p(goal) in nats, mean
    of sum over goals of (p - 1{goal})^2."""

    method: str
    point: str
    count: int
    accuracy: float
    log_loss: float
    brier: float


def walks(
    tracks: Sequence[PersonTrack],
    measured: Sequence[PersonTrack],
    labels: Sequence[Label],
    goals: Mapping[str, tuple[Goal, ...]],
) -> tuple[Walk, ...]:
    """The usable walks: tracks give begin and end, measured what may be answered from."""
    known = {(label.recording, label.agent): label for label in labels if label.usable}
    found = []
    for track, seen in zip(tracks, measured, strict=True):
        label = known.get(track.key)
        if label is None or not len(track.t_s):
            continue
        if label.scene not in goals:
            raise InputError(
                f"goal_labels: {label.recording!r} shows scene {label.scene!r}, the goals are of "
                f"{', '.join(goals)}; add its goals"
            )
        here = goals[label.scene]
        goal = goal_index([each.name for each in here], label)
        begin_s, end_s = float(track.t_s[0]), float(track.t_s[-1])
        found.append(Walk(seen, begin_s, end_s, label.scene, here, goal))
    return tuple(found)


def cross_validated(
    people: Sequence[Walk],
    labels: Sequence[Label],
    *,
    held: str,
    settings: FilterSettings,
    update: Update,
    seed: int,
) -> tuple[Answered, ...]:
    """Every method's answers about one recording; what it learned comes from the others.

    Learned are the prior of each scene and the concentrations of the bearing; the filter's settings
    are as given. Where there is no other recording the concentrations are 2.
    """
    others = [walk for walk in people if walk.measured.recording != held]
    steep = _concentrations(others, labels, held)
    answers: list[Answered] = []
    for walk in people:
        if walk.measured.recording == held:
            prior = learned_prior(walk.goals, labels, scene=walk.scene, without=frozenset({held}))
            answers += _answered(walk, prior, steep, settings=settings, update=update, seed=seed)
    return tuple(answers)


def _concentrations(
    others: Sequence[Walk], labels: Sequence[Label], held: str
) -> tuple[float, float, float]:
    """Of bearing, bearing x prior and bearing x root prior, fitted on the other recordings."""
    plain, weighted, rooted = [], [], []
    for walk in others:
        own = frozenset({held, walk.measured.recording})
        prior = learned_prior(walk.goals, labels, scene=walk.scene, without=own).probability
        for t_s in walk.times_s().values():
            cosine = cosines(walk.measured.until(t_s), walk.goals)
            plain.append((cosine, np.ones(len(prior)), walk.goal))
            weighted.append((cosine, prior, walk.goal))
            rooted.append((cosine, np.sqrt(prior), walk.goal))
    if not plain:
        return 2.0, 2.0, 2.0
    return (
        fitted_concentration(plain), fitted_concentration(weighted), fitted_concentration(rooted)
    )  # fmt: skip


def _answered(
    walk: Walk,
    prior: Prior,
    steep: tuple[float, float, float],
    *,
    settings: FilterSettings,
    update: Update,
    seed: int,
) -> list[Answered]:
    track, p = walk.measured, prior.probability
    even = np.full(len(p), 1.0 / len(p))
    intents = Intents.of_person(walk.goals, track.recording, track.agent, seed=seed)
    times = walk.times_s()
    # The k-th belief knows the first k measurements and nothing else.
    beliefs = follow(track.until(max(times.values(), default=-math.inf)), intents, settings, update)
    found = []
    for point, t_s in times.items():
        history = track.until(t_s)
        cosine = cosines(history, walk.goals)
        by_method = {
            PRIOR: p,
            BEARING: bearing_answer(cosine, steep[0], even),
            BEARING_PRIOR: bearing_answer(cosine, steep[1], p),
            BEARING_ROOT: bearing_answer(cosine, steep[2], np.sqrt(p)),
            FILTER_EQUAL: even,
            FILTER: np.sqrt(p) / np.sqrt(p).sum(),
        }
        if len(history.t_s):
            belief = beliefs[len(history.t_s) - 1]
            by_method |= {
                FILTER_EQUAL: answer(belief, even, settings),
                FILTER: answer(belief, p, settings),
            }
        found += [
            Answered(method, point, track.recording, probability, walk.goal)
            for method, probability in by_method.items()
        ]
    return found


def scored(answers: Sequence[Answered]) -> tuple[Score, ...]:
    """A row per method and point that has answers, in the order of METHODS and POINTS."""
    rows = []
    for method in METHODS:
        for point in POINTS:
            chosen = [each for each in answers if (each.method, each.point) == (method, point)]
            if chosen:
                rows.append(_score(method, point, chosen))
    return tuple(rows)


def _score(method: str, point: str, chosen: Sequence[Answered]) -> Score:
    right = [int(np.argmax(each.probability)) == each.goal for each in chosen]
    loss = [-math.log(max(float(each.probability[each.goal]), 1e-12)) for each in chosen]
    brier = [
        float((each.probability**2).sum() - 2.0 * each.probability[each.goal] + 1.0)
        for each in chosen
    ]
    means = (float(np.mean(right)), float(np.mean(loss)), float(np.mean(brier)))
    return Score(method, point, len(chosen), *means)


@final
@dataclass(frozen=True, slots=True)
class Calibrated:
    """Of the probabilities given out within [low, high): how many, their mean, and the share of
    them whose goal was reached."""

    low: float
    high: float
    count: int
    stated: float
    reached: float


def calibration(answers: Sequence[Answered], method: str, *, bins: int = 10) -> list[Calibrated]:
    """Stated probability against frequency, over all goals and points; empty bins left out."""
    own = [each for each in answers if each.method == method]
    stated = np.concatenate([each.probability for each in own]) if own else np.zeros(0)
    reached = np.concatenate([np.arange(len(each.probability)) == each.goal for each in own]) \
        if own else np.zeros(0)  # fmt: skip
    index = np.minimum((stated * bins).astype(int), bins - 1)
    return [
        Calibrated(b / bins, (b + 1) / bins, int((index == b).sum()),
                   float(stated[index == b].mean()), float(reached[index == b].mean()))
        for b in range(bins)
        if (index == b).any()
    ]  # fmt: skip
