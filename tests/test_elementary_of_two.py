"""Claim: atan2 and real powers over boxes contain 200-bit values and are tight off their limits."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from workbench.sensitivity import elementary_exp, elementary_inverse
from workbench.sensitivity.inclusion import inclusion

flint = pytest.importorskip("flint", reason="python-flint (ball arithmetic) is not installed")

BOXES = 6000
Box = tuple[float, float, float, float]


@pytest.fixture(autouse=True)
def _two_hundred_bits():
    before, flint.ctx.prec = flint.ctx.prec, 200
    yield
    flint.ctx.prec = before


def bounds(operation: Callable[..., ca.SX], boxes: list[Box]) -> list[tuple[float, float, bool]]:
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    function = inclusion(ca.Function("f", [a, b], [operation(a, b)]))
    ends = [ca.DM([box[k] for box in boxes]).T for k in range(4)]
    low, high, valid = (np.array(part).ravel().tolist() for part in function(*ends))
    return [(x, y, bool(z)) for x, y, z in zip(low, high, valid, strict=True)]


def angle_boxes(seed: int) -> list[Box]:
    """Boxes in all quadrants, across the axes, with ends at 0, points, and of all sizes."""
    rng = random.Random(seed)
    boxes = []
    for _ in range(BOXES):
        size = 10.0 ** rng.choice([rng.uniform(-8, 3), 150, -150])
        sides = []
        for factor in (1.0, 10.0 ** rng.uniform(-3, 3)):
            ends = sorted(size * factor * rng.gauss(0, 1) for _ in range(2))
            if rng.random() < 0.3:
                ends[rng.randrange(2)] = 0.0
                ends.sort()
            sides.append((ends[0], ends[0]) if rng.random() < 0.3 else (ends[0], ends[1]))
        boxes.append((*sides[0], *sides[1]))
    return boxes


def inside(rng: random.Random, low: float, high: float) -> float:
    return min(max(rng.choice([low, high, low + rng.random() * (high - low)]), low), high)


def angle_faults() -> int:
    """Boxes whose bounds miss a value, exceed the stated error, or have the wrong validity."""
    rng, boxes, faults = random.Random(1), angle_boxes(0), 0
    error = 2.0 * elementary_inverse.ANGLE_ERROR * (1.0 + 1e-9)
    for (y0, y1, x0, x1), (low, high, valid) in zip(boxes, bounds(ca.atan2, boxes), strict=True):
        on_the_cut = y0 <= 0.0 <= y1 and x0 <= 0.0
        faults += valid == on_the_cut
        if on_the_cut or not valid:
            continue
        angle = flint.arb.atan2
        corners = [angle(flint.arb(y), flint.arb(x)) for y in (y0, y1) for x in (x0, x1)]
        least, most = min(corners, key=float), max(corners, key=float)
        point = angle(flint.arb(inside(rng, y0, y1)), flint.arb(inside(rng, x0, x1)))
        missed = any(v < flint.arb(low) or v > flint.arb(high) for v in (least, most, point))
        faults += missed or float(least) - low > error or high - float(most) > error
    return faults


def test_angles_are_held_within_the_stated_error_off_the_cut() -> None:
    assert angle_faults() == 0


@pytest.mark.parametrize(
    ("name", "value"), [("ANGLE_ERROR", 0.0), ("_HALF_PI_BELOW", 1.57079632679)]
)
def test_a_fault_in_the_angle_would_be_caught(monkeypatch, name: str, value: float) -> None:
    monkeypatch.setattr(elementary_inverse, name, value)
    assert angle_faults() > 0


EXPONENTS = (0.5, 1.5, -0.5, 2.25, 33.0625, -7.75, 0.1, -0.3, 1 / 3, 7.1, -2.7, 120.7, 0.001)


def bases(seed: int, exponent: float) -> list[tuple[float, float]]:
    """Intervals of bases whose powers stay within e^-250 and e^250."""
    rng, reach = random.Random(seed), min(250.0 / abs(exponent), 300.0)
    low = 0.0 if exponent > 0 else None
    intervals = []
    for _ in range(300):
        ends = sorted(math.exp(rng.uniform(-reach, reach)) for _ in range(2))
        near = 1.0 + 10.0 ** rng.uniform(-15, -1)
        kind = rng.randrange(4)
        intervals.append(
            (ends[0] if low is None or kind else low, ends[1])
            if kind != 1
            else (1.0, near)
            if rng.random() < 0.5
            else (ends[1], ends[1])
        )
    return intervals


def power_faults(exponent: float) -> int:
    rng, faults = random.Random(2), 0
    intervals = bases(3, exponent)
    boxes = [(a, b, 0.0, 0.0) for a, b in intervals]
    rows = bounds(lambda x, _: ca.SX.binary(ca.OP_CONSTPOW, x, exponent), boxes)
    for (a, b), (low, high, valid) in zip(intervals, rows, strict=True):
        values = [flint.arb(v) ** flint.arb(exponent) for v in (a, b, inside(rng, a, b))]
        values = [v for v in values if v.is_finite()] if a == 0.0 else values
        least, most = min(values, key=float), max(values, key=float)
        missed = any(v < flint.arb(low) or v > flint.arb(high) for v in values)
        loose = high > float(most) * (1 + 1e-12) or (a > 0 and low < float(least) * (1 - 1e-12))
        faults += not valid or missed or loose or (a == 0.0 and low != 0.0)
    return faults


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_constant_powers_are_held_tightly(exponent: float) -> None:
    assert power_faults(exponent) == 0


@pytest.mark.parametrize("name", ["EXPONENTIAL_ERROR", "LOGARITHM_ERROR"])
def test_a_missing_error_term_would_be_caught(monkeypatch, name: str) -> None:
    monkeypatch.setattr(elementary_exp, name, 0.0)
    assert sum(power_faults(exponent) for exponent in (0.1, 7.1, 120.7)) > 0


def test_powers_of_independent_base_and_exponent_reach_their_corners() -> None:
    rng = random.Random(4)
    boxes = []
    for _ in range(500):
        base = sorted(math.exp(rng.uniform(-20, 20)) for _ in range(2))
        exponent = sorted(rng.uniform(-10, 10) for _ in range(2))
        boxes.append((base[0], base[rng.randrange(2)], exponent[0], exponent[rng.randrange(2)]))
    for (a, b, p, q), (low, high, valid) in zip(
        boxes, bounds(lambda x, y: x**y, boxes), strict=True
    ):
        corners = [flint.arb(x) ** flint.arb(y) for x, y in itertools.product((a, b), (p, q))]
        least, most = min(corners, key=float), max(corners, key=float)
        assert valid
        assert not least < flint.arb(low)
        assert not most > flint.arb(high)
        assert float(least) * (1 - 1e-11) <= low
        assert high <= float(most) * (1 + 1e-11)


def test_a_base_that_reaches_zero_has_powers_down_to_zero() -> None:
    boxes = [(0.0, 0.0, 0.0, 0.0), (5e-324, 1e-300, 0.0, 0.0), (0.0, 4.0, 0.0, 0.0)]
    for exponent in (0.25, 0.3, 2.5, 2.7, 150.3):
        rows = bounds(lambda x, _, c=exponent: ca.SX.binary(ca.OP_CONSTPOW, x, c), boxes)
        for (a, b, *_), (low, high, valid) in zip(boxes, rows, strict=True):
            assert valid
            assert low <= float(flint.arb(a) ** flint.arb(exponent)) if a else low == 0.0
            assert flint.arb(b) == 0 or not flint.arb(b) ** flint.arb(exponent) > flint.arb(high)
