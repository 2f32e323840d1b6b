"""Interval operations hold every result of the real numbers in their operands: sines and cosines
against ball arithmetic, quotients by points; their ends are within two steps of the best ones."""

from __future__ import annotations

import math
from fractions import Fraction

import flint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.estimation.outward import cosine, meet, middle, minus, quotient, sine

ANGLES = st.floats(-1e6, 1e6)
NUMBERS = st.floats(-1e6, 1e6)
Interval = tuple[float, float]


def ordered(numbers: st.SearchStrategy[float]) -> st.SearchStrategy[Interval]:
    return st.tuples(numbers, numbers).map(lambda pair: (min(pair), max(pair)))


def ball_within(value: flint.arb, found: Interval) -> bool:
    """Up to the ball's own radius, about 1e-60."""
    return not (value < flint.arb(found[0]) or value > flint.arb(found[1]))


@given(ANGLES)
def test_at_a_point(angle: float) -> None:
    flint.ctx.prec = 200
    for exact, found in (
        (flint.arb(angle).sin(), sine((angle, angle))),
        (flint.arb(angle).cos(), cosine((angle, angle))),
    ):
        assert ball_within(exact, found)
        assert found[1] - found[0] <= 4.0 * math.ulp(max(map(abs, found))) + 1e-39


@given(ordered(ANGLES), st.floats(0.0, 1.0))
def test_over_wide_intervals(angle: Interval, part: float) -> None:
    inside = min(max(angle[0] + part * (angle[1] - angle[0]), angle[0]), angle[1])
    flint.ctx.prec = 200
    assert ball_within(flint.arb(inside).sin(), sine(angle))
    assert ball_within(flint.arb(inside).cos(), cosine(angle))


@given(st.floats(-30.0, 30.0), st.floats(0.0, 7.0))
def test_over_narrow_intervals_the_hull_is_sharp(low: float, width: float) -> None:
    angle = (low, low + width)
    samples = [low + width * k / 400 for k in range(401)]
    for found, function in ((sine(angle), math.sin), (cosine(angle), math.cos)):
        values = [function(sample) for sample in samples]
        assert found[0] <= min(values) + 1e-15
        assert max(values) - 1e-15 <= found[1]
        assert found[0] >= min(values) - 2e-4
        assert found[1] <= max(values) + 2e-4


@pytest.mark.parametrize("angle", [(0.0, math.inf), (-2e6, 0.0), (math.nan, 1.0)])
def test_beyond_the_largest_angle_everything_is_held(angle: Interval) -> None:
    assert sine(angle) == cosine(angle) == (-1.0, 1.0)


@given(ordered(NUMBERS), ordered(NUMBERS), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_differences_and_quotients_hold_theirs(
    a: Interval, b: Interval, i: float, j: float
) -> None:
    u, v = (min(max(x[0] + k * (x[1] - x[0]), x[0]), x[1]) for x, k in ((a, i), (b, j)))
    low, high = minus(a, b)
    assert Fraction(low) <= Fraction(u) - Fraction(v) <= Fraction(high)
    if b[1] > 0.0 and v > 0.0:
        low, high = quotient(a, b)
        exact = Fraction(u) / Fraction(v)
        assert low == -math.inf or Fraction(low) <= exact
        assert high == math.inf or exact <= Fraction(high)


@given(ordered(NUMBERS), ordered(NUMBERS), NUMBERS)
def test_what_intervals_have_in_common(a: Interval, b: Interval, value: float) -> None:
    common = meet(a, b)
    both = a[0] <= value <= a[1] and b[0] <= value <= b[1]
    assert both == (common is not None and common[0] <= value <= common[1])
    assert a[0] <= middle(a) <= a[1]
