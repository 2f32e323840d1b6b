"""Settings of an estimator of people, and people who walk past it."""

from __future__ import annotations

import dataclasses

from workbench.estimation.goals import Goal
from workbench.estimation.intent_cloud import FilterSettings, NumpyUpdate
from workbench.estimation.motion_parameters import shipped_motion
from workbench.estimation.people_estimator import (
    Bodies,
    EstimatorSettings,
    PeopleEstimator,
    PeopleNow,
    Sighting,
)
from workbench.estimation.people_guards import LimitsGuard, LimitsGuards
from workbench.estimation.person_intents import EveryIntent
from workbench.runtime import MotionLimits, ObservedPerson

SQUARE = (
    Goal("west", -10.0, 0.0, 1.0), Goal("east", 10.0, 0.0, 1.0), Goal("north", 0.0, 10.0, 1.0),
)  # fmt: skip
LIMITS = MotionLimits(2.5, 1.5)
NOISE_M, BODY_M = 0.05, 0.3
MOTION = shipped_motion()
LAW = LimitsGuard(LIMITS, NOISE_M, NOISE_M, 0.0, 0.5)
SETTINGS = EstimatorSettings(
    goals=SQUARE,
    intents=dataclasses.replace(FilterSettings.chosen(), particles=40),
    update=NumpyUpdate(),
    motion=MOTION.numbers,
    forwarding=EveryIntent(MOTION, 0.26, 0.9, 3.5),
    guards=LimitsGuards(LAW, dataclasses.replace(LAW, limits=MotionLimits(7.0, 1.5))),
    bodies=Bodies(BODY_M, 0.9, 0.1),
    max_age_s=0.5,
    gone_age_s=1.0,
    headroom=1.2,
    seed=1,
)
NO_GOALS = dataclasses.replace(SETTINGS, goals=())


def walk(name: str, *, count: int = 12, x: float = 0.0, vx: float = 1.3) -> list[Sighting]:
    return [Sighting(name, "ped", 0.1 * k, x + vx * 0.1 * k, 0.2 * k) for k in range(count)]


def fed(*seen: Sighting, rules: EstimatorSettings = SETTINGS) -> PeopleEstimator:
    estimator = PeopleEstimator(rules)
    for each in sorted(seen, key=lambda s: s.t_s):
        estimator.measure(each)
    return estimator


def person(now: PeopleNow, name: str) -> ObservedPerson:
    return next(each for each in now.people if each.name == name)
