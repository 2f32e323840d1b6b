"""Beacons at fixed places that tell a simulated car how far its antenna is from them, on its bus.

Time of flight, with an error, with strays that came round a corner, and with losses; each range is
a RANGE frame with the stamp of the beacons' own clock.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime.localiser.site import Beacon, Site
from workbench.runtime.protocols import Refusal
from workbench.runtime.protocols.ranges import COUNTER_BITS, STAMP_BITS, SentRange, range_frame
from workbench.simulation.pacmod2_unit import CanFrame
from workbench.simulation.plants.chassis import Motion

RANGED_US: Final = 333_333
"""Each beacon ranges three times a second; they take turns."""
_COUNT_US: Final = 100
"""A stamp counts tenths of a millisecond."""
_FIRST_STAMP: Final = 2**STAMP_BITS - 120_000
"""So near its end that the stamp wraps within every drive."""
_CLOCK: Final = 1.0 + 50e-6
"""Their clock is fast."""
_DELAY_US: Final = (500, 9_500)


@final
@dataclass(frozen=True, slots=True)
class RangeErrors:
    """What becomes of a range on its way.

    deviation_m: of its error, normal; stray_share: of those that came round a corner and are longer
    by an excess that is exponential with mean stray_m; dropped: share that does not come at all.
    Raises InputError for a deviation or mean that is not finite and >= 0, and for shares outside of
    [0, 1).
    """

    deviation_m: float
    stray_share: float
    stray_m: float
    dropped: float

    def __post_init__(self) -> None:
        for name in ("deviation_m", "stray_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"{name}: expected a finite number >= 0, got {value!r}")
        for name in ("stray_share", "dropped"):
            value = getattr(self, name)
            if not 0.0 <= value < 1.0:
                raise InputError(f"{name}: expected a share in [0, 1), got {value!r}")

    @classmethod
    def stated(cls, site: Site, *, dropped: float) -> RangeErrors:
        """Those that the site file states; it says nothing of losses."""
        ranges = site.ranges
        return cls(ranges.deviation_m, ranges.stray_share, ranges.stray_m, dropped)


@final
class Beacons:
    """The site's beacons, one after the other; `due` gives what they send as time goes on.

    Instants are of the bus, in us; period_us: between two ranges of one beacon. The same site,
    errors and chance give the same frames for the same motion.
    """

    def __init__(
        self, site: Site, errors: RangeErrors, chance: random.Random, *, period_us: int
    ) -> None:
        self._site, self._errors, self._chance = site, errors, chance
        self._period_us, self._first_us = period_us, chance.randrange(period_us)
        self._turn = self._number = self._sent_us = 0

    def due(self, motion: Motion, at_us: int, *, silent: bool) -> Iterator[tuple[int, CanFrame]]:
        """What is measured by now: when each frame is on the bus, and the frame.

        silent: nothing is ranged. A range that is lost, or longer than a frame can say, leaves no
        frame. They come in the order in which they were measured.
        """
        beacons = self._site.beacons
        while self._first_us + self._turn * self._period_us // len(beacons) <= at_us:
            beacon = self._turn % len(beacons)
            self._turn += 1
            # Drawn whether or not it is sent: a silence changes no range after it.
            range_m, lost = self._measured(beacons[beacon], motion), self._lost()
            later_us = self._chance.randint(*_DELAY_US)
            frame = self._frame(beacon, range_m, at_us)
            if silent or lost or isinstance(frame, Refusal):
                continue
            self._number += 1
            self._sent_us = max(at_us + later_us, self._sent_us + 1)
            yield self._sent_us, frame

    def _lost(self) -> bool:
        return self._chance.random() < self._errors.dropped

    def _measured(self, beacon: Beacon, motion: Motion) -> float:
        errors, chance = self._errors, self._chance
        stray_m = chance.expovariate(1.0) * errors.stray_m
        strays = chance.random() < errors.stray_share
        error_m = chance.gauss(0.0, 1.0) * errors.deviation_m + (stray_m if strays else 0.0)
        return max(true_range_m(self._site, beacon, motion) + error_m, 0.0)

    def _frame(self, beacon: int, range_m: float, at_us: int) -> CanFrame | Refusal:
        stamp = (_FIRST_STAMP + round(at_us * _CLOCK / _COUNT_US)) % 2**STAMP_BITS
        return range_frame(SentRange(self._number % 2**COUNTER_BITS, beacon, range_m, stamp))


def true_range_m(site: Site, beacon: Beacon, motion: Motion) -> float:
    """From a beacon to the antenna of a car that is there."""
    antenna = site.antenna
    c, s = math.cos(motion.heading), math.sin(motion.heading)
    x_m = motion.x_m + antenna.forward_m * c - antenna.left_m * s
    y_m = motion.y_m + antenna.forward_m * s + antenna.left_m * c
    return math.dist((x_m, y_m, antenna.height_m), (beacon.x_m, beacon.y_m, beacon.height_m))
