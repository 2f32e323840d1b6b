"""One Observation of what was received: everything moved on to one instant, as wide as it must be.

Nothing here measures: it states what follows from the last reports, the last localisation and the
last set of people, given `SensorBounds`. What cannot be stated is no observation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from workbench.runtime.arc import Interval
from workbench.runtime.observation import Observation
from workbench.runtime.onboard.crowd import observed_person, watched_now
from workbench.runtime.onboard.dead_reckoning import Quantity, reckoned, way_m
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.readings import (
    NotObserved,
    NotObservedError,
    Unobserved,
    driven_of,
    localised_pose,
    recent_localisation,
    recent_people,
    require_recent_reports,
)
from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.onboard.times import LATEST_US, seconds
from workbench.runtime.onboard.way_tubes import recent_ways

__all__ = ["Integrals", "NotObserved", "Unobserved", "observe"]


@final
@dataclass(frozen=True, slots=True)
class Integrals:
    """What our own controller knows of itself: its integrals (m; m s), each as an interval, and the
    speed that it follows."""

    speed: Interval
    offset: Interval
    reference_speed_mps: float


def observe(
    intake: Intake, *, now_us: int, integrals: Integrals, settings: SensorBounds
) -> Observation | NotObserved:
    """Everything at now_us, an instant not before the last frame's; never raises.

    The state contains the true one, every guard the person who was sent, and within `watched`
    nobody else is, if all of `settings` holds, the senders' discs and radii hold what they claim,
    and everybody within WATCHED_RADIUS of the vehicle at the stamp was sent. Speed and steering
    come from the samples around each instant, the pose from the last localisation, moved on; all of
    them grow with age, and past its age nothing is used. Rigor: containment with outward rounding.
    Times are all of our own clock: skew_s is 0, and how uncertain the people's clock is widens
    their discs.

    Intent is not estimated here: whoever was seen is taken to go the ways that were sent of them
    (`way_tubes`), and, where none can be used, on as they do, with a change of velocity of up to
    intent_mps2. Either is an assumption of `LookAhead` and of nothing else. Whoever is only assumed
    may intend all that they can do.
    """
    try:
        return _observed(intake, now_us, integrals, settings)
    except NotObservedError as error:
        return error.found


def _observed(
    intake: Intake, now_us: int, integrals: Integrals, settings: SensorBounds
) -> Observation:
    last_us = now_us if intake.last_us is None else intake.last_us
    if not -LATEST_US <= last_us <= now_us <= LATEST_US:
        raise NotObservedError(Unobserved.CLOCK, f"{now_us} us, the last frame at {last_us} us")
    place = recent_localisation(intake, now_us, settings)
    people = recent_people(intake, now_us, settings)
    require_recent_reports(intake, now_us, settings)
    since_us = min(place.stamp_us[0], people.stamp_us[0])
    driven = driven_of(intake, place, from_us=since_us, settings=settings)
    pose = reckoned(localised_pose(place.value), driven, then_us=place.stamp_us, now_us=now_us)
    way = way_m(driven.speed, from_us=people.stamp_us[0], until_us=now_us)
    if pose is None or way is None:
        raise NotObservedError(Unobserved.CONTRADICTION, "since the last sets were stamped")
    ways = recent_ways(intake.ways.seen, now_us, settings)
    return Observation(
        x=pose.x,
        y=pose.y,
        heading=pose.heading,
        steering=_now(driven.steering, now_us),
        speed=_now(driven.speed, now_us),
        speed_integral=integrals.speed,
        offset_integral=integrals.offset,
        reference_speed_mps=integrals.reference_speed_mps,
        people=tuple(
            observed_person(sent, people.stamp_us, now_us=now_us, settings=settings, ways=ways)
            for sent in people.value.people
        ),
        stamp_s=seconds(now_us),
        watched=watched_now(people, pose, now_us=now_us, way_m=way[1], settings=settings),
    )


def _now(quantity: Quantity, now_us: int) -> Interval:
    found = quantity.within(now_us, now_us)
    if found is None:
        raise NotObservedError(Unobserved.CONTRADICTION, "at the instant of the observation")
    return found
