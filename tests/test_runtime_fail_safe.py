"""Through the monitor, too, no TRACK is sent without a proved stop, and a miss carries it out."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from runtime_world import TIMING, Asked, observation, standing

from workbench.claims import Verdict
from workbench.runtime import (
    Action,
    Bundle,
    Deciding,
    Decision,
    Disc,
    Monitor,
    MotionLimits,
    Observation,
    Watched,
)
from workbench.runtime.bundle import Result
from workbench.runtime.policies import Hypothesis, Violation

STANDING = observation(speed=(0.0, 0.05))
SLOW = observation(speed=(0.0, 0.2))
BROKEN = replace(SLOW, x=(math.nan, 0.0))
AHEAD = standing("Ann", 8.0, 0.5)


def _held(deciding: Deciding = Deciding.FAIL_SAFE, **settings: Any) -> Asked:
    """A monitor of a car that is known to stand from the next observation on."""
    asked = Asked(deciding=deciding, **settings)
    first = asked.step(STANDING)
    assert first.action is Action.BRAKE
    assert "the car is not known to stand" in first.reason
    return asked


def _tracking(deciding: Deciding = Deciding.FAIL_SAFE, **settings: Any) -> Asked:
    """A monitor of a car that has just been told to TRACK."""
    asked = _held(deciding, **settings)
    assert asked.step(STANDING).action is Action.TRACK
    assert _turn(asked, 0.02).name == "TRACK"
    return asked


def _turn(asked: Asked, after_s: float) -> Action:
    asked.clock.now_s += after_s
    return asked.monitor.turn().action


def _hypotheses(violations: tuple[Violation, ...]) -> list[Hypothesis]:
    return [violation.hypothesis for violation in violations]


def test_nothing_is_sent_but_brake_before_the_car_is_known_to_stand() -> None:
    asked = Asked(deciding=Deciding.FAIL_SAFE)
    assert asked.monitor.turn().action is Action.BRAKE
    decision = asked.step(observation())
    assert (decision.verdict, decision.action) == (Verdict.SAFE, Action.BRAKE)
    assert decision.reason == "no new plan: the car is not known to stand"
    # From 2.1 m/s it stands 1.05 s after the stamp; a slower speed measured since says it earlier.
    assert asked.step(STANDING).action is Action.BRAKE
    assert _turn(asked, 0.0) is Action.BRAKE
    assert asked.step(STANDING).action is Action.TRACK


def test_a_plan_begins_with_the_next_turn_and_ends_with_brake_in_its_switch_interval() -> None:
    asked = _tracking()
    stamp_s = asked.clock.now_s - 0.02
    decision = asked.step(SLOW, after_s=0.08)
    assert (decision.verdict, decision.action) == (Verdict.SAFE, Action.TRACK)
    assert decision.brake_from_s == pytest.approx(stamp_s + 0.1 + TIMING.switch_s[0], abs=1e-5)
    assert _turn(asked, 0.14) is Action.TRACK
    turn = asked.monitor.turn(asked.clock.now_s + 0.03)
    assert turn.action is Action.BRAKE
    assert turn.violation is not None
    assert turn.violation.hypothesis is Hypothesis.ON_TIME


def test_a_plan_that_is_not_begun_in_time_is_not_begun_at_all() -> None:
    asked = _held()
    assert asked.step(STANDING).action is Action.TRACK
    assert _turn(asked, 0.05) is Action.BRAKE


@pytest.mark.parametrize(
    "missed",
    [BROKEN, replace(SLOW, x=(-60.0, -59.0)), replace(SLOW, people=None)],  # type: ignore[arg-type]
)
@pytest.mark.parametrize("deciding", [Deciding.FAIL_SAFE, Deciding.BOTH])
def test_what_cannot_be_judged_carries_out_the_plan_in_force(
    missed: Observation, deciding: Deciding
) -> None:
    asked = _tracking(deciding)
    begun_s = asked.clock.now_s - 0.02
    decision = asked.step(missed, after_s=0.08)
    assert (decision.verdict, decision.action) == (Verdict.INVALID, Action.BRAKE)
    assert decision.violations == ()
    assert decision.brake_from_s == pytest.approx(begun_s + TIMING.switch_s[0], abs=1e-5)
    assert decision.alert is not None
    # Not at once: braking at any other time is not what was proved. And for good.
    assert _turn(asked, 0.0) is Action.TRACK
    late = asked.monitor.step(replace(SLOW, stamp_s=asked.clock.now_s))
    assert late.action is Action.BRAKE
    assert "the plan in force is being carried out" in late.fail_safe.reason
    assert _turn(asked, 0.03) is Action.TRACK
    assert _turn(asked, 0.03) is Action.BRAKE


def test_what_cannot_be_judged_withdraws_an_offer() -> None:
    asked = _held()
    assert asked.step(STANDING).action is Action.TRACK
    asked.monitor.step(BROKEN)
    assert _turn(asked, 0.01) is Action.BRAKE


def test_where_look_ahead_decides_alone_what_cannot_be_judged_brakes_at_once() -> None:
    asked = Asked(deciding=Deciding.LOOK_AHEAD)
    assert asked.step(observation()).action is Action.TRACK
    assert _turn(asked, 0.01) is Action.TRACK
    assert asked.monitor.step(BROKEN).action is Action.BRAKE
    assert _turn(asked, 0.0) is Action.BRAKE


def test_with_both_the_worst_verdict_counts_and_an_objection_carries_the_plan_out() -> None:
    asked = _tracking(Deciding.BOTH, release_steps=2)
    decision = asked.step(replace(SLOW, people=observation(AHEAD).people), after_s=0.08)
    ahead, safe = decision.look_ahead, decision.fail_safe
    assert {ahead.verdict, safe.verdict, decision.verdict} == {Verdict.SAFE}
    unproved = replace(observation(AHEAD, speed=(0.0, 2.0)))
    decision = asked.step(unproved)
    assert decision.look_ahead.verdict is Verdict.UNPROVED
    assert (decision.verdict, decision.action) == (Verdict.UNPROVED, Action.BRAKE)
    assert decision.reason.startswith("LookAhead: unproved: separation from Ann")
    assert "; FailSafe: " in decision.reason


def test_a_state_outside_of_the_proved_tube_brakes_at_once() -> None:
    asked = _tracking()
    decision = asked.step(observation(speed=(2.9, 3.0)), after_s=0.08)
    assert _hypotheses(decision.violations) == [Hypothesis.STATE]
    assert decision.action is Action.BRAKE
    assert _turn(asked, 0.0) is Action.BRAKE


def test_hypotheses_are_checked_also_where_the_kernel_cannot_be_asked() -> None:
    asked = _tracking()
    decision = asked.step(
        replace(observation(speed=(2.9, 3.0)), reference_speed_mps=7.0), after_s=0.08
    )
    assert decision.verdict is Verdict.INVALID
    assert _hypotheses(decision.violations) == [Hypothesis.STATE]


def test_old_or_future_observations_are_not_used() -> None:
    decision = _tracking().step(SLOW, after_s=0.08, age_s=0.06)
    assert _hypotheses(decision.violations) == [Hypothesis.AGE]
    assert decision.look_ahead.verdict is Verdict.INVALID
    decision = _tracking().step(SLOW, after_s=0.08, age_s=-1.0)
    assert {*_hypotheses(decision.violations)} == {Hypothesis.CLOCK}


def test_a_check_that_takes_too_long_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, call = _tracking(), Bundle.call

    def slowly(self: Bundle, values: Any) -> Result:
        asked.clock.now_s += TIMING.latency_s + 0.001
        return call(self, values)

    monkeypatch.setattr(Bundle, "call", slowly)
    decision = asked.step(SLOW, after_s=0.08)
    assert _hypotheses(decision.violations) == [Hypothesis.AGE, Hypothesis.ON_TIME]
    assert decision.action is Action.BRAKE


def test_too_little_that_is_watched_makes_no_plan() -> None:
    asked = _held()
    decision = asked.step(replace(STANDING, watched=Watched(0.0, 0.0, 4.0)))
    assert decision.action is Action.BRAKE
    assert "m are watched beyond the tube" in decision.reason


@pytest.mark.parametrize("level", [0, 1, 2])
def test_a_standing_car_stands_at_every_level_and_starts(level: int) -> None:
    asked = _tracking(level=level)
    assert asked.step(SLOW, after_s=0.08).violations == ()


def test_the_watched_disc_must_hold_the_required_clearance_and_the_skew() -> None:
    def room_m(clearance_m: float, skew_s: float) -> float:
        asked = _held(clearance_required_m=clearance_m)
        seen = replace(STANDING, watched=Watched(0.0, 0.0, 4.0), skew_s=(-skew_s, 0.0))
        return float(asked.step(seen).reason.split("only ")[1].split(" m ")[0])

    assert room_m(0.0, 0.0) - room_m(1.5, 0.0) == pytest.approx(1.5, abs=0.011)
    # Somebody unseen may come 2.5 m/s nearer meanwhile.
    assert room_m(0.0, 0.0) - room_m(0.0, 0.4) == pytest.approx(1.0, abs=0.011)


def test_nobody_is_held_to_less_than_the_bundle_says() -> None:
    ann = observation(standing("Ann", 30.0, 9.0)).people[0]
    reasons = []
    for limits in (MotionLimits(2.5, 2.0), MotionLimits(0.1, 0.0)):
        asked = _held()
        slow = replace(ann, guard=replace(ann.guard, limits=limits))
        reasons.append(asked.step(replace(STANDING, people=(slow,))).fail_safe.reason)
        assert _turn(asked, 0.02) is Action.TRACK
        walked = replace(slow, guard=replace(slow.guard, velocity=Disc(0.2, 0.0, 0.05)))
        assert asked.step(replace(SLOW, people=(walked,)), after_s=0.08).violations == ()
    assert reasons[0] == reasons[1]
    assert "m from Ann" in reasons[0]


class _UnspeakableError(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no words")


def test_whatever_goes_wrong_is_answered_and_leaves_no_half_a_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked, decided = _tracking(), Monitor._decision
    calls = []

    def fails_once(self: Monitor, *arguments: Any) -> Decision:
        calls.append(arguments)
        if len(calls) == 1:
            raise _UnspeakableError
        return decided(self, *arguments)

    monkeypatch.setattr(Monitor, "_decision", fails_once)
    decision = asked.step(SLOW, after_s=0.08)
    assert (decision.verdict, decision.action) == (Verdict.INVALID, Action.BRAKE)
    assert "invalid: _UnspeakableError" in decision.reason
    # The plan before it is carried out; the one that was made in the failed step is not in force.
    monkeypatch.undo()
    assert "being carried out" in asked.step(SLOW, after_s=0.02).reason


@pytest.mark.parametrize("now_s", [math.nan, -math.inf, 0.0, "noon", 10**400])
def test_a_turn_at_no_instant_brakes(now_s: Any) -> None:
    asked = _tracking()
    turn = asked.monitor.turn(now_s)
    assert turn.action is Action.BRAKE
    assert turn.violation is not None
    assert turn.violation.hypothesis is Hypothesis.CLOCK
    assert _turn(asked, 0.01) is Action.BRAKE


def test_a_clock_that_fails_brakes() -> None:
    asked = _tracking()
    clock = asked.clock
    del clock.now_s
    decision = asked.monitor.step(replace(SLOW, stamp_s=100.3))
    assert (decision.verdict, decision.action) == (Verdict.INVALID, Action.BRAKE)
    assert Hypothesis.CLOCK in _hypotheses(decision.violations)
    assert asked.monitor.turn().action is Action.BRAKE


_EVENTS = st.one_of(
    st.tuples(st.just("seen"), st.sampled_from([SLOW, STANDING, BROKEN, observation(AHEAD)])),
    st.tuples(st.just("turn"), st.none()),
)


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.0, 0.06), _EVENTS), max_size=60),
    st.sampled_from([Deciding.FAIL_SAFE, Deciding.BOTH]),
)
def test_track_is_sent_only_before_the_switch_of_a_plan_that_was_accepted(
    events: list[tuple[float, Any]], deciding: Deciding
) -> None:
    asked = _held(deciding)
    until_s = -math.inf
    for after_s, (kind, seen) in events:
        if kind == "turn":
            action = _turn(asked, after_s)
            assert action is Action.BRAKE or asked.clock.now_s < until_s
            continue
        decision = asked.step(seen, after_s=after_s)
        if decision.action is Action.TRACK:
            assert decision.fail_safe.verdict is Verdict.SAFE
            until_s = asked.clock.now_s + TIMING.switch_s[0] + 1e-5


@pytest.mark.parametrize("deciding", Deciding)
def test_a_car_that_brakes_by_itself_needs_a_new_standstill(deciding: Deciding) -> None:
    alone = deciding is Deciding.LOOK_AHEAD
    asked = Asked(deciding=deciding) if alone else _tracking(deciding)
    if alone:
        assert asked.step(STANDING).action is Action.TRACK
        assert _turn(asked, 0.02).name == "TRACK"
    asked.clock.now_s += 0.02
    asked.monitor.hold(asked.clock.now_s)
    assert [_turn(asked, 0.02).name for _ in range(3)] == ["BRAKE"] * 3
    if not alone:
        # A speed that is no standstill permits nothing, one that is does.
        assert asked.step(SLOW).action is Action.BRAKE
        stood = [asked.step(STANDING).action for _ in range(25)]
        assert stood[-1] is Action.TRACK


@pytest.mark.parametrize("now_s", [math.nan, math.inf, -1.0])
def test_holding_at_no_instant_brakes(now_s: float) -> None:
    asked = _tracking()
    asked.monitor.hold(now_s)
    assert _turn(asked, 0.02).name == "BRAKE"
