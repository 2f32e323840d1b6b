"""Where the car is now, from where it was: intervals of speed and steering between reports.

Everything is rounded outward: sums and products by one step of the last bit, the library's sine,
cosine and tangent by more than they are known to err.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.arc import Interval, cosine, hull, sine, times
from workbench.runtime.onboard.stamps import Instants
from workbench.runtime.onboard.times import longest_s, span_s

MOST_PIECES: Final = 48
PIECE_US: Final = 25_000
# Reports this near say the most about an instant; those farther away only cost time.
_NEAR_US: Final = 70_000
_ERROR: Final = 2.0**-48


def outward(interval: Interval) -> Interval:
    """The ends moved by one step of the last bit: covers one rounding of each."""
    return math.nextafter(interval[0], -math.inf), math.nextafter(interval[1], math.inf)


def plus(a: Interval, b: Interval) -> Interval:
    """Holds {u + v}."""
    return outward((a[0] + b[0], a[1] + b[1]))


def product(a: Interval, b: Interval) -> Interval:
    """Holds {u v}."""
    return outward(times(a, b))


def around(value: float, radius: float) -> Interval:
    """Holds everything within the radius of the value."""
    return outward((value - radius, value + radius))


@final
@dataclass(frozen=True, slots=True)
class Sampled:
    """A quantity that lay in `value` at one instant from_us to until_us."""

    value: Interval
    from_us: int
    until_us: int


@final
@dataclass(frozen=True, slots=True)
class Quantity:
    """What samples say of a quantity at other times.

    samples: in the order of time; rates: of its change per s, lower <= 0 <= upper, at all times;
    range: it never leaves that.
    """

    samples: tuple[Sampled, ...]
    rates: Interval
    range: Interval

    def within(self, from_us: int, until_us: int) -> Interval | None:
        """Holds the quantity at every instant of the span; None: samples and bounds contradict.

        At t after a sample's instant tau it is at most value + upper (t - tau), before it at most
        value - lower (tau - t); the smallest of these over samples, tau and t as unlucky as they
        can be, and the same from below.
        """
        (falls, rises), (low, high) = self.rates, self.range
        for sample in self._near(from_us, until_us):
            ahead_s = longest_s(max(until_us - sample.from_us, 0))
            back_s = longest_s(max(sample.until_us - from_us, 0))
            more = math.nextafter(max(rises * ahead_s, -falls * back_s), math.inf)
            less = math.nextafter(max(-falls * ahead_s, rises * back_s), math.inf)
            high = min(high, math.nextafter(sample.value[1] + more, math.inf))
            low = max(low, math.nextafter(sample.value[0] - less, -math.inf))
        return (low, high) if low <= high else None

    def _near(self, from_us: int, until_us: int) -> Sequence[Sampled]:
        """Samples near the span, or the last one before and the first one after it."""
        first, last = from_us - _NEAR_US, until_us + _NEAR_US
        near = [s for s in self.samples if s.until_us >= first and s.from_us <= last]
        if near:
            return near
        before = [s for s in self.samples if s.until_us < first][-1:]
        after = [s for s in self.samples if s.from_us > last][:1]
        return [*before, *after]


@final
@dataclass(frozen=True, slots=True)
class Pose:
    """Boxes of the middle of the rear axle (m) and of the heading (rad)."""

    x: Interval
    y: Interval
    heading: Interval


@final
@dataclass(frozen=True, slots=True)
class Driven:
    """What moves a bicycle: speed (m/s), road-wheel angle (rad) and 1 / wheelbase (1/m)."""

    speed: Quantity
    steering: Quantity
    per_wheelbase: Interval


def per_wheelbase(wheelbase_m: Interval) -> Interval:
    """1 / L of a positive interval."""
    return outward((1.0 / wheelbase_m[1], 1.0 / wheelbase_m[0]))


def reckoned(pose: Pose, driven: Driven, *, then_us: Instants, now_us: int) -> Pose | None:
    """The pose now of a car that was in `pose` at one instant of then_us; None: contradiction.

    x' = v cos(heading), y' = v sin(heading), heading' = v tan(steering) / L, in pieces of at most
    25 ms, or more where there would be more than MOST_PIECES. In a piece of duration h, with V, D
    holding speed and steering on all of it: the turn lies in h W, W = V tan(D) / L; all headings of
    the piece in H + [min(0, h W), max(0, h W)] =: H'; the ways in h V cos(H') and h V sin(H'). The
    first piece, from the unknown instant of then_us to its end, has every duration from 0 on.
    Rigor: containment, given the samples, bounds and the bicycle; then_us not after now_us.
    """
    first, last = then_us[0], min(then_us[1], now_us)
    found: Pose | None = pose
    if last > first:
        found = _moved(pose, driven, from_us=first, until_us=last, duration=span_s(0, last - first))
    for begin, end in itertools.pairwise(breaks(last, now_us)):
        if found is None:
            return None
        whole = span_s(end - begin, end - begin)
        found = _moved(found, driven, from_us=begin, until_us=end, duration=whole)
    return found


def way_m(speed: Quantity, *, from_us: int, until_us: int) -> Interval | None:
    """Holds the length of the way between two instants, and it to the other direction: the integral
    of |v|; None: contradiction."""
    total: Interval = (0.0, 0.0)
    for begin, end in itertools.pairwise(breaks(from_us, until_us)):
        v = speed.within(begin, end)
        if v is None:
            return None
        size = (max(v[0], -v[1], 0.0), max(-v[0], v[1]))
        total = plus(total, product(span_s(end - begin, end - begin), size))
    return max(total[0], 0.0), total[1]


def turn_rate(driven: Driven, *, from_us: int, until_us: int) -> Interval | None:
    """Holds v tan(steering) / L at every instant of the span; None: contradiction."""
    speed = driven.speed.within(from_us, until_us)
    steering = driven.steering.within(from_us, until_us)
    if speed is None or steering is None:
        return None
    return _turn_rate(speed, steering, driven)


def breaks(from_us: int, until_us: int) -> Sequence[int]:
    """Instants from the one to the other, both among them, that cut the time into pieces."""
    length = until_us - from_us
    count = min(-(-length // PIECE_US), MOST_PIECES)
    return [from_us + length * k // count for k in range(count + 1)] if count > 0 else [from_us]


def _moved(
    pose: Pose, driven: Driven, *, from_us: int, until_us: int, duration: Interval
) -> Pose | None:
    speed = driven.speed.within(from_us, until_us)
    steering = driven.steering.within(from_us, until_us)
    if speed is None or steering is None:
        return None
    turn = _turn_rate(speed, steering, driven)
    headings = plus(pose.heading, hull((0.0, 0.0), product((0.0, duration[1]), turn)))
    along = product(duration, speed)
    return Pose(
        plus(pose.x, product(along, _cosine(headings))),
        plus(pose.y, product(along, _sine(headings))),
        plus(pose.heading, product(duration, turn)),
    )


def _turn_rate(speed: Interval, steering: Interval, driven: Driven) -> Interval:
    return product(product(speed, _tangent(steering)), driven.per_wheelbase)


def _tangent(angle: Interval) -> Interval:
    """Of angles within (-pi/2, pi/2)."""
    low, high = math.tan(angle[0]), math.tan(angle[1])
    return low - _ERROR * (1.0 + low * low), high + _ERROR * (1.0 + high * high)


def _cosine(angle: Interval) -> Interval:
    return _widened(cosine(angle), angle)


def _sine(angle: Interval) -> Interval:
    return _widened(sine(angle), angle)


def _widened(found: Interval, angle: Interval) -> Interval:
    """A sine or cosine errs by its own last bits and by those of an angle that was shifted."""
    error = _ERROR * (1.0 + max(abs(angle[0]), abs(angle[1])))
    return max(found[0] - error, -1.0), min(found[1] + error, 1.0)
