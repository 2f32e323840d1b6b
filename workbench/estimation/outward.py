"""Interval arithmetic on floats, rounded outward; sines and cosines without a mathematical library.

An interval holds all real numbers from its lower to its upper end, which may be infinite.
"""

from __future__ import annotations

import functools
import math
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from typing import Final

from workbench.runtime.arc import Interval
from workbench.runtime.onboard.dead_reckoning import outward, plus, product

__all__ = ["cosine", "meet", "middle", "minus", "outward", "plus", "product", "quotient", "sine"]

LARGEST_ANGLE_RAD: Final = 1e6
# Decimal's operations are correctly rounded by its specification.
_DIGITS: Final = Context(prec=60, Emin=-999_999, Emax=999_999)
_PI: Final = Decimal(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899"
)
_LAST_POWER: Final = 41
# Above the error of `_sine_at`: the series ends within (pi/2)^43 / 43! < 5e-45, and the multiple of
# pi that is taken off, below 1e7, is rounded in its 60th digit.
_ERROR: Final = Decimal("1e-40")


def minus(a: Interval, b: Interval) -> Interval:
    """Holds {u - v}."""
    return outward((a[0] - b[1], a[1] - b[0]))


def quotient(a: Interval, b: Interval) -> Interval:
    """Holds {u / v : v > 0} for b[1] > 0; without an upper (lower) end where v comes near 0.

    >>> quotient((1.0, 1.0), (0.0, 2.0))[1]
    inf
    """
    least, most = max(b[0], 0.0), b[1]
    low = a[0] / most if a[0] >= 0.0 else (a[0] / least if least > 0.0 else -math.inf)
    high = a[1] / most if a[1] <= 0.0 else (a[1] / least if least > 0.0 else math.inf)
    return outward((low, high))


def meet(*parts: Interval) -> Interval | None:
    """What all parts have in common; None: nothing."""
    low, high = max(part[0] for part in parts), min(part[1] for part in parts)
    return (low, high) if low <= high else None


def middle(a: Interval) -> float:
    """A number near the middle of a finite interval."""
    return min(max(a[0] + 0.5 * (a[1] - a[0]), a[0]), a[1])


def sine(angle: Interval) -> Interval:
    """Holds {sin(u)}; ENCLOSED for angles within 1e6 rad, [-1, 1] beyond."""
    return _range(angle, quarter_turns=0)


def cosine(angle: Interval) -> Interval:
    """Holds {cos(u)}; ENCLOSED for angles within 1e6 rad, [-1, 1] beyond.

    >>> cosine((-0.1, 0.2))[1]
    1.0
    """
    return _range(angle, quarter_turns=1)


def _range(angle: Interval, *, quarter_turns: int) -> Interval:
    low, high = angle
    if not (-LARGEST_ANGLE_RAD <= low <= high <= LARGEST_ANGLE_RAD):
        return -1.0, 1.0
    ends = (_sine_at(low, quarter_turns), _sine_at(high, quarter_turns))
    top = _reaches(angle, 1 - quarter_turns)
    bottom = _reaches(angle, -1 - quarter_turns)
    least = -1.0 if bottom else max(min(end[0] for end in ends), -1.0)
    return least, 1.0 if top else min(max(end[1] for end in ends), 1.0)


def _reaches(angle: Interval, quarter_turns: int) -> bool:
    """Whether quarter_turns pi / 2 + 2 pi k may lie in the interval for some whole k."""
    turns = [
        _DIGITS.divide(_DIGITS.subtract(Decimal(end), _quarters(quarter_turns)), 2 * _PI)
        for end in angle
    ]
    first = (turns[0] - _ERROR).to_integral_value(ROUND_CEILING)
    return first <= (turns[1] + _ERROR).to_integral_value(ROUND_FLOOR)


def _quarters(count: int) -> Decimal:
    return _DIGITS.divide(_DIGITS.multiply(_PI, Decimal(count)), Decimal(2))


@functools.lru_cache(maxsize=4096)
def _sine_at(angle_rad: float, quarter_turns: int) -> Interval:
    """Holds sin(angle + quarter_turns pi / 2): reduced to [-pi/2, pi/2], then the Taylor series."""
    whole = _DIGITS.add(Decimal(angle_rad), _quarters(quarter_turns))
    half_turns = _DIGITS.divide(whole, _PI).to_integral_value()
    r = _DIGITS.subtract(whole, _DIGITS.multiply(half_turns, _PI))
    square = _DIGITS.multiply(r, r)
    term = total = r
    for power in range(3, _LAST_POWER + 2, 2):
        term = _DIGITS.divide(_DIGITS.multiply(term, -square), Decimal(power * (power - 1)))
        total = _DIGITS.add(total, term)
    if half_turns % 2:
        total = -total
    low, high = _DIGITS.subtract(total, _ERROR), _DIGITS.add(total, _ERROR)
    return math.nextafter(float(low), -math.inf), math.nextafter(float(high), math.inf)
