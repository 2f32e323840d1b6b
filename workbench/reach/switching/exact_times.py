"""Times as whole multiples of 2^-44 s, so that their sums and differences are exact."""

from __future__ import annotations

from fractions import Fraction

from workbench.errors import InputError

# Multiples of 2^-44 below 2^9 have at most 53 binary digits: as doubles they are exact.
_PER_SECOND = 2**44
_LONGEST_S = 2.0**8

# A time or a duration as a number of such ticks.
Ticks = int


def ticks_down(time_s: float | Fraction) -> Ticks:
    """The last tick that is not after `time_s`, 0 <= time_s < 256 s."""
    if not 0.0 <= time_s < _LONGEST_S:
        raise InputError(f"expected a time from 0 to {_LONGEST_S:g} s, got {float(time_s)!r}")
    scaled = Fraction(time_s) * _PER_SECOND
    return scaled.numerator // scaled.denominator


def ticks_up(time_s: float | Fraction) -> Ticks:
    """The first tick that is not before `time_s`."""
    below = ticks_down(time_s)
    return below + (seconds(below) < time_s)


def nearest_ticks(time_s: float | Fraction) -> Ticks:
    """The tick next to `time_s`; at most 3e-14 s away."""
    below = ticks_down(time_s)
    return below + (Fraction(time_s) * _PER_SECOND - below > Fraction(1, 2))


def seconds(ticks: Ticks) -> float:
    """The exact double of a tick, in s."""
    return ticks / _PER_SECOND
