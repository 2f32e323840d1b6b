"""FailSafe names every hypothesis that fails, carries out its plan or brakes, and stays latched."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from policy_cases import CHECK_S, PERIOD_S, Drive, changed_person, cycle, person, tracking
from policy_runs import FAIL_SAFE, TIMING
from policy_world import BRAKE, LIMITS, Car, measured

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.runtime import Action
from workbench.runtime.person_guard import Disc, Guard
from workbench.runtime.policies import (
    Hypothesis,
    Phase,
    Relation,
    SeenPerson,
    Watched,
)
from workbench.sets import Box


def test_a_start_needs_standstill_shown_and_then_tracks() -> None:
    drive = Drive()
    first = drive.ask()
    assert (first.action, first.verdict) == (Action.BRAKE, Verdict.SAFE)
    assert "not known to stand" in first.reason
    # Standing is shown once the brake has had the time to stop what was measured.
    drive.send(BRAKE.stop_s(0.05) + 0.01)
    needed = FAIL_SAFE.start_s(drive.state, drive.now_s)
    assert needed is not None
    assert needed[0] == 0.0
    assert needed[1] > TIMING.latency_s + TIMING.send_gap_s
    granted = drive.ask()
    assert granted.action is Action.TRACK
    assert drive.state.phase is Phase.HOLDING
    assert drive.send(drive.now_s + 0.01) == [Action.TRACK]
    assert drive.state.phase is Phase.TRACKING


def test_a_start_whose_turn_never_comes_is_withdrawn() -> None:
    drive = Drive()
    drive.ask()
    drive.send(BRAKE.stop_s(0.05) + 0.01)
    assert drive.ask().action is Action.TRACK
    drive.now_s += TIMING.send_gap_s + 0.01
    assert drive.send(drive.now_s + 0.05) == [Action.BRAKE] * 5
    assert drive.state.offer is None


def test_no_check_at_all_carries_out_the_plan_within_its_switch_interval() -> None:
    drive = tracking()
    plan = drive.state.plan
    assert plan is not None
    sent = drive.send(plan.standstill_s - 0.02)
    # The bound is no earlier than the stop and not much later.
    assert drive.car.speed_mps == 0.0
    assert plan.switch_s[1] + BRAKE.delay_s < plan.standstill_s < plan.switch_s[1] + 1.2
    switch = sent.index(Action.BRAKE)
    assert Action.TRACK not in sent[switch:]
    assert plan.switch_s[0] <= drive.state.braking_s <= plan.switch_s[1]
    assert drive.state.stands_s == plan.standstill_s
    drive.send(plan.standstill_s + 0.01)
    assert drive.on().action is Action.TRACK


def _breaks(drive: Drive) -> dict[str, tuple[dict[str, Any], Hypothesis, bool]]:
    t = drive.now_s
    here = person("Ann", t).guard
    far = Disc(here.position.x + 1.2, here.position.y, here.position.radius)
    fast = Disc(2.0, 1.9, here.velocity.radius)
    near = SeenPerson("Bob", Guard(t, Disc(9.0, 6.0, 0.4), Disc(0.0, 0.0, 0.1), LIMITS))
    behind = measured(dataclasses.replace(drive.car, station_m=drive.car.station_m - 1.0), 0.0, 0.0)
    return {
        "late": ({"finished_s": t + PERIOD_S + 0.2}, Hypothesis.AGE, False),
        "old": ({"stamp_s": t - 0.2}, Hypothesis.AGE, False),
        "fault": ({"fault": "rounding is not to nearest"}, Hypothesis.ARITHMETIC, False),
        "backwards": ({"finished_s": t - 0.5}, Hypothesis.CLOCK, True),
        "never": ({"finished_s": math.nan}, Hypothesis.CLOCK, True),
        "elsewhere": ({"measured": (behind,)}, Hypothesis.STATE, True),
        "jumped": ({"people": (changed_person(t, position=far),)}, Hypothesis.PEOPLE, True),
        "ran": ({"people": (changed_person(t, velocity=fast),)}, Hypothesis.PEOPLE, True),
        "lost": ({"people": ()}, Hypothesis.NOBODY_LOST, False),
        "new": ({"people": (person("Ann", t), near)}, Hypothesis.NOBODY_NEW, True),
    }


@pytest.mark.parametrize("name", list(_breaks(tracking())))
def test_a_violation_is_named_and_brakes_to_standstill(name: str) -> None:
    drive = tracking()
    plan = drive.state.plan
    assert plan is not None
    changes, hypothesis, refutes = _breaks(drive)[name]
    outcome = drive.ask(**changes)
    assert outcome.action is Action.BRAKE
    assert hypothesis in [violation.hypothesis for violation in outcome.violations]
    assert hypothesis.name in outcome.reason
    assert any(violation.refutes_plan for violation in outcome.violations) == refutes
    if refutes:
        assert drive.state.phase is Phase.HOLDING
        assert drive.state.plan is None
    else:
        assert drive.state.plan is plan
        assert outcome.brake_from_s == plan.switch_s[0]
    # However good the next cycles are, nothing follows before standstill.
    while drive.car.speed_mps > 0.0:
        drive.now_s = round(drive.now_s + 0.01, 6)
        moving = drive.car.speed_mps
        assert drive.ask().action is Action.BRAKE
        sent = drive.send(drive.now_s + PERIOD_S - CHECK_S)
        if drive.state.phase is Phase.HOLDING:
            assert sent[-1] is Action.BRAKE
        assert drive.car.speed_mps <= moving + PERIOD_S
    for _ in range(20):
        resumed = drive.on()
    # Bob, who was seen once, is lost from then on.
    assert (resumed.action is Action.TRACK) == (name != "new")


def test_a_plan_that_was_overtaken_by_its_switch_is_named_by_the_sender() -> None:
    drive = tracking()
    plan = drive.state.plan
    assert plan is not None
    state, turn = drive.policy.turn(drive.state, plan.switch_s[0])
    assert turn.action is Action.BRAKE
    assert turn.violation is not None
    assert turn.violation.hypothesis is Hypothesis.ON_TIME
    assert state.stands_s == plan.standstill_s
    state, turn = drive.policy.turn(drive.state, plan.switch_s[1] + 0.01)
    assert turn.violation is not None
    assert turn.violation.hypothesis is Hypothesis.SENDER
    assert state.stands_s == math.inf
    state, turn = drive.policy.turn(drive.state, plan.switch_s[0] - 1e-6)
    assert turn.action is Action.TRACK
    for broken in (drive.now_s - 1.0, math.nan, math.inf):
        state, turn = drive.policy.turn(drive.state, broken)
        assert turn.violation is not None
        assert turn.violation.hypothesis is Hypothesis.CLOCK
        assert (turn.action, state.phase) == (Action.BRAKE, Phase.HOLDING)


def test_a_check_must_end_before_the_switch_begins() -> None:
    drive = tracking()
    plan = drive.state.plan
    assert plan is not None
    first = plan.switch_s[0]
    for end_s, on_time in ((math.nextafter(first, 0.0), True), (first, False)):
        stamp_s = first - CHECK_S
        made = cycle(drive.state, drive.car, stamp_s)
        made = dataclasses.replace(made, finished_s=end_s)
        _, outcome = drive.policy.step(drive.state, made)
        late = [v for v in outcome.violations if v.hypothesis is Hypothesis.ON_TIME]
        assert (not late) == on_time


def test_a_plan_brakes_a_grain_inside_of_what_was_asked_about() -> None:
    plan = tracking().state.plan
    assert plan is not None
    low, high = (plan.scene.stamp_s + end for end in TIMING.switch_s)
    assert low < plan.switch_s[0] < plan.switch_s[1] < high
    assert plan.switch_s[1] - plan.switch_s[0] >= TIMING.send_gap_s


def test_standstill_is_shown_only_by_what_was_measured_under_brake() -> None:
    drive = tracking()
    plan = drive.state.plan
    assert plan is not None
    drive.state, turn = drive.policy.turn(drive.state, plan.switch_s[0])
    assert turn.action is Action.BRAKE
    slow = Car(drive.car.station_m, 0.0)
    for stamp_s, shown in ((plan.switch_s[0] - 0.02, False), (plan.switch_s[0] + 0.02, True)):
        made = cycle(drive.state, slow, stamp_s)
        state, _ = drive.policy.step(dataclasses.replace(drive.state, plan=None), made)
        assert (state.stands_s < plan.standstill_s) == shown


def test_braking_counts_from_when_it_was_first_commanded() -> None:
    drive = tracking()
    behind = measured(dataclasses.replace(drive.car, station_m=-9.0), 0.0, 0.0)
    drive.ask(measured=(behind,))
    # No turn has sent BRAKE yet: what is measured now says nothing about when the car stands.
    assert drive.state.braking_s == math.inf
    assert drive.ask().brake_from_s == drive.now_s
    assert drive.state.stands_s == math.inf
    begun_s = drive.now_s + 0.01
    drive.send(begun_s + 0.04)
    assert drive.state.braking_s == begun_s
    drive.ask(people=(changed_person(drive.now_s, velocity=Disc(9.0, 0.0, 0.1)),))
    assert drive.state.braking_s == begun_s


def test_a_speed_that_may_be_zero_does_not_contradict_standstill() -> None:
    drive = Drive()
    drive.on(6)
    state = dataclasses.replace(FAIL_SAFE.start(0.0), stands_s=0.0)
    for low, named in ((0.0, False), (1e-9, True)):
        box = Box(("station", "speed"), (-0.1, low), (0.1, 0.1))
        _, outcome = drive.policy.step(state, cycle(state, Car(), 9.0, measured=(box,)))
        found = [v.hypothesis for v in outcome.violations]
        assert (Hypothesis.STANDSTILL in found) == named


def test_another_policy_may_object_and_the_plan_is_carried_out() -> None:
    drive = tracking()
    made = cycle(drive.state, drive.car, drive.now_s)
    state, outcome = drive.policy.step(drive.state, made, consent=False)
    assert (outcome.action, outcome.verdict) == (Action.BRAKE, Verdict.SAFE)
    assert state.phase is Phase.CLOSING
    assert state.plan is drive.state.plan


def test_a_car_that_moves_where_it_must_stand_is_named() -> None:
    drive = tracking()
    drive.send(drive.now_s + 3.0)
    rolling = measured(Car(drive.car.station_m, 0.4), 0.0, 0.0)
    outcome = drive.ask(measured=(rolling,))
    assert [v.hypothesis for v in outcome.violations] == [Hypothesis.STANDSTILL]
    assert drive.state.stands_s == math.inf


def test_the_new_guard_may_be_required_inside_the_old_one() -> None:
    strict = dataclasses.replace(FAIL_SAFE, required=Relation.INSIDE)
    drive = tracking()
    wide = dataclasses.replace(person("Ann", drive.now_s).guard.position, radius=0.9)
    people = (changed_person(drive.now_s, position=wide),)
    made = cycle(drive.state, drive.car, drive.now_s, people=people)
    assert FAIL_SAFE.step(drive.state, made)[1].action is Action.TRACK
    outcome = strict.step(drive.state, made)[1]
    assert [v.hypothesis for v in outcome.violations] == [Hypothesis.PEOPLE]
    assert not outcome.violations[0].refutes_plan
    exact = cycle(drive.state, drive.car, drive.now_s)
    assert strict.step(drive.state, exact)[1].action is Action.TRACK


@pytest.mark.parametrize("covers", [True, False])
def test_somebody_assumed_covers_who_appears_and_who_is_lost(covers: bool) -> None:
    drive = tracking()
    t = drive.now_s
    edge = Guard(t, Disc(9.0, 9.0 if covers else 15.0, 3.0), Disc(0.0, 0.0, 2.5), LIMITS)
    assumed = SeenPerson("edge", edge, assumed=True)
    drive.ask(people=(person("Ann", t), assumed))
    new = SeenPerson("Bob", Guard(drive.now_s, Disc(9.0, 9.5, 0.4), Disc(1.0, 0.0, 0.1), LIMITS))
    outcome = drive.ask(people=(person("Ann", drive.now_s), new))
    assert (Hypothesis.NOBODY_NEW in [v.hypothesis for v in outcome.violations]) != covers
    drive = tracking()
    t = drive.now_s
    there = 5.0 + 1.4 * t if covers else 40.0
    behind = Guard(t, Disc(there, 8.0, 3.0), Disc(0.0, 0.0, 2.5), LIMITS)
    outcome = drive.ask(people=(SeenPerson("edge", behind, assumed=True),))
    assert (Hypothesis.NOBODY_LOST in [v.hypothesis for v in outcome.violations]) != covers


def test_people_come_and_go_across_the_watched_edge() -> None:
    drive = tracking()
    x = drive.car.station_m
    far = SeenPerson("far", Guard(drive.now_s, Disc(x, 30.36, 0.4), Disc(0.0, 2.4, 0.1), LIMITS))
    assert drive.ask(people=(person("Ann", drive.now_s), far)).violations == ()
    assert drive.ask(watched=Watched(x, 0.0, 30.0)).violations == ()


def test_whoever_was_lost_is_remembered_while_the_car_stands() -> None:
    drive = Drive()
    drive.on(1)
    for _ in range(5):
        outcome = drive.ask(people=())
        drive.send(drive.now_s + 0.2)
        assert [v.hypothesis for v in outcome.violations] == [Hypothesis.NOBODY_LOST]
    assert drive.on().action is Action.TRACK


def test_settings_that_check_nothing_are_refused() -> None:
    for change in ({"level": -1}, {"unseen_speed_mps": 0.0}, {"required": Relation.OUTSIDE}):
        with pytest.raises(InputError, match="FailSafe"):
            dataclasses.replace(FAIL_SAFE, **change)
