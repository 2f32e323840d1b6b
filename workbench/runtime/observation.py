"""What the vehicle knows at one instant: its own state as intervals, and the people around it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.runtime.arc import Interval
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import (
    FOREVER_S,
    Person,
    PersonTube,
    TrackedPerson,
    TubeKind,
    fault_in_people,
)
from workbench.runtime.policies.cycle import SeenPerson, Watched

__all__ = [
    "Observation",
    "ObservedPerson",
    "Person",
    "fault_in_observation",
    "held_to",
    "seen_people",
    "tracked_people",
    "watched_at_stamp",
]

_FARTHEST_M = 1e7
_FASTEST_MPS = 100.0
_LARGEST_HEADING_RAD = 1e6
_LARGEST_SKEW_S = 10.0
_OLDEST_GUARD_S = 60.0
# Three roundings of positive numbers err by less than this, relatively.
_OUTWARD = 1.0 + 2.0**-50


@final
@dataclass(frozen=True, slots=True)
class ObservedPerson:
    """Somebody seen, or assumed where nobody can be seen; all times are after the stamp (s).

    intent: tubes of kind INTENT (none: no prediction, so nothing is proved clear of what they
    intend); guard: where they are and how they can move; its at_s may be negative. assumed: nobody
    was seen.
    """

    name: str
    intent: tuple[PersonTube, ...]
    guard: Guard
    assumed: bool = False


@final
@dataclass(frozen=True, slots=True)
class Observation:
    """One instant, unchecked: a sensor may say anything, and `Monitor` answers it with a decision.

    x, y (m), heading (rad, any turn), steering (rad), speed (m/s), speed_integral (m),
    offset_integral (m s): (lower, upper) intervals that jointly contain the state of the middle of
    the rear axle; reference_speed_mps: what the controller follows; it must not follow another one
    before TRACK is decided on an observation that names it. people: everybody within `watched`,
    seen or assumed, until their guard lies wholly beyond it; stamp_s: instant of the monitor's
    clock at which all this holds; skew_s: how far the people's clock may be ahead of it, (lower,
    upper); intent tubes that begin after skew_s[0] predict nothing of the time before.
    """

    x: Interval
    y: Interval
    heading: Interval
    steering: Interval
    speed: Interval
    speed_integral: Interval
    offset_integral: Interval
    reference_speed_mps: float
    people: tuple[ObservedPerson, ...]
    stamp_s: float
    watched: Watched
    skew_s: Interval = (0.0, 0.0)


_LIMITS = {
    "x": _FARTHEST_M,
    "y": _FARTHEST_M,
    "heading": _LARGEST_HEADING_RAD,
    "steering": math.pi,
    "speed": _FASTEST_MPS,
    "speed_integral": _FARTHEST_M,
    "offset_integral": _FARTHEST_M,
    "skew_s": _LARGEST_SKEW_S,
}


def tracked_people(observation: Observation) -> tuple[TrackedPerson, ...]:
    """Everybody with all their tubes, the guard's last, from the stamp on; unchecked.

    The guard's tube begins where the people's clock may be at the stamp, and has no end.
    """
    from_s = min(observation.skew_s[0], 0.0)
    return tuple(
        TrackedPerson(
            person.name,
            (*person.intent, guard_disc(person.guard, from_s=from_s, until_s=FOREVER_S)),
        )
        for person in observation.people
    )


def fault_in_observation(observation: Observation, people: Sequence[TrackedPerson]) -> str | None:
    """Why the observation's own numbers cannot be used, or None; people: its `tracked_people`.

    Intervals must be finite, ordered, and of a size that no later product can overflow; people
    must be tellable by name; tubes and guards as `fault_in_person` wants them.
    """
    for name, limit in _LIMITS.items():
        low, high = getattr(observation, name)
        if not (-limit <= low <= high <= limit):
            return f"{name}: expected lower <= upper within +-{limit:g}, got [{low!r}, {high!r}]"
    if not abs(observation.stamp_s) <= FOREVER_S:
        return f"stamp_s: expected within +-{FOREVER_S:g} s, got {observation.stamp_s!r}"
    watched = observation.watched
    near = abs(watched.x_m) <= _FARTHEST_M and abs(watched.y_m) <= _FARTHEST_M
    if not (near and 0.0 <= watched.radius_m <= _FARTHEST_M):
        return f"watched: expected a disc within +-{_FARTHEST_M:g} m, got {watched}"
    if len({person.name for person in observation.people}) != len(observation.people):
        return f"people: expected distinct names, got {[p.name for p in observation.people]}"
    for person in observation.people:
        fault = _fault_in_claims(person)
        if fault is not None:
            return f"person {person.name!r}: {fault}"
    return fault_in_people(people)


def _fault_in_claims(person: ObservedPerson) -> str | None:
    if any(tube.kind is not TubeKind.INTENT for tube in person.intent):
        return f"expected tubes of kind intent, got {[str(tube.kind) for tube in person.intent]}"
    guard = person.guard
    sizes = (guard.position.radius, guard.velocity.radius)
    limits = (guard.limits.speed_mps, guard.limits.acceleration_mps2)
    # A NaN fails the comparison; how large these may be is checked of the guard's tube.
    if not all(value >= 0.0 for value in (*sizes, *limits)):
        return f"expected a guard with radii and limits >= 0, got {guard}"
    if not abs(guard.at_s) <= _OLDEST_GUARD_S:
        return f"expected a guard of within +-{_OLDEST_GUARD_S:g} s, got at_s {guard.at_s!r}"
    return None


def seen_people(observation: Observation) -> tuple[SeenPerson, ...]:
    """Everybody as the policies compare them: with guards on the clock, not after the stamp.

    What the people's clock calls at_s is one instant between stamp + at_s - skew_s[1] and stamp +
    at_s - skew_s[0] of ours. The guard is taken at the first of them or, if that is earlier, at the
    stamp, D before the last at most: position within r + V D, velocity within q + A D, rounded
    outward. Without a skew it is the guard itself.
    """
    low, high = observation.skew_s
    found = []
    for person in observation.people:
        after_s = min(person.guard.at_s - high, 0.0)
        guard = _before(person.guard, by_s=person.guard.at_s - low - after_s)
        at_s = observation.stamp_s + after_s
        found.append(SeenPerson(person.name, dataclasses.replace(guard, at_s=at_s), person.assumed))
    return tuple(found)


def held_to(observation: Observation, limits: MotionLimits) -> Observation:
    """The observation with nobody's limits below `limits`: what nobody is relied on to stay under.

    Expects an observation without a fault; who claims less than the bundle does is not believed.
    """
    return dataclasses.replace(
        observation,
        people=tuple(
            dataclasses.replace(person, guard=_held(person.guard, limits))
            for person in observation.people
        ),
    )


def _held(guard: Guard, limits: MotionLimits) -> Guard:
    own = guard.limits
    wider = MotionLimits(
        max(own.speed_mps, limits.speed_mps),
        max(own.acceleration_mps2, limits.acceleration_mps2),
    )
    return dataclasses.replace(guard, limits=wider)


def watched_at_stamp(observation: Observation, *, unseen_speed_mps: float) -> Watched:
    """The disc within which everybody is on the list at the stamp of our clock.

    The list is of an instant up to d = max(-skew_s[0], skew_s[1]) away, in which somebody unseen
    comes nearer by unseen_speed_mps d.
    """
    watched, (low, high) = observation.watched, observation.skew_s
    nearer_m = unseen_speed_mps * max(-low, high) * _OUTWARD
    return dataclasses.replace(watched, radius_m=max(watched.radius_m - nearer_m, 0.0))


def _before(guard: Guard, *, by_s: float) -> Guard:
    """Where they were, up to by_s earlier than the guard says."""
    if by_s == 0.0:
        return guard
    position, velocity, limits = guard.position, guard.velocity, guard.limits
    moved = (position.radius + limits.speed_mps * by_s) * _OUTWARD
    turned = (velocity.radius + limits.acceleration_mps2 * by_s) * _OUTWARD
    return dataclasses.replace(
        guard,
        position=Disc(position.x, position.y, moved),
        velocity=Disc(velocity.x, velocity.y, turned),
    )
