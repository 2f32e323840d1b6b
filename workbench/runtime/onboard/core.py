"""The core of the monitor on the vehicle: frames in, frames out, turn by turn, without a clock."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable
from typing import Final, final

from workbench.runtime.bundle import Bundle
from workbench.runtime.decision import Action, Decision
from workbench.runtime.onboard.announcing import Announcer
from workbench.runtime.onboard.arming import fault_refusal, state_refusal
from workbench.runtime.onboard.commands import Frame
from workbench.runtime.onboard.faults import Fault, Found, Reaction
from workbench.runtime.onboard.found_in_car import enabled_since, stands
from workbench.runtime.onboard.helm import Helm
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.last_resort import LastResort
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.permission import Permission
from workbench.runtime.onboard.states import (
    BRAKING,
    COMMANDING,
    DRIVING,
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
from workbench.runtime.onboard.times import DECIDE_EVERY, seconds
from workbench.runtime.onboard.turns import TurnResult, internal, news, overrun, untimely
from workbench.runtime.onboard.watching import Sight, Watch
from workbench.runtime.path import PathTable

__all__ = ["Core", "Frame", "Mode", "Request", "State", "TurnResult"]

_ASKED_US: Final = 100_000
"""An ARM that waited longer than this is not carried out: whoever asked has seen other things."""


@final
class Core:
    """Checks faults and makes frames on every turn, decides on every third.

    The same calls with the same numbers give the same results, bit for bit. `receive`,
    `receive_upstream`, `bus_error`, `request` and `turn` never raise; what goes wrong inside is
    INTERNAL, and brakes a car that is driven. All calls from one thread. Raises InputError for a
    bundle, settings or a mode that do not fit each other.
    """

    def __init__(
        self, bundle: Bundle, path: PathTable, settings: OnboardSettings, *, mode: Mode
    ) -> None:
        manifest = bundle.manifest
        self._mode, self._settings, self._brake = mode, settings, manifest.brake
        self._watch = Watch(manifest, path, settings, mode=mode)
        self._helm = Helm(settings, manifest.parameters, upstream=self._watch.upstream, mode=mode)
        self._permission = Permission(bundle, path, settings)
        self._announcer = Announcer(mode, settings.bundle_tag)
        self._last_resort = LastResort(settings.drive_by_wire, mode)
        self._standing = started(0)
        self._request: tuple[Request, int] | None = None
        self._broken: Found | None = None
        self._known: frozenset[Fault] = frozenset()
        self._turns, self._owes = 0, False
        self._before_us: int | None = None

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        """One frame from the vehicle's bus."""
        try:
            self._watch.receive(identifier, data, at_us)
        except Exception as error:
            self._broke("receive", error, at_us)

    def receive_upstream(self, identifier: int, data: bytes, at_us: int) -> None:
        """One frame from the upstream controller's bus; in GATE alone it means something."""
        try:
            if self._watch.upstream is not None:
                self._watch.upstream.receive(identifier, data, at_us)
        except Exception as error:
            self._broke("receive_upstream", error, at_us)

    def bus_error(self, kind: BusError, at_us: int) -> None:
        """The bus or its driver reports an error."""
        try:
            self._watch.intake.bus_error(kind, at_us)
        except Exception as error:
            self._broke("bus_error", error, at_us)

    def request(self, request: Request, at_us: int) -> None:
        """The operator asks; the next turn answers with an event. DISARM is never overwritten."""
        if self._request is None or self._request[0] is not Request.DISARM:
            self._request = request, at_us

    def turn(self, at_us: int, clock: Callable[[], int]) -> TurnResult:
        """One turn that begins at at_us; clock: read once, when a decision has ended."""
        try:
            result = self._turn(at_us, clock)
        except Exception as error:
            result = self._failed(at_us, error)
        self._before_us = at_us
        self._turns += 1
        return result

    def _turn(self, at_us: int, clock: Callable[[], int]) -> TurnResult:
        self._helm.elapse(self._elapsed_s(at_us))
        sight = self._watch.look(at_us, self._standing, self._helm.integrals)
        found = (*self._own_faults(at_us), *sight.found)
        request, events = self._checked(found, at_us)
        situation = self._situation(found, request, at_us)
        asked = self._asks(situation)
        decision, ended_us = self._decided(sight, at_us, clock) if asked else (None, None)
        now_us = at_us if ended_us is None else max(at_us, ended_us)
        found += overrun(at_us, ended_us, self._settings.timing)
        situation = dataclasses.replace(situation, action=self._permitted(situation, now_us))
        before, order = self._standing.state, self._moved_on(situation, now_us, sight)
        if order is Order.TRACK:
            self._follow_reference(sight, decision)
        frames, fault = self._commanded(order, sight, now_us=now_us, begun_us=at_us)
        found += fault
        events += news(self._known, found, before=before, after=self._standing.state)
        self._known = frozenset(each.fault for each in found)
        return TurnResult(
            at_us,
            (*frames, *self._announced(sight, decision, at_us, asked=asked)),
            self._standing.state,
            decision,
            ended_us,
            None if decision is None else sight.observation,
            found,
            events,
        )

    def _elapsed_s(self, at_us: int) -> float:
        return 0.0 if self._before_us is None else seconds(max(at_us - self._before_us, 0))

    def _own_faults(self, at_us: int) -> tuple[Found, ...]:
        """What the core itself has noticed since the last turn."""
        found = () if self._broken is None else (self._broken,)
        self._broken = None
        return (*found, *untimely(self._before_us, at_us, self._settings.timing))

    def _checked(
        self, found: tuple[Found, ...], at_us: int
    ) -> tuple[Request | None, tuple[str, ...]]:
        """The operator's request where it may be carried out, and the answer."""
        if self._request is None:
            return None, ()
        (asked, asked_us), self._request = self._request, None
        if asked is Request.DISARM:
            return asked, ("disarming, as asked",)
        refusal = state_refusal(asked, self._standing, self._mode)
        if not refusal and not 0 <= at_us - asked_us <= _ASKED_US:
            refusal = f"asked {at_us - asked_us} us ago; ask again"
        refusal = refusal or fault_refusal(found, self._watch.intake, self._settings, at_us)
        if refusal:
            return None, (f"not armed: {refusal}",)
        agreed_m = self._watch.agreed_m
        seen = f"agree with localisation over {agreed_m:.1f} m" if agreed_m else "were not compared"
        return asked, (f"armed; speed and steering reports {seen}",)

    def _situation(
        self, found: tuple[Found, ...], request: Request | None, at_us: int
    ) -> Situation:
        intake, limits = self._watch.intake, self._settings.limits
        return Situation(
            now_us=at_us,
            reactions=frozenset(each.fault.reaction for each in found),
            request=request,
            action=Action.BRAKE,
            enabled=enabled_since(intake, self._standing.since_us),
            stands=stands(intake, limits),
        )

    def _asks(self, situation: Situation) -> bool:
        """Whether this turn decides: every third, but not before an answer to a fault is sent.

        The decision takes time that a car with a new fault does not have; the next turn makes up.
        """
        standing, reactions = self._standing, situation.reactions
        due = self._owes or self._turns % DECIDE_EVERY == 0
        yields = standing.state in COMMANDING and Reaction.YIELD in reactions
        calm = standing.state in DRIVING | {State.ARMED} and standing.faulted_us is None
        self._owes = due and bool(yields or (calm and reactions & BRAKING))
        return due and not self._owes

    def _decided(
        self, sight: Sight, at_us: int, clock: Callable[[], int]
    ) -> tuple[Decision | None, int | None]:
        if sight.observation is None:
            return None, None
        return self._permission.decide(sight.observation, at_us, clock)

    def _permitted(self, situation: Situation, now_us: int) -> Action:
        """What may be done now, told to the monitor where a fault says otherwise."""
        release_us = self._settings.limits.release_us
        if held(self._standing, situation, release_us=release_us):
            self._permission.hold(now_us)
            return Action.BRAKE
        return self._permission.turn(now_us).action

    def _moved_on(self, situation: Situation, now_us: int, sight: Sight) -> Order:
        """Into the next state; a car that begins or ceases to obey is a new beginning."""
        release_us = self._settings.limits.release_us
        drove = self._standing.state in _OBEYING
        self._standing, order = next_standing(self._standing, situation, release_us=release_us)
        drives = self._standing.state in _OBEYING
        if drives is not drove:
            self._permission.begin(now_us, drives=drives, station_m=sight.station_m)
            self._permission.turn(now_us)
        return order

    def _follow_reference(self, sight: Sight, decision: Decision | None) -> None:
        """What TRACK was decided for is what it follows; a refused one leaves the last."""
        if sight.observation is not None and decision and decision.action is Action.TRACK:
            self._helm.follow(sight.observation.reference_speed_mps)

    def _commanded(
        self, order: Order, sight: Sight, *, now_us: int, begun_us: int
    ) -> tuple[tuple[Frame, ...], tuple[Found, ...]]:
        """The vehicle's frames, and what was found in making them."""
        frames = self._helm.carry_out(
            order,
            sight.reading,
            read_back_rad=sight.read_back_rad,
            elapsed_s=self._elapsed_s(begun_us),
            made_s=seconds(now_us - begun_us),
        )
        fault: tuple[Found, ...] = ()
        if self._helm.fault:
            fault = (Found(Fault.NOT_COVERED, self._helm.fault, now_us),)
            self._standing = dataclasses.replace(
                self._standing, state=State.BRAKING, since_us=now_us, faulted_us=now_us
            )
            self._permission.hold(now_us)
        if not frames and order in (Order.TRACK, Order.BRAKE):
            frames = self._last_resort.brake()
        self._last_resort.sent(frames)
        self._follow(sight, now_us)
        return frames, fault

    def _follow(self, sight: Sight, now_us: int) -> None:
        """Remember what was sent, so that the vehicle can be held to it."""
        watch, outputs = self._watch, self._helm.outputs
        if outputs is None:
            watch.following = watch.following.silent()
            return
        braking = self._standing.state is not State.TRACKING
        fastest_mps = self._settings.limits.speed_mps[1]
        if sight.observation is not None:
            fastest_mps = sight.observation.speed[1]
        watch.following = watch.following.commanding(
            now_us,
            outputs,
            acceleration_mps2=-self._brake.deceleration_min_mps2
            if braking
            else self._helm.acceleration_mps2,
            brakes_from_mps=fastest_mps if braking else None,
        )

    def _announced(
        self, sight: Sight, decision: Decision | None, at_us: int, *, asked: bool
    ) -> tuple[Frame, ...]:
        beat = self._announcer.heartbeat(at_us, self._standing.state)
        if not asked:
            return (beat,)
        brakes = self._standing.state in (State.BRAKING, State.FAULT)
        said = self._announcer.decision(decision, at_us, brakes=brakes, people_set=sight.people_set)
        return (beat, *said)

    def _broke(self, where: str, error: Exception, at_us: int) -> None:
        self._broken = internal(where, error, at_us)

    def _failed(self, at_us: int, error: Exception) -> TurnResult:
        """What is sent when a turn could not be made: BRAKE where the car is driven."""
        found, before = internal("turn", error, at_us), self._standing.state
        frames: tuple[Frame, ...] = ()
        if before in _OBEYING:
            frames = self._last_resort.brake()
            self._standing = Standing(State.FAULT, at_us, latched=True)
        elif before is State.ARMED:
            frames = self._last_resort.disable()
            self._standing = started(at_us)
        own: tuple[Frame, ...] = ()
        with contextlib.suppress(Exception):
            own = (self._announcer.heartbeat(at_us, self._standing.state),)
        state, self._known = self._standing.state, frozenset()
        events = news(frozenset(), (found,), before=before, after=state)
        return TurnResult(at_us, (*frames, *own), state, None, None, None, (found,), events)


_OBEYING: Final = DRIVING | {State.FAULT}
"""States in which the car does what we send."""
