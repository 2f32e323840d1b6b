"""Guards of people who keep their limits never contradict each other, and a jump is counted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from guard_walkers import crowd, walker
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.estimation.guard_model import GuardFit, GuardModel, VelocityError
from workbench.estimation.guard_violations import (
    count_violations,
    person_violations,
    violation_lines,
)
from workbench.estimation.people_data import PersonTrack
from workbench.runtime import MotionLimits

LIMITS = MotionLimits(2.0, 1.5)
MODEL = GuardModel(1e-6, VelocityError(*[0.0] * 10), 1.0, LIMITS, "the walkers' own")


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6))
def test_whoever_keeps_the_limits_is_never_said_to_break_them(seed: int) -> None:
    track = walker(np.random.default_rng(seed), LIMITS)
    found = person_violations(MODEL, track.t_s, track)
    assert len(found) == 59 + 50
    assert not any(found)


def test_a_jump_is_found_by_the_pairs_across_it_and_counted() -> None:
    track = walker(np.random.default_rng(4), LIMITS, name=("r0", "p", "ped"))
    jumped = track.xy_m.copy()
    jumped[30:] += 40.0
    broken = PersonTrack("r0", "q", "ped", track.t_s, jumped)
    found = person_violations(MODEL, track.t_s, broken)
    assert found[29]
    assert found[59 + 20]
    assert not any(found[:29])
    fits = {"r0": GuardFit({"ped": MODEL})}
    (count,) = count_violations([track, broken], [track, broken], fits, name="own")
    assert (count.people, count.compared, count.people_refuted) == (2, 218, 1)
    assert count.refuted == sum(found)
    assert list(violation_lines([count]))[2].startswith("| own | ped | 2 | 218 |")


def test_guards_far_too_tight_contradict_each_other() -> None:
    people = crowd(5, 1, 4, LIMITS)
    tight = dataclasses.replace(MODEL, limits=MotionLimits(0.1, 0.01))
    fits = {"r0": GuardFit({"ped": tight})}
    counts = list(count_violations(people, people, fits, name="tight"))
    assert [count.kind for count in counts] == ["cyclist", "ped"]
    assert all(count.refuted > 0.5 * count.compared for count in counts)


def test_before_the_first_measurement_there_is_no_guard() -> None:
    track = walker(np.random.default_rng(4), LIMITS)
    late = PersonTrack("r", "p", "ped", track.t_s[20:], track.xy_m[20:])
    assert len(person_violations(MODEL, track.t_s, late)) == 39 + 30


@pytest.mark.parametrize("age", [0.0, 0.07])
def test_guards_between_measurements_agree_too(age: float) -> None:
    track = walker(np.random.default_rng(8), LIMITS)
    assert not any(person_violations(MODEL, track.t_s + age, track))
