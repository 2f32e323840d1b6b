"""Ways that were sent as tubes of what a person intends, or why they are not used."""

from __future__ import annotations

import enum
import itertools
import math
from typing import Final, final

from workbench.runtime.onboard.readings import rounding
from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.onboard.times import longest_s, seconds
from workbench.runtime.onboard.ways import WaysSeen
from workbench.runtime.person_guard import Guard
from workbench.runtime.person_tubes import (
    FOREVER_S,
    DiscPiece,
    PersonTube,
    RadiusBetween,
    TrackedPerson,
    TubeKind,
    fault_in_person,
    timed_discs,
)
from workbench.runtime.protocols import NoSet, Way

# A sender's difference and our sum of places within 2^14 m err by less than 2^-39 m together; all
# sums and products of radii, below 2^10 m where a way is no faster than a tube can be, by 2^-40 m.
_SUMS_M: Final = 2.0**-37
# The period may be off by 1 ns a knot, and instants are made doubles.
_TIMES_US: Final = 1


@final
class NoWay(enum.Enum):
    """Why somebody is judged without ways."""

    NOT_SENT = "no way was sent"
    LEFT = "not where a way has them"
    UNUSABLE = "a way that no tube can hold"


def old_since_us(seen: WaysSeen, settings: SensorBounds) -> int:
    """The last instant at which ways are used: when they are as old as people may be."""
    return seen.stamp_us[0] + settings.people_age_us


def recent_ways(seen: WaysSeen | NoSet, now_us: int, settings: SensorBounds) -> WaysSeen | None:
    """The ways that may be used now, if there are any."""
    if isinstance(seen, NoSet) or now_us > old_since_us(seen, settings):
        return None
    return seen


def intended(
    seen: WaysSeen, track: int, guard: Guard, *, now_us: int, settings: SensorBounds
) -> tuple[PersonTube, ...] | NoWay:
    """A tube for each way of a person, in times after now_us, or why they cannot be used.

    guard: where they are, in the same times. Who cannot be in a way's disc now, by their guard, has
    left it: then none of their ways is used, because who sent them did not know what they want.
    """
    ways = seen.ways.get(track)
    if ways is None:
        return NoWay.NOT_SENT
    tubes = tuple(_tube(way, seen, guard, now_us=now_us, settings=settings) for way in ways)
    if fault_in_person(TrackedPerson(f"{track}", tubes)) is not None:
        return NoWay.UNUSABLE
    return NoWay.LEFT if any(_left(tube, guard) for tube in tubes) else tubes


def _tube(
    way: Way, seen: WaysSeen, guard: Guard, *, now_us: int, settings: SensorBounds
) -> PersonTube:
    """Where they are if they take this way, from now on and without an end.

    Knot j is at an unknown instant from e_j on, for up to W: the stamp's interval and how far the
    sender's clock may drift until the last knot. The tube has it at e_j. At any instant t they are
    where the tube has them at a time between t - W and t: within W v of its centre at t, v the
    fastest that the centre moves, with the radius of a piece that lies no more than W back. Places
    and radii are those of the frames, widened by what these may have moved.

    After the last knot nothing is sent. They then keep within its disc, grown by their top speed.
    Rigor: if they take the way, they are in the tube.
    """
    period_us, last = seen.period_us, len(way) - 1
    slack_us = settings.stamps.drifted_us(last * period_us) + _TIMES_US
    first_us = seen.stamp_us[0] - slack_us - now_us
    unsure_us = seen.stamp_us[1] - seen.stamp_us[0] + 2 * slack_us
    longest_m = max(math.dist(a[:2], b[:2]) for a, b in itertools.pairwise(way))
    moved_m = longest_m / seconds(period_us) * longest_s(unsure_us)
    moved_m += rounding("PERSON_WAY", "X", "Y") + rounding("PERSON_POSITION", "X", "Y")
    moved_m += rounding("PERSON_WAY", "RADIUS") + _SUMS_M
    back = -(-unsure_us // period_us)
    radii = [
        max(knot[2] for knot in way[max(j - back, 0) : j + 1]) + moved_m for j in range(len(way))
    ]
    times_s = [seconds(first_us + j * period_us) for j in range(len(way))]
    xs_m, ys_m = [knot[0] for knot in way], [knot[1] for knot in way]
    (pieces,) = timed_discs(times_s, xs_m, ys_m, radii, between=RadiusBetween.LARGER).bounds
    top_mps = guard.limits.speed_mps
    after = DiscPiece(times_s[last], xs_m[last], ys_m[last], 0.0, 0.0, radii[last], top_mps, 0.0)
    return PersonTube(TubeKind.INTENT, ((*pieces, after),), FOREVER_S)


def _left(tube: PersonTube, guard: Guard) -> bool:
    """Whether the tube's disc at time 0 lies outside of a disc that the guard has them in then."""
    (pieces,) = tube.bounds
    piece = [piece for piece in pieces if piece.from_s <= 0.0][-1]
    x, y = piece.x_m - piece.vx_mps * piece.from_s, piece.y_m - piece.vy_mps * piece.from_s
    radius = piece.radius_m - piece.growth_mps * piece.from_s
    p, w, limits, t = guard.position, guard.velocity, guard.limits, -guard.at_s
    turned_m = p.radius + w.radius * t + 0.5 * limits.acceleration_mps2 * t * t
    return (
        math.hypot(x - p.x, y - p.y) > radius + p.radius + limits.speed_mps * t
        or math.hypot(x - p.x - w.x * t, y - p.y - w.y * t) > radius + turned_m
    )
