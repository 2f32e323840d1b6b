"""What the look-ahead decision is told of a person: places, times and radii for their intents."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.estimation.field_paths import Others, TowardGoal
from workbench.estimation.motion_filter import Estimate
from workbench.estimation.motion_parameters import MotionParameters
from workbench.estimation.prediction import PreferredVelocity
from workbench.runtime.person_tubes import (
    MOST_PIECES,
    MOST_TUBES,
    PersonTube,
    RadiusBetween,
    timed_discs,
)

Values = NDArray[np.float64]
KNOT_S = 0.5
"""Between two times of a prediction; errors were fitted at this spacing."""
_LEAST_THRESHOLD = 1.0 / MOST_TUBES


@final
@dataclass(frozen=True, slots=True)
class Intent:
    """One thing a person may want: its probability, and the goal (m), None where it is unknown."""

    probability: float
    goal_m: tuple[float, float] | None

    def __post_init__(self) -> None:
        if not 0.0 <= self.probability <= 1.0:
            raise InputError(f"expected a probability from 0 to 1, got {self.probability}")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Waypoints:
    """Location-time pairs of one intent: times_s (k,) after the question, the first 0, places_m
    (k, 2), radii_m (k,) of the person's position, the body not included."""

    intent: Intent
    times_s: Values
    places_m: Values
    radii_m: Values

    def tube(self, *, body_m: float) -> PersonTube:
        """INTENT tube through the discs, radii grown by body_m, which holds the whole body."""
        radii = self.radii_m + body_m
        return timed_discs(
            self.times_s.tolist(), self.places_m[:, 0].tolist(), self.places_m[:, 1].tolist(),
            radii.tolist(), between=RadiusBetween.LARGER,
        )  # fmt: skip


@final
@dataclass(frozen=True, slots=True, eq=False)
class Forwarded:
    """What is passed on of a person, and the probability (0 to 1) of all that is not."""

    waypoints: tuple[Waypoints, ...]
    left_out: float


class Forwarding(Protocol):
    """Which intents the decision sees, and how wide."""

    def forward(
        self, known: Estimate, at_s: float, intents: Sequence[Intent], others: Others
    ) -> Forwarded:
        """known: by at_s; intents: what the person may want, their probabilities summing to 1."""
        ...


@final
@dataclass(frozen=True, slots=True)
class EveryIntent:
    """Every intent of at least `threshold`, radii from the fitted quantiles of `level`.

    Where none reaches the threshold, the person is predicted without a goal. Holds, at each time
    alone, level of those people who want what is forwarded, as far as they are like those of the
    fit (SAMPLED); the rest, left_out, adds to what is missed (union bound). The decision takes at
    most 4 tubes of a person, the guard's among them: the threshold is above 1/4, which at most 3
    intents reach.
    """

    parameters: MotionParameters
    threshold: float
    level: float
    until_s: float

    def __post_init__(self) -> None:
        if not _LEAST_THRESHOLD < self.threshold <= 1.0:
            raise InputError(
                f"expected a threshold above {_LEAST_THRESHOLD:g} and up to 1, got "
                f"{self.threshold}: the decision takes {MOST_TUBES - 1} intents of a person"
            )
        _times(self.until_s)

    def forward(
        self, known: Estimate, at_s: float, intents: Sequence[Intent], others: Others
    ) -> Forwarded:
        """As `Forwarding` says; InputError for a level that was not fitted."""
        _whole(intents)
        kept = [each for each in intents if each.probability >= self.threshold]
        left = math.fsum(each.probability for each in intents if each not in kept)
        times, motion = _times(self.until_s), PreferredVelocity(self.parameters.numbers)
        speed = motion.speed_mps(known, at_s)
        found = []
        for intent in kept or [Intent(0.0, None)]:
            fit = self.parameters.free if intent.goal_m is None else self.parameters.toward_goal
            leads = at_s - known.t_s + times
            radii = np.array([fit.radius_m(self.level, lead, speed) for lead in leads])
            places = _places(self.parameters, known, at_s, intent, others, times)
            found.append(Waypoints(intent, times, places, radii))
        return Forwarded(tuple(found), left)


@final
@dataclass(frozen=True, slots=True)
class MostLikelyIntent:
    """The paper's: the single most likely intent, with one radius for all times.

    Nothing says what share of people the radius holds. Of equally likely intents, the first.
    """

    parameters: MotionParameters
    radius_m: float
    until_s: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.radius_m < math.inf:
            raise InputError(f"expected a radius of 0 m or more, got {self.radius_m}")
        _times(self.until_s)

    def forward(
        self, known: Estimate, at_s: float, intents: Sequence[Intent], others: Others
    ) -> Forwarded:
        """As `Forwarding` says."""
        _whole(intents)
        intent = max(intents, key=lambda each: each.probability)
        times = _times(self.until_s)
        places = _places(self.parameters, known, at_s, intent, others, times)
        radii = np.full(len(times), self.radius_m)
        return Forwarded((Waypoints(intent, times, places, radii),), 1.0 - intent.probability)


def _places(
    parameters: MotionParameters, known: Estimate, at_s: float, intent: Intent, others: Others,
    times_s: Values,
) -> Values:  # fmt: skip
    """The way to the goal, where it ends; without a goal, straight on.

    Reached is the goal at the first of times_s after which the way, within the softening of it,
    would lead away again.
    """
    if intent.goal_m is None:
        return PreferredVelocity(parameters.numbers).forecast(known, at_s, times_s)
    toward = TowardGoal(parameters.field)
    places = toward.places_m(known, at_s, times_s, goal_m=intent.goal_m, others=others)
    distance = np.hypot(*(places - intent.goal_m).T)
    turning = (np.diff(distance) > 0.0) & (distance[:-1] <= parameters.field.softening_m)
    if turning.any():
        places[int(np.argmax(turning)) + 1 :] = intent.goal_m
    return places


def _times(until_s: float) -> Values:
    if not 0.0 < until_s <= KNOT_S * MOST_PIECES:
        raise InputError(
            f"expected predictions until at most {KNOT_S * MOST_PIECES:g} s (a tube has "
            f"{MOST_PIECES} pieces), got {until_s}"
        )
    return np.linspace(0.0, until_s, math.ceil(until_s / KNOT_S - 1e-9) + 1)


def _whole(intents: Sequence[Intent]) -> None:
    total = math.fsum(each.probability for each in intents)
    if not abs(total - 1.0) <= 1e-6:
        raise InputError(
            f"expected intents whose probabilities sum to 1, got {len(intents)} with {total:g}; "
            "give what is left to the unknown goal"
        )
