"""An answer that is not about this car, its timing and its standstill permits nothing."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from policy_cases import Drive, changed_person, cycle, tracking
from policy_runs import FAIL_SAFE
from policy_world import BRAKE

from workbench.claims import Verdict
from workbench.runtime import Action
from workbench.runtime.person_guard import Disc
from workbench.runtime.policies import Answer, Phase, ProvedTube, StopAnswer, Watched


def _stop(drive: Drive, **changes: Any) -> StopAnswer:
    return dataclasses.replace(cycle(drive.state, drive.car, drive.now_s).stop_guard, **changes)


def test_an_answer_that_is_not_about_this_car_permits_nothing() -> None:
    drive = tracking()
    stop = _stop(drive)
    answer, tube = stop.answer, stop.tube
    cut = ProvedTube(tube.times_s[:5], tube.lower[:4], tube.upper[:4])
    moved = ProvedTube(
        tube.times_s, [(a + 0.3, b) for a, b in tube.lower], [(a + 0.3, b) for a, b in tube.upper]
    )
    broken = ProvedTube(
        tube.times_s, [(math.nan, b) for _, b in tube.lower], [(a, math.nan) for a, _ in tube.upper]
    )
    cases: dict[str, StopAnswer] = {
        "near": dataclasses.replace(
            stop, answer=Answer(Verdict.UNPROVED, "near Ann", 0.0, 0.0, "Ann", 3.0)
        ),
        "hold for": dataclasses.replace(stop, answer=dataclasses.replace(answer, holds_s=0.3)),
        "to stand after": dataclasses.replace(stop, tube=cut),
        "start around": dataclasses.replace(stop, tube=moved),
        "the measured set": dataclasses.replace(stop, tube=broken),
        "no rows": dataclasses.replace(stop, tube=ProvedTube((0.0,), (), ())),
        "may be commanded": dataclasses.replace(stop, switch_s=(0.2, 0.3)),
        "TRACK begins": dataclasses.replace(stop, start_s=(0.0, 0.1)),
        "are watched beyond": dataclasses.replace(stop, farthest_m=29.0),
    }
    for reason, changed in cases.items():
        made = dataclasses.replace(cycle(drive.state, drive.car, drive.now_s), stop_guard=changed)
        state, outcome = drive.policy.step(drive.state, made)
        assert (outcome.action, outcome.violations) == (Action.BRAKE, ()), reason
        assert reason in outcome.reason
        assert state.phase is Phase.CLOSING


def test_a_standing_car_must_be_asked_about_as_standing() -> None:
    drive = Drive()
    drive.on(5)
    drive.state = dataclasses.replace(FAIL_SAFE.start(0.0), stands_s=0.0)
    stop = dataclasses.replace(_stop(drive), start_s=None)
    assert "but the car stands" in drive.ask(stop_guard=stop).reason


def test_a_stamp_from_before_the_begin_needs_a_tube_that_begins_there() -> None:
    drive = Drive()
    drive.ask()
    drive.send(BRAKE.stop_s(0.05) + 0.01)
    drive.ask()
    stamp_s = drive.now_s + 0.002
    drive.send(drive.now_s + 0.01)
    assert drive.state.phase is Phase.TRACKING
    needed = FAIL_SAFE.start_s(drive.state, stamp_s)
    assert needed is not None
    assert needed[0] < drive.state.begun_s - stamp_s < needed[1]
    made = cycle(drive.state, drive.car, stamp_s)
    assert drive.policy.step(drive.state, made)[1].action is Action.TRACK
    before = dataclasses.replace(made.stop_guard, start_s=None)
    for stop, reason in (
        (before, "TRACK was commanded after the stamp"),
        (dataclasses.replace(before, start_s=(0.0, needed[0])), "TRACK begins"),
    ):
        refused = drive.policy.step(drive.state, dataclasses.replace(made, stop_guard=stop))[1]
        assert reason in refused.reason


@settings(max_examples=100, deadline=None)
@given(st.floats(), st.floats(), st.floats(), st.floats(), st.integers(0, 3))
def test_no_numbers_whatever_move_the_car(
    a: float, b: float, c: float, d: float, kind: int
) -> None:
    drive = tracking()
    changes: list[dict[str, Any]] = [
        {"stamp_s": a, "started_s": b, "finished_s": c},
        {"stop_guard": _stop(drive, switch_s=(a, b), farthest_m=c, start_s=(c, d))},
        {"watched": Watched(a, b, math.nan if d > 1e6 else c)},
        {"people": (changed_person(drive.now_s, position=Disc(a, b, c)),)},
    ]
    made = cycle(drive.state, drive.car, drive.now_s, **changes[kind])
    state, outcome = drive.policy.step(drive.state, made)
    if outcome.action is Action.BRAKE:
        assert state.phase is not Phase.TRACKING
        assert state.plan in (None, drive.state.plan)
