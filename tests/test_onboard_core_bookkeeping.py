"""Each turn tells its monitor, its log and everybody else just what it did, and when."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from onboard_core_bench import Bench, bench, brakes, commander, commands, driven, faults, said
from onboard_core_cases import SETTINGS

from workbench.runtime.decision import Action, Decision
from workbench.runtime.onboard.core import Request, State, TurnResult
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.following import Following
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.times import DECIDE_EVERY

LATENCY_US = round(SETTINGS.timing.latency_s * 1e6)
BRAKE, TRACK = 1, 2
"""DECISION.ACTION."""


def raises(*args: object, **named: object) -> None:
    raise ZeroDivisionError("planted")


def aligned(b: Bench, *, decides: bool = True) -> Bench:
    """With the next turn one that decides, or one that does not."""
    while (b.turns % DECIDE_EVERY == 0) is not decides:
        b.step()
    return b


def permitted(b: Bench, at_us: int) -> Action:
    """What the monitor permits then, as far as it has been told."""
    return b.core._permission.turn(at_us).action


def heard(b: Bench, monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What the monitor is told from now on of turns, holds and new beginnings."""
    told: list[tuple[Any, ...]] = []

    def spied(name: str) -> None:
        says = getattr(b.core._permission, name)

        def say(at_us: int, **named: Any) -> Any:
            told.append((name, at_us, named) if named else (name, at_us))
            return says(at_us, **named)

        monkeypatch.setattr(b.core._permission, name, say)

    for name in ("begin", "turn", "hold"):
        spied(name)
    return told


def announced(result: TurnResult) -> float:
    return said(result)["DECISION"]["ACTION"]


def test_a_fault_that_brakes_ends_the_plan_in_force() -> None:
    b = aligned(driven(), decides=False)
    assert permitted(b, b.at_us) is Action.TRACK
    b.core.bus_error(BusError.ERROR_FRAME, b.at_us - 1)
    result = b.step()
    assert (result.state, faults(result)) == (State.BRAKING, {Fault.ERROR_FRAME})
    assert permitted(b, result.at_us) is Action.BRAKE


def test_a_command_that_cannot_be_made_ends_the_plan_in_force() -> None:
    b = aligned(driven(), decides=False)
    commander(b).silent()
    result = b.step()
    assert (result.state, faults(result)) == (State.BRAKING, {Fault.NOT_COVERED})
    assert permitted(b, result.at_us) is Action.BRAKE


def test_each_turn_is_told_to_the_monitor_once_with_the_end_of_its_decision(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    b = aligned(driven())
    told = heard(b, monkeypatch)
    decides, only_sends = b.step(), b.step()
    b.core.bus_error(BusError.ERROR_FRAME, b.at_us - 1)
    braked = b.step()
    assert decides.decided_us == decides.at_us + b.takes_us
    assert told[:2] == [("turn", decides.decided_us), ("turn", only_sends.at_us)]
    assert [each for each in told if each[0] == "hold"] == [("hold", braked.at_us)]


def test_a_car_that_begins_to_obey_is_a_new_beginning_and_that_turn_belongs_to_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    b = bench()
    b.run(12)
    b.request(Request.ARM)
    b.until(State.ARMED)
    told = heard(b, monkeypatch)
    result = b.until(State.BRAKING)
    now_us = result.at_us if result.decided_us is None else result.decided_us
    station_m = b.core._watch._station_m
    assert station_m is not None
    beginnings = [each for each in told if each[0] == "begin"]
    assert beginnings == [("begin", now_us, {"drives": True, "station_m": station_m})]
    assert told[-2:] == [*beginnings, ("turn", now_us)]
    # What was permitted to a car that did not obey is not permitted to one that does.
    assert permitted(b, now_us) is Action.BRAKE


def test_a_car_that_ceases_to_obey_is_a_new_beginning(monkeypatch: pytest.MonkeyPatch) -> None:
    b = aligned(driven(), decides=False)
    told = heard(b, monkeypatch)
    b.changes["GLOBAL_RPT", "OVERRIDE_STATUS"] = 1
    result = b.step()
    named = {"drives": False, "station_m": b.core._watch._station_m}
    assert result.state is State.YIELDED
    assert told[-2:] == [("begin", result.at_us, named), ("turn", result.at_us)]
    b.step()
    assert len([each for each in told if each[0] == "begin"]) == 1


def test_a_car_left_to_its_driver_is_held_to_nothing() -> None:
    b = driven()
    assert b.core._watch.following.sent != ()
    b.changes["GLOBAL_RPT", "OVERRIDE_STATUS"] = 1
    assert b.step().state is State.YIELDED
    assert b.core._watch.following == Following()


def test_the_helm_follows_the_reference_of_decisions_that_permit_track_and_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    b = aligned(driven())
    followed: list[float] = []
    monkeypatch.setattr(b.core._helm, "follow", followed.append)
    first = b.step()
    assert first.observation is not None
    assert followed == [first.observation.reference_speed_mps]
    assert [b.step().state for _ in range(DECIDE_EVERY - 1)] == [State.TRACKING] * 2
    assert len(followed) == 1
    decide = b.core._permission.decide

    def refused(*args: Any) -> tuple[Decision, int]:
        decision, ended_us = decide(*args)
        return replace(decision, action=Action.BRAKE), ended_us

    # The plan that was permitted before goes on, and with it the reference it was permitted for.
    monkeypatch.setattr(b.core._permission, "decide", refused)
    result = b.step()
    assert result.decision is not None
    assert (result.state, result.decision.action) == (State.TRACKING, Action.BRAKE)
    assert len(followed) == 1


@pytest.mark.parametrize(("takes_us", "late"), [(LATENCY_US, False), (LATENCY_US + 1, True)])
def test_a_decision_beyond_the_latency_is_a_fault_of_its_turn_alone(
    takes_us: int, late: bool
) -> None:
    b = bench()
    b.run(12)
    b.takes_us = takes_us
    assert (Fault.OVERRUN in faults(b.step())) is late
    assert Fault.OVERRUN not in faults(b.step())


def test_a_fault_is_told_when_it_comes_and_when_it_goes_and_not_between() -> None:
    b = bench()
    first = b.step()
    assert first.faults != ()
    assert first.events == tuple(f"{found}" for found in first.faults)
    assert b.step().events == ("STALE_REPORT is over",)
    lasting = b.step()
    assert lasting.faults != ()
    assert lasting.events == ()


def test_a_state_that_changes_is_told_with_the_answer_to_the_request() -> None:
    b = bench()
    b.run(12)
    b.request(Request.ARM)
    armed = "armed; speed and steering reports were not compared"
    assert b.step().events == (armed, "DISARMED -> ARMED")
    assert b.step().events == ()


def test_who_arms_is_told_over_which_way_the_reports_agree() -> None:
    b = bench()
    b.run(12)
    b.core._watch._agreement = replace(b.core._watch._agreement, agreed_m=12.34)
    b.request(Request.ARM)
    assert b.step().events[0] == (
        "armed; speed and steering reports agree with localisation over 12.3 m"
    )


def test_an_observation_is_told_of_turns_that_decided_and_of_no_other() -> None:
    b = aligned(driven())
    decided, between = b.step(), b.step()
    assert decided.decision is not None
    assert decided.observation is not None
    assert (between.decision, between.observation) == (None, None)


def test_turns_that_decide_announce_it_and_the_others_only_their_state() -> None:
    b = aligned(driven())
    own = [said(b.step()).keys() & {"HEARTBEAT", "DECISION"} for _ in range(2 * DECIDE_EVERY)]
    assert own == [{"HEARTBEAT", "DECISION"}, {"HEARTBEAT"}, {"HEARTBEAT"}] * 2


def test_brake_is_announced_while_it_is_sent_whatever_was_decided() -> None:
    b = bench()
    b.run(12)
    disarmed, tracked, latched = b.step(), aligned(driven()), aligned(driven(), decides=False)
    assert disarmed.decision is not None
    assert (disarmed.state, disarmed.decision.action) == (State.DISARMED, Action.TRACK)
    assert announced(disarmed) == announced(tracked.step()) == TRACK
    for error, state in ((BusError.ERROR_FRAME, State.BRAKING), (BusError.BUS_OFF, State.FAULT)):
        one = latched.copied()
        one.core.bus_error(error, one.at_us - 1)
        one.step()
        result = aligned(one).step()
        assert result.decision is not None
        assert result.decision.action is Action.TRACK
        assert (result.state, brakes(result), announced(result)) == (state, True, BRAKE)


@pytest.mark.parametrize("moves", [True, False])
def test_a_turn_that_fails_latches_and_is_announced_all_the_same(
    monkeypatch: pytest.MonkeyPatch, moves: bool
) -> None:
    b = driven() if moves else bench()
    if not moves:
        b.run(12)
        b.request(Request.ARM)
        b.until(State.BRAKING)
    with monkeypatch.context() as broken:
        broken.setattr(b.core._watch, "look", raises)
        failed = b.step()
    assert (failed.state, brakes(failed)) == (State.FAULT, True)
    assert said(failed)["HEARTBEAT"]["STATE"] == State.FAULT
    # A car that was braked already has no other fault after it, and yet only the operator ends it.
    for _ in range(2 * DECIDE_EVERY):
        result = b.step()
        assert (result.state, brakes(result)) == (State.FAULT, True)
        assert moves or faults(result) == set()


def test_a_turn_that_fails_while_disarmed_says_so_and_sends_nothing_to_the_vehicle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    b = bench()
    monkeypatch.setattr(b.core._watch, "look", raises)
    result = b.step()
    assert (result.state, commands(result)) == (State.DISARMED, set())
    assert said(result)["HEARTBEAT"]["STATE"] == State.DISARMED
