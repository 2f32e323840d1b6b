"""Whether reports, localisation and the bicycle tell of one motion; what they say must meet.

Every check compares two sets that both hold the truth if `SensorBounds` holds: where they are
disjoint, some bound is broken, and there is no false alarm. Sets that meet prove little: a fault
smaller than the errors that are allowed is not seen.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

from workbench.runtime.arc import Interval
from workbench.runtime.onboard.dead_reckoning import (
    Driven,
    Pose,
    plus,
    reckoned,
    turn_rate,
    way_m,
)
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.readings import (
    NotObservedError,
    driven_of,
    localised_pose,
    localised_speed,
    sample_of,
)
from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.onboard.set_streams import SetSeen
from workbench.runtime.protocols import Localised, NoSet


@final
class Check(enum.Enum):
    """What contradicts what."""

    SPEED = "reported speed against the speed that was localised"
    WAY = "reported speed against the way between two localisations"
    TURN = "speed, steering and wheelbase against the turn between two localisations"
    YAW_RATE = "speed, steering and wheelbase against the reported yaw rate"
    FROZEN = "localisations stay the same while the car has moved"
    CHANGE = "reports leave the car's range, or change faster than it can"


@final
@dataclass(frozen=True, slots=True)
class Contradiction:
    """A check that failed, how, and when the frame came that showed it."""

    check: Check
    detail: str
    since_us: int


def contradictions(
    intake: Intake, settings: SensorBounds, *, moved_m: float, yaw_rate_error_radps: float
) -> tuple[Contradiction, ...]:
    """All that fails of the newest localisation and reports; never raises.

    To be asked when a localisation has come: the answer changes with no other frame but one of a
    yaw rate. Latency, from the first wrong frame on: SPEED, the next localisation; WAY and TURN,
    the first one by which the error has grown beyond what both poses, speed and steering may err
    by (error of speed times time > the sum of radii; earlier localisations reach back 0.25 s to
    some 2 s, so that an error that takes longer is not seen); FROZEN, the first one after moved_m
    driven (more than 0.25 s after the first that was the same); YAW_RATE, CHANGE, at once.
    moved_m: way after which no two localisations are alike in every digit. yaw_rate_error_radps:
    of the reported rate.
    """
    newest = intake.localisation
    if isinstance(newest, NoSet):
        return ()
    earlier = [each for each in intake.localisations if each.last_us < newest.last_us]
    since_us = min(each.stamp_us[0] for each in (*earlier, newest))
    try:
        driven = driven_of(intake, None, from_us=since_us, settings=settings)
    except NotObservedError:
        return ()
    compared = {each.last_us: each for each in (*earlier[:1], *earlier[-1:])}
    found = [
        *_speed(newest, driven),
        *(each for before in compared.values() for each in _motion(before, newest, driven)),
        *_frozen(earlier, newest, driven, moved_m),
        *_yaw_rate(intake, driven, settings, yaw_rate_error_radps),
    ]
    return tuple(found)


def _speed(newest: SetSeen[Localised], driven: Driven) -> Iterator[Contradiction]:
    reported = driven.speed.within(*newest.stamp_us)
    localised = localised_speed(newest.value)
    if reported is None or driven.steering.within(*newest.stamp_us) is None:
        yield Contradiction(Check.CHANGE, "around the last localisation", newest.last_us)
    elif not _meet(reported, localised):
        detail = f"{_said(reported)} m/s reported, {_said(localised)} m/s localised"
        yield Contradiction(Check.SPEED, detail, newest.last_us)


def _motion(
    before: SetSeen[Localised], newest: SetSeen[Localised], driven: Driven
) -> Iterator[Contradiction]:
    """Where the earlier one leads, and the later one, both at the end of the later one's stamp."""
    at_us = newest.stamp_us[1]
    led = reckoned(localised_pose(before.value), driven, then_us=before.stamp_us, now_us=at_us)
    there = reckoned(localised_pose(newest.value), driven, then_us=newest.stamp_us, now_us=at_us)
    if led is None or there is None:
        yield Contradiction(Check.CHANGE, "between two localisations", newest.last_us)
        return
    if not (_meet(led.x, there.x) and _meet(led.y, there.y)):
        yield Contradiction(Check.WAY, f"{_place(led)}, localised {_place(there)}", newest.last_us)
    apart = 0.5 * (sum(there.heading) - sum(led.heading))
    whole = math.tau * round(apart / math.tau)
    if not _meet(plus(led.heading, (whole, whole)), there.heading):
        detail = f"{_said(led.heading)} rad, localised {_said(there.heading)} rad"
        yield Contradiction(Check.TURN, detail, newest.last_us)


def _frozen(
    earlier: list[SetSeen[Localised]], newest: SetSeen[Localised], driven: Driven, moved_m: float
) -> Iterator[Contradiction]:
    same = None
    for each in reversed(earlier):
        if _digits(each.value) != _digits(newest.value):
            break
        same = each
    if same is None:
        return
    way = way_m(driven.speed, from_us=same.stamp_us[1], until_us=newest.stamp_us[0])
    if way is not None and way[0] > moved_m:
        detail = f"the same pose after at least {way[0]:.2f} m"
        yield Contradiction(Check.FROZEN, detail, newest.last_us)


def _yaw_rate(
    intake: Intake, driven: Driven, settings: SensorBounds, error_radps: float
) -> Iterator[Contradiction]:
    place = intake.names.yaw_rate
    report = None if place is None else intake.reports.get(place.message)
    if place is None or report is None:
        return
    reported = (report.values[place.signal],) * 2
    sampled = sample_of(plus(reported, (-error_radps, error_radps)), report.at_us, settings)
    rate = turn_rate(driven, from_us=sampled.from_us, until_us=sampled.until_us)
    if rate is not None and not _meet(rate, sampled.value):
        detail = f"{_said(rate)} rad/s by the bicycle, {_said(sampled.value)} rad/s reported"
        yield Contradiction(Check.YAW_RATE, detail, report.at_us)


def _digits(place: Localised) -> tuple[float, float, float]:
    return place.x_m, place.y_m, place.heading_rad


def _meet(a: Interval, b: Interval) -> bool:
    return a[0] <= b[1] and b[0] <= a[1]


def _said(ends: Interval) -> str:
    return f"{ends[0]:.3f} to {ends[1]:.3f}"


def _place(pose: Pose) -> str:
    return f"x {_said(pose.x)} m, y {_said(pose.y)} m"
