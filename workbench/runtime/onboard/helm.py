"""Our own hands on the car: the control law with its integrals, and the frames it ends up in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

from workbench.runtime.contents import Parameter
from workbench.runtime.onboard import observing
from workbench.runtime.onboard.actuation import Actuated, Outputs, Wanted
from workbench.runtime.onboard.commands import Commander, Frame
from workbench.runtime.onboard.gate import Upstream, passed
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.pid import (
    NOTHING,
    Integrals,
    LawCommand,
    Reading,
    TrackLaw,
    advanced,
    law_of,
    ramped_reference_mps,
)
from workbench.runtime.onboard.states import Mode, Order

_RESTED_S: Final = 1.0
_MOST_MS: Final = 2.4
"""Of the offset's integral at a start: four fifths of the shipped operating region."""


@final
class Helm:
    """Carries out one order per turn; one thread.

    parameters: of the bundle's loop, from which the law is; upstream: whose commands pass instead
    of ours, None for ours. In SHADOW nothing is carried out. The speed's integral begins anew with
    every switch between TRACK and BRAKE, as in the proof; both are 0 while nothing is driven.
    The reference speed begins at the speed that is read and goes to the target with no more change
    from decision to decision than the pedals' slew lets through in one turn (a jump would be
    withheld, which no tube holds). `integrals` names the next one, and TRACK follows it only once
    it was decided on (`follow`): the speed that a tube is about is the one that is followed. For
    the same reason the offset's integral of a car that has rested (no plan is about it any more) is
    the one with which the wheel does not turn at first: the offset at the start is driven out by
    the integral, over kp / ki.
    Raises InputError for a vehicle or a loop that cannot be driven.
    """

    def __init__(
        self,
        settings: OnboardSettings,
        parameters: Sequence[Parameter],
        *,
        upstream: Upstream | None,
        mode: Mode,
    ) -> None:
        self._settings, self._upstream = settings, upstream
        self._driver = None
        if mode is not Mode.SHADOW:
            self._driver = Commander(settings.drive_by_wire), law_of(parameters)
        self._integrals = Integrals()
        self._command = NOTHING
        self._order = Order.SILENT
        self._rested_s = 0.0
        self._reference_mps = self._next_mps = settings.reference_speed_mps
        self.fault = ""

    @property
    def integrals(self) -> observing.Integrals:
        """The integrals now, as an observation has them, and the reference speed to decide on."""
        speed, offset = self._integrals.speed_m, self._integrals.offset_ms
        return observing.Integrals((speed, speed), (offset, offset), self._next_mps)

    @property
    def outputs(self) -> Outputs | None:
        """What was last sent under TRACK or BRAKE; None while nothing is driven."""
        last = self._last
        return None if last is None else last.sent.outputs

    @property
    def acceleration_mps2(self) -> float:
        """What was last asked of the pedals, 0 under BRAKE."""
        last = self._last
        return 0.0 if last is None else last.sent.command.acceleration_mps2

    @property
    def _last(self) -> Actuated | None:
        return None if self._driver is None else self._driver[0].last

    def elapse(self, elapsed_s: float) -> None:
        """So much time has passed under the last command."""
        self._integrals = advanced(self._integrals, self._command, elapsed_s)
        if self._driver is not None:
            dbw = self._settings.drive_by_wire
            self._next_mps = ramped_reference_mps(
                self._driver[1],
                self._reference_mps,
                target_mps=self._settings.reference_speed_mps,
                slew_mps3=dbw.pedals.slew_mps3,
                step_s=min(elapsed_s, dbw.turn_s),
            )

    def follow(self, reference_speed_mps: float) -> None:
        """TRACK was decided on an observation that names this reference speed."""
        self._reference_mps = reference_speed_mps

    def carry_out(
        self,
        order: Order,
        reading: Reading | None,
        *,
        read_back_rad: float,
        elapsed_s: float,
        made_s: float = 0.0,
    ) -> tuple[Frame, ...]:
        """The vehicle's frames for this turn; `fault` says why TRACK became BRAKE, or ''.

        reading: None where the car is not known to be on the path; BRAKE then holds the steering
        wheel where the last path command had it. elapsed_s, made_s: see `Commander.track`.
        """
        self.fault = ""
        if self._driver is None:
            return ()
        if order is not Order.TRACK and reading is not None:
            self._reference_mps = max(reading.speed_mps, 0.0)
        commander, law = self._driver
        if order in (Order.TRACK, Order.BRAKE):
            now = _Now(commander, law, reading, read_back_rad, elapsed_s, made_s)
            self._switched(order)
            self._rest(order, now)
            return self._driven(order, now)
        self._integrals, self._command, self._order = Integrals(), NOTHING, order
        # Only a car that stands is armed.
        self._rested_s = _RESTED_S
        if order is Order.ENABLE:
            return commander.enable(read_back_rad)
        if order is Order.CLEAR_OVERRIDE:
            return commander.clear_override()
        return commander.give_up() if order is Order.DISABLE else commander.silent()

    def _switched(self, order: Order) -> None:
        if order is not self._order:
            self._integrals = replace(self._integrals, speed_m=0.0)
        self._order = order

    def _rest(self, order: Order, now: _Now) -> None:
        """The offset's integral of a car that is braked and rests."""
        if order is Order.TRACK:
            self._rested_s = 0.0
        elif now.reading is not None:
            stands = now.reading.speed_mps <= self._settings.drive_by_wire.stop_speed_mps
            self._rested_s = self._rested_s + now.elapsed_s if stands else 0.0
            if self._rested_s >= _RESTED_S:
                offset_ms = now.law.at_rest(now.reading, most_ms=_MOST_MS)
                self._integrals = replace(self._integrals, offset_ms=offset_ms)

    def _driven(self, order: Order, now: _Now) -> tuple[Frame, ...]:
        if order is Order.TRACK:
            frames = self._tracked(now)
            if not self.fault:
                return frames
            self._switched(Order.BRAKE)
        self._command = NOTHING
        if now.reading is not None:
            stop_mps = self._settings.drive_by_wire.stop_speed_mps
            self._command = now.law.brake(now.reading, self._integrals, stop_speed_mps=stop_mps)
        if not _finite(self._command):
            return now.commander.hold()
        return now.commander.brake(
            self._command.steering_rate_radps,
            read_back_rad=now.read_back_rad,
            elapsed_s=now.elapsed_s,
            made_s=now.made_s,
        )

    def _tracked(self, now: _Now) -> tuple[Frame, ...]:
        command = NOTHING
        if now.reading is not None:
            command = now.law.track(
                now.reading,
                self._integrals,
                reference_speed_mps=self._reference_mps,
            )
        if not _finite(command):
            self.fault = "the control law gives no command here"
            return ()
        wanted = own = Wanted(command.acceleration_mps2, command.steering_rate_radps)
        if self._upstream is not None:
            margin, dbw = self._settings.gate, self._settings.drive_by_wire
            wanted = passed(self._upstream.wanted(now.read_back_rad), own, margin, dbw)
        frames = now.commander.track(
            wanted.acceleration_mps2,
            wanted.steering_rate_radps,
            read_back_rad=now.read_back_rad,
            elapsed_s=now.elapsed_s,
            made_s=now.made_s,
        )
        last = now.commander.last
        if last is None:
            self.fault = "nothing is enabled"
        elif not last.covered:
            self.fault = last.fault or (
                f"what is sent stays behind by {last.withheld.acceleration_mps2:.3f} m/s^2 and "
                f"{last.withheld.steering_rate_radps:.3f} rad/s"
            )
        self._command = command
        return frames


@final
@dataclass(frozen=True, slots=True)
class _Now:
    """Who acts in this turn, and on what."""

    commander: Commander
    law: TrackLaw
    reading: Reading | None
    read_back_rad: float
    elapsed_s: float
    made_s: float


def _finite(command: LawCommand) -> bool:
    return math.isfinite(command.acceleration_mps2)
