"""What the instants of turns say is exact to the microsecond, and only what has changed is told."""

from __future__ import annotations

from typing import NoReturn

import pytest

from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.states import State
from workbench.runtime.onboard.times import SEND_US
from workbench.runtime.onboard.turns import internal, news, overrun, untimely
from workbench.runtime.policies import Timing

TIMING = Timing(period_s=0.1, latency_s=0.03, send_gap_s=0.05)
MOST_US = 50_000 - SEND_US
LATENCY_US = 30_000
LATE, FROZEN = Found(Fault.LATE, "late", 1), Found(Fault.FROZEN, "frozen", 2)


def test_the_first_turn_is_never_untimely() -> None:
    assert untimely(None, 10**9, TIMING) == ()


@pytest.mark.parametrize("gap_us", [0, 1, MOST_US - 1, MOST_US])
def test_a_turn_within_the_gap_is_in_time(gap_us: int) -> None:
    assert untimely(1_000_000, 1_000_000 + gap_us, TIMING) == ()


@pytest.mark.parametrize("over_us", [1, 2, 900_000])
def test_a_late_turn_is_late_since_the_gap_ended(over_us: int) -> None:
    at_us = 1_000_000 + MOST_US + over_us
    (found,) = untimely(1_000_000, at_us, TIMING)
    assert (found.fault, found.since_us) == (Fault.LATE_TURN, 1_000_000 + MOST_US)
    assert str(MOST_US + over_us) in found.detail


@pytest.mark.parametrize("back_us", [1, 500])
def test_a_turn_before_the_last_is_a_clock_that_runs_backwards(back_us: int) -> None:
    (found,) = untimely(1_000_000, 1_000_000 - back_us, TIMING)
    assert (found.fault, found.since_us) == (Fault.CLOCK_BACKWARDS, 1_000_000 - back_us)


def test_no_decision_is_never_over_time() -> None:
    assert overrun(0, None, TIMING) == ()


@pytest.mark.parametrize("over_us", [-1, 0, 1])
def test_a_decision_overruns_beyond_the_latency_alone(over_us: int) -> None:
    found = overrun(1_000_000, 1_000_000 + LATENCY_US + over_us, TIMING)
    overran = [(Fault.OVERRUN, 1_000_000 + LATENCY_US)] if over_us > 0 else []
    assert [(each.fault, each.since_us) for each in found] == overran


def test_what_came_and_went_is_told_and_nothing_that_stays() -> None:
    known = frozenset({Fault.LATE, Fault.LOG_LOST})
    told = news(known, (LATE, FROZEN), before=State.TRACKING, after=State.BRAKING)
    assert told == ("FROZEN: frozen", "LOG_LOST is over", "TRACKING -> BRAKING")
    same = news(frozenset({Fault.LATE}), (LATE,), before=State.ARMED, after=State.ARMED)
    assert same == ()


def test_an_exception_is_a_fault_even_where_it_cannot_be_put_into_words() -> None:
    class MuteError(Exception):
        def __str__(self) -> NoReturn:
            raise RuntimeError

    mute = internal("turn", MuteError(), 5)
    assert mute == Found(Fault.INTERNAL, "turn: MuteError", 5)
    assert internal("turn", ValueError("no"), 6).detail == "turn: ValueError: no"
