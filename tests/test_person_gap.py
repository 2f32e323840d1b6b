"""The gap of a rectangle and a moving disc is never above the true one, and is it when apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from person_cases import Array, distance_to

from workbench.reach import person_gap
from workbench.reach.person_gap import box_function, car_function, gap_function

WINDOW = (0.0, 0.2)


def car_of(rectangle: Sequence[float]) -> tuple[list[float], bool]:
    car, ok = car_function()(rectangle)
    return [float(v) for v in car.nonzeros()], float(ok) == 1.0


def gap_of(
    rectangle: Sequence[float], piece: Sequence[float], window: Sequence[float]
) -> float | None:
    car, known = car_of(rectangle)
    gap, ok = gap_function()(rectangle, car, piece, window)
    return float(gap) if known and float(ok) == 1.0 else None


def discs(piece: Sequence[float], times: Array) -> tuple[Array, Array]:
    """Centres (N, 2) and radii (N) by the definition."""
    from_s, x, y, vx, vy, radius, growth, growth2 = piece
    s = times - from_s
    places = np.stack([x + vx * s, y + vy * s], axis=-1)
    return places, np.maximum(radius + growth * s + growth2 * s**2 / 2, 0.0)


@pytest.mark.parametrize(
    ("rectangle", "piece", "expected"),
    [
        ((0, 0, 0, 2, 1), (0, 0, 5, 0, 0, 0.5, 0, 0), 3.5),
        ((0, 0, 0, 2, 1), (0, 5, 5, 0, 0, 0.5, 0, 0), 4.5),
        ((0, 0, math.pi / 2, 2, 1), (0, 0, 5, 0, 0, 0.5, 0, 0), 2.5),
        ((1, 1, 0, 2, 1), (0, 1, -5, 0, 5, 0.5, 0, 0), 3.5),
        ((0, 0, 0, 2, 1), (0, 0, 5, 0, 0, 0.5, 1, 4), 3.5 - 0.2 - 0.08),
        ((0, 0, 0, 2, 1), (-1, 0, 5, 0, -1, 0.5, 0, 0), 3.5 - 1.2),
        # Past a corner: nearest in the middle of the window, at right angles.
        ((0, 0, 0, 2, 1), (0, 3.5, 1.5, -5, 5, 0, 0, 0), math.sqrt(2) / 2 * 2 - 0.0),
        # Touching, and inside through the nearer side.
        ((0, 0, 0, 2, 1), (0, 0, 1.5, 0, 0, 0.5, 0, 0), 0.0),
        ((0, 0, 0, 2, 1), (0, 0.5, 0, 0, 0, 0.5, 0, 0), -1.5),
        # A shrinking disc counts as it is at the start, and never below radius 0.
        ((0, 0, 0, 2, 1), (0, 0, 5, 0, 0, 0.5, -9, 0), 3.5),
    ],
)
def test_closed_forms(rectangle: Sequence[float], piece: Sequence[float], expected: float) -> None:
    gap = gap_of(rectangle, piece, WINDOW)
    assert gap is not None
    assert expected - 1e-12 <= gap <= expected + 1e-15


_size = st.floats(0.0, 3.0)
_rectangles = st.tuples(
    st.floats(-5, 5), st.floats(-5, 5), st.floats(-50, 50), _size, _size
)  # fmt: skip
_place = st.floats(-9, 9)
_pieces = st.tuples(
    st.floats(-2, 0), _place, _place, st.floats(-5, 5), st.floats(-5, 5), st.floats(0, 2),
    st.floats(-3, 3), st.floats(0, 4),
)  # fmt: skip


@settings(max_examples=400, deadline=None)
@given(_rectangles, _pieces, st.floats(0.0, 1.0))
def test_nobody_in_the_disc_is_nearer_than_the_gap(
    rectangle: tuple[float, ...], piece: tuple[float, ...], length: float
) -> None:
    gap = gap_of(rectangle, piece, (0.0, length))
    assert gap is not None
    places, radii = discs(piece, np.linspace(0.0, length, 101))
    distance = distance_to(np.array(rectangle), places)
    assert gap <= max(float((distance - radii).min()), 0.0) + 1e-12
    box, ok = box_function()(piece, (0.0, length))
    x_low, x_high, y_low, y_high = (float(v) for v in box.nonzeros())
    assert float(ok) == 1.0
    assert x_low <= (places[:, 0] - radii).min() + 1e-13
    assert x_high >= (places[:, 0] + radii).max() - 1e-13
    assert y_low <= (places[:, 1] - radii).min() + 1e-13
    assert y_high >= (places[:, 1] + radii).max() - 1e-13


# The nearest point of the hull is on the side of the way away from the rectangle's middle.
@example((2.1, 0.0, 0.0, 2.0, 0.0), (0.0, 0.0, 1.0, -2.0, 1.0, 0.0, 1.0, 1.0), 1.0)
@settings(max_examples=200, deadline=None)
@given(_rectangles, _pieces, st.floats(0.0, 1.0))
def test_apart_the_gap_is_the_distance_to_the_swept_disc(
    rectangle: tuple[float, ...], piece: tuple[float, ...], length: float
) -> None:
    """With the radius on its chord: dense samples cannot come nearer to it than their spacing."""
    gap = gap_of(rectangle, piece, (0.0, length))
    places, ends = discs(piece, np.array([0.0, length]))
    share = np.linspace(0.0, 1.0, 2001)
    along = places[0] + share[:, None] * (places[1] - places[0])
    radii = ends[0] + share * (ends[1] - ends[0])
    true = float((distance_to(np.array(rectangle), along) - radii).min())
    assert gap is not None
    # A way without width may cross a rectangle without width between two samples.
    if true > 1e-3 + float(np.hypot(*(places[1] - places[0]))) / 2000:
        assert (
            true - 0.01 * float(np.hypot(*(places[1] - places[0]))) - 1e-12 <= gap <= true + 1e-12
        )
        assert abs(gap - true) < 1e-4


@settings(max_examples=200, deadline=None)
@given(_rectangles)
def test_the_cars_box_holds_its_corners(rectangle: tuple[float, ...]) -> None:
    (c, s, *box), ok = car_of(rectangle)
    x, y, heading, half_length, half_width = rectangle
    assert ok
    assert abs(c - math.cos(heading)) < 2e-15
    assert abs(s - math.sin(heading)) < 2e-15
    for a in (-half_length, half_length):
        for b in (-half_width, half_width):
            corner = (x + a * math.cos(heading) - b * math.sin(heading),
                      y + a * math.sin(heading) + b * math.cos(heading))  # fmt: skip
            assert box[0] - 1e-14 <= corner[0] <= box[1] + 1e-14
            assert box[2] - 1e-14 <= corner[1] <= box[3] + 1e-14


def above_exact(count: int = 300) -> int:
    """Gaps and boxes that are wrong when nothing is rounded: beside a car that heads along x, far
    out, where doubles are coarse."""
    rng = np.random.default_rng(8)
    wrong = 0
    for _ in range(count):
        far = 10.0 ** rng.uniform(0, 6)
        x, y = (float(v) for v in far * rng.uniform(-1, 1, 2))
        rectangle = (x, y, 0.0, 2.0, 1.0)
        start, vy = -float(rng.uniform(0, far)), float(rng.uniform(-3, 3))
        # Long on the way, so that large numbers cancel.
        place = (x + float(rng.uniform(-1, 1)), y + float(rng.uniform(40, 50)) + vy * start)
        piece = (start, *place, 0.0, vy, 1.0, -1.0 / (1.0 - start), 1e-3 / (1.0 + start * start))
        window = (0.0, float(rng.uniform(0.01, 0.3)))
        gap = gap_of(rectangle, piece, window)
        box = [float(v) for v in box_function()(piece, window)[0].nonzeros()]
        exact = [Fraction(v) for v in piece]
        ends = []
        for time in window:
            s = Fraction(time) - exact[0]
            radius = exact[5] + exact[6] * s + exact[7] * s * s / 2
            ends.append((exact[2] + exact[4] * s, max(radius, Fraction(0))))
        true = min(at - radius for at, radius in ends) - Fraction(y) - 1
        largest = max(radius for _, radius in ends)
        assert gap is not None
        wrong += Fraction(gap) > true
        wrong += Fraction(box[2]) > min(at for at, _ in ends) - largest
        wrong += Fraction(box[3]) < max(at for at, _ in ends) + largest
    return wrong


def test_every_rounding_is_covered() -> None:
    assert above_exact() == 0


@pytest.mark.parametrize("budget", ["_GAP_BUDGET", "_BOX_BUDGET"])
def test_a_budget_left_out_is_noticed(budget: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(person_gap, budget, 0.0)
    for name in ("gap_function", "box_function"):
        monkeypatch.setitem(globals(), name, getattr(person_gap, name).__wrapped__)
    assert above_exact(100) > 0


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300, -1e300])
def test_numbers_that_are_none_give_no_gap(value: float) -> None:
    rectangle, piece = [0.0, 0.0, 0.3, 2.0, 1.0], [0.0, 0.0, 5.0, 0.1, 0.2, 0.5, 0.1, 0.1]
    car, _ = car_of(rectangle)
    for i in range(5):
        broken = [*rectangle[:i], value, *rectangle[i + 1 :]]
        assert not car_of(broken)[1]
        gap, ok = gap_function()(broken, car, piece, WINDOW)
        assert float(ok) != 1.0 or float(gap) < 0.0
    for i in range(8):
        broken = [*piece[:i], value, *piece[i + 1 :]]
        gap, ok = gap_function()(rectangle, car, broken, WINDOW)
        # 1e300 is finite: a disc that is certainly far away, or one that covers everything.
        assert float(ok) != 1.0 or float(gap) < 0.0 or abs(value) == 1e300
        if not math.isfinite(value):
            assert float(ok) != 1.0
            assert float(box_function()(broken, WINDOW)[1]) != 1.0
    for window in ((value, 0.2), (0.0, value), (0.2, 0.0)):
        gap, ok = gap_function()(rectangle, car, piece, window)
        assert float(ok) != 1.0 or float(gap) < 0.0
    assert float(gap_function()(rectangle, [value] * 6, piece, WINDOW)[1]) != 1.0


@pytest.mark.parametrize("i", [3, 4])
def test_a_rectangle_of_negative_size_gives_no_gap(i: int) -> None:
    rectangle = [0.0, 0.0, 0.3, 2.0, 1.0]
    car, _ = car_of(rectangle)
    rectangle[i] = -0.1
    assert not car_of(rectangle)[1]
    piece = [0.0, 0.0, 5.0, 0.1, 0.2, 0.5, 0.1, 0.1]
    assert float(gap_function()(rectangle, car, piece, WINDOW)[1]) != 1.0
