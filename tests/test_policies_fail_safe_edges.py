"""FailSafe's instants count to their edges, and each violation says whether it refutes the plan."""

from __future__ import annotations

import dataclasses
import math

import pytest
from policy_cases import Drive, cycle, tracking
from policy_runs import FAIL_SAFE, TIMING
from policy_world import BRAKE, nobody

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.runtime import Action
from workbench.runtime.policies import (
    FailSafe,
    FailSafeState,
    Hypothesis,
    Phase,
    Watched,
)
from workbench.runtime.policies.horizon import GRAIN_S
from workbench.runtime.policies.plan import Plan, proved_standstill_s
from workbench.sets import Box


def planned() -> tuple[FailSafeState, Plan]:
    state = tracking().state
    assert state.plan is not None
    return state, state.plan


def offered() -> Drive:
    """A car at standstill that may begin."""
    drive = Drive()
    drive.ask()
    drive.send(BRAKE.stop_s(0.05) + 0.01)
    assert drive.ask().action is Action.TRACK
    return drive


@pytest.mark.parametrize(("speed_mps", "refused"), [(0.5, False), (math.inf, True), (0.0, True)])
def test_the_speed_of_the_unseen_is_positive_and_finite(speed_mps: float, refused: bool) -> None:
    if refused:
        with pytest.raises(InputError, match="unseen_speed_mps"):
            dataclasses.replace(FAIL_SAFE, unseen_speed_mps=speed_mps)
    else:
        assert dataclasses.replace(FAIL_SAFE, unseen_speed_mps=speed_mps)


def test_track_is_in_force_from_the_very_instant_at_which_it_was_commanded() -> None:
    state, _ = planned()
    assert FAIL_SAFE.start_s(state, state.begun_s) is None
    assert FAIL_SAFE.start_s(state, state.begun_s + 1.0) is None
    before = FAIL_SAFE.start_s(state, state.begun_s - 0.5)
    assert before == pytest.approx((0.5 - GRAIN_S, 0.5 + GRAIN_S), abs=1e-12)


def test_no_tube_is_asked_to_begin_before_its_stamp() -> None:
    state, _ = planned()
    needed = FAIL_SAFE.start_s(state, state.begun_s - 0.5 * GRAIN_S)
    assert needed is not None
    assert needed[0] == 0.0


def test_a_clock_that_runs_backwards_refutes_the_plan() -> None:
    state, _ = planned()
    for now_s in (state.clock_s - 1e-3, math.inf, math.nan):
        braked, turn = FAIL_SAFE.turn(state, now_s)
        assert turn.violation is not None
        assert (turn.violation.hypothesis, turn.violation.refutes_plan) == (Hypothesis.CLOCK, True)
        assert (turn.action, braked.plan) == (Action.BRAKE, None)
        answer = dataclasses.replace(nobody(), verdict=Verdict.INVALID)
        _, outcome = FAIL_SAFE.missed(state, answer, now_s=now_s)
        assert [each.refutes_plan for each in outcome.violations] == [True]


def test_every_turn_is_remembered_as_the_latest_instant() -> None:
    state, plan = planned()
    for now_s in (state.clock_s, state.clock_s + 1e-3, plan.switch_s[0], plan.switch_s[1]):
        after, _ = FAIL_SAFE.turn(state, now_s)
        assert after.clock_s == now_s
    tracked, _ = FAIL_SAFE.turn(state, state.clock_s + 2e-3)
    _, turn = FAIL_SAFE.turn(tracked, state.clock_s + 1e-3)
    assert turn.violation is not None


def test_the_switch_interval_holds_both_its_ends() -> None:
    state, plan = planned()
    first, last = plan.switch_s
    assert FAIL_SAFE.turn(state, math.nextafter(first, 0.0))[1].action is Action.TRACK
    for now_s in (first, last):
        held, turn = FAIL_SAFE.turn(state, now_s)
        assert turn.action is Action.BRAKE
        assert held.stands_s == plan.standstill_s
        assert turn.violation is not None
        # Nothing is wrong with a plan that is carried out for want of another.
        assert turn.violation.hypothesis is Hypothesis.ON_TIME
        assert not turn.violation.refutes_plan
    braked, turn = FAIL_SAFE.turn(state, math.nextafter(last, math.inf))
    assert turn.violation is not None
    assert turn.violation.hypothesis is Hypothesis.SENDER
    assert turn.violation.refutes_plan
    assert braked.plan is None


@pytest.mark.parametrize("end", [0, 1])
def test_an_offer_is_taken_at_both_ends_of_its_start(end: int) -> None:
    state = offered().state
    assert state.offer is not None
    assert state.offer.start_s is not None
    now_s = state.offer.start_s[end]
    begun, turn = FAIL_SAFE.turn(state, now_s)
    assert (turn.action, begun.phase, begun.begun_s) == (Action.TRACK, Phase.TRACKING, now_s)
    late, turn = FAIL_SAFE.turn(state, math.nextafter(state.offer.start_s[1], math.inf))
    assert (turn.action, late.offer) == (Action.BRAKE, None)


def test_a_car_must_stand_at_the_very_instant_for_which_it_was_proved() -> None:
    state, plan = planned()
    held, _ = FAIL_SAFE.turn(state, plan.switch_s[0])
    drive = tracking()
    for stamp_s, moves in ((plan.standstill_s, True), (plan.standstill_s - 1e-3, False)):
        made = cycle(held, drive.car, stamp_s)
        _, outcome = FAIL_SAFE.step(held, made)
        named = {each.hypothesis: each.refutes_plan for each in outcome.violations}
        assert named.get(Hypothesis.STANDSTILL, False) is moves


def test_standstill_counts_from_the_last_instant_at_which_brake_may_be_commanded() -> None:
    drive = tracking()
    made = cycle(drive.state, drive.car, drive.now_s)
    state, _ = FAIL_SAFE.step(drive.state, made)
    assert state.plan is not None
    stop, names = made.stop_guard, made.measured[0].names
    last_s = proved_standstill_s(stop.tube, names, switch_by_s=stop.switch_s[1], brake=BRAKE)
    assert state.plan.standstill_s == made.stamp_s + last_s
    wide = dataclasses.replace(stop, switch_s=(0.0, stop.switch_s[1]))
    again, _ = FAIL_SAFE.step(drive.state, dataclasses.replace(made, stop_guard=wide))
    assert again.plan is not None
    assert again.plan.standstill_s == state.plan.standstill_s


@pytest.mark.parametrize(("less", "enough"), [(0.0, True), (1e-9, False)])
def test_the_watched_room_beyond_the_tube_is_what_the_unseen_walk_until_standstill(
    less: float, enough: bool
) -> None:
    drive = tracking()
    made = cycle(drive.state, drive.car, drive.now_s)
    stop, names = made.stop_guard, made.measured[0].names
    stands_s = proved_standstill_s(stop.tube, names, switch_by_s=stop.switch_s[1], brake=BRAKE)
    room_m = FAIL_SAFE.unseen_speed_mps * stands_s
    # Differences from 0 are exact.
    near = dataclasses.replace(
        made,
        watched=Watched(made.watched.x_m, made.watched.y_m, room_m * (1.0 - less)),
        stop_guard=dataclasses.replace(stop, farthest_m=0.0),
    )
    _, outcome = FAIL_SAFE.step(drive.state, near)
    assert ("are watched beyond the tube" in outcome.reason) is not enough


def test_the_level_that_is_asked_about_is_the_one_that_is_measured() -> None:
    drive = tracking()
    made = cycle(drive.state, drive.car, drive.now_s)
    (small,) = made.measured
    elsewhere = Box(small.names, (-90.0, 0.0), (-80.0, 0.0))
    second = FailSafe(
        level=1, timing=TIMING, brake=BRAKE, required=FAIL_SAFE.required,
        unseen_speed_mps=FAIL_SAFE.unseen_speed_mps,
    )  # fmt: skip
    both = dataclasses.replace(made, measured=(elsewhere, small))
    assert second.step(drive.state, both)[1].action is Action.TRACK
    assert FAIL_SAFE.step(drive.state, both)[1].action is Action.BRAKE


def test_the_next_plan_may_begin_at_the_very_instant_of_standstill() -> None:
    drive = tracking()
    plan = drive.state.plan
    assert plan is not None
    drive.send(plan.switch_s[1] + 0.01)
    assert drive.state.phase is Phase.HOLDING
    drive.send(plan.standstill_s + 0.02)
    for stands_s, stands in ((drive.now_s, True), (math.nextafter(drive.now_s, math.inf), False)):
        state = dataclasses.replace(drive.state, stands_s=stands_s, braking_s=math.inf)
        made = cycle(state, drive.car, drive.now_s)
        after, outcome = FAIL_SAFE.step(state, made)
        assert (after.offer is not None) is stands
        assert (outcome.action is Action.TRACK) is stands


def test_a_holding_car_is_told_of_the_brake_in_force_or_of_the_switch_that_is_offered() -> None:
    drive = Drive()
    refused = drive.ask()
    assert refused.action is Action.BRAKE
    assert refused.brake_from_s == drive.state.braking_s
    state = offered().state
    made = cycle(state, drive.car, state.clock_s + 0.01)
    after, outcome = FAIL_SAFE.step(state, made)
    assert after.offer is not None
    assert outcome.action is Action.TRACK
    assert outcome.brake_from_s == after.offer.switch_s[0]
    # While a plan is carried out, BRAKE has been sent since the switch.
    moving, plan = planned()
    braking, _ = FAIL_SAFE.turn(moving, plan.switch_s[0])
    answer = dataclasses.replace(nobody(), verdict=Verdict.INVALID)
    _, told = FAIL_SAFE.missed(braking, answer, now_s=plan.switch_s[0] + 0.05)
    assert told.brake_from_s == plan.switch_s[0]
    _, told = FAIL_SAFE.missed(moving, answer, now_s=moving.clock_s)
    assert told.brake_from_s == plan.switch_s[0]
