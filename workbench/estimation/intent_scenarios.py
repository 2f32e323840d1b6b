"""Generated walkers whose goal is not in the set, or who change it: how soon a filter notices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.goals import Goal
from workbench.estimation.intent_cloud import FilterSettings, Update, Values
from workbench.estimation.intent_filter import Belief, Intents, follow
from workbench.estimation.people_data import PersonTrack

CROSSING = (
    Goal("across", 0.0, 12.0, 1.0), Goal("along, right", 14.0, 0.0, 1.0),
    Goal("along, left", -14.0, 0.0, 1.0),
)  # fmt: skip
_NEVER = math.inf


@final
@dataclass(frozen=True, slots=True, eq=False)
class Errand:
    """A walk along straight legs at one speed.

    corners_m: (k, 2) from start to end; speed_mps; turn: which corner is the change of mind, 0
    where there is none; right: index of the goal that is right after it, -1 for the unknown one.
    """

    name: str
    corners_m: Values
    speed_mps: float
    turn: int
    right: int

    def track(self, *, period_s: float, noise_m: float, seed: int) -> PersonTrack:
        """Measured every period, with independent Gaussian errors of noise_m in x and y."""
        legs = np.hypot(*np.diff(self.corners_m, axis=0).T)
        at = np.concatenate([[0.0], np.cumsum(legs)])
        t_s = np.arange(0.0, at[-1] / self.speed_mps, period_s)
        way = self.speed_mps * t_s
        xy = np.stack([np.interp(way, at, column) for column in self.corners_m.T], axis=1)
        noise = noise_m * np.random.default_rng(seed).standard_normal(xy.shape)
        return PersonTrack("generated", f"{self.name} {seed}", "ped", t_s, xy + noise)

    def turned_s(self) -> float:
        """When the corner of the change is passed, s."""
        legs = np.hypot(*np.diff(self.corners_m, axis=0).T)
        return float(legs[: self.turn].sum()) / self.speed_mps


def errands() -> tuple[Errand, ...]:
    """A right goal, two changes of mind and two goals that the set lacks, among CROSSING."""
    start = (0.0, -4.0)
    return (
        Errand("goes across", np.array([start, (0.0, 12.0)]), 1.3, 0, 0),
        Errand("across, then right", np.array([start, (0.0, 2.0), (14.0, 0.0)]), 1.3, 1, 1),
        Errand("right, then across", np.array([start, (6.0, -2.3), (0.0, 12.0)]), 1.3, 1, 0),
        Errand("to a goal not in the set", np.array([start, (-1.0, -20.0)]), 1.3, 0, -1),
        Errand("between two goals", np.array([start, (22.0, 20.0)]), 1.3, 0, -1),
    )


@final
@dataclass(frozen=True, slots=True)
class Noticed:
    """Over `runs` seeds: share in which the right intent (or the unknown one) leads to the end, and
    median and 90 % quantile of the time after the change until it leads; inf where it never does.
    """

    name: str
    period_s: float
    runs: int
    share: float
    median_s: float
    late_s: float


def noticed(
    errand: Errand,
    *,
    period_s: float,
    noise_m: float,
    runs: int,
    settings: FilterSettings,
    update: Update,
) -> Noticed:
    """When the right intent, or the unknown goal, begins to lead for good.

    For an errand to a known goal the unknown one counts as noticed too: both end the belief in the
    wrong goal. Raises InputError when there are no runs.
    """
    if runs < 1:
        raise InputError(f"expected at least one run, got {runs}")
    waits = []
    for seed in range(runs):
        track = errand.track(period_s=period_s, noise_m=noise_m, seed=seed)
        intents = Intents.of_person(CROSSING, track.recording, track.agent, seed=seed)
        beliefs = follow(track, intents, settings, update)
        waits.append(_wait(errand, beliefs))
    found = np.array(waits)
    median, late = np.quantile(found, (0.5, 0.9), method="higher")
    return Noticed(
        errand.name, period_s, runs, float(np.isfinite(found).mean()), float(median), float(late)
    )


def _wait(errand: Errand, beliefs: Sequence[Belief]) -> float:
    """From the change until the first belief from which on the leader is never wrong again."""
    turned = errand.turned_s()
    allowed = {len(CROSSING), *([errand.right] if errand.right >= 0 else [])}
    since = _NEVER
    for belief in beliefs:
        if belief.t_s < turned:
            continue
        leads = int(np.argmax(belief.weights)) in allowed
        since = min(since, belief.t_s) if leads else _NEVER
    return since - turned
