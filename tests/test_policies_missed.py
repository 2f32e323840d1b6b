"""A cycle of which nothing can be said does what a failed check does, and refutes nothing."""

from __future__ import annotations

import dataclasses
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from policy_cases import Drive, cycle, tracking
from policy_runs import FAIL_SAFE, POLICIES, TIMING
from policy_world import Car

from workbench.claims import Verdict
from workbench.runtime import Action
from workbench.runtime.policies import (
    Answer,
    Deciding,
    Hypothesis,
    LookAhead,
    Phase,
    Policies,
    PoliciesState,
)

UNKNOWN = Answer(Verdict.INVALID, "invalid: no state", None, None, None, 0.0)


def _miss(drive: Drive) -> None:
    drive.state, outcome = drive.policy.missed(drive.state, UNKNOWN, now_s=drive.now_s)
    assert (outcome.verdict, outcome.action) == (Verdict.INVALID, Action.BRAKE)
    assert outcome.reason == "no new plan: invalid: no state"
    assert outcome.violations == ()


def _fail(drive: Drive) -> None:
    made = cycle(drive.state, drive.car, drive.now_s)
    stop = dataclasses.replace(made.stop_guard, answer=UNKNOWN)
    made = dataclasses.replace(made, stop_guard=stop, finished_s=drive.now_s)
    drive.state, outcome = drive.policy.step(drive.state, made)
    assert outcome.action is Action.BRAKE
    assert outcome.violations == ()


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 12), st.floats(0.0, 0.2))
def test_after_a_miss_the_same_is_sent_as_after_a_failed_check(cycles: int, after_s: float) -> None:
    sent = []
    for act in (_miss, _fail):
        drive = Drive()
        drive.on(cycles)
        drive.send(drive.now_s + after_s)
        act(drive)
        phase = drive.state.phase
        assert phase is not Phase.TRACKING
        sent.append((phase, drive.send(drive.now_s + 1.5)))
        assert sent[-1][1][-1] is Action.BRAKE
    assert sent[0] == sent[1]


def test_a_miss_carries_the_plan_in_force_out_and_nothing_replaces_it() -> None:
    drive = tracking()
    plan = drive.state.plan
    assert plan is not None
    _miss(drive)
    assert (drive.state.phase, drive.state.plan) == (Phase.CLOSING, plan)
    outcome = drive.ask()
    assert outcome.reason == "no new plan: the plan in force is being carried out"
    assert outcome.brake_from_s == plan.switch_s[0]
    actions = drive.send(plan.switch_s[1] + 0.5)
    switched = actions.index(Action.BRAKE)
    assert set(actions[:switched]) == {Action.TRACK}
    assert set(actions[switched:]) == {Action.BRAKE}
    assert drive.state.stands_s == plan.standstill_s


def test_a_miss_at_standstill_withdraws_the_offer_and_keeps_what_is_known() -> None:
    drive = Drive()
    for _ in range(9):
        if drive.ask().action is Action.TRACK:
            break
        drive.send(drive.now_s + 0.05)
    assert drive.state.offer is not None
    before = drive.state
    _miss(drive)
    assert drive.state == dataclasses.replace(before, offer=None)
    assert drive.send(drive.now_s + 0.05) == [Action.BRAKE] * 5


@pytest.mark.parametrize("now_s", [math.nan, math.inf, -1.0])
def test_a_miss_at_no_instant_brakes_at_once(now_s: float) -> None:
    drive = tracking()
    state, outcome = drive.policy.missed(drive.state, UNKNOWN, now_s=now_s)
    assert [violation.hypothesis for violation in outcome.violations] == [Hypothesis.CLOCK]
    assert (state.phase, state.plan) == (Phase.HOLDING, None)
    assert state.clock_s == drive.state.clock_s
    ahead = LookAhead(horizon_s=2.0, release_steps=1, timing=TIMING)
    kept, _ = ahead.missed(ahead.start(5.0), UNKNOWN, now_s=now_s)
    assert kept.clock_s == 5.0


def test_look_ahead_brakes_warns_everybody_and_counts_from_the_start_again() -> None:
    ahead = LookAhead(horizon_s=2.0, release_steps=2, timing=TIMING)
    state, outcome = ahead.missed(ahead.start(0.0), UNKNOWN, now_s=1.0)
    assert (outcome.verdict, outcome.action) == (Verdict.INVALID, Action.BRAKE)
    assert outcome.alert is not None
    assert outcome.alert.person is None
    made = [cycle(FAIL_SAFE.start(0.0), Car(), stamp_s) for stamp_s in (1.1, 1.2)]
    actions = []
    for each in made:
        state, outcome = ahead.step(state, each)
        actions.append(outcome.action)
    assert actions == [Action.BRAKE, Action.TRACK]


@pytest.mark.parametrize("deciding", Deciding)
def test_what_is_sent_after_a_miss_follows_who_decides(deciding: Deciding) -> None:
    policies = dataclasses.replace(POLICIES, deciding=deciding)
    state, now_s = _driven(policies)
    state, outcome = policies.missed(state, UNKNOWN, now_s=now_s)
    assert outcome.action is Action.BRAKE
    assert {each.verdict for each in outcome.heard} == {Verdict.INVALID}
    assert len(outcome.heard) == (2 if deciding is Deciding.BOTH else 1)
    _, turn = policies.turn(state, now_s)
    alone = deciding is Deciding.LOOK_AHEAD
    assert turn.action is (Action.BRAKE if alone else Action.TRACK)
    plan = state.fail_safe.plan
    if not alone:
        assert plan is not None
        assert outcome.brake_from_s == plan.switch_s[0] > now_s
    else:
        assert outcome.brake_from_s == now_s


def _driven(policies: Policies) -> tuple[PoliciesState, float]:
    """Cycles of a car that stands, until TRACK is sent."""
    state, now_s = policies.start(0.0), 0.0
    for _ in range(20):
        now_s += 0.05
        made = cycle(state.fail_safe, Car(), now_s)
        now_s = made.finished_s
        state, _ = policies.step(state, made)
        state, turn = policies.turn(state, now_s)
        if turn.action is Action.TRACK and state.fail_safe.plan is not None:
            return state, now_s
    pytest.fail("TRACK was never sent")
