"""The vehicle's place and heading for bounded errors: boxes that hold the truth, without Gaussians.

Everything is rounded outward; sums and products by the dead reckoning's own helpers, which move a
box on between ranges (`runtime.onboard.dead_reckoning.reckoned`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.estimation.localisation_site import Antenna, Beacon
from workbench.runtime.arc import Interval, cosine, hull, sine
from workbench.runtime.onboard.dead_reckoning import (
    Driven,
    Pose,
    outward,
    plus,
    product,
    reckoned,
)

# The library's sine, cosine and arc tangent err by less; angles are kept below this many radians.
_ERROR: Final = 2.0**-46
_LARGEST_ANGLE: Final = 100.0
_ROUNDS: Final = 8
# Share of the heading's width that the turn since the anchor may have.
_LOOSE: Final = 0.5


@final
@dataclass(frozen=True, slots=True)
class Spot:
    """A box that holds the antenna."""

    x: Interval
    y: Interval


@final
@dataclass(frozen=True, slots=True)
class BoundedRange:
    """A range that is in `range_m` unless it is one of those that may be wrong."""

    beacon: Beacon
    range_m: Interval

    def __post_init__(self) -> None:
        low, high = self.range_m
        if not 0.0 <= low <= high < math.inf:
            raise InputError(f"range_m: expected 0 <= lower <= upper, got {self.range_m!r}")


def contracted(
    pose: Pose, ranges: Sequence[BoundedRange], antenna: Antenna, *, wrong: int
) -> tuple[Pose, Spot] | None:
    """The part of a pose's box that agrees with all ranges but up to `wrong`, and the antenna's.

    With the antenna at (x + c f - s l, y + s f + c l), c and s the cosine and sine of the heading:
    each range holds it in a ring around its beacon, whose box within the present one is found from
    dx^2 = d^2 - dy^2 and likewise; per axis, what lies in at least n - wrong of these boxes is kept
    (the relaxed intersection of Jaulin, Automatica 45, 2009). Eight rounds. None: nothing agrees,
    so more ranges are wrong, or a bound does not hold. The larger the boxes, the wider the ranges
    and the more of them wrong, the larger the result. Rigor: containment, given the bounds, with
    outward rounding. Raises InputError unless 0 <= wrong < n.
    """
    if not 0 <= wrong < len(ranges):
        raise InputError(f"wrong: expected 0 <= wrong < {len(ranges)} ranges, got {wrong!r}")
    spot = antenna_spot(pose, antenna)
    ahead, aside = _lever(pose.heading, antenna)
    x, y = spot.x, spot.y
    for _ in range(_ROUNDS):
        boxes = [
            found for each in ranges
            if (found := _in_ring(x, y, each, antenna.height_m)) is not None
        ]  # fmt: skip
        needed = len(ranges) - wrong
        xs = _relaxed([box[0] for box in boxes], needed)
        ys = _relaxed([box[1] for box in boxes], needed)
        if xs is None or ys is None:
            return None
        x, y = xs, ys
    kept_x = _meet(pose.x, plus(x, (-ahead[1], -ahead[0])))
    kept_y = _meet(pose.y, plus(y, (-aside[1], -aside[0])))
    if kept_x is None or kept_y is None:
        return None
    return Pose(kept_x, kept_y, pose.heading), Spot(x, y)


def antenna_spot(pose: Pose, antenna: Antenna) -> Spot:
    """Where the antenna of a car in the pose may be."""
    ahead, aside = _lever(pose.heading, antenna)
    return Spot(plus(pose.x, ahead), plus(pose.y, aside))


def _lever(heading: Interval, antenna: Antenna) -> tuple[Interval, Interval]:
    c, s = trigonometric(heading)
    return (
        plus(_scaled(c, antenna.forward_m), _scaled(s, -antenna.left_m)),
        plus(_scaled(s, antenna.forward_m), _scaled(c, antenna.left_m)),
    )


def heading_between(start: Spot, end: Spot, driven: Spot) -> Interval | None:
    """Headings at the start, from where a point of the car went; None: any, it went too little.

    start, end: boxes of the point; driven: of its displacement in the car's own axes at the start.
    Turned by the first heading, that is the displacement in the plane: so the heading is the
    difference of the two directions. Directions of a box that does not hold 0 are between those of
    its corners. Comes out up to whole turns. Rigor: containment, as above.
    """
    went = Spot(
        plus(end.x, (-start.x[1], -start.x[0])), plus(end.y, (-start.y[1], -start.y[0]))
    )  # fmt: skip
    there, own = _directions(went), _directions(driven)
    return None if there is None or own is None else plus(there, (-own[1], -own[0]))


def _directions(box: Spot) -> Interval | None:
    dx, dy = box.x, box.y
    if dx[0] <= 0.0 <= dx[1] and dy[0] <= 0.0 <= dy[1]:
        return None
    middle = math.atan2(0.5 * (dy[0] + dy[1]), 0.5 * (dx[0] + dx[1]))
    corners = [math.remainder(math.atan2(b, a) - middle, math.tau) for a in dx for b in dy]
    return middle + min(corners) - _ERROR, middle + max(corners) + _ERROR


def nearest_turn(heading: Interval, *, to: Interval) -> Interval:
    """The same headings, moved by whole turns until their middle is nearest to that of `to`."""
    turns = round((0.5 * (sum(to)) - 0.5 * sum(heading)) / math.tau)
    moved = plus(heading, (turns * math.tau, turns * math.tau))
    return moved[0] - _ERROR, moved[1] + _ERROR


_HERE: Final = Pose((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))


@final
@dataclass(frozen=True, slots=True)
class BoundedTrack:
    """A box that holds the pose at at_us, and the way since it was last tied down.

    anchor: where the antenna was then, None: it never was; since: the pose now in the car's axes of
    then. A heading of a whole circle says that nothing is known of it.
    """

    pose: Pose
    at_us: int
    anchor: Spot | None = None
    since: Pose = _HERE

    def moved_on(self, driven: Driven, *, until_us: int) -> BoundedTrack | None:
        """The box later, by `reckoned`; None: reports and bounds contradict each other."""
        pose, since = (
            reckoned(start, driven, then_us=(self.at_us, self.at_us), now_us=until_us)
            for start in (self.pose, self.since)
        )
        if pose is None or since is None:
            return None
        return BoundedTrack(pose, until_us, self.anchor, since)

    def ranged(
        self, ranges: Sequence[BoundedRange], antenna: Antenna, *, wrong: int
    ) -> BoundedTrack | None:
        """The box after ranges of this instant: `contracted`, then the heading by the way driven.

        None: nothing agrees. Once the heading is not known much better than the turn since, the
        track is tied down here.
        """
        found = contracted(self.pose, ranges, antenna, wrong=wrong)
        if found is None:
            return None
        pose, spot = found
        anew = BoundedTrack(pose, self.at_us, spot)
        if self.anchor is None:
            return anew
        here = antenna_spot(self.since, antenna)
        own = Spot(
            plus(here.x, (-antenna.forward_m, -antenna.forward_m)),
            plus(here.y, (-antenna.left_m, -antenna.left_m)),
        )
        first = heading_between(self.anchor, spot, own)
        if first is None:
            return dataclasses.replace(self, pose=pose)
        heading = _same_heading(pose.heading, plus(first, self.since.heading))
        if heading is None:
            return None
        pose = Pose(pose.x, pose.y, heading)
        turned = self.since.heading
        loose = turned[1] - turned[0] > _LOOSE * (heading[1] - heading[0])
        return dataclasses.replace(anew if loose else self, pose=pose)


def _same_heading(known: Interval, told: Interval) -> Interval | None:
    """Headings of `known` that are in `told` up to whole turns; of a whole circle all of these."""
    if known[1] - known[0] >= math.tau:
        return told
    near = nearest_turn(told, to=known)
    parts = []
    for turns in (-math.tau, 0.0, math.tau):
        moved = plus(near, (turns, turns))
        part = _meet(known, (moved[0] - _ERROR, moved[1] + _ERROR))
        if part is not None:
            parts.append(part)
    return hull(*parts) if parts else None


def trigonometric(heading: Interval) -> tuple[Interval, Interval]:
    """Cosine and sine of headings, rounded outward."""
    if not -_LARGEST_ANGLE <= heading[0] <= heading[1] <= _LARGEST_ANGLE:
        raise InputError(
            f"heading: expected lower <= upper within +-{_LARGEST_ANGLE:g} rad, got {heading!r}"
        )
    return _wider(cosine(heading)), _wider(sine(heading))


def _wider(found: Interval) -> Interval:
    error = _ERROR * _LARGEST_ANGLE
    return max(found[0] - error, -1.0), min(found[1] + error, 1.0)


def _scaled(interval: Interval, factor: float) -> Interval:
    return product(interval, (factor, factor))


def _square(a: Interval) -> Interval:
    least = 0.0 if a[0] <= 0.0 <= a[1] else min(abs(a[0]), abs(a[1]))
    most = max(abs(a[0]), abs(a[1]))
    low, high = outward((least * least, most * most))
    return max(low, 0.0), high


def _in_ring(
    x: Interval, y: Interval, seen: BoundedRange, height_m: float
) -> tuple[Interval, Interval] | None:
    beacon = seen.beacon
    rise = outward((height_m - beacon.height_m, height_m - beacon.height_m))
    flat2 = _less(_square(seen.range_m), _square(rise))
    if flat2 is None:
        return None
    dx, dy = plus(x, (-beacon.x_m, -beacon.x_m)), plus(y, (-beacon.y_m, -beacon.y_m))
    new_x = _side(dx, _less(flat2, _square(dy)))
    new_y = None if new_x is None else _side(dy, _less(flat2, _square(new_x)))
    if new_x is None or new_y is None:
        return None
    return plus(new_x, (beacon.x_m, beacon.x_m)), plus(new_y, (beacon.y_m, beacon.y_m))


def _less(whole: Interval, part: Interval) -> Interval | None:
    """Numbers >= 0 among the differences."""
    low, high = outward((whole[0] - part[1], whole[1] - part[0]))
    return None if high < 0.0 else (max(low, 0.0), high)


def _side(d: Interval, square: Interval | None) -> Interval | None:
    """Those of d whose squares are in `square`: of either sign, or hull of both."""
    if square is None:
        return None
    low = max(math.nextafter(math.sqrt(square[0]), -math.inf), 0.0)
    high = math.nextafter(math.sqrt(square[1]), math.inf)
    right, left = _meet(d, (low, high)), _meet(d, (-high, -low))
    if right is None or left is None:
        return right if left is None else left
    return left[0], right[1]


def _meet(a: Interval, b: Interval) -> Interval | None:
    low, high = max(a[0], b[0]), min(a[1], b[1])
    return (low, high) if low <= high else None


def _relaxed(parts: Sequence[Interval], needed: int) -> Interval | None:
    """Hull of the points that lie in at least `needed` of the parts; None: there is no such point.

    The lowest such point is a lower end: the first, from below, that so many parts hold; and the
    highest an upper one.
    """
    lows = [a for a, _ in parts if sum(low <= a <= high for low, high in parts) >= needed]
    highs = [b for _, b in parts if sum(low <= b <= high for low, high in parts) >= needed]
    return (min(lows), max(highs)) if lows and highs else None
