"""A plan's tube and answer are read to their edges, and rows of another form are no rows."""

from __future__ import annotations

import dataclasses
import math

import pytest
from policy_cases import cycle, tracking
from policy_world import BRAKE

from workbench.claims import Verdict
from workbench.runtime.policies import ProvedTube, StopAnswer, Watched
from workbench.runtime.policies.guards import Scene
from workbench.runtime.policies.plan import (
    Plan,
    fault_in_answer,
    proved_standstill_s,
    starts_fault,
    state_violation,
)
from workbench.sets import Box

NAMES = ("offset", "speed")


def speeds(*upper: float) -> ProvedTube:
    rows = tuple((0.0, speed) for speed in upper)
    return ProvedTube(tuple(float(k) for k in range(len(upper) + 1)), rows, rows)


@pytest.mark.parametrize(
    ("switch_by_s", "upper", "expected"),
    [
        # Nothing is known from the tube's end on.
        (2.0, (2.0, 2.0), math.inf),
        (1.9, (2.0, 2.0), 1.9 + BRAKE.stop_s(2.0)),
        # BRAKE within the last row: the rows cannot show standstill after it, the brake can.
        (3.5, (2.0, 1.0, 1.0, 0.0), 3.5 + BRAKE.stop_s(2.0)),
        # BRAKE at the stamp: the first row's speed is the fastest at that instant.
        (0.0, (1.0, 9.0, 9.0), BRAKE.stop_s(1.0)),
        (1.0, (1.0, 9.0, 9.0), 1.0 + BRAKE.stop_s(1.0)),
        (1.1, (1.0, 3.0, 9.0), 1.1 + BRAKE.stop_s(3.0)),
        (0.0, (0.0, 0.0), 0.0),
    ],
)
def test_standstill_is_read_from_the_rows_until_the_switch(
    switch_by_s: float, upper: tuple[float, ...], expected: float
) -> None:
    found_s = proved_standstill_s(speeds(*upper), NAMES, switch_by_s=switch_by_s, brake=BRAKE)
    assert found_s == expected


@pytest.mark.parametrize("width", [1, 3])
def test_rows_of_another_number_of_states_cannot_be_compared(width: int) -> None:
    rows = ((0.0,) * width,)
    plan = Plan(
        ProvedTube((0.0, 1.0), rows, rows), NAMES, Scene(0.0, (), Watched(0.0, 0.0, 9.0)),
        (1.0, 1.5), None, 3.0,
    )  # fmt: skip
    with pytest.raises(ValueError, match="zip"):
        state_violation(plan, Box(NAMES, (0.0, 0.0), (0.0, 0.0)), 0.5)


ROWS = ProvedTube((0.0, 1.0, 2.0), ((0.0, 1.0), (5.0, 0.0)), ((1.0, 2.0), (6.0, 0.0)))
MEASURED = Box(NAMES, (0.0, 1.0), (1.0, 2.0))
NEEDED = (0.25, 0.5)


def fault(
    tube: ProvedTube = ROWS,
    *,
    measured: Box = MEASURED,
    switch_s: tuple[float, float] = NEEDED,
    holds_s: float = 9.0,
    standstill_s: float = 1.0,
) -> str | None:
    drive = tracking()
    made = cycle(drive.state, drive.car, drive.now_s)
    safe = dataclasses.replace(made.stop_guard.answer, verdict=Verdict.SAFE, holds_s=holds_s)
    stop = StopAnswer(safe, tube, switch_s, None, 0.0)
    about = dataclasses.replace(made, measured=(measured,), stop_guard=stop)
    return fault_in_answer(about, 0, standstill_s=standstill_s, needed=NEEDED)


def test_one_row_is_enough_and_rows_and_times_belong_together() -> None:
    one = ProvedTube((0.0, 1.0), ROWS.lower[:1], ROWS.upper[:1])
    assert fault(one) is None
    for times, lower, upper in (
        ((0.0,), (), ()),
        ((0.0, 1.0, 2.0), ROWS.lower[:1], ROWS.upper),
        ((0.0, 1.0, 2.0), ROWS.lower, ROWS.upper[:1]),
        ((0.0, 1.0), ROWS.lower, ROWS.upper),
    ):
        assert "as many as times" in (fault(ProvedTube(times, lower, upper)) or "")


def test_only_the_first_row_holds_the_measured_set_and_its_edges_count() -> None:
    assert fault() is None
    for beyond in ((-1e-9, 1.0), (0.0, 1.0 - 1e-9)):
        assert "start around" in (fault(measured=Box(NAMES, beyond, (1.0, 2.0))) or "")
    for beyond in ((1.0 + 1e-9, 2.0), (1.0, 2.0 + 1e-9)):
        assert "start around" in (fault(measured=Box(NAMES, (0.0, 1.0), beyond)) or "")
    late = ProvedTube((0.1, 1.0, 2.0), ROWS.lower, ROWS.upper)
    assert "start around" in (fault(late) or "")
    with pytest.raises(ValueError, match="zip"):
        fault(measured=Box(("offset",), (0.0,), (1.0,)))


@pytest.mark.parametrize(
    ("switch_s", "covers"),
    [((0.25, 0.5), True), ((0.0, 9.0), True), ((0.26, 0.5), False), ((0.25, 0.49), False),
     ((0.3, 0.4), False), ((0.5, 0.5), False), ((0.25, 0.25), False)],
)  # fmt: skip
def test_every_instant_of_the_switch_must_be_covered(
    switch_s: tuple[float, float], covers: bool
) -> None:
    assert (fault(switch_s=switch_s) is None) is covers


@pytest.mark.parametrize(
    ("standstill_s", "holds_s", "enough"),
    [(2.0, 2.0, True), (2.0, 9.0, True), (2.01, 9.0, False), (1.5, 1.4, False), (1.5, 1.5, True)],
)
def test_tube_and_answer_hold_until_standstill(
    standstill_s: float, holds_s: float, enough: bool
) -> None:
    assert (fault(standstill_s=standstill_s, holds_s=holds_s) is None) is enough


def test_track_begins_within_what_the_tube_allows_its_ends_included() -> None:
    drive = tracking()
    stop = cycle(drive.state, drive.car, drive.now_s).stop_guard
    granted = (10.25, 10.5)
    tracks = dataclasses.replace(stop, start_s=None)
    assert starts_fault(tracks, 10.0, stamp_s=10.0, granted=granted) is None
    assert starts_fault(tracks, 10.1, stamp_s=10.0, granted=granted) is not None
    assert starts_fault(tracks, None, stamp_s=10.0, granted=granted) is not None
    for start_s, begun_s, fits in (
        ((0.25, 0.5), None, True),
        ((0.26, 0.5), None, False),
        ((0.25, 0.49), None, False),
        ((0.75, 0.75), 10.75, True),
        ((0.76, 0.9), 10.75, False),
        ((0.0, 0.74), 10.75, False),
    ):
        begins = dataclasses.replace(stop, start_s=start_s)
        found = starts_fault(begins, begun_s, stamp_s=10.0, granted=granted)
        assert (found is None) is fits


def test_a_car_that_stands_or_rolls_back_needs_the_brake_s_delay_and_build_up() -> None:
    assert BRAKE.stop_s(-1.0) == BRAKE.stop_s(0.0) == pytest.approx(0.3, abs=1e-12)
