"""Who is who from frame to frame: association, births and deaths of tracks."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.optimize import linear_sum_assignment

from workbench.errors import InputError
from workbench.runtime.person_guard import Disc, Guard, MotionLimits
from workbench.runtime.policies.guards import Relation, relation_to
from workbench.runtime.protocols.people import PersonKind

# Above any sum that may count: one more pair is worth any of them.
_NO_PAIR: Final = 1e9
# Of squared radii (m^2), so that two points are no division by nothing.
_LEAST: Final = 1e-18
# A few roundings of sums of positive numbers err by less than this, relatively.
_OUTWARD: Final = 1.0 + 2.0**-48


@final
@dataclass(frozen=True, slots=True)
class Sighting:
    """Somebody in one frame: a disc that contains their position (m), and who they are."""

    kind: PersonKind
    place: Disc


@final
@dataclass(frozen=True, slots=True)
class Track:
    """One person over time. guard: discs of position and velocity at the last frame they were seen
    in; places: (time, disc) of that and earlier ones; seen: in how many frames."""

    number: int
    kind: PersonKind
    guard: Guard
    places: tuple[tuple[float, Disc], ...]
    seen: int

    def expected(self, at_s: float) -> tuple[float, float]:
        """Where they are at a constant velocity (m)."""
        t = at_s - self.guard.at_s
        p, w = self.guard.position, self.guard.velocity
        return p.x + w.x * t, p.y + w.y * t

    def place_at(self, at_s: float) -> Disc:
        """A disc that holds their position at at_s >= guard.at_s: the smaller one of the guard's
        two bounds, r + q t + A t^2 / 2 about p + w t and r + V t about p. Rounded outward."""
        t = at_s - self.guard.at_s
        p, w, limits = self.guard.position, self.guard.velocity, self.guard.limits
        if t <= 0.0:
            return p
        x, y = self.expected(at_s)
        slack = 2.0**-50 * (abs(p.x) + abs(p.y) + (abs(w.x) + abs(w.y)) * t)
        turned = p.radius + w.radius * t + 0.5 * limits.acceleration_mps2 * t * t + slack
        bounds = Disc(x, y, turned * _OUTWARD), Disc(p.x, p.y, _run(p.radius, limits, t))
        return min(bounds, key=lambda disc: disc.radius)

    def velocity_at(self, at_s: float) -> Disc:
        """A disc that holds their velocity at at_s >= guard.at_s: q + A t about w, or all that the
        speed limit leaves. Rounded outward."""
        t = max(at_s - self.guard.at_s, 0.0)
        w, limits = self.guard.velocity, self.guard.limits
        spread = (w.radius + limits.acceleration_mps2 * t) * (_OUTWARD if t > 0.0 else 1.0)
        anything = Disc(0.0, 0.0, limits.speed_mps)
        return min(Disc(w.x, w.y, spread), anything, key=lambda disc: disc.radius)


@final
@dataclass(frozen=True, slots=True)
class TrackLimits:
    """on_foot, on_wheels: what nobody exceeds; forget_s: a track unseen for longer is given up;
    memory_s: how long earlier places serve to tell the velocity."""

    on_foot: MotionLimits
    on_wheels: MotionLimits
    forget_s: float
    memory_s: float

    def __post_init__(self) -> None:
        for name in ("forget_s", "memory_s"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise InputError(f"{name}: expected a finite number above 0, got {value!r}")

    def of(self, kind: PersonKind) -> MotionLimits:
        """The limits of a kind."""
        return self.on_foot if kind is PersonKind.ON_FOOT else self.on_wheels


@final
@dataclass(frozen=True, slots=True)
class Tracks:
    """Everybody who is tracked, and who was given up at the last frame; values in, values out.

    numbers: of the tracks that the last frame's sightings belong to, in the sightings' order.
    """

    limits: TrackLimits
    people: tuple[Track, ...] = ()
    lost: tuple[Track, ...] = ()
    numbers: tuple[int, ...] = ()
    next_number: int = 1

    def after(self, sightings: Sequence[Sighting], *, at_s: float) -> Tracks:
        """The tracks after one more frame, taken at at_s.

        Pairs of track and sighting are allowed only where the person can have come from the one to
        the other: `relation_to` the track's guard, that is within r + r' + q t + A t^2 / 2 of the
        place at constant velocity, and within r + r' + V t of the last place. As many pairs as
        possible are made, and of all such choices the likeliest one (`unlikeliness`). A sighting
        without a track is somebody new at once, as one who
        is taken for an error would not be braked for. A track without a sighting keeps its guard,
        which grows; unseen for more than forget_s it is lost, and whoever uses the list must have
        somebody assumed in its place. Raises InputError for frames that go back in time.
        """
        if any(at_s <= track.guard.at_s for track in self.people):
            raise InputError(f"expected frames in the order of time, got one at {at_s!r} s again")
        pairs = associated(self.people, sightings, at_s=at_s)
        found = [
            self._seen(track, sightings[pairs[k]], at_s) if k in pairs else track
            for k, track in enumerate(self.people)
        ]
        numbers = {column: self.people[row].number for row, column in pairs.items()}
        new = [k for k in range(len(sightings)) if k not in numbers]
        born = [self._born(self.next_number + k, sightings[new[k]], at_s) for k in range(len(new))]
        numbers |= {column: track.number for column, track in zip(new, born, strict=True)}
        stays = [at_s - track.guard.at_s <= self.limits.forget_s for track in found]
        return dataclasses.replace(
            self,
            people=(*(t for t, stay in zip(found, stays, strict=True) if stay), *born),
            lost=tuple(t for t, stay in zip(found, stays, strict=True) if not stay),
            numbers=tuple(numbers[column] for column in range(len(sightings))),
            next_number=self.next_number + len(born),
        )

    def _born(self, number: int, sighting: Sighting, at_s: float) -> Track:
        limits = self.limits.of(sighting.kind)
        guard = Guard(at_s, sighting.place, Disc(0.0, 0.0, limits.speed_mps), limits)
        return Track(number, sighting.kind, guard, ((at_s, sighting.place),), 1)

    def _seen(self, track: Track, sighting: Sighting, at_s: float) -> Track:
        """Who was once on wheels stays so: its limits are the wider ones."""
        on_foot = PersonKind.ON_FOOT in (track.kind, sighting.kind) and track.kind == sighting.kind
        kind = PersonKind.ON_FOOT if on_foot else PersonKind.ON_WHEELS
        limits = self.limits.of(kind)
        earlier = [place for place in track.places if place[0] >= at_s - self.limits.memory_s]
        known = [Disc(0.0, 0.0, limits.speed_mps), *(
            velocity_between(then_s, place, at_s, sighting.place, limits=limits)
            for then_s, place in earlier
        )]  # fmt: skip
        velocity = min(known, key=lambda disc: disc.radius)
        guard = Guard(at_s, sighting.place, velocity, limits)
        places = (*earlier, (at_s, sighting.place))
        return Track(track.number, kind, guard, places, track.seen + 1)


def _run(radius_m: float, limits: MotionLimits, t: float) -> float:
    return (radius_m + limits.speed_mps * t) * _OUTWARD


def velocity_between(
    then_s: float, then: Disc, now_s: float, now: Disc, *, limits: MotionLimits
) -> Disc:
    """Velocities now of one who was in both discs at their times: the mean velocity lies within
    (r + r') / d of (p' - p) / d, d = now_s - then_s > 0, and that of now within A d / 2 of it.

    |v(now) - mean| = |integral of (s - then) / d a(s) ds| <= A d / 2. Rounded outward.
    """
    d = now_s - then_s
    x, y = (now.x - then.x) / d, (now.y - then.y) / d
    # Two differences and a quotient round once each, relative to their results.
    slack = 2.0**-50 * (abs(x) + abs(y))
    radius = (now.radius + then.radius) / d + 0.5 * limits.acceleration_mps2 * d + slack
    return Disc(x, y, radius * _OUTWARD)


def associated(
    tracks: Sequence[Track], sightings: Sequence[Sighting], *, at_s: float
) -> dict[int, int]:
    """Sighting by track, as `Tracks.after` says: most pairs, then the likeliest ones."""
    if not tracks or not sightings:
        return {}
    cost = np.full((len(tracks), len(sightings)), _NO_PAIR)
    for row, track in enumerate(tracks):
        for column, sighting in enumerate(sightings):
            if _can_be(track.guard, sighting, at_s):
                cost[row, column] = unlikeliness(track, sighting, at_s)
    rows, columns = linear_sum_assignment(cost)
    return {
        int(row): int(column)
        for row, column in zip(rows, columns, strict=True)
        if cost[row, column] < _NO_PAIR
    }


def unlikeliness(track: Track, sighting: Sighting, at_s: float) -> float:
    """2 d^2 / s + log s, s = r^2 + r'^2: minus the logarithm of a density, up to a constant.

    d: from the place at constant velocity to the sighting's centre; r, r': radii of the track's
    disc by now and of the sighting. As if both places were normal about their centres with half of
    the radius as standard deviation: of two people who may have come to a vague place, the one of
    whom more is known is the likelier. Guessing decides only who is who, no disc.
    """
    x, y = track.expected(at_s)
    r = track.place_at(at_s).radius
    s = max(r * r + sighting.place.radius**2, _LEAST)
    d = math.hypot(sighting.place.x - x, sighting.place.y - y)
    return 2.0 * d * d / s + math.log(s)


def _can_be(guard: Guard, sighting: Sighting, at_s: float) -> bool:
    anything = Disc(0.0, 0.0, guard.limits.speed_mps)
    now = Guard(at_s, sighting.place, anything, guard.limits)
    return relation_to(guard, now) is not Relation.OUTSIDE
