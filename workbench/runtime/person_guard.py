"""Everywhere a person can be under bounds on speed and acceleration, as a tube of discs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from workbench.runtime.arc import Interval
from workbench.runtime.person_tubes import DiscPiece, PersonTube, TubeKind

_PAD = 2.0**-48
_TINY = 1e-290


@final
@dataclass(frozen=True, slots=True)
class Disc:
    """All (x, y) within `radius` of the centre: positions in m, or velocities in m/s."""

    x: float
    y: float
    radius: float

    @classmethod
    def around(cls, x: Interval, y: Interval) -> Disc:
        """A disc that contains the box x times y (finite intervals), rounded outward."""
        cx, cy = 0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1])
        half = [max(ends[1] - c, c - ends[0]) for ends, c in ((x, cx), (y, cy))]
        return cls(cx, cy, _above(math.hypot(*half)))


@final
@dataclass(frozen=True, slots=True)
class MotionLimits:
    """What nobody exceeds: speed (m/s) and the size of the acceleration (m/s^2)."""

    speed_mps: float
    acceleration_mps2: float


@final
@dataclass(frozen=True, slots=True)
class Guard:
    """A person at one time: position (m) and velocity (m/s) in discs, motion within `limits`."""

    at_s: float
    position: Disc
    velocity: Disc
    limits: MotionLimits


def guard_disc(guard: Guard, *, from_s: float, until_s: float) -> PersonTube:
    """GUARD tube: everywhere the person can be between from_s and until_s (at_s among them).

    Position in disc(p, r) and velocity in disc(w, q) at at_s, then |a| <= A and |v| <= V. With
    t = tau - at_s >= 0, at every time, two bounds hold at once:
    acceleration: v(t) = v0 + integral of a lies within q + A t of w, so that x(t) lies within
    r + q t + A t^2/2 of p + w t;  speed: x(t) lies within r + V t of p.
    The first is the smaller one at first, the second later; the separation takes the better one in
    each segment, so no time of change has to be chosen. Backwards in time the same bounds hold with
    |t| (turned around, a motion within the limits is one with velocity -v): for from_s < at_s each
    bound has a second piece, whose radius shrinks until at_s; its coefficients are rounded and its
    radius is widened by 2^-48 of the sizes involved, their total error being below 16 2^-53. The
    forward pieces hold the given numbers themselves, without any rounding.

    Nesting: let a member move from (x0, v0) to (x1, v1) in a time d >= 0 within the limits. Its own
    guard at d (radii 0) lies inside this one at every later time t = d + s. Acceleration bound:
    |x1 + v1 s - p - w t| <= |x1 - p - w d| + |v1 - w| s <= (r + q d + A d^2/2) + (q + A d) s, and
    adding A s^2/2 gives r + q t + A t^2/2. Speed bound: |x1 - p| + V s <= r + V d + V s. Bounds are
    nested one by one, and so are their intersections (a tube that changed from the first to the
    second at a time of its own would not be nested: members change at other times). For discs in
    place of (x1, v1) see `guard_contains`.
    Rigor: ENCLOSED, given that the person is in the discs and keeps to the limits. Numbers that
    make no sense are passed on, and `fault_in_person` names them.
    """
    p, w = guard.position, guard.velocity
    top, most = guard.limits.speed_mps, guard.limits.acceleration_mps2
    accelerated = DiscPiece(guard.at_s, p.x, p.y, w.x, w.y, p.radius, w.radius, most)
    fast = DiscPiece(guard.at_s, p.x, p.y, 0.0, 0.0, p.radius, top, 0.0)
    if not from_s < guard.at_s:
        return PersonTube(TubeKind.GUARD, ((accelerated,), (fast,)), until_s)
    d = guard.at_s - from_s
    spread = w.radius * d + most * d * d
    pad = _PAD * (p.radius + abs(p.x) + abs(p.y) + (abs(w.x) + abs(w.y) + top) * d + spread) + _TINY
    before = DiscPiece(
        from_s, p.x - w.x * d, p.y - w.y * d, w.x, w.y,
        _above(p.radius + w.radius * d + 0.5 * most * d * d + pad), -(w.radius + most * d), most,
    )  # fmt: skip
    fast_before = DiscPiece(from_s, p.x, p.y, 0.0, 0.0, _above(p.radius + top * d + pad), -top, 0.0)
    return PersonTube(TubeKind.GUARD, ((before, accelerated), (fast_before, fast)), until_s)


def guard_contains(earlier: Guard, later: Guard) -> bool:
    """Whether the later guard's discs lie inside the earlier guard's from later.at_s on.

    Sufficient, with d = later.at_s - earlier.at_s >= 0, primes for the later one:
    |p' - p - w d| + r' <= r + q d + A d^2/2,  |w' - w| + q' <= q + A d,  |p' - p| + r' <= r + V d,
    A' <= A, V' <= V: the first two bound position and growth of the acceleration bound coefficient
    by coefficient in the time since later.at_s, the third the speed bound. Rounded against the
    answer; False for NaN. A measurement that is less certain than the earlier guard's prediction is
    not inside, though the person may be: meet its discs with the prediction first.
    """
    d = later.at_s - earlier.at_s
    p, w, p1, w1 = earlier.position, earlier.velocity, later.position, later.velocity
    top, most = earlier.limits.speed_mps, earlier.limits.acceleration_mps2
    sizes = (p.x, p.y, p1.x, p1.y, p.radius, p1.radius, w.x * d, w.y * d, w.radius * d, top * d)
    slack = _PAD * (sum(map(abs, sizes)) + most * d * d) + _TINY
    turn = _PAD * (sum(map(abs, (w.x, w.y, w1.x, w1.y, w.radius, w1.radius))) + most * d) + _TINY
    moved = math.hypot(p1.x - p.x - w.x * d, p1.y - p.y - w.y * d)
    return (
        d >= 0.0
        and later.limits.acceleration_mps2 <= most
        and later.limits.speed_mps <= top
        and moved + p1.radius + slack <= p.radius + w.radius * d + 0.5 * most * d * d
        and math.hypot(w1.x - w.x, w1.y - w.y) + w1.radius + turn <= w.radius + most * d
        and math.hypot(p1.x - p.x, p1.y - p.y) + p1.radius + slack <= p.radius + top * d
    )


def _above(rounded: float) -> float:
    """Above what `rounded`, a sum or root of few roundings, stands for."""
    return math.nextafter(rounded * (1.0 + 2.0**-50), math.inf)
