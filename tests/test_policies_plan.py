"""A plan's rows are compared at their instants, and standstill is read from them safely."""

from __future__ import annotations

import dataclasses
import math

import pytest
from policy_cases import cycle, tracking
from policy_runs import FAIL_SAFE
from policy_world import BRAKE

from workbench.claims import Verdict
from workbench.runtime.policies import Hypothesis, ProvedTube, Watched
from workbench.runtime.policies.guards import Scene
from workbench.runtime.policies.plan import Plan, proved_standstill_s, state_violation
from workbench.sets import Box

NAMES = ("offset", "speed")
TUBE = ProvedTube(
    (0.0, 1.0, 2.0, 3.0),
    ((0.0, 1.0), (10.0, 0.5), (20.0, -2.0)),
    ((1.0, 2.0), (11.0, 1.0), (21.0, -1.0)),
)
STAMP_S = 1000.0
PLAN = Plan(TUBE, NAMES, Scene(STAMP_S, (), Watched(0.0, 0.0, 9.0)), (1.0, 1.5), None, 1003.0)


def _fits(elapsed_s: float, offset: float, speed: float = math.nan) -> bool:
    k = next(k for k in range(3) if 10.0 * k - 1.0 <= offset <= 10.0 * k + 2.0)
    if math.isnan(speed):
        speed = max(TUBE.lower[k][1], 0.0)
    box = Box(NAMES, (offset, speed), (offset, speed))
    found = state_violation(PLAN, box, STAMP_S + elapsed_s)
    assert found is None or (found.hypothesis is Hypothesis.STATE and found.refutes_plan)
    return found is None


@pytest.mark.parametrize(
    ("elapsed_s", "rows"),
    [
        (0.0, {0}), (0.5, {0}), (1.0 - 1e-5, {0}), (1.0 - 1e-7, {0, 1}), (1.0, {0, 1}),
        (1.0 + 1e-7, {0, 1}), (1.0 + 1e-5, {1}), (2.0, {1, 2}), (2.5, {2}), (3.0, {2}),
        (300.0, {2}), (-0.5, {0}),
    ],
)  # fmt: skip
def test_the_rows_of_an_instant_are_those_whose_time_holds_it(
    elapsed_s: float, rows: set[int]
) -> None:
    assert {k for k in range(3) if _fits(elapsed_s, 10.0 * k + 0.5)} == rows


def test_touching_is_meeting_and_beside_is_not() -> None:
    for offset, fits in ((0.0, True), (1.0, True), (-1e-9, False), (1.0 + 1e-9, False)):
        assert _fits(0.5, offset) == fits
    for speed, fits in ((1.0, True), (2.0, True), (0.999, False), (2.001, False)):
        assert _fits(0.5, 0.5, speed) == fits


def test_speeds_below_zero_are_standstill_and_no_other_state_is_treated_so() -> None:
    for speed, fits in ((-0.3, True), (0.0, True), (0.1, False)):
        assert _fits(2.5, 20.5, speed) == fits
    below = ProvedTube((0.0, 1.0), ((-5.0, 0.0),), ((-4.0, 0.0),))
    plan = dataclasses.replace(PLAN, tube=below)
    assert state_violation(plan, Box(NAMES, (-3.0, 0.0), (-3.0, 0.0)), STAMP_S) is not None
    found = state_violation(plan, Box(NAMES, (-4.5, 2.0), (-4.5, 2.0)), STAMP_S)
    assert found is not None
    assert "speed" in found.detail


def test_rows_that_are_no_numbers_meet_nothing() -> None:
    broken = ProvedTube((0.0, 1.0), ((math.nan, 0.0),), ((1.0, 1.0),))
    plan = dataclasses.replace(PLAN, tube=broken)
    assert state_violation(plan, Box(NAMES, (0.0, 0.0), (0.0, 0.0)), STAMP_S) is not None


def _speeds(*upper: float) -> ProvedTube:
    rows = tuple((0.0, speed) for speed in upper)
    return ProvedTube(tuple(float(k) for k in range(len(upper) + 1)), rows, rows)


@pytest.mark.parametrize(
    ("upper", "expected"),
    [
        # BRAKE by 1.5 s; the first row that begins after it is the third.
        ((2.0, 2.0, 0.0, 0.0), 2.0),
        ((2.0, 2.0, 0.1, 0.0), 1.5 + BRAKE.stop_s(2.0)),
        ((2.0, 0.0, 0.0, 0.0), 2.0),
        ((0.0, 0.0, 0.0, 0.0), 1.5 + BRAKE.stop_s(0.0)),
        ((1.0, 3.0, 9.0, 0.0), 3.0),
        ((9.0, 2.0, 1.0, 1.0), 1.5 + BRAKE.stop_s(9.0)),
        ((9.0, 0.0, 0.0, 1.0), 1.5 + BRAKE.stop_s(9.0)),
        ((2.0, math.nan, 0.0, 0.0), math.inf),
        ((2.0,), math.inf),
        ((), math.inf),
    ],
)
def test_standstill_is_read_from_rows_after_the_switch_or_from_the_brake(
    upper: tuple[float, ...], expected: float
) -> None:
    found_s = proved_standstill_s(_speeds(*upper), NAMES, switch_by_s=1.5, brake=BRAKE)
    assert found_s == pytest.approx(expected, rel=1e-12)


def test_only_what_cannot_be_judged_is_invalid() -> None:
    drive = tracking()
    for change, verdict in (
        ({"fault": "rounding is not to nearest"}, Verdict.INVALID),
        ({"started_s": math.nan}, Verdict.INVALID),
        ({"people": ()}, Verdict.SAFE),
    ):
        made = cycle(drive.state, drive.car, drive.now_s, **change)
        assert FAIL_SAFE.step(drive.state, made)[1].verdict is verdict
