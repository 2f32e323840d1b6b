"""Closed-form intervals for short arcs of bounded curvature, and for cosines."""

from __future__ import annotations

import math

Interval = tuple[float, float]


def hull(*parts: Interval) -> Interval:
    """Smallest interval that holds all parts."""
    return min(part[0] for part in parts), max(part[1] for part in parts)


def times(a: Interval, b: Interval) -> Interval:
    """{u v : u in a, v in b}, to rounding."""
    products = (a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1])
    return min(products), max(products)


def cosine(angle: Interval) -> Interval:
    """Range of cos over an interval of angles, to rounding.

    >>> cosine((-0.1, 0.2))[1]
    1.0
    """
    low, high = angle
    ends = (math.cos(low), math.cos(high))
    has_top = math.ceil(low / math.tau) * math.tau <= high
    has_bottom = math.ceil((low - math.pi) / math.tau) * math.tau + math.pi <= high
    return (-1.0 if has_bottom else min(ends)), (1.0 if has_top else max(ends))


def sine(angle: Interval) -> Interval:
    """Range of sin over an interval of angles, to rounding."""
    return cosine((angle[0] - 0.5 * math.pi, angle[1] - 0.5 * math.pi))


def _sinc(angle: float) -> float:
    return math.sin(angle) / angle if abs(angle) > 1e-5 else 1.0 - angle * angle / 6.0


def displacement(arc_m: float, curvature: Interval) -> tuple[Interval, Interval]:
    """Where an arc of signed length `arc_m` ends, along and across its starting direction.

    With phi(tau) in tau [k_lo, k_hi] and |phi| <= pi / 2: along in sgn(arc) [sin(K m) / K, sin(k m)
    / k], m = |arc|, K = max |curvature|, k = min |curvature|; across in [(1 - cos(k_lo m)) / k_lo,
    (1 - cos(k_hi m)) / k_hi].
    """
    low, high = curvature
    length = abs(arc_m)
    largest = max(-low, high)
    smallest = max(low, -high, 0.0)
    shortest, longest = (length * _sinc(k * length) for k in (largest, smallest))
    along = (shortest, longest) if arc_m >= 0.0 else (-longest, -shortest)
    return along, (_sagitta(length, low), _sagitta(length, high))


def _sagitta(length: float, curvature: float) -> float:
    half = 0.5 * curvature * length
    return length * math.sin(half) * _sinc(half)
