"""LookAhead's settings are finite, its horizon is met exactly, and its memory only moves on."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from policy_cases import cycle, tracking
from policy_runs import TIMING
from policy_world import nobody

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.runtime import Action
from workbench.runtime.policies import Alert, Answer, Cycle, LookAhead, LookAheadState, Outcome

POLICY = LookAhead(horizon_s=2.0, release_steps=3, timing=TIMING)
UNPROVED = Answer(Verdict.UNPROVED, "near Ann", 0.0, 0.5, "Ann", 3.0)


def asked(**changes: Any) -> Cycle:
    drive = tracking()
    made = cycle(drive.state, drive.car, drive.now_s)
    return dataclasses.replace(made, **({"track_intent": nobody()} | changes))


def fresh(state: LookAheadState | None = None, **changes: Any) -> tuple[LookAheadState, Outcome]:
    return POLICY.step(POLICY.start(0.0) if state is None else state, asked(**changes))


@pytest.mark.parametrize(
    ("horizon_s", "release_steps", "refused"),
    [(0.5, 1, False), (1e-9, 1, False), (0.0, 1, True), (math.inf, 1, True), (math.nan, 1, True),
     (2.0, 0, True), (2.0, math.inf, True), (2.0, math.nan, True)],
)  # fmt: skip
def test_settings_are_positive_and_finite(
    horizon_s: float, release_steps: Any, refused: bool
) -> None:
    if refused:
        with pytest.raises(InputError, match="release_steps"):
            LookAhead(horizon_s=horizon_s, release_steps=release_steps, timing=TIMING)
    else:
        assert LookAhead(horizon_s=horizon_s, release_steps=release_steps, timing=TIMING)


@pytest.mark.parametrize(("holds_s", "verdict"), [(2.0, Verdict.SAFE), (1.999, Verdict.UNPROVED)])
def test_an_answer_counts_from_the_horizon_on(holds_s: float, verdict: Verdict) -> None:
    _, outcome = fresh(track_intent=dataclasses.replace(nobody(), holds_s=holds_s))
    assert outcome.verdict is verdict
    assert (outcome.action is Action.TRACK) is (verdict is Verdict.SAFE)


def test_after_a_brake_so_many_safe_in_a_row_release() -> None:
    state, outcome = fresh(track_intent=UNPROVED)
    assert (state.safe_in_a_row, outcome.action) == (0, Action.BRAKE)
    for number in (1, 2):
        state, outcome = POLICY.step(dataclasses.replace(state, stamp_s=-math.inf), asked())
        assert (state.safe_in_a_row, outcome.action) == (number, Action.BRAKE)
        assert f"this is number {number}" in outcome.reason
    for _ in range(2):
        state, outcome = POLICY.step(dataclasses.replace(state, stamp_s=-math.inf), asked())
        assert (state.safe_in_a_row, outcome.action) == (3, Action.TRACK)
        assert "in a row" not in outcome.reason


def test_the_latest_instant_and_stamp_are_remembered_unless_the_clock_is_broken() -> None:
    made = asked()
    state, _ = POLICY.step(POLICY.start(0.0), made)
    assert (state.clock_s, state.stamp_s) == (made.finished_s, made.stamp_s)
    newer = dataclasses.replace(state, stamp_s=made.stamp_s + 1.0)
    again, outcome = POLICY.step(newer, made)
    assert again.stamp_s == made.stamp_s + 1.0
    assert outcome.verdict is Verdict.INVALID
    ahead = dataclasses.replace(state, clock_s=made.finished_s + 1.0, stamp_s=-math.inf)
    broken, outcome = POLICY.step(ahead, made)
    assert (broken.clock_s, broken.stamp_s, broken.safe_in_a_row) == (ahead.clock_s, -math.inf, 0)
    assert outcome.action is Action.BRAKE


@pytest.mark.parametrize(
    ("now_s", "clock_s"), [(5.0, 5.0), (4.0, 4.0), (3.9, 4.0), (math.inf, 4.0), (math.nan, 4.0)]
)
def test_a_missed_cycle_brakes_and_moves_the_clock_only_forward(
    now_s: float, clock_s: float
) -> None:
    before = LookAheadState(3, 4.0, 3.0)
    state, outcome = POLICY.missed(before, UNPROVED, now_s=now_s)
    assert state == LookAheadState(0, clock_s, 3.0)
    assert (outcome.action, outcome.verdict) == (Action.BRAKE, Verdict.INVALID)
    assert (outcome.reason, outcome.brake_from_s) == ("near Ann", None)
    assert outcome.alert == Alert("Ann", "braking is not proved to keep clear: near Ann")


@pytest.mark.parametrize("action", list(Action))
def test_people_are_warned_where_braking_is_not_proved_to_help(action: Action) -> None:
    track = nobody() if action is Action.TRACK else UNPROVED
    bob = dataclasses.replace(UNPROVED, clearance_person="Bob")
    _, outcome = fresh(track_intent=track)
    assert (outcome.action, outcome.alert) == (action, None)
    for changes, person in (
        ({"brake_intent": UNPROVED, "brake_guard": bob}, "Ann"),
        ({"brake_guard": bob}, "Bob" if action is Action.BRAKE else None),
    ):
        _, outcome = fresh(track_intent=track, **changes)
        assert (None if outcome.alert is None else outcome.alert.person) == person
