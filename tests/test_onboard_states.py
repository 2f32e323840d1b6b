"""Only stated ways lead from state to state: no TRACK with a fault, no latch that goes away."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from workbench.runtime import Action
from workbench.runtime.onboard.faults import Reaction
from workbench.runtime.onboard.states import (
    BRAKING,
    CLEARING_TURNS,
    COMMANDING,
    Order,
    Request,
    Situation,
    Standing,
    State,
    next_standing,
    started,
)
from workbench.runtime.protocols import load_protocol

RELEASE_US = 1_000_000
TURN_US = 33_333
CALM = Situation(0, frozenset(), None, Action.BRAKE, enabled=False, stands=True)

situations = st.builds(
    Situation,
    now_us=st.just(0),
    reactions=st.frozensets(st.sampled_from(Reaction), max_size=2),
    request=st.one_of(st.none(), st.sampled_from(Request)),
    action=st.sampled_from(Action),
    enabled=st.booleans(),
    stands=st.booleans(),
)
# Most turns are calm, or little but DISARMED and YIELDED would be seen.
lives = st.lists(
    st.one_of(
        situations,
        st.sampled_from(
            [
                Situation(0, frozenset(), request, Action.TRACK, enabled=True, stands=True)
                for request in (None, None, None, Request.ARM, Request.REARM)
            ]
        ),
    ),
    max_size=60,
)


def turn(before: Standing, now: Situation) -> tuple[Standing, Order]:
    return next_standing(before, now, release_us=RELEASE_US)


def at(now: Situation, k: int) -> Situation:
    return Situation(
        k * TURN_US, now.reactions, now.request, now.action, enabled=now.enabled, stands=now.stands
    )


@given(lives)
def test_every_life_keeps_to_the_rules(life: list[Situation]) -> None:
    standing = started(0)
    orders: list[Order] = [Order.SILENT]
    for k, plain in enumerate(life):
        now, before = at(plain, k), standing
        standing, order = turn(before, now)
        orders.append(order)
        if order is Order.TRACK:
            assert not now.reactions & (BRAKING | {Reaction.YIELD})
            assert now.action is Action.TRACK
            assert standing.state is State.TRACKING
            assert not standing.latched
        if Reaction.YIELD in now.reactions:
            assert standing.state not in COMMANDING or before.state not in COMMANDING
            assert order in (Order.SILENT, Order.DISABLE, Order.CLEAR_OVERRIDE)
        if order is Order.DISABLE:
            assert before.state in COMMANDING
            assert standing.state in (State.DISARMED, State.YIELDED)
        silent = standing.state in (State.DISARMED, State.YIELDED)
        assert silent is (order in (Order.SILENT, Order.DISABLE))
        if before.latched and standing.state is not State.DISARMED:
            assert standing.latched
            assert standing.state in (State.FAULT, State.YIELDED)
        _keeps_to_the_enabling(orders)


def _keeps_to_the_enabling(orders: list[Order]) -> None:
    """ENABLE comes after CLEAR_OVERRIDE, and TRACK after BRAKE, which ends the arming."""
    if orders[-1] is Order.ENABLE:
        assert orders[-2] in (Order.CLEAR_OVERRIDE, Order.ENABLE)
    if orders[-1] is Order.TRACK:
        assert orders[-2] in (Order.TRACK, Order.BRAKE)
    if orders[-1] is Order.BRAKE:
        assert orders[-2] is not Order.SILENT
        assert orders[-2] is not Order.DISABLE
    if orders[-1] is Order.CLEAR_OVERRIDE:
        assert orders[-2] in (Order.SILENT, Order.DISABLE, Order.CLEAR_OVERRIDE)


def armed() -> Standing:
    standing, order = turn(started(0), at(_asking(Request.ARM), 1))
    assert (standing.state, order) == (State.ARMED, Order.CLEAR_OVERRIDE)
    return standing


def _asking(request: Request | None, *reactions: Reaction, **changed: bool) -> Situation:
    flags = {"enabled": False, "stands": True} | changed
    return Situation(0, frozenset(reactions), request, Action.TRACK, **flags)


def braking() -> Standing:
    standing = armed()
    for _ in range(CLEARING_TURNS - 1):
        standing, order = turn(standing, at(_asking(None, enabled=True), 2))
        assert order is Order.CLEAR_OVERRIDE
    standing, order = turn(standing, at(_asking(None), 3))
    assert order is Order.ENABLE
    standing, order = turn(standing, at(_asking(None, enabled=True), 4))
    assert (standing.state, order) == (State.BRAKING, Order.BRAKE)
    return standing


def test_arming_clears_then_enables_then_brakes_then_tracks() -> None:
    standing, order = turn(braking(), at(_asking(None), 5))
    assert (standing.state, order) == (State.TRACKING, Order.TRACK)


def test_a_fault_ends_arming_and_nothing_has_braked() -> None:
    for reaction in (Reaction.BRAKE, Reaction.LATCH, Reaction.REFUSE):
        standing, order = turn(armed(), at(_asking(None, reaction), 2))
        assert (standing, order) == (started(2 * TURN_US), Order.DISABLE)


def test_a_brake_is_released_when_it_is_over_and_the_car_stands() -> None:
    standing, _ = turn(braking(), at(_asking(None, Reaction.BRAKE), 5))
    k = 5
    while k * TURN_US < 5 * TURN_US + RELEASE_US:
        k += 1
        before = standing
        standing, order = turn(before, at(_asking(None), k))
        released = (k - 5) * TURN_US >= RELEASE_US
        assert order is (Order.TRACK if released else Order.BRAKE)
    moving, _ = turn(before, at(_asking(None, stands=False), k + 30))
    assert moving.state is State.BRAKING


def test_a_latch_survives_yielding_and_only_disarm_ends_it() -> None:
    fault, order = turn(braking(), at(_asking(None, Reaction.LATCH), 5))
    assert (fault.state, order) == (State.FAULT, Order.BRAKE)
    assert turn(fault, at(_asking(None), 90))[0].state is State.FAULT
    yielded, order = turn(fault, at(_asking(None, Reaction.YIELD), 6))
    assert (yielded.state, order) == (State.YIELDED, Order.DISABLE)
    assert turn(yielded, at(_asking(Request.REARM), 7)) == (yielded, Order.SILENT)
    disarmed, order = turn(yielded, at(_asking(Request.DISARM), 8))
    assert (disarmed.state, order) == (State.DISARMED, Order.SILENT)
    assert turn(disarmed, at(_asking(Request.ARM), 9))[0].state is State.ARMED
    yielded, _ = turn(braking(), at(_asking(None, Reaction.YIELD), 5))
    yielded, _ = turn(yielded, at(_asking(None, Reaction.LATCH), 6))
    assert yielded.latched
    assert turn(yielded, at(_asking(Request.REARM), 7))[0].state is State.YIELDED


def test_who_yielded_comes_back_by_rearm_alone() -> None:
    yielded, _ = turn(braking(), at(_asking(None, Reaction.YIELD), 5))
    assert turn(yielded, at(_asking(Request.ARM), 6))[0] == yielded
    rearmed, order = turn(yielded, at(_asking(Request.REARM), 6))
    assert (rearmed.state, order) == (State.ARMED, Order.CLEAR_OVERRIDE)


def test_disarming_brakes_a_moving_car_first_unless_asked_twice() -> None:
    standing, order = turn(braking(), at(_asking(Request.DISARM, stands=False), 5))
    assert (standing.state, order) == (State.BRAKING, Order.BRAKE)
    standing, order = turn(standing, at(_asking(None, stands=False), 6))
    assert (standing.state, order) == (State.BRAKING, Order.BRAKE)
    assert turn(standing, at(_asking(None), 7)) == (started(7 * TURN_US), Order.DISABLE)
    twice = turn(standing, at(_asking(Request.DISARM, stands=False), 7))
    assert twice == (started(7 * TURN_US), Order.DISABLE)


def test_the_numbers_are_those_of_the_heartbeat() -> None:
    heartbeat = load_protocol("workbench").by_name["HEARTBEAT"]
    assert dict(heartbeat.signal("STATE").choices) == {state: state.name for state in State}
