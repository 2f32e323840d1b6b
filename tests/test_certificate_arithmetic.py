"""The checker's intervals hold the exact results (200-bit balls) and are almost as narrow."""

from __future__ import annotations

import math
from fractions import Fraction

import flint
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.checker.arithmetic import Interval, UnprovedError, grown, positive

flint.ctx.prec = 200
DOMAINS = {
    "sin": (-1e5, 1e5), "cos": (-1e5, 1e5), "tan": (-1.55, 1.55), "exp": (-690.0, 690.0),
    "log": (1e-300, 1e300), "atan": (-1e300, 1e300), "sqrt": (0.0, 1e300),
}  # fmt: skip
ends = st.floats(-1e150, 1e150, allow_nan=False)


def ball(value: float) -> flint.arb:
    return flint.arb(Fraction(value).numerator) / Fraction(value).denominator


def holds(interval: Interval, exact: flint.arb) -> bool:
    """Whether the exact value, known to 200 bits, is not seen outside."""
    return not (bool(exact < ball(interval.low)) or bool(exact > ball(interval.high)))


@pytest.mark.parametrize("name", DOMAINS)
@settings(deadline=None)
@given(data=st.data())
def test_functions_of_points_hold_the_value(name: str, data: st.DataObject) -> None:
    x = data.draw(st.floats(*DOMAINS[name]))
    result = Interval(x).function(name)
    exact = getattr(ball(x), name)()
    assert holds(result, exact)
    scale = max(abs(float(exact)), 1.0 if name in ("sin", "cos", "log", "tan") else 0.0)
    slope = abs(x) * (1.0 + abs(float(exact)) ** 2) if name in ("sin", "cos", "tan") else 0.0
    assert (
        result.high - result.low
        <= 1e-13 * scale * (1.0 + abs(x) * (name == "exp")) + 1e-15 * slope + 1e-300
    )


@pytest.mark.parametrize("name", DOMAINS)
@settings(deadline=None)
@given(data=st.data())
def test_functions_of_intervals_hold_inner_values(name: str, data: st.DataObject) -> None:
    low, high = sorted(data.draw(st.floats(*DOMAINS[name])) for _ in range(2))
    if name in ("sin", "cos"):
        high = min(high, low + data.draw(st.floats(0.0, 8.0)))
    result = Interval(low, high).function(name)
    for share in (0.0, 0.1, 0.37, 0.5, 0.83, 1.0):
        inner = min(max(low + share * (high / 2 - low / 2) * 2, low), high)
        assert holds(result, getattr(ball(inner), name)())
    if name in ("sin", "cos") and high - low > 6.3:
        assert (result.low, result.high) == (-1.0, 1.0)


@settings(deadline=None)
@given(ends, ends, ends, ends, st.integers(1, 9))
def test_arithmetic_holds_the_exact_results(a: float, b: float, c: float, d: float, n: int) -> None:
    x, y = Interval(min(a, b), max(a, b)), Interval(min(c, d), max(c, d))
    exact = {p: Fraction(p) for p in (a, b, c, d)}
    for p in (a, b):
        for q in (c, d):
            for result, value in (
                (x + y, exact[p] + exact[q]), (x - y, exact[p] - exact[q]),
                (x * y, exact[p] * exact[q]),
            ):  # fmt: skip
                assert Fraction(result.low) <= value <= Fraction(result.high)
            if y.low > 0 or y.high < 0:
                try:
                    ratio = x / y
                except UnprovedError:
                    continue
                assert Fraction(ratio.low) <= exact[p] / exact[q] <= Fraction(ratio.high)
    small = Interval(x.low / 1e140, x.high / 1e140)
    for p in (small.low, small.high, 0.0 if small.low <= 0.0 <= small.high else small.low):
        power = small**n
        assert Fraction(power.low) <= Fraction(p) ** n <= Fraction(power.high)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("tan", 1.5, 1.6), ("tan", -1.6, -1.5), ("tan", 0.0, 4.0), ("log", 0.0, 1.0),
        ("log", -1.0, 2.0), ("sqrt", -1e-300, 1.0), ("exp", 0.0, 800.0), ("sin", 0.0, 1e7),
        ("sin", math.nan, math.nan), ("exp", math.nan, math.nan),
    ],
)  # fmt: skip
def test_what_has_no_bound_is_refused(name: str, low: float, high: float) -> None:
    with pytest.raises(UnprovedError):
        Interval(low, high).function(name)


def test_division_by_zero_and_overflow_are_refused() -> None:
    for low, high in ((-1.0, 1.0), (0.0, 1.0), (-1.0, 0.0), (0.0, 0.0)):
        with pytest.raises(UnprovedError):
            Interval(1.0) / Interval(low, high)
    with pytest.raises(UnprovedError):
        Interval(1e300) * Interval(1e300)


@given(st.lists(st.floats(-3.0, 3.0), min_size=9, max_size=9), st.floats(0.01, 2.0))
def test_positive_is_never_said_of_another_matrix(entries: list[float], more: float) -> None:
    rows = [[entries[3 * min(i, j) + max(i, j)] for j in range(3)] for i in range(3)]
    for i in range(3):
        rows[i][i] = abs(rows[i][i]) + more
    exact = [[Fraction(v) for v in row] for row in rows]
    two = exact[0][0] * exact[1][1] - exact[0][1] ** 2
    three = (
        exact[0][0] * (exact[1][1] * exact[2][2] - exact[1][2] ** 2)
        - exact[0][1] * (exact[0][1] * exact[2][2] - exact[1][2] * exact[0][2])
        + exact[0][2] * (exact[0][1] * exact[1][2] - exact[1][1] * exact[0][2])
    )
    said = positive([[Interval(v) for v in row] for row in rows])
    assert said <= (exact[0][0] > 0 and two > 0 and three > 0)
    assert said or min(two, three) < 1e-9


@settings(deadline=None)
@given(st.lists(st.floats(0.0, 2.0), min_size=4, max_size=4), st.floats(-6.0, 2.0))
def test_growth_is_bounded_and_tight(entries: list[float], rate: float) -> None:
    a = [[rate, entries[0]], [entries[1], rate - 1.0]]
    matrix = flint.arb_mat([[ball(v) for v in [*a[0], entries[2]]],
                            [ball(v) for v in [*a[1], 0.1]], [ball(0.0)] * 3])  # fmt: skip
    exact = (matrix * ball(1.5)).exp() * flint.arb_mat(
        [[ball(1.0)], [ball(entries[3])], [ball(1.0)]]
    )
    found = grown(
        [[Interval(v) for v in row] for row in a],
        [Interval(entries[2]), Interval(0.1)],
        [Interval(1.0), Interval(entries[3])],
        Interval(1.5),
    )
    for i in range(2):
        assert not bool(exact[i, 0] > ball(found[i].high))
        assert found[i].high <= float(exact[i, 0]) * (1 + 1e-9) + 1e-9
