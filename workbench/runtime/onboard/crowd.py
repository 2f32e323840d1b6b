"""People of a set at a later instant: their guards, what they may intend, and who else is near."""

from __future__ import annotations

import dataclasses
import math
from typing import Final

from workbench.runtime.observation import ObservedPerson
from workbench.runtime.onboard.dead_reckoning import Pose
from workbench.runtime.onboard.readings import rounding
from workbench.runtime.onboard.sensor_bounds import PersonBounds, SensorBounds
from workbench.runtime.onboard.set_streams import SetSeen
from workbench.runtime.onboard.stamps import Instants
from workbench.runtime.onboard.times import longest_s, seconds
from workbench.runtime.onboard.way_tubes import NoWay, intended
from workbench.runtime.onboard.ways import WaysSeen
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import FOREVER_S, PersonTube, TubeKind
from workbench.runtime.policies.cycle import Watched
from workbench.runtime.protocols import PeopleSeen, PersonKind, SentPerson

# A few roundings of sums of positive numbers err by less than this, relatively.
_OUTWARD: Final = 1.0 + 2.0**-49
# How far the frames move an age, and an instant after the stamp when it is made a double.
_AGE_US: Final = math.ceil(rounding("PERSON_TRACK", "AGE") * 1e6) + 1


def observed_person(
    sent: SentPerson,
    stamp_us: Instants,
    *,
    now_us: int,
    settings: SensorBounds,
    ways: WaysSeen | None = None,
) -> ObservedPerson:
    """The person with times after now_us: discs of one instant of our clock, which lies before.

    They were in the disc AGE before the stamp, that is at an unknown instant up to D from the
    middle one. Their speed within D of it is at most u = min(V, |w| + q + A D); so at the middle
    one they are within r + u D, with a velocity within q + A D. What the frames may have moved of
    centres and radii is in r and q.

    Intent: the ways of their track, where `ways` has some that can be used (`intended`). Otherwise
    the same discs and bounds with intent_mps2 in place of A; of somebody assumed with A itself, as
    nobody knows what they want.
    """
    assumed = sent.kind is PersonKind.ASSUMED
    bounds = _bounds(sent.kind, settings)
    age_us = round(sent.age_s * 1e6)
    first_us, last_us = stamp_us[0] - age_us - _AGE_US, stamp_us[1] - age_us + _AGE_US
    at_us = min((first_us + last_us) // 2, now_us)
    unsure_s = longest_s(max(last_us - at_us, at_us - first_us))
    limits = bounds.limits
    moved_m = rounding("PERSON_POSITION", "X", "Y") + rounding("PERSON_TRACK", "POSITION_RADIUS")
    turned_mps = rounding("PERSON_MOTION", "X_SPEED", "Y_SPEED")
    turned_mps += rounding("PERSON_MOTION", "VELOCITY_RADIUS") + sent.velocity_radius_mps
    turned_mps += limits.acceleration_mps2 * unsure_s
    fastest_mps = math.hypot(sent.x_speed_mps, sent.y_speed_mps) + turned_mps
    moved_m += min(limits.speed_mps, fastest_mps * _OUTWARD) * unsure_s + sent.position_radius_m
    guard = Guard(
        seconds(at_us - now_us),
        Disc(sent.x_m, sent.y_m, moved_m * _OUTWARD),
        Disc(sent.x_speed_mps, sent.y_speed_mps, turned_mps * _OUTWARD),
        limits,
    )
    change_mps2 = limits.acceleration_mps2 if assumed else bounds.intent_mps2
    tubes: tuple[PersonTube, ...] = (_intent(guard, change_mps2),)
    if ways is not None and not assumed:
        found = intended(ways, sent.track, guard, now_us=now_us, settings=settings)
        tubes = tubes if isinstance(found, NoWay) else found
    return ObservedPerson(f"{sent.track}", tubes, guard, assumed=assumed)


def _bounds(kind: PersonKind, settings: SensorBounds) -> PersonBounds:
    """Of somebody assumed, whose kind nobody knows: the larger of both."""
    foot, wheels = settings.on_foot, settings.on_wheels
    if kind is PersonKind.ON_FOOT:
        return foot
    if kind is PersonKind.ON_WHEELS:
        return wheels
    limits = MotionLimits(
        max(foot.limits.speed_mps, wheels.limits.speed_mps),
        max(foot.limits.acceleration_mps2, wheels.limits.acceleration_mps2),
    )
    return PersonBounds(limits, max(foot.intent_mps2, wheels.intent_mps2))


def _intent(guard: Guard, change_mps2: float) -> PersonTube:
    """Everywhere they can be from now on with this change of velocity, as a claim of intent."""
    limits = dataclasses.replace(guard.limits, acceleration_mps2=change_mps2)
    tube = guard_disc(dataclasses.replace(guard, limits=limits), from_s=0.0, until_s=FOREVER_S)
    return dataclasses.replace(tube, kind=TubeKind.INTENT)


def watched_now(
    people: SetSeen[PeopleSeen], pose: Pose, *, now_us: int, way_m: float, settings: SensorBounds
) -> Watched:
    """The disc within which everybody is on the list now, about the middle of the pose's box.

    At the stamp everybody within R of the vehicle was. Since then the vehicle has moved by way_m
    at most, so that it was within way_m + b of the centre, b the half diagonal of the box; and who
    was outside has come nearer by unseen_speed_mps T, T since the earliest instant of the stamp.
    R - (way_m + b + unseen_speed_mps T) is left, less what the frames may have rounded R up by.
    """
    middle = Disc.around(pose.x, pose.y)
    elapsed_s = longest_s(now_us - people.stamp_us[0])
    less_m = rounding("PEOPLE", "WATCHED_RADIUS") + way_m + middle.radius
    less_m = (less_m + settings.unseen_speed_mps * elapsed_s) * _OUTWARD
    left_m = math.nextafter(people.value.watched_radius_m - less_m, -math.inf)
    return Watched(middle.x, middle.y, max(left_m, 0.0))
