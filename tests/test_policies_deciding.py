"""Whoever decides, a permission ends when it must, and FailSafe learns what the car really did."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from policy_cases import cycle, tracking
from policy_runs import FAIL_SAFE, TIMING
from policy_world import nobody, objection

from workbench.claims import Verdict
from workbench.runtime import Action
from workbench.runtime.policies import (
    Cycle,
    Deciding,
    Hypothesis,
    LookAhead,
    Phase,
    Policies,
    PoliciesState,
)

AHEAD = LookAhead(horizon_s=2.0, release_steps=1, timing=TIMING)
INVALID = dataclasses.replace(nobody(), verdict=Verdict.INVALID, reason="no")


def policies(deciding: Deciding) -> Policies:
    return Policies(look_ahead=AHEAD, fail_safe=FAIL_SAFE, deciding=deciding)


def state_of(deciding: Deciding, *, until_s: float = -math.inf) -> tuple[PoliciesState, Cycle]:
    """A car that tracks by a plan of FailSafe's, and the next good cycle about it."""
    drive = tracking()
    start = policies(deciding).start(0.0)
    made = cycle(drive.state, drive.car, drive.now_s, track_intent=nobody())
    return PoliciesState(start.look_ahead, drive.state, until_s), made


def step(deciding: Deciding, **changes: Any) -> tuple[PoliciesState, Any, Cycle]:
    state, made = state_of(deciding)
    made = dataclasses.replace(made, **changes)
    return *policies(deciding).step(state, made), made


def test_look_ahead_s_track_expires_after_period_latency_and_gap() -> None:
    state, outcome, made = step(Deciding.LOOK_AHEAD)
    assert outcome.action is Action.TRACK
    assert state.tracks_until_s == outcome.brake_from_s == made.stamp_s + TIMING.switch_s[1]
    state, outcome, made = step(Deciding.LOOK_AHEAD, track_intent=objection())
    assert outcome.action is Action.BRAKE
    assert state.tracks_until_s == outcome.brake_from_s == made.finished_s


@pytest.mark.parametrize("deciding", [Deciding.BOTH, Deciding.FAIL_SAFE])
def test_where_fail_safe_decides_its_plan_says_when_to_brake(deciding: Deciding) -> None:
    state, outcome, made = step(deciding)
    assert outcome.action is Action.TRACK
    assert state.fail_safe.plan is not None
    assert outcome.brake_from_s == state.fail_safe.plan.switch_s[0] > made.finished_s
    assert state.tracks_until_s == -math.inf


@pytest.mark.parametrize("deciding", list(Deciding))
def test_an_objection_counts_where_both_decide_and_is_heard_by_its_own(deciding: Deciding) -> None:
    _, outcome, _ = step(deciding, track_intent=objection())
    assert (outcome.action is Action.TRACK) is (deciding is Deciding.FAIL_SAFE)
    heard = {each.policy for each in outcome.heard}
    both = {"LookAhead", "FailSafe"}
    assert heard == (both if deciding is Deciding.BOTH else {deciding.value})


def test_a_violation_that_both_find_is_named_once() -> None:
    _, outcome, _ = step(Deciding.BOTH, fault="rounding")
    assert [each.hypothesis for each in outcome.violations] == [Hypothesis.ARITHMETIC]
    assert outcome.look_ahead.violations == outcome.fail_safe.violations


@pytest.mark.parametrize("deciding", list(Deciding))
def test_a_missed_cycle_never_prolongs_a_permission(deciding: Deciding) -> None:
    for until_s in (-math.inf, math.inf):
        state, made = state_of(deciding, until_s=until_s)
        now_s = made.stamp_s + 0.01
        after, outcome = policies(deciding).missed(state, INVALID, now_s=now_s)
        assert after.tracks_until_s == min(until_s, now_s)
        assert outcome.action is Action.BRAKE
        assert outcome.alert is not None
        plan = state.fail_safe.plan
        assert plan is not None
        ahead = deciding is Deciding.LOOK_AHEAD
        assert outcome.brake_from_s == (now_s if ahead else plan.switch_s[0])


def test_where_look_ahead_decides_the_turn_tracks_until_the_instant_and_no_longer() -> None:
    state, made = state_of(Deciding.LOOK_AHEAD, until_s=1000.0)
    alone = policies(Deciding.LOOK_AHEAD)
    for now_s, action in (
        (made.stamp_s, Action.TRACK),
        (math.nextafter(1000.0, 0.0), Action.TRACK),
        (1000.0, Action.BRAKE),
    ):
        _, turn = alone.turn(state, now_s)
        assert turn.action is action
    _, turn = alone.turn(state, state.fail_safe.clock_s - 1.0)
    assert turn.violation is not None
    assert (turn.violation.hypothesis, turn.action) == (Hypothesis.CLOCK, Action.BRAKE)


def test_a_car_that_tracks_on_has_left_its_plan_and_one_that_brakes_must_show_standstill() -> None:
    alone = policies(Deciding.LOOK_AHEAD)
    state, _ = state_of(Deciding.LOOK_AHEAD, until_s=1000.0)
    plan = state.fail_safe.plan
    assert plan is not None
    # FailSafe would brake at the switch; LookAhead tracks on.
    on, turn = alone.turn(state, plan.switch_s[1])
    assert turn.action is Action.TRACK
    assert (on.fail_safe.phase, on.fail_safe.plan) == (Phase.TRACKING, None)
    assert on.fail_safe.begun_s == state.fail_safe.begun_s
    # FailSafe would track; LookAhead's permission is over.
    over = dataclasses.replace(state, tracks_until_s=0.0)
    now_s = state.fail_safe.clock_s + 1e-3
    off, turn = alone.turn(over, now_s)
    assert turn.action is Action.BRAKE
    assert (off.fail_safe.phase, off.fail_safe.plan) == (Phase.HOLDING, None)
    assert (off.fail_safe.braking_s, off.fail_safe.stands_s) == (now_s, math.inf)
    kept = (state.fail_safe.stamp_s, state.fail_safe.scene)
    assert (off.fail_safe.stamp_s, off.fail_safe.scene) == kept
    # A car that begins to track where FailSafe holds has begun now.
    begun, turn = alone.turn(dataclasses.replace(off, tracks_until_s=1000.0), now_s + 1e-3)
    assert turn.action is Action.TRACK
    assert begun.fail_safe.begun_s == now_s + 1e-3


def test_after_a_brake_that_was_sent_anyway_nothing_is_permitted() -> None:
    state, _ = state_of(Deciding.LOOK_AHEAD, until_s=1000.0)
    held = policies(Deciding.LOOK_AHEAD).held(state, 50.0)
    assert held.tracks_until_s == -math.inf
    assert (held.fail_safe.phase, held.fail_safe.plan) == (Phase.HOLDING, None)
    assert held.fail_safe.braking_s == 50.0
    assert held.look_ahead == state.look_ahead
