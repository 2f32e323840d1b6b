"""Who has the car: the states of the monitor on the vehicle, and the one function between them."""

from __future__ import annotations

import dataclasses
import enum
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.decision import Action
from workbench.runtime.onboard.faults import Reaction

CLEARING_TURNS: Final = 3
"""How many turns in a row ask the vehicle to clear an override, each a frame set without ENABLE."""


@final
class Mode(enum.IntEnum):
    """What the monitor may do; the numbers are those of HEARTBEAT.MODE.

    SHADOW: nothing is sent to the vehicle. GATE: an upstream controller's commands pass, within
    what the proof covers. DRIVE: our own controller's.
    """

    SHADOW = 1
    GATE = 2
    DRIVE = 3


@final
class State(enum.IntEnum):
    """Where the monitor is; the numbers are those of HEARTBEAT.STATE.

    DISARMED: silent. ARMED: overrides are cleared, then ENABLE goes out with accelerator 0 and
    brake 0 until the vehicle says that it is enabled. TRACKING, BRAKING: what is commanded.
    YIELDED: the driver has the car, nothing is sent. FAULT: BRAKE until the operator disarms.
    """

    DISARMED = 1
    ARMED = 2
    TRACKING = 3
    BRAKING = 4
    YIELDED = 5
    FAULT = 6


COMMANDING: Final = frozenset({State.ARMED, State.TRACKING, State.BRAKING, State.FAULT})
"""States in which the vehicle gets frames on every turn."""

DRIVING: Final = frozenset({State.TRACKING, State.BRAKING})
"""States in which decisions move the car."""


@final
class Request(enum.Enum):
    """What the operator asks for; ARM and REARM only count once they were checked."""

    ARM = "arm"
    DISARM = "disarm"
    REARM = "rearm"


@final
class Order(enum.Enum):
    """What goes to the vehicle on this turn.

    DISABLE: ENABLE 0, once. CLEAR_OVERRIDE: without ENABLE. ENABLE: with accelerator 0, brake 0.
    """

    SILENT = enum.auto()
    DISABLE = enum.auto()
    CLEAR_OVERRIDE = enum.auto()
    ENABLE = enum.auto()
    TRACK = enum.auto()
    BRAKE = enum.auto()


@final
@dataclass(frozen=True, slots=True)
class Standing:
    """What is remembered from turn to turn.

    since_us: when the state began; latched: a LATCH was found since the last DISARM; faulted_us:
    when a fault that brakes was last found, None once it is released; clearing: turns left that
    clear an override; disarming: DISARM was asked while the car moved, and it is braked first.
    """

    state: State
    since_us: int
    latched: bool = False
    faulted_us: int | None = None
    clearing: int = 0
    disarming: bool = False


@final
@dataclass(frozen=True, slots=True)
class Situation:
    """What one turn knows: reactions: of all faults found; request: of the operator, checked;
    action: what the decision in force permits; enabled: the vehicle reports so, since it was
    asked; stands: the car is measured at standstill."""

    now_us: int
    reactions: frozenset[Reaction]
    request: Request | None
    action: Action
    enabled: bool
    stands: bool


_LATCHING: Final = frozenset({Reaction.LATCH, Reaction.REFUSE})
BRAKING: Final = _LATCHING | {Reaction.BRAKE}
"""Reactions that brake a car that is driven."""


def started(now_us: int) -> Standing:
    """Silent, until the operator arms."""
    return Standing(State.DISARMED, now_us)


def held(standing: Standing, situation: Situation, *, release_us: int) -> bool:
    """Whether a fault keeps the car braked, whatever decisions say.

    A fault that brakes holds for release_us (us) after it was last found, and until the car stands.
    """
    stays = standing.state is State.FAULT or standing.disarming
    if stays or situation.reactions & BRAKING or situation.request is Request.DISARM:
        return True
    since_us = standing.faulted_us
    if since_us is None:
        return False
    return situation.now_us - since_us < release_us or not situation.stands


def next_standing(
    before: Standing, situation: Situation, *, release_us: int
) -> tuple[Standing, Order]:
    """The state after this turn, and what it sends.

    YIELD goes before everything, then DISARM, then what latches, then what brakes, then the
    decision. DISARM brakes a car that moves until it stands, unless it is asked twice. A fault
    while ARMED ends the arming: nothing is driven yet. A LATCH found while the car is yielded
    leaves it with the driver, and only DISARM, then ARM, takes it back.
    """
    state, now_us = before.state, situation.now_us
    latched = state is not State.DISARMED and (
        before.latched or bool(situation.reactions & _LATCHING)
    )
    before = dataclasses.replace(before, latched=latched)
    if state in COMMANDING and Reaction.YIELD in situation.reactions:
        return Standing(State.YIELDED, now_us, latched=latched), Order.DISABLE
    asked = situation.request is Request.DISARM
    if asked or before.disarming:
        halts = state in DRIVING or state is State.FAULT
        if not halts or situation.stands or (asked and before.disarming):
            return started(now_us), Order.DISABLE if state in COMMANDING else Order.SILENT
        before = dataclasses.replace(before, disarming=True)
    if state not in COMMANDING:
        return _waiting(before, situation)
    if state is State.ARMED:
        return _arming(before, situation)
    if latched:
        return _in_state(before, State.FAULT, now_us), Order.BRAKE
    return _driven(before, situation, release_us=release_us)


def _waiting(before: Standing, situation: Situation) -> tuple[Standing, Order]:
    """DISARMED or YIELDED: only a request that fits leads on."""
    disarmed = before.state is State.DISARMED
    wanted = Request.ARM if disarmed else Request.REARM
    if situation.request is not wanted or before.latched:
        return before, Order.SILENT
    armed = Standing(State.ARMED, situation.now_us, clearing=CLEARING_TURNS - 1)
    return armed, Order.CLEAR_OVERRIDE


def _arming(before: Standing, situation: Situation) -> tuple[Standing, Order]:
    """ARMED: clear, enable, and brake as soon as the vehicle is enabled."""
    if situation.reactions & BRAKING:
        return started(situation.now_us), Order.DISABLE
    if before.clearing:
        left = dataclasses.replace(before, clearing=before.clearing - 1)
        return left, Order.CLEAR_OVERRIDE
    if situation.enabled:
        return Standing(State.BRAKING, situation.now_us), Order.BRAKE
    return before, Order.ENABLE


def _driven(before: Standing, situation: Situation, *, release_us: int) -> tuple[Standing, Order]:
    """TRACKING or BRAKING: BRAKE while a fault holds the car, then what the decision permits."""
    now_us = situation.now_us
    if held(before, situation, release_us=release_us):
        found = bool(situation.reactions & BRAKING)
        kept = dataclasses.replace(before, faulted_us=now_us if found else before.faulted_us)
        return _in_state(kept, State.BRAKING, now_us), Order.BRAKE
    if situation.action is Action.TRACK:
        free = dataclasses.replace(before, faulted_us=None)
        return _in_state(free, State.TRACKING, now_us), Order.TRACK
    return _in_state(before, State.BRAKING, now_us), Order.BRAKE


def _in_state(before: Standing, state: State, now_us: int) -> Standing:
    since_us = before.since_us if before.state is state else now_us
    return dataclasses.replace(before, state=state, since_us=since_us)
