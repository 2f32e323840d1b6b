"""The edges of the states: three turns clear, release to the microsecond, a latched car stops."""

from __future__ import annotations

import pytest

from workbench.runtime import Action
from workbench.runtime.onboard.arming import state_refusal
from workbench.runtime.onboard.faults import Reaction
from workbench.runtime.onboard.states import (
    Mode,
    Order,
    Request,
    Situation,
    Standing,
    State,
    held,
    next_standing,
    started,
)
from workbench.runtime.protocols import load_protocol

RELEASE_US = 1_000_000


def now(
    now_us: int,
    *reactions: Reaction,
    request: Request | None = None,
    enabled: bool = False,
    stands: bool = True,
) -> Situation:
    return Situation(
        now_us, frozenset(reactions), request, Action.TRACK, enabled=enabled, stands=stands
    )


def turn(before: Standing, situation: Situation) -> tuple[Standing, Order]:
    return next_standing(before, situation, release_us=RELEASE_US)


def test_an_override_is_cleared_for_three_turns_and_only_then_enable_goes_out() -> None:
    standing, order = turn(started(0), now(1, request=Request.ARM))
    orders = [order]
    for k in range(2, 6):
        standing, order = turn(standing, now(k))
        orders.append(order)
    assert orders == [Order.CLEAR_OVERRIDE] * 3 + [Order.ENABLE] * 2


def test_nothing_is_remembered_at_the_start() -> None:
    nothing = Standing(State.DISARMED, 7, latched=False, faulted_us=None, clearing=0)
    assert started(7) == nothing
    assert not nothing.disarming


@pytest.mark.parametrize("since_us", [0, 5])
def test_a_fault_holds_the_car_to_the_last_microsecond_of_the_release_time(since_us: int) -> None:
    braking = Standing(State.BRAKING, 0, faulted_us=since_us)
    last, first = now(since_us + RELEASE_US - 1), now(since_us + RELEASE_US)
    assert held(braking, last, release_us=RELEASE_US) is True
    assert held(braking, first, release_us=RELEASE_US) is False
    assert turn(braking, last)[1] is Order.BRAKE
    assert turn(braking, first)[1] is Order.TRACK
    rolls = now(since_us + RELEASE_US, stands=False)
    assert held(braking, rolls, release_us=RELEASE_US) is True


def test_who_was_never_at_fault_is_not_held() -> None:
    braking = Standing(State.BRAKING, 0)
    assert held(braking, now(1, stands=False), release_us=RELEASE_US) is False


def test_a_latched_car_that_moves_is_braked_before_it_is_let_go() -> None:
    fault = Standing(State.FAULT, 0, latched=True)
    asked = turn(fault, now(1, request=Request.DISARM, stands=False))
    assert asked[1] is Order.BRAKE
    assert asked[0].state is State.FAULT
    assert asked[0].disarming
    assert turn(asked[0], now(2, stands=False))[1] is Order.BRAKE
    assert turn(asked[0], now(2)) == (started(2), Order.DISABLE)


def test_a_state_has_lasted_since_it_began() -> None:
    braking = Standing(State.BRAKING, 10)
    for k in (20, 30):
        braking, order = turn(braking, now(k, Reaction.BRAKE))
        assert (braking.since_us, braking.faulted_us, order) == (10, k, Order.BRAKE)
    tracking, _ = turn(Standing(State.BRAKING, 10), now(40))
    assert (tracking.state, tracking.since_us) == (State.TRACKING, 40)
    assert turn(tracking, now(50))[0].since_us == 40


def test_the_modes_numbers_are_those_of_the_heartbeat() -> None:
    mode = load_protocol("workbench").by_name["HEARTBEAT"].signal("MODE")
    assert dict(mode.choices) == {each: each.name for each in Mode}


def test_a_latch_refuses_the_operator_in_words() -> None:
    yielded = Standing(State.YIELDED, 0, latched=True)
    assert "latched" in state_refusal(Request.REARM, yielded, Mode.DRIVE)
    assert state_refusal(Request.REARM, Standing(State.YIELDED, 0), Mode.DRIVE) == ""
