"""How much the filter's numbers matter: each halved and doubled, and chosen on other recordings."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.estimation.intent_cloud import FilterSettings, Update
from workbench.estimation.intent_filter import Intents, answer, follow
from workbench.estimation.intent_labels import Label, learned_prior
from workbench.estimation.intent_scores import FILTER, Answered, Score, Walk, scored

VARIED: Final = ("kick", "free_kick", "relax_s", "deviation_m", "floor", "switch_per_s",
                 "mixing_per_s", "unknown", "entry_m", "bearing", "doubted_bearing")  # fmt: skip
CHOSEN_ELSEWHERE: Final = "chosen on the other recordings"


@final
@dataclass(frozen=True, slots=True)
class Varied:
    """The scores of one set of numbers, by what was changed."""

    change: str
    scores: tuple[Score, ...]


def variants(settings: FilterSettings) -> dict[str, FilterSettings]:
    """The settings as they are, and with each of VARIED halved and doubled."""
    found = {"as shipped": settings}
    for name in VARIED:
        for factor in (0.5, 2.0):
            value = factor * getattr(settings, name)
            found[f"{name} = {value:g}"] = dataclasses.replace(settings, **{name: value})
    return found


def varied(
    people: Sequence[Walk],
    labels: Sequence[Label],
    choices: Mapping[str, FilterSettings],
    *,
    update: Update,
    seed: int,
    progress: Callable[[], None],
) -> list[Varied]:
    """Scores for each choice, and last for the honest one: each recording is judged with the
    choice that has the least mean log-loss on the other recordings."""
    answers = {}
    for change, settings in choices.items():
        answers[change] = _answers(people, labels, settings, update=update, seed=seed)
        progress()
    rows = [Varied(change, scored(given)) for change, given in answers.items()]
    picked: list[Answered] = []
    for held in sorted({walk.measured.recording for walk in people}):
        best = min(answers, key=lambda change: _loss_without(answers[change], held))
        picked += [each for each in answers[best] if each.recording == held]
    return [*rows, Varied(CHOSEN_ELSEWHERE, scored(picked))]


def _loss_without(answers: Sequence[Answered], held: str) -> float:
    """Mean over the other recordings of their mean log-loss; 0 where there are none."""
    losses: dict[str, list[float]] = {}
    for each in answers:
        if each.recording != held:
            losses.setdefault(each.recording, []).append(-np.log(each.probability[each.goal]))
    return float(np.mean([np.mean(own) for own in losses.values()])) if losses else 0.0


def _answers(
    people: Sequence[Walk],
    labels: Sequence[Label],
    settings: FilterSettings,
    *,
    update: Update,
    seed: int,
) -> list[Answered]:
    priors = {
        (walk.scene, walk.measured.recording): learned_prior(
            walk.goals, labels, scene=walk.scene, without=frozenset({walk.measured.recording})
        ).probability
        for walk in people
    }
    found = []
    for walk in people:
        track, prior = walk.measured, priors[walk.scene, walk.measured.recording]
        intents = Intents.of_person(walk.goals, track.recording, track.agent, seed=seed)
        times = walk.times_s()
        seen = track.until(max(times.values(), default=-np.inf))
        beliefs = follow(seen, intents, settings, update)
        root = np.sqrt(prior) / np.sqrt(prior).sum()
        for point, t_s in times.items():
            count = len(track.until(t_s).t_s)
            given = answer(beliefs[count - 1], prior, settings) if count else root
            found.append(Answered(FILTER, point, track.recording, given, walk.goal))
    return found
