"""Only a SAFE that withstands every doubt lets the vehicle track; all else brakes, with reasons."""

from __future__ import annotations

import ctypes
import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from runtime_fixture import STEPS
from runtime_world import Asked, assert_invalid, observation, standing

from workbench.claims import Rigor, Verdict
from workbench.runtime import Action, Person
from workbench.runtime.policies import Hypothesis

FAR = standing("far", 30.0, 9.0)
AHEAD = standing("Ann", 8.0, 0.5)
NEAR = standing("Ann", 4.0, 0.5)


def test_nobody_near_is_safe_and_the_decision_says_what_it_rests_on() -> None:
    decision = Asked().step(observation())
    assert (decision.verdict, decision.action) == (Verdict.SAFE, Action.TRACK)
    assert decision.reason == "safe: nobody is near"
    assert decision.clearance_m is None
    assert decision.clearance_time_s is None
    assert decision.clearance_person is None
    assert [a.name for a in decision.assumptions] == ["model"]
    assert decision.rigor is Rigor.NUMERICAL
    assert decision.elapsed_s > 0.0
    assert len(decision.tube_lower) == len(decision.tube_upper) == STEPS
    assert [len(row) for row in decision.occupancy] == [5] * STEPS
    assert decision.tube_lower[0][0] < 0.0 < decision.tube_upper[0][0]
    assert decision.tube_upper[-1][0] == pytest.approx(0.1 + 2.1 * 3.0, abs=1e-4)


def test_a_person_at_a_distance_is_safe_with_the_clearance_named() -> None:
    decision = Asked().step(observation(FAR, standing("farther", 50.0, 9.0)))
    assert decision.verdict is Verdict.SAFE
    assert decision.clearance_person == "far"
    assert decision.clearance_m is not None
    assert decision.clearance_m > 10.0
    assert "from far" in decision.reason


def test_a_person_in_the_way_is_unproved_and_named_with_the_time() -> None:
    decision = Asked().step(observation(FAR, AHEAD))
    assert (decision.verdict, decision.action) == (Verdict.UNPROVED, Action.BRAKE)
    assert decision.clearance_person == "Ann"
    assert decision.clearance_time_s is not None
    assert "separation from Ann at" in decision.reason
    assert f"{decision.clearance_time_s:.2f} s" in decision.reason
    assert "0.50 m required" in decision.reason
    assert len(decision.occupancy) == STEPS


@settings(max_examples=60, deadline=None)
@given(st.floats(-5.0, 40.0), st.floats(-15.0, 15.0), st.floats(-2.0, 2.0), st.floats(0.0, 3.0))
def test_the_verdict_follows_the_clearance(x_m: float, y_m: float, vy: float, need: float) -> None:
    person = Person("p", x_m, y_m, 0.0, vy, 0.3, 0.1, 0.2)
    decision = Asked(clearance_required_m=need).step(observation(person))
    assert decision.clearance_m is not None
    assert (decision.verdict is Verdict.SAFE) == (decision.clearance_m >= need)


def test_the_path_window_moves_with_the_vehicle() -> None:
    monitor = Asked()
    for x in (0.0, 0.3, 9.0, 31.0):
        decision = monitor.step(observation(at=(x, 0.0)))
        assert decision.verdict is Verdict.SAFE
        assert decision.occupancy[0][:2] == pytest.approx((x + 0.05, 0.0), abs=0.06)
    late = monitor.step(observation(at=(62.0, 0.0)))
    assert (late.verdict, late.action) == (Verdict.UNPROVED, Action.BRAKE)
    assert "the tube left the path table or the operating region after 1." in late.reason
    assert 20 < len(late.tube_lower) == len(late.occupancy) < STEPS


@pytest.mark.parametrize(
    ("kind", "people", "reason"),
    [
        (1, (), "the kernel refused the query (code 7)"),
        (2, (), "status is nan"),
        (3, (), "track_verdicts is 7.0, expected a whole number from 0 to 2"),
        (4, (), "track_verdicts is 0.5"),
        (5, (), "track_status is 9.0"),
        (6, (), "track_rows is 2.5"),
        (7, (), "track_rows is 61.0"),
        (8, (), "tube track holds numbers not finite"),
        (9, (), "tube track holds numbers not finite"),
        (10, (), "occupancy track holds numbers not finite"),
        (11, (), "track is inside out"),
        (12, (), "track does not start around the measured state"),
        (30, (), "track does not start around the measured state"),
        (50, (), "track does not start around the measured state"),
        (46, (), "stop does not start around the measured state"),
        (13, (), "negative size"),
        (29, (), "negative size"),
        (14, (), "says SAFE of the tube track, but also: the tube left"),
        (15, (), "complete after 59 of 60 steps"),
        (16, (FAR,), "says SAFE of the tube track, but also: separation from far"),
        (17, (FAR,), "says SAFE of the tube track, but also: nobody was looked at"),
        (18, (FAR,), "track_intent is 1.0"),
        (18, (), "track_intent is 0.0"),
        (19, (FAR,), "m at -0.1"),
        (20, (FAR,), "m at nan s"),
        (21, (FAR,), "clearance of nan m"),
        (22, (FAR,), "to nobody"),
        (25, (), "calls the tube track invalid"),
        (26, (), "calls the query invalid: the kernel found its input not finite"),
        (27, (), "the kernel changed the processor's mode: rounding is not to nearest"),
        (31, (), "SAFE of a set, but not of a smaller one: track_verdicts"),
        (32, (), "has rows, but is of no level"),
        (33, (), "track_level is 1.0, expected a whole number from -1 to 0"),
        (34, (), "track_cells is 0.0"),
        (35, (), "spent is 1000000000.0, expected a whole number from 0 to 1000"),
        (36, (), "the whole query: the tube left"),
        (38, (), "calls the tube stop complete before standstill"),
        (39, (), "calls the tube stop complete before standstill"),
        (43, (), "calls the tube stop complete before standstill"),
        (40, (FAR,), "m to far, and as its cause NOT_PREDICTED"),
        (41, (), "track_intent is 4.0"),
        (42, (), "track_intent is 4.0, expected a whole number from -1 to 3"),
        (44, (FAR,), "SAFE of the tube track, but also: nobody asked about"),
        (48, (NEAR,), "says SAFE of the tube brake, but also: separation from Ann"),
    ],
)
def test_a_kernel_that_contradicts_itself_is_not_believed(
    kind: int, people: tuple[Person, ...], reason: str
) -> None:
    try:
        decision = Asked(kind).step(observation(*people))
    finally:
        ctypes.CDLL(None).fesetround(0)
    assert_invalid(decision, reason)
    assert [violation.hypothesis for violation in decision.violations] == [Hypothesis.ARITHMETIC]


def test_a_query_that_the_kernel_refuses_is_no_fault_of_its_arithmetic() -> None:
    decision = Asked(37).step(observation())
    assert_invalid(decision, "invalid: the kernel found its input not finite or out of range")
    assert decision.violations == ()


def test_an_unproved_tube_says_why() -> None:
    decision = Asked(28).step(observation(FAR))
    assert decision.verdict is Verdict.UNPROVED
    assert decision.reason == "unproved: not proved within the kernel's budget"
    decision = Asked(49).step(observation(FAR))
    assert "no distance was found to far at" in decision.reason
    assert decision.clearance_m is None
    decision = Asked(45).step(observation(FAR))
    assert decision.verdict is Verdict.SAFE
    assert decision.fail_safe.verdict is Verdict.UNPROVED


def test_a_warning_is_given_unless_braking_is_proved_to_keep_clear() -> None:
    assert Asked().step(observation(FAR)).alert is None
    alert = Asked().step(observation(FAR, NEAR)).alert
    assert alert is not None
    assert alert.person == "Ann"
    assert "unproved: separation from Ann" in alert.reason
    # The kernel's own verdict about BRAKE counts as well, where its numbers name no reason.
    alert = Asked(47).step(observation(FAR)).alert
    assert alert is not None
    assert "not proved within the kernel's budget" in alert.reason


@settings(max_examples=60, deadline=None)
@given(st.floats(3.0, 15.0), st.floats(-2.0, 2.0), st.sampled_from((0, 1, 2)))
def test_the_deciding_level_s_verdict_counts_and_larger_ones_settle_it(
    x_m: float, y_m: float, level: int
) -> None:
    decision = Asked(level=level).step(observation(standing("p", x_m, y_m)))
    assert decision.deciding_level == ("whole", "two thirds", "one third")[level]
    assert set(decision.level_verdicts) == {"track", "stop", "brake"}
    verdicts = decision.level_verdicts["track"]
    assert decision.look_ahead.verdict is verdicts[level]
    assert list(verdicts) == sorted(verdicts, key=lambda v: v is Verdict.SAFE)
    assert decision.fail_safe.verdict is decision.level_verdicts["stop"][level]


def test_smaller_sets_are_proved_where_the_whole_is_not() -> None:
    seen = observation(standing("p", 9.2, 3.05))
    found = [Asked(level=level).step(seen) for level in (0, 1, 2)]
    safe, unproved = Verdict.SAFE, Verdict.UNPROVED
    assert [d.level_verdicts["track"] for d in found] == [(unproved, safe, safe)] * 3
    assert [d.verdict for d in found] == [unproved, safe, safe]
    # What is reported is of the deciding level, or of a larger one that settled it.
    assert found[0].clearance_m < 0.5 <= found[1].clearance_m == found[2].clearance_m  # type: ignore[operator]


def test_a_proof_that_ends_early_is_unproved() -> None:
    decision = Asked(23).step(observation(FAR))
    assert decision.verdict is Verdict.UNPROVED
    assert decision.reason == "unproved: no enclosure of the motion was found after 0.00 s"
    assert len(decision.tube_lower) == 0
    decision = Asked(24).step(observation())
    assert (decision.verdict, decision.action) == (Verdict.UNPROVED, Action.BRAKE)
    assert decision.reason == "unproved: the path coordinates became singular after 0.50 s"
    assert len(decision.tube_lower) == 10


def test_release_takes_the_stated_number_of_safe_verdicts_in_a_row() -> None:
    monitor = Asked(release_steps=3)
    safe, near = observation(), observation(AHEAD)
    broken = replace(safe, speed=(math.nan, 0.0))
    script = [safe, safe, near, safe, safe, broken, safe, safe, safe, safe, near, safe]
    expected = "TTBBBBBBTTBB"
    decisions = [monitor.step(seen) for seen in script]
    assert "".join(d.action.name[0] for d in decisions) == expected
    assert decisions[3].verdict is Verdict.SAFE
    assert decisions[3].reason.endswith("braking until 3 SAFE in a row, this is number 1")


@given(st.lists(st.booleans(), max_size=40), st.integers(1, 5))
@settings(max_examples=40, deadline=None)
def test_no_track_within_the_release_steps_after_a_brake(safe: list[bool], steps: int) -> None:
    monitor = Asked(release_steps=steps)
    actions = [monitor.step(observation() if ok else observation(AHEAD)).action for ok in safe]
    for k, action in enumerate(actions):
        recent = safe[max(0, k - steps + 1) : k + 1]
        tracks = safe[k] and (all(recent) if False in safe[:k] else True)
        assert (action is Action.TRACK) == tracks
