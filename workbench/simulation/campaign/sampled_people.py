"""What somebody of a sampled scenario does, from coordinates of its point."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime import MotionLimits
from workbench.simulation.scenarios.company import ByChance, Chasing, Part, Told
from workbench.simulation.scenarios.frames_of_path import PathFrame
from workbench.simulation.walkers.cues import CarWithin
from workbench.simulation.walkers.moving import GUARD, Who, body_radius_m
from workbench.simulation.walkers.pursuing import Chase
from workbench.simulation.walkers.scripted import Leg, Script

PERSON_AXES: Final = (
    "behaviour", "side", "lateral distance", "station", "speed", "trigger distance", "angle",
)  # fmt: skip
_HURRIES_MPS2: Final = 1.4
"""Of who starts to run or turns across; the guard allows 1.5."""


@final
@dataclass(frozen=True, slots=True)
class _Coordinates:
    """Coordinates of one person by name, each in [0, 1); side is 1 (left) or -1."""

    side: float
    lateral: float
    station: float
    speed: float
    trigger: float
    angle: float


def person(name: str, coordinates: Sequence[float], frame: PathFrame) -> Part:
    """One of seven behaviours in equal shares; coordinates as `PERSON_AXES`."""
    behaviour, side, *rest = coordinates
    values = _Coordinates(1.0 if side < 0.5 else -1.0, *rest)
    make = _BEHAVIOURS[int(behaviour * len(_BEHAVIOURS))]
    return make(Who(name, "ped", body_radius_m("ped")), values, frame)


def _stands(who: Who, u: _Coordinates, frame: PathFrame) -> Part:
    """Beside the path, up to 5 m from its middle."""
    return Told(
        who, Script(frame.place((7.0 + 17.0 * u.station, u.side * (1.3 + 3.7 * u.lateral))))
    )


def _alongside(who: Who, u: _Coordinates, frame: PathFrame) -> Part:
    """With the car or against it."""
    left_m, speed_mps = u.side * (1.5 + 3.0 * u.lateral), 0.6 + 1.2 * u.speed
    with_car = u.angle < 0.5
    begin = (-2.0 + 12.0 * u.station if with_car else 16.0 + 16.0 * u.station, left_m)
    end = (begin[0] + (40.0 if with_car else -40.0), left_m)
    legs = frame.legs(begin, (Leg(end, speed_mps),))
    return Told(who, Script(frame.place(begin), legs, start_mps=0.99 * speed_mps))


def _crosses(who: Who, u: _Coordinates, frame: PathFrame) -> Part:
    """From beside to the other side, at 50 to 130 degrees to the path, once the car is near."""
    return _across(who, u, frame, 0.6 + 1.0 * u.speed)


def _runs(who: Who, u: _Coordinates, frame: PathFrame) -> Part:
    """The same, at up to what the guard allows."""
    return _across(who, u, frame, 1.8 + 0.69 * u.speed)


def _across(who: Who, u: _Coordinates, frame: PathFrame, speed_mps: float) -> Part:
    left_m = u.side * (2.5 + 5.0 * u.lateral)
    begin = (8.0 + 14.0 * u.station, left_m)
    angle = math.radians(50.0 + 80.0 * u.angle)
    end = (begin[0] + (abs(left_m) + 4.0) / math.tan(angle), -u.side * 4.0)
    cue = CarWithin(2.0 + 12.0 * u.trigger)
    leg = Leg(frame.place(end), speed_mps, cue)
    return Told(who, Script(frame.place(begin), (leg,), acceleration_mps2=_HURRIES_MPS2))


def _turns(who: Who, u: _Coordinates, frame: PathFrame) -> Part:
    """Walks alongside and turns across the path at once when the car is near."""
    left_m, speed_mps = u.side * (1.6 + 2.4 * u.lateral), 0.8 + 1.0 * u.speed
    begin = (5.0 + 10.0 * u.station, left_m)
    ahead = frame.legs(begin, (Leg((begin[0] + 30.0, left_m), speed_mps),))
    turns_m = 10.0 + 14.0 * u.angle
    across = Leg(frame.place((turns_m, -u.side * 4.0)), speed_mps, CarWithin(0.8 + 7.0 * u.trigger))
    script = Script(
        frame.place(begin),
        (*ahead, across),
        start_mps=0.99 * speed_mps,
        acceleration_mps2=_HURRIES_MPS2,
    )
    return Told(who, script)


def _pursues(who: Who, u: _Coordinates, frame: PathFrame) -> Part:
    """Wants to be hit, within the guard's limits, for a while."""
    begin = frame.place((2.0 + 22.0 * u.station, u.side * (1.8 + 5.0 * u.lateral)))
    chase = Chase(
        begin, (0.0, 0.0), CarWithin(1.0 + 9.0 * u.trigger),
        MotionLimits(0.8 + 1.7 * u.speed, GUARD.acceleration_mps2),
        ahead_m=2.2 * u.angle, gives_up_s=4.0,
    )  # fmt: skip
    return Chasing(who, chase)


def _wanders(who: Who, u: _Coordinates, frame: PathFrame) -> Part:
    """Any accelerations within limits."""
    at = (6.0 + 18.0 * u.station, u.side * (1.5 + 4.0 * u.lateral))
    speed_mps, turned = 0.5 + 1.9 * u.speed, math.tau * u.angle
    slow = 0.6 * speed_mps
    velocity = frame.vector(at, (slow * math.cos(turned), slow * math.sin(turned)))
    limits = MotionLimits(speed_mps, GUARD.acceleration_mps2)
    return ByChance(who, (frame.place(at), velocity), limits, (0.3, 0.5 + 1.5 * u.trigger))


_BEHAVIOURS: Final[tuple[Callable[[Who, _Coordinates, PathFrame], Part], ...]] = (
    _stands, _alongside, _crosses, _runs, _turns, _pursues, _wanders,
)  # fmt: skip
