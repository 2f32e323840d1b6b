"""LookAhead tracks after enough SAFE in a row and alerts; every turn keeps the deciding rule."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from policy_cases import PERIOD_S, cycle
from policy_runs import FAIL_SAFE, GENES, POLICIES, TIMING, World, run
from policy_world import Car, nobody, objection

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.runtime import Action
from workbench.runtime.policies import (
    Cycle,
    Deciding,
    Hypothesis,
    LookAhead,
    Outcome,
    Phase,
    Policies,
    PoliciesOutcome,
)

AHEAD = LookAhead(horizon_s=2.0, release_steps=3, timing=TIMING)


def _cycles(verdicts: list[bool], **changes: Any) -> list[Cycle]:
    state = FAIL_SAFE.start(0.0)
    return [
        cycle(state, Car(), 0.1 * k, track_intent=nobody() if safe else objection(), **changes)
        for k, safe in enumerate(verdicts, start=1)
    ]


def _outcomes(policy: LookAhead, cycles: list[Cycle]) -> list[Outcome]:
    state, outcomes = policy.start(0.0), []
    for each in cycles:
        state, outcome = policy.step(state, each)
        outcomes.append(outcome)
    return outcomes


@given(st.lists(st.booleans(), max_size=30), st.integers(1, 5))
@settings(max_examples=50, deadline=None)
def test_it_tracks_iff_enough_safe_in_a_row_follow_the_last_brake(
    safe: list[bool], steps: int
) -> None:
    policy = dataclasses.replace(AHEAD, release_steps=steps)
    for k, outcome in enumerate(_outcomes(policy, _cycles(safe))):
        recent = safe[max(0, k - steps + 1) : k + 1]
        tracks = safe[k] and (all(recent) if False in safe[:k] else True)
        assert (outcome.action is Action.TRACK) == tracks
        assert outcome.verdict is (Verdict.SAFE if safe[k] else Verdict.UNPROVED)
        assert ("in a row" in outcome.reason) == (safe[k] and not tracks)


def test_what_holds_too_shortly_or_cannot_be_judged_brakes() -> None:
    short = dataclasses.replace(nobody(), holds_s=1.9)
    (outcome,) = _outcomes(AHEAD, _cycles_with(track_intent=short))
    assert (outcome.verdict, outcome.action) == (Verdict.UNPROVED, Action.BRAKE)
    for changes, hypothesis in (
        ({"fault": "no"}, Hypothesis.ARITHMETIC),
        ({"finished_s": 0.5}, Hypothesis.AGE),
        ({"finished_s": math.nan}, Hypothesis.CLOCK),
        ({"stamp_s": -math.inf}, Hypothesis.CLOCK),
    ):
        (outcome,) = _outcomes(AHEAD, _cycles_with(**changes))
        assert (outcome.verdict, outcome.action) == (Verdict.INVALID, Action.BRAKE)
        assert hypothesis in [violation.hypothesis for violation in outcome.violations]
        assert hypothesis.name in outcome.reason


def _cycles_with(**changes: Any) -> list[Cycle]:
    return [cycle(FAIL_SAFE.start(0.0), Car(), 0.1, **changes)]


def test_the_same_observation_twice_is_no_second_safe() -> None:
    (made,) = _cycles([True])
    outcomes = _outcomes(AHEAD, [made, made])
    assert [outcome.verdict for outcome in outcomes] == [Verdict.SAFE, Verdict.INVALID]


@pytest.mark.parametrize("track", [True, False])
@pytest.mark.parametrize("intent", [True, False])
@pytest.mark.parametrize("guard", [True, False])
def test_a_person_is_alerted_when_braking_is_not_proved_to_help(
    track: bool, intent: bool, guard: bool
) -> None:
    ann = dataclasses.replace(objection(), clearance_person="Ann")
    bob = dataclasses.replace(objection(), clearance_person="Bob")
    (made,) = _cycles(
        [track], brake_intent=nobody() if intent else ann, brake_guard=nobody() if guard else bob
    )
    (outcome,) = _outcomes(AHEAD, [made])
    if not intent:
        assert outcome.alert is not None
        assert outcome.alert.person == "Ann"
    elif not track and not guard:
        assert outcome.alert is not None
        assert outcome.alert.person == "Bob"
    else:
        assert outcome.alert is None


def _drive(
    policies: Policies, *, objects_from: int = 10**9, refuses_from: int = 10**9, cycles: int = 40
) -> tuple[list[PoliciesOutcome], list[tuple[float, Action]], Car]:
    """Good cycles, but LookAhead objects and the stop answer is refused from given cycles on."""
    state, car, now_s = policies.start(0.0), Car(braking_s=0.0), 0.0
    outcomes, sent = [], []
    for k in range(cycles):
        made = cycle(
            state.fail_safe, car, now_s,
            track_intent=objection() if k >= objects_from else nobody(),
        )  # fmt: skip
        if k >= refuses_from:
            stop = dataclasses.replace(made.stop_guard, answer=objection())
            made = dataclasses.replace(made, stop_guard=stop)
        end_s = now_s + PERIOD_S
        judged = False
        while now_s < end_s - 1e-9:
            if not judged and now_s >= made.stamp_s + 0.03:
                made = dataclasses.replace(made, finished_s=now_s)
                state, outcome = policies.step(state, made)
                outcomes.append(outcome)
                judged = True
            car.move(now_s, 0.01, accel=0.5, deceleration=2.5)
            now_s += 0.01
            state, turn = policies.turn(state, now_s)
            car.command(track=turn.action is Action.TRACK, now_s=now_s)
            sent.append((now_s, turn.action))
    return outcomes, sent, car


def test_both_must_agree_and_the_objection_carries_out_the_plan() -> None:
    outcomes, sent, car = _drive(POLICIES, objects_from=25)
    assert [o.action for o in outcomes[10:25]] == [Action.TRACK] * 15
    refused = outcomes[25]
    assert (refused.action, refused.look_ahead.action) == (Action.BRAKE, Action.BRAKE)
    assert refused.fail_safe.verdict is Verdict.SAFE
    first_brake = min(t for t, action in sent if action is Action.BRAKE and t > 25 * PERIOD_S)
    assert refused.brake_from_s <= first_brake < refused.brake_from_s + 0.011
    assert car.speed_mps == 0.0
    outcomes, _, _ = _drive(POLICIES, refuses_from=25)
    assert outcomes[25].look_ahead.action is Action.TRACK
    assert outcomes[25].action is Action.BRAKE


def test_fail_safe_alone_drives_over_the_objection_which_is_logged() -> None:
    alone = dataclasses.replace(POLICIES, deciding=Deciding.FAIL_SAFE)
    outcomes, _, car = _drive(alone, objects_from=5)
    assert car.speed_mps > 1.0
    assert outcomes[-1].action is Action.TRACK
    assert outcomes[-1].look_ahead.action is Action.BRAKE
    assert outcomes[-1].deciding is Deciding.FAIL_SAFE


def test_look_ahead_alone_drives_on_and_fail_safe_is_followed_in_the_log() -> None:
    alone = dataclasses.replace(POLICIES, deciding=Deciding.LOOK_AHEAD)
    outcomes, _, car = _drive(alone, refuses_from=20)
    assert car.speed_mps > 1.0
    assert outcomes[15].fail_safe.action is Action.TRACK
    assert outcomes[20].fail_safe.verdict is Verdict.UNPROVED
    assert {o.fail_safe.action for o in outcomes[20:]} == {Action.BRAKE}
    assert {o.action for o in outcomes[20:]} == {Action.TRACK}
    outcomes, sent, car = _drive(alone, objects_from=30)
    assert sent[-1][1] is Action.BRAKE
    assert outcomes[-1].fail_safe.action is Action.BRAKE


def test_look_ahead_alone_expires_without_checks_and_with_a_broken_clock() -> None:
    alone = dataclasses.replace(POLICIES, deciding=Deciding.LOOK_AHEAD)
    state = alone.start(0.0)
    made = cycle(state.fail_safe, Car(), 0.1)
    state, outcome = alone.step(state, made)
    assert outcome.action is Action.TRACK
    assert alone.turn(state, outcome.brake_from_s - 0.01)[1].action is Action.TRACK
    assert alone.turn(state, outcome.brake_from_s)[1].action is Action.BRAKE
    for broken in (0.0, math.nan):
        assert alone.turn(state, broken)[1].action is Action.BRAKE


def test_every_violation_is_listed_once() -> None:
    state = POLICIES.start(0.0)
    made = cycle(state.fail_safe, Car(), 0.1, finished_s=0.5)
    _, outcome = POLICIES.step(state, made)
    names = [violation.hypothesis for violation in outcome.violations]
    assert names == [Hypothesis.AGE]
    assert outcome.alert is None


def test_a_run_decided_by_both_never_tracks_against_either() -> None:
    record = run([0.5] * GENES, World(late=0.0))
    for outcome in record.outcomes:
        both = outcome.look_ahead.action is outcome.fail_safe.action is Action.TRACK
        assert (outcome.action is Action.TRACK) == both


def test_settings_that_cannot_be_are_refused() -> None:
    for change in ({"horizon_s": 0.0}, {"horizon_s": math.nan}, {"release_steps": 0}):
        with pytest.raises(InputError, match="LookAhead"):
            dataclasses.replace(AHEAD, **change)
    assert Phase.HOLDING is POLICIES.start(0.0).fail_safe.phase
