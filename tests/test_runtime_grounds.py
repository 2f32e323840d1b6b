"""Claim: what stands against TRACK is told as values that agree with the reasons in words."""

from __future__ import annotations

import ctypes
import math
from dataclasses import replace
from typing import Any

import pytest
from runtime_world import Asked, observation, standing

from workbench.claims import Verdict
from workbench.runtime import Action, Deciding
from workbench.runtime.grounds import ground_of, grounds
from workbench.runtime.judgement import Judgement, unjudged
from workbench.runtime.policies import Ground, Hypothesis, Outcome, PoliciesOutcome, Violation

FAR, AHEAD = standing("far", 30.0, 9.0), standing("Ann", 8.0, 0.5)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({}, ()),
        ({"speed": (5.0, 6.5)}, (Ground.REGION,)),
        ({"y": (1.9, 2.3)}, (Ground.REGION,)),
        ({"reference_speed_mps": 6.1}, (Ground.REGION,)),
        ({"x": (math.nan, 0.0)}, (Ground.READING,)),
        ({"x": (-60.0, -59.0)}, (Ground.READING,)),
        ({"x": None}, (Ground.ARITHMETIC,)),
    ],
)
def test_what_cannot_be_judged_says_of_which_kind_it_is(
    change: dict[str, Any], found: tuple[Ground, ...]
) -> None:
    assert Asked().step(replace(observation(FAR), **change)).grounds == found


def test_a_person_in_the_way_and_a_tube_without_its_end_are_told_apart() -> None:
    asked = Asked(deciding=Deciding.LOOK_AHEAD)
    assert asked.step(observation(FAR, AHEAD)).grounds == (Ground.PEOPLE,)
    monitor = Asked(deciding=Deciding.LOOK_AHEAD)
    for x in (0.0, 9.0, 31.0):
        assert monitor.step(observation(at=(x, 0.0))).grounds == ()
    late = monitor.step(observation(at=(62.0, 0.0)))
    assert "left the path table" in late.reason
    assert late.grounds == (Ground.MOTION,)


def test_a_kernel_that_is_not_believed_is_no_matter_of_people() -> None:
    try:
        found = Asked(2).step(observation(AHEAD)).grounds
    finally:
        ctypes.CDLL(None).fesetround(0)
    assert found == (Ground.ARITHMETIC,)


def test_who_is_lost_counts_as_people_and_only_where_that_policy_decides() -> None:
    found = {}
    for deciding in Deciding:
        monitor = Asked(deciding=deciding)
        still = {"speed": (-0.01, 0.01)}
        monitor.step(replace(observation(FAR), **still))
        found[deciding] = monitor.step(replace(observation(), **still))
    lost = Hypothesis.NOBODY_LOST
    for deciding in (Deciding.FAIL_SAFE, Deciding.BOTH):
        assert lost in {each.hypothesis for each in found[deciding].fail_safe.violations}
        assert Ground.PEOPLE in found[deciding].grounds
    assert found[Deciding.LOOK_AHEAD].grounds == ()


def said(action: Action, *found: Hypothesis) -> Outcome:
    violations = tuple(Violation(each, "how", refutes_plan=False) for each in found)
    return Outcome("policy", Verdict.SAFE, action, "why", violations, None, None)


def told(deciding: Deciding, ahead: Outcome, safe: Outcome) -> PoliciesOutcome:
    return PoliciesOutcome(Action.BRAKE, 0.0, deciding, ahead, safe, None)


def judged(ahead: Ground, stop: Ground) -> Judgement:
    found = unjudged("why", ahead)
    answer = replace(found.stop_guard.answer, ground=stop)
    return replace(found, stop_guard=replace(found.stop_guard, answer=answer))


@pytest.mark.parametrize(
    ("deciding", "expected"),
    [
        (Deciding.LOOK_AHEAD, (Ground.TIME, Ground.MOTION)),
        (Deciding.FAIL_SAFE, (Ground.PEOPLE, Ground.REGION)),
        (Deciding.BOTH, (Ground.TIME, Ground.MOTION, Ground.PEOPLE, Ground.REGION)),
    ],
)
def test_each_deciding_policy_that_brakes_is_heard_once(
    deciding: Deciding, expected: tuple[Ground, ...]
) -> None:
    ahead = said(Action.BRAKE, Hypothesis.AGE, Hypothesis.CLOCK)
    safe = said(Action.BRAKE, Hypothesis.PEOPLE)
    answers = judged(Ground.MOTION, Ground.REGION)
    assert grounds(told(deciding, ahead, safe), answers) == expected


def test_who_permits_track_has_nothing_against_it() -> None:
    tracks, brakes = said(Action.TRACK), said(Action.BRAKE)
    answers = judged(Ground.MOTION, Ground.PEOPLE)
    assert grounds(told(Deciding.BOTH, tracks, brakes), answers) == (Ground.PEOPLE,)
    assert grounds(told(Deciding.BOTH, brakes, tracks), answers) == (Ground.MOTION,)


def test_every_hypothesis_is_about_something() -> None:
    about = {each: ground_of(each) for each in Hypothesis}
    people = {each for each, ground in about.items() if ground is Ground.PEOPLE}
    assert people == {Hypothesis.PEOPLE, Hypothesis.NOBODY_NEW, Hypothesis.NOBODY_LOST}
    motion = {each for each, ground in about.items() if ground is Ground.MOTION}
    assert motion == {Hypothesis.STATE, Hypothesis.STANDSTILL}
    assert about[Hypothesis.ARITHMETIC] is Ground.ARITHMETIC
    assert Ground.REGION not in about.values()
