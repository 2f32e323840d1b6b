"""Instants and spans on board: integer microseconds, counted from the core's start."""

from __future__ import annotations

import math
from typing import Final

from workbench.runtime.arc import Interval

TURN_US: Final = 32_500
"""Time between two turns of the loop: half a millisecond less than PACMod states for its commands,
so that a fault is answered, brake and all, within 34 ms."""
SEND_US: Final = 8_000
"""Longest time from making a turn's frames to the last of them on the bus; later ones stay."""
DECIDE_EVERY: Final = 3
"""Every so many turns the loop decides."""
LATEST_US: Final = 10**15
"""Instants are within this: as numbers of seconds they err by less than 10^-7 s."""


def seconds(at_us: int) -> float:
    """The nearest double to at_us 10^-6 s; expects |at_us| <= LATEST_US.

    >>> seconds(33_333)
    0.033333
    """
    return at_us / 1e6


def span_s(shortest_us: int, longest_us: int) -> Interval:
    """Every duration from the one to the other, in s, rounded outward; both >= 0."""
    low = math.nextafter(seconds(shortest_us), -math.inf) if shortest_us else 0.0
    return low, longest_s(longest_us)


def longest_s(longest_us: int) -> float:
    """A duration in s, rounded up; 0 stays 0."""
    return math.nextafter(seconds(longest_us), math.inf) if longest_us else 0.0
