"""People who walk where they are told to, leg by leg, each begun at a cue."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime import MotionLimits
from workbench.simulation.frames import Point
from workbench.simulation.walkers.cues import Cue
from workbench.simulation.walkers.moving import Mover, Who
from workbench.simulation.walkers.pedestrian import CarNow, PersonNow

WALK_OFF_MPS2 = 1.2
"""How people change their velocity who are not in a hurry."""
_PASSED_M = 0.25
_ARRIVED_M = 0.05
_ARRIVED_MPS = 0.05
_STANDING = MotionLimits(1.0, WALK_OFF_MPS2)


@final
@dataclass(frozen=True, slots=True)
class Leg:
    """Straight to a place (m) at a speed (m/s).

    cue: begins delay_s after it, whatever legs before are not done, so that a cue can turn somebody
    back; None: delay_s after the leg before has ended, or the scenario begun. Who goes on at once
    walks by the place, all others come to rest there. Raises InputError unless the speed is above 0
    and the delay 0 or more.
    """

    to: Point
    speed_mps: float
    cue: Cue | None = None
    delay_s: float = 0.0

    def __post_init__(self) -> None:
        if not (all(map(math.isfinite, self.to)) and 0.0 < self.speed_mps < math.inf):
            raise InputError(
                f"leg: expected finite metres and a speed above 0 m/s, got {self.to} and "
                f"{self.speed_mps}"
            )
        if not 0.0 <= self.delay_s < math.inf:
            raise InputError(f"leg: expected a delay of 0 s or more, got {self.delay_s}")

    @property
    def follows_at_once(self) -> bool:
        """Whether it goes on from the leg before without a stop."""
        return self.cue is None and self.delay_s == 0.0


@final
@dataclass(frozen=True, slots=True)
class Script:
    """What somebody does: begin (m), legs in order, none for who stands.

    start_mps: speed at the begin, towards the first leg's end; acceleration_mps2: how fast they
    change their velocity; there_s: from when until when they are there at all.
    """

    begin: Point
    legs: tuple[Leg, ...] = ()
    start_mps: float = 0.0
    acceleration_mps2: float = WALK_OFF_MPS2
    there_s: tuple[float, float] = (-math.inf, math.inf)

    def __post_init__(self) -> None:
        if not self.there_s[0] < self.there_s[1]:
            raise InputError(f"there_s: expected [from, until] with from < until: {self.there_s}")
        if not 0.0 <= self.start_mps < math.inf or (self.start_mps and not self.legs):
            raise InputError(
                f"start_mps: expected 0 or more, and legs for who is not at rest: {self.start_mps}"
            )

    @property
    def limits(self) -> MotionLimits:
        """What they keep to: the fastest leg, and acceleration_mps2."""
        fastest = max((leg.speed_mps for leg in self.legs), default=_STANDING.speed_mps)
        return MotionLimits(max(fastest, self.start_mps), self.acceleration_mps2)

    def moved(self, by: Point) -> Script:
        """The same, at another place."""
        legs = tuple(
            Leg(_sum(leg.to, by), leg.speed_mps, leg.cue, leg.delay_s) for leg in self.legs
        )
        return Script(
            _sum(self.begin, by), legs, self.start_mps, self.acceleration_mps2, self.there_s
        )


@final
class Scripted:
    """Somebody who follows a `Script`."""

    def __init__(self, who: Who, script: Script) -> None:
        """At the begin; raises InputError where the script's numbers are out of order."""
        self._who, self._script = who, script
        self._mover = Mover(script.begin, _start(script), script.limits)
        self._leg = 0 if script.start_mps else -1
        self._from = script.begin
        self._ended_s: float | None = None if script.start_mps else 0.0
        self._cued_s: float | None = None
        self._t_s = 0.0

    @property
    def now(self) -> PersonNow | None:
        """As `Pedestrian` says."""
        first_s, last_s = self._script.there_s
        if not first_s <= self._t_s < last_s:
            return None
        return self._who.at(self._mover.place, self._mover.velocity)

    def advance(self, from_s: float, until_s: float, car: CarNow) -> None:
        """As `Pedestrian` says."""
        begins = self._begins(from_s, car)
        if begins is not None:
            if self._script.legs[begins].cue is not None:
                self._cued_s = None
            self._leg, self._from, self._ended_s = begins, self._mover.place, None
        self._go(until_s - from_s)
        if self._ended_s is None and self._has_ended():
            self._ended_s = until_s
        self._t_s = until_s

    def _begins(self, t_s: float, car: CarNow) -> int | None:
        """Which leg begins now: the next one with a cue, if that was given; or the next one."""
        legs, follows = self._script.legs, self._leg + 1
        cued = next((k for k in range(follows, len(legs)) if legs[k].cue is not None), None)
        if cued is not None:
            cue = legs[cued].cue
            if self._cued_s is None and cue is not None and cue.given(t_s, self._mover.place, car):
                self._cued_s = t_s
            if _over(self._cued_s, legs[cued].delay_s, t_s):
                return cued
        if follows in (cued, len(legs)) or not _over(self._ended_s, legs[follows].delay_s, t_s):
            return None
        return follows

    def _go(self, duration_s: float) -> None:
        if self._leg < 0:
            self._mover.turn_to((0.0, 0.0), duration_s)
            return
        leg = self._script.legs[self._leg]
        self._mover.walk_to(leg.to, leg.speed_mps, duration_s, stops=not self._passes())

    def _passes(self) -> bool:
        """Whether they walk by the end of the leg."""
        follows = self._leg + 1
        return follows < len(self._script.legs) and self._script.legs[follows].follows_at_once

    def _has_ended(self) -> bool:
        if self._leg < 0:
            return False
        to, place = self._script.legs[self._leg].to, self._mover.place
        left_m = math.dist(place, to)
        if self._passes():
            return left_m <= _PASSED_M or _beyond(self._from, to, place)
        return left_m <= _ARRIVED_M and math.hypot(*self._mover.velocity) <= _ARRIVED_MPS


def group(who: Who, script: Script, offsets: Sequence[Point]) -> tuple[Scripted, ...]:
    """Several who do the same, each moved by an offset (m); names get the number, from 1."""
    return tuple(
        Scripted(Who(f"{who.name} {k}", who.kind, who.body_radius_m), script.moved(by))
        for k, by in enumerate(offsets, start=1)
    )


def _start(script: Script) -> Point:
    if not script.start_mps:
        return 0.0, 0.0
    to, begin = script.legs[0].to, script.begin
    away_m = math.dist(to, begin)
    if away_m == 0.0:
        raise InputError("start_mps: expected a first leg that leads away from the begin")
    share = script.start_mps / away_m
    return share * (to[0] - begin[0]), share * (to[1] - begin[1])


def _beyond(begin: Point, end: Point, place: Point) -> bool:
    """Whether a place lies behind the line through the end, across the leg."""
    along = (end[0] - begin[0], end[1] - begin[1])
    return along[0] * (place[0] - end[0]) + along[1] * (place[1] - end[1]) >= 0.0


def _over(since_s: float | None, delay_s: float, t_s: float) -> bool:
    """Whether so much time has gone by since an instant, None for one that has not come."""
    return since_s is not None and t_s >= since_s + delay_s - 1e-9


def _sum(a: Point, b: Point) -> Point:
    return a[0] + b[0], a[1] + b[1]
