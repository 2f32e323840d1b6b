"""The people around a car, fed measurement by measurement: what each wants, where each can be."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.field_paths import Others
from workbench.estimation.goals import Goal
from workbench.estimation.guard_limits import (
    LimitsViolation,
    broken_limits,
    widened,
    widest,
)
from workbench.estimation.intent_cloud import FilterSettings, Update, Values
from workbench.estimation.intent_filter import STEP_S, Belief, Intents, advance
from workbench.estimation.intent_filter import begin as begin_belief
from workbench.estimation.motion_filter import Estimate, MotionNumbers, filter_step
from workbench.estimation.motion_filter import begin as begin_motion
from workbench.estimation.people_data import PersonTrack
from workbench.estimation.people_guards import ON_FOOT, Guards, assumed_guard, with_body
from workbench.estimation.person_intents import Forwarded, Forwarding, Intent
from workbench.runtime import Guard, MotionLimits, ObservedPerson

UNKNOWN = "unknown"
"""What the goal that is none of the known ones is called."""
HISTORY_S = 12.0
"""Measurements older than this before the newest one are forgotten, but for the last two; no guard
looks farther back."""
COMPARED_S = 1.0
"""A guard is held against the same person's earlier guards up to this old."""
_SAME_TIME_S = 1e-9
# Measurements come a little early, too.
_INTENT_PERIOD_S = 0.95 * STEP_S


@final
@dataclass(frozen=True, slots=True)
class Sighting:
    """One measurement of one person: kind is ped, cyclist, skater, sitting or another word."""

    name: str
    kind: str
    t_s: float
    x_m: float
    y_m: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.t_s, self.x_m, self.y_m))):
            raise InputError(f"{self.name}: expected a finite time and place, got {self}")


@final
@dataclass(frozen=True, slots=True)
class Bodies:
    """Radius of a disc that contains the body, m: of people on foot and of all others; error_m: how
    far a measured place may be off, the car's own place included. Predictions are grown by both."""

    on_foot_m: float
    on_wheels_m: float
    error_m: float

    def of(self, kind: str) -> float:
        """Of `kind`, without the error."""
        return self.on_foot_m if kind in ON_FOOT else self.on_wheels_m


@final
@dataclass(frozen=True, slots=True, eq=False)
class EstimatorSettings:
    """How `PeopleEstimator` works.

    goals: where people of this place go, () where nobody knows: then everybody's goal is unknown;
    intents, update, seed: of the particle filters; motion: numbers of the filter of position and
    velocity, whose measurement_m is that of your sensor; forwarding: which intents `LookAhead` is
    told, and how wide; guards: what `FailSafe` is told; bodies; max_age_s: who was not seen for
    longer is only assumed to be there, gone_age_s: and for longer than this is taken to have left;
    headroom: how much more than was seen one who broke the limits may do, see `widened`.
    Raises InputError for ages out of order and a headroom below 1.
    """

    goals: tuple[Goal, ...]
    intents: FilterSettings
    update: Update
    motion: MotionNumbers
    forwarding: Forwarding
    guards: Guards
    bodies: Bodies
    max_age_s: float
    gone_age_s: float
    headroom: float
    seed: int

    def __post_init__(self) -> None:
        if not 0.0 <= self.max_age_s <= self.gone_age_s < math.inf:
            raise InputError(
                f"expected 0 <= max_age_s <= gone_age_s, got {self.max_age_s} and {self.gone_age_s}"
            )
        if not 1.0 <= self.headroom < math.inf:
            raise InputError(f"headroom: expected a finite number >= 1, got {self.headroom!r}")


@final
@dataclass(frozen=True, slots=True)
class Wanted:
    """A goal by name, or `UNKNOWN`, and its probability."""

    goal: str
    probability: float


@final
@dataclass(frozen=True, slots=True)
class PeopleNow:
    """Everybody at one instant. people: for an observation stamped with it; wanted: of each by
    name, every intent, the unknown one last; violations: limits that somebody was seen to break
    since the last question."""

    people: tuple[ObservedPerson, ...]
    wanted: Mapping[str, tuple[Wanted, ...]] = field(default_factory=dict)
    violations: tuple[LimitsViolation, ...] = ()


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """What is known of one person; guards: at each measurement of the last second, newest last,
    without the body, all under the limits that hold now."""

    history: PersonTrack
    motion: Estimate
    belief: Belief | None
    guards: tuple[Guard, ...]

    @property
    def seen_s(self) -> float:
        return float(self.history.t_s[-1])

    @property
    def limits(self) -> MotionLimits:
        return self.guards[-1].limits


@final
class PeopleEstimator:
    """Intents and guards of several people, each with filters of their own.

    Only what was measured by then enters an answer. A person's limits are those of their guard
    until a measurement refutes them; from then on they are wider, and stay so: by name, also for
    one who left and came back. The random numbers of a person depend on the seed and their name
    alone. Repulsion by other people and cars is left out (the shipped fit has none).
    """

    def __init__(self, settings: EstimatorSettings) -> None:
        self._settings = settings
        self._known: dict[str, _Known] = {}
        self._limits: dict[str, MotionLimits] = {}
        self._violations: list[LimitsViolation] = []
        self._newest_s = -math.inf

    def measure(self, seen: Sighting) -> None:
        """Take one measurement; several people may be measured at the same time.

        Raises InputError, and changes nothing, for a measurement before the newest one of all, or
        not after the same person's last.
        """
        if seen.t_s < self._newest_s:
            raise InputError(
                f"{seen.name}: expected a measurement at {self._newest_s:.3f} s or later, got one "
                f"at {seen.t_s:.3f} s; give measurements in the order of time"
            )
        before = self._known.get(seen.name)
        if before is not None and not seen.t_s > before.seen_s:
            raise InputError(
                f"{seen.name}: expected a measurement after {before.seen_s:.3f} s, got another one "
                f"at {seen.t_s:.3f} s; give each person one at a time"
            )
        if before is not None and seen.t_s - before.seen_s > self._settings.gone_age_s:
            before = None
        known, violation = self._advanced(seen, before)
        self._newest_s = seen.t_s
        self._known[seen.name] = known
        if violation is not None:
            self._limits[seen.name] = known.limits
            self._violations.append(violation)

    def at(self, t_s: float) -> PeopleNow:
        """Everybody at t_s, which is not before the newest measurement (else InputError).

        In the order in which they were first seen; times of tubes and guards are after t_s.
        """
        if not self._newest_s - _SAME_TIME_S <= t_s < math.inf:
            raise InputError(
                f"expected a time from the newest measurement on, {self._newest_s:.3f} s, got {t_s}"
            )
        t_s = max(t_s, self._newest_s)
        gone_s = t_s - self._settings.gone_age_s
        self._known = {name: k for name, k in self._known.items() if k.seen_s >= gone_s}
        found, wanted = [], {}
        for name, known in self._known.items():
            wanted[name] = self._wanted(known)
            found.append(self._observed(name, known, t_s))
        violations, self._violations = tuple(self._violations), []
        return PeopleNow(tuple(found), wanted, violations)

    def ways(self, t_s: float) -> dict[str, Forwarded]:
        """What is passed on of everybody whom `at` would name at t_s, by name."""
        gone_s = t_s - self._settings.gone_age_s
        return {
            name: self._forwarded(known, t_s)
            for name, known in self._known.items()
            if known.seen_s >= gone_s
        }

    def _advanced(
        self, seen: Sighting, before: _Known | None
    ) -> tuple[_Known, LimitsViolation | None]:
        place = np.array([seen.x_m, seen.y_m])
        history = _history(seen, before)
        law = self._settings.guards.of(history.kind)
        limits = widest(law.limits, self._limits.get(seen.name))
        alike = before is not None and before.history.kind == seen.kind
        if before is not None and not alike:
            # Of two kinds that somebody is taken for, they may be either.
            limits = widest(limits, before.limits)
            self._limits[seen.name] = limits
        guard = law.guard(history, limits)
        earlier = _recent(before.guards, seen.t_s) if before is not None and alike else ()
        violation = broken_limits(seen.name, earlier, guard)
        guards = (*earlier, guard)
        if violation is not None:
            limits = widened(limits, violation, headroom=self._settings.headroom)
            # What was said under the old limits is refuted.
            guards = (law.guard(history, limits),)
        motion = _moved(before, seen.t_s, place, self._settings.motion)
        belief = self._believed(seen, before, place)
        return _Known(history, motion, belief, guards), violation

    def _believed(self, seen: Sighting, before: _Known | None, place: Values) -> Belief | None:
        """The filter takes five measurements a second at most, as the paper's."""
        s = self._settings
        if not s.goals:
            return None
        belief = None if before is None else before.belief
        if belief is None:
            intents = Intents.of_person(s.goals, "", seen.name, seed=s.seed)
            return begin_belief(intents, seen.t_s, place, s.intents)
        if seen.t_s - belief.t_s < _INTENT_PERIOD_S:
            return belief
        return advance(belief, seen.t_s, place, s.intents, s.update)

    def _wanted(self, known: _Known) -> tuple[Wanted, ...]:
        if known.belief is None:
            return (Wanted(UNKNOWN, 1.0),)
        names = [*(goal.name for goal in self._settings.goals), UNKNOWN]
        return tuple(map(Wanted, names, known.belief.weights.tolist()))

    def _forwarded(self, known: _Known, t_s: float) -> Forwarded:
        s = self._settings
        places = [*((goal.x_m, goal.y_m) for goal in s.goals), None]
        chances = (1.0,) if known.belief is None else known.belief.weights.tolist()
        intents = [Intent(chance, at) for chance, at in zip(chances, places, strict=True)]
        return s.forwarding.forward(known.motion, t_s, intents, Others.none())

    def _observed(self, name: str, known: _Known, t_s: float) -> ObservedPerson:
        s = self._settings
        forwarded = self._forwarded(known, t_s)
        body_m = s.bodies.of(known.history.kind)
        tubes = (way.tube(body_m=body_m + s.bodies.error_m) for way in forwarded.waypoints)
        newest = known.guards[-1]
        guard = dataclasses.replace(with_body(newest, body_m), at_s=newest.at_s - t_s)
        lost = t_s - known.seen_s > s.max_age_s
        return ObservedPerson(
            name, tuple(tubes), assumed_guard(guard) if lost else guard, assumed=lost
        )


def _history(seen: Sighting, before: _Known | None) -> PersonTrack:
    """The measurements up to this one that still count."""
    row, place = np.array([seen.t_s]), np.array([[seen.x_m, seen.y_m]])
    if before is None:
        return PersonTrack("", seen.name, seen.kind, row, place)
    old = before.history
    kept = min(int(np.searchsorted(old.t_s, seen.t_s - HISTORY_S)), len(old.t_s) - 1)
    t_s, xy_m = np.append(old.t_s[kept:], row), np.vstack([old.xy_m[kept:], place])
    return PersonTrack("", old.agent, seen.kind, t_s, xy_m)


def _moved(before: _Known | None, t_s: float, place: Values, numbers: MotionNumbers) -> Estimate:
    """`motion_filter.estimate`, one measurement on."""
    if before is None:
        return Estimate(t_s, *begin_motion(place, numbers))
    known = before.motion
    mean, covariance = filter_step()(
        known.mean, known.covariance, t_s - known.t_s, place[None, :], numbers.row
    )
    return Estimate(t_s, mean.full(), covariance.full())


def _recent(guards: Sequence[Guard], t_s: float) -> tuple[Guard, ...]:
    """Those of the last second, and the newest however old it is."""
    return tuple(g for g in guards if g.at_s >= t_s - COMPARED_S) or tuple(guards[-1:])
