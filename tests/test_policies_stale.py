"""An observation no newer than the last says nothing of car and people, and erases nothing."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from policy_cases import Drive, changed_person, cycle, tracking
from policy_runs import FAIL_SAFE, POLICIES
from policy_world import Car, measured, nobody, objection

from workbench.errors import InputError
from workbench.runtime import Action
from workbench.runtime.person_guard import Disc
from workbench.runtime.policies import Deciding, Hypothesis, Phase


def _elsewhere(drive: Drive) -> dict[str, dict[str, Any]]:
    behind = measured(dataclasses.replace(drive.car, station_m=drive.car.station_m - 1.0), 0.0, 0.0)
    ran = changed_person(drive.now_s, velocity=Disc(9.0, 0.0, 0.1))
    return {"state": {"measured": (behind,)}, "people": {"people": (ran,)}}


@pytest.mark.parametrize("what", ["state", "people"])
@pytest.mark.parametrize("earlier_s", [0.0, 0.3])
def test_what_is_old_refutes_no_plan(what: str, earlier_s: float) -> None:
    drive = tracking()
    drive.ask()
    plan, stamp_s = drive.state.plan, drive.state.stamp_s
    outcome = drive.ask(stamp_s=stamp_s - earlier_s, **_elsewhere(drive)[what])
    assert [v.hypothesis for v in outcome.violations] == [Hypothesis.AGE]
    assert (drive.state.plan, drive.state.phase) == (plan, Phase.CLOSING)
    assert drive.state.stamp_s == stamp_s


def test_what_is_old_erases_nobody_and_shows_no_standstill() -> None:
    drive = Drive()
    drive.on(2)
    scene, stands_s, stamp_s = drive.state.scene, drive.state.stands_s, drive.state.stamp_s
    slow = measured(Car(drive.car.station_m, 0.0), 0.0, 0.0)
    for earlier_s in (0.0, 0.01):
        outcome = drive.ask(stamp_s=stamp_s - earlier_s, people=(), measured=(slow,))
        assert [v.hypothesis for v in outcome.violations] == [Hypothesis.AGE]
        assert (drive.state.scene, drive.state.stands_s) == (scene, stands_s)


def test_an_old_stamp_makes_no_later_one_new() -> None:
    state = POLICIES.start(0.0)
    for stamp_s, finished_s in ((1.0, 1.02), (0.9, 1.03), (0.95, 1.04)):
        made = cycle(state.fail_safe, Car(), stamp_s, finished_s=finished_s)
        state, outcome = POLICIES.step(state, made)
        old = [v.hypothesis for v in outcome.violations] == [Hypothesis.AGE]
        assert old == (stamp_s != 1.0)
        assert state.look_ahead.stamp_s == state.fail_safe.stamp_s == 1.0


@pytest.mark.parametrize("deciding", Deciding)
def test_the_alert_is_about_what_the_car_does(deciding: Deciding) -> None:
    policies = dataclasses.replace(POLICIES, deciding=deciding)
    # LookAhead would track; FailSafe brakes, because the car is not known to stand.
    made = cycle(FAIL_SAFE.start(0.0), Car(), 0.1, brake_guard=objection(), track_intent=nobody())
    _, outcome = policies.step(policies.start(0.0), made)
    assert outcome.look_ahead.action is Action.TRACK
    assert (outcome.alert is not None) == (deciding is not Deciding.LOOK_AHEAD)


def test_who_decides_may_be_given_by_value_and_by_no_other_word() -> None:
    for deciding in Deciding:
        given: Any = deciding.value
        assert dataclasses.replace(POLICIES, deciding=given).deciding is deciding
    unknown: Any = "all"
    with pytest.raises(InputError, match=r"\['both', 'LookAhead', 'FailSafe'\], got 'all'"):
        dataclasses.replace(POLICIES, deciding=unknown)


def test_a_broken_clock_is_named_once() -> None:
    state, _ = POLICIES.turn(POLICIES.start(0.0), 5.0)
    made = cycle(state.fail_safe, Car(), 1.0, finished_s=0.5)
    _, outcome = POLICIES.step(state, made)
    named = [v.hypothesis for v in outcome.violations]
    assert named.count(Hypothesis.CLOCK) == 1


def test_a_brake_that_is_carried_out_is_called_that() -> None:
    drive = tracking()
    plan = drive.state.plan
    assert plan is not None
    drive.send(plan.switch_s[1] + 0.01)
    assert drive.ask().reason == "no new plan: BRAKE is carried out to standstill"


def test_at_standstill_too_nobody_is_faster_than_their_own_limit() -> None:
    drive = Drive()
    outcome = drive.ask(people=(changed_person(0.0, velocity=Disc(9.0, 0.0, 0.1)),))
    (found,) = outcome.violations
    assert (found.hypothesis, found.refutes_plan) == (Hypothesis.PEOPLE, True)
