"""Multi-hypothesis particle filter of where people go: one filter per person, one set of
particles per goal and one for a goal that is not known."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.goals import Goal, centres_m, spreads_m
from workbench.estimation.intent_baselines import cosines_of, trail_begin
from workbench.estimation.intent_cloud import (
    Cloud,
    Draws,
    FilterSettings,
    Measured,
    Update,
    Values,
)
from workbench.estimation.people_data import PersonTrack

STEP_S = 0.2
_MOST_STEPS = 8


@final
@dataclass(frozen=True, slots=True, eq=False)
class Intents:
    """What a filter weighs: goals, and the random numbers of one person.

    goals: at least one; seed: two persons with the same seed and measurements get the same answer.
    """

    goals: tuple[Goal, ...]
    seed: int

    def __post_init__(self) -> None:
        if not self.goals:
            raise InputError("expected at least one goal, got none; the unknown one is added")

    @classmethod
    def of_person(cls, goals: Sequence[Goal], recording: str, agent: str, *, seed: int) -> Intents:
        """Random numbers that depend on the person and the seed alone, not on who else is there."""
        return cls(tuple(goals), zlib.crc32(f"{seed}/{recording}/{agent}".encode()))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """What a filter knows of one person after `count` measurements, the last one at t_s.

    weights: (goals + 1,), the probability of each intent with equal priors, the unknown goal last;
    cloud: their particles; place_m: (2,), the last measurement; trail: (k, 3), times and places
    of the measurements from the last one at least 0.5 s old up to the newest.
    """

    intents: Intents
    t_s: float
    place_m: Values
    cloud: Cloud
    weights: Values
    trail: Values
    count: int

    @property
    def unknown(self) -> float:
        """Probability that the goal is none of the known ones."""
        return float(self.weights[-1])

    @property
    def among_known(self) -> Values:
        """(goals,), probability of each goal given that it is one of them."""
        known: Values = self.weights[:-1] / self.weights[:-1].sum()
        return known

    @property
    def cosines(self) -> Values:
        """(goals,), of the angle between the way the person goes and the way to each goal."""
        if trail_begin(self.trail[:, 0]) < 0:
            return np.zeros(len(self.intents.goals))
        return cosines_of(self.place_m, self.place_m - self.trail[0, 1:], self.intents.goals)


def begin(intents: Intents, t_s: float, place_m: Values, settings: FilterSettings) -> Belief:
    """The belief after the first measurement of a person: place_m (2,), m, at t_s.

    Velocities point to each particle's aim, and anywhere for the unknown goal.
    """
    place_m = _place(place_m)
    goals, spreads = centres_m(intents.goals), spreads_m(intents.goals)
    n, count = settings.particles, len(goals) + 1
    rng = _random(intents.seed, 0)
    place = place_m + 0.3 * settings.deviation_m * rng.standard_normal((count, n, 2))
    aim = np.zeros((count, n, 2))
    offset = rng.standard_normal((count - 1, n, 2)) / math.sqrt(2.0)
    aim[:-1] = goals[:, None] + spreads[:, None, None] * offset
    way = aim - place
    way[-1] = rng.standard_normal((n, 2))
    way /= np.maximum(np.hypot(way[..., 0], way[..., 1]), 1e-9)[..., None]
    speed = settings.speed_mps + settings.speed_spread_mps * rng.standard_normal((count, n))
    speed = np.clip(np.abs(speed), 0.2, 2.5)
    velocity = speed[..., None] * way + 0.3 * rng.standard_normal((count, n, 2))
    distance = np.hypot(*(goals - place_m).T)
    doubt = settings.entry_doubt * np.exp(-0.5 * (distance / settings.entry_m) ** 2)
    weights = _with_unknown((1.0 - doubt) / (1.0 - doubt).sum(), settings)
    trail, cloud = np.array([[t_s, *place_m]]), Cloud(place, velocity, aim, speed)
    return Belief(intents, float(t_s), place_m, cloud, weights, trail, 1)


def advance(
    belief: Belief, t_s: float, place_m: Values, settings: FilterSettings, update: Update
) -> Belief:
    """The belief after one more measurement: place_m (2,), m, at t_s, later than the last one.

    weights <- weights of the intents, some people choosing anew, times the mean over an intent's
    particles of exp(-|predicted - measured|^2 / (2 deviation^2)) + floor; particles are then
    resampled within their intent. Particles move in steps of 0.2 s, or in 8 equal ones over gaps
    longer than 1.6 s. Raises InputError when time does not increase.
    """
    place_m, duration_s = _place(place_m), float(t_s) - belief.t_s
    if not 0.0 < duration_s < math.inf:
        raise InputError(
            f"expected a measurement after {belief.t_s:g} s, got one at {t_s}; give them in order"
        )
    n, goals = settings.particles, belief.intents.goals
    steps = min(max(math.ceil(duration_s / STEP_S - 1e-6), 1), _MOST_STEPS)
    replaced = round(n * -math.expm1(-settings.mixing_per_s * duration_s))
    anew = -math.expm1(-settings.switch_per_s * duration_s)
    equal = _with_unknown(np.full(len(goals), 1.0 / len(goals)), settings)
    weights = (1.0 - anew) * belief.weights + anew * equal
    rng = _random(belief.intents.seed, belief.count)
    draws = Draws.of(rng, steps=steps, intents=len(goals) + 1, n=n, m=replaced)
    measured = Measured(place_m, duration_s, weights, centres_m(goals), spreads_m(goals))
    cloud, after = update(belief.cloud, draws, measured, settings)
    trail = np.vstack([belief.trail, [t_s, *place_m]])
    trail = trail[max(trail_begin(trail[:, 0]), 0) :]
    return Belief(belief.intents, float(t_s), place_m, cloud, after, trail, belief.count + 1)


def follow(
    track: PersonTrack, intents: Intents, settings: FilterSettings, update: Update
) -> tuple[Belief, ...]:
    """The belief after each measurement of a track; the k-th depends on the first k only."""
    beliefs: list[Belief] = []
    for t_s, place in zip(track.t_s, track.xy_m, strict=True):
        if beliefs:
            beliefs.append(advance(beliefs[-1], t_s, place, settings, update))
        else:
            beliefs.append(begin(intents, t_s, place, settings))
    return tuple(beliefs)


def answer(belief: Belief, prior: Values, settings: FilterSettings) -> Values:
    """(goals,), the probability of each known goal that is given out; sums to 1.

    p_g = (1 - u) a_g r_g e^(b c_g) / sum(a r e^(b c)) + u r_g e^(d c_g) / sum(r e^(d c)), with a
    the filter's weights among the known goals, u that of the unknown goal, r the square root of
    the prior (goals,), c the cosines of the bearing, b and d what they count. Where the way fits
    no goal, prior and bearing are all that is left. The root, as what people of one recording do
    is only a rough guide to those of another: their goals change with the hour. With an equal
    prior, no unknown goal and b = 0 this is the paper's distribution.
    """
    root = np.sqrt(np.asarray(prior, dtype=np.float64))
    if root.shape != (len(belief.intents.goals),) or not (root > 0.0).all():
        raise InputError(
            f"expected a prior above zero for each of {len(belief.intents.goals)} goals, got "
            f"{prior}"
        )
    cosines = belief.cosines
    among = belief.among_known * root * np.exp(settings.bearing * cosines)
    apart = root * np.exp(settings.doubted_bearing * cosines)
    out: Values = (
        1.0 - belief.unknown
    ) * among / among.sum() + belief.unknown * apart / apart.sum()
    return out


def _with_unknown(known: Values, settings: FilterSettings) -> Values:
    weights: Values = np.append((1.0 - settings.unknown) * known, settings.unknown)
    return weights


def _place(place_m: Values) -> Values:
    place = np.array(place_m, dtype=np.float64)
    if place.shape != (2,) or not np.isfinite(place).all():
        raise InputError(f"expected a measured place (2,) of finite metres, got {place_m}")
    return place


def _random(seed: int, count: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=seed, counter=(0, 0, 0, count)))
