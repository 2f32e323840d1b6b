"""Claim: each elementary enclosure contains the 200-bit value and keeps its stated error."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest

from workbench.sensitivity import elementary_exp, elementary_inverse, elementary_trig
from workbench.sensitivity.inclusion import inclusion

flint = pytest.importorskip("flint", reason="python-flint (ball arithmetic) is not installed")

POINTS = 10_000
U = 2.0**-53


@pytest.fixture(autouse=True)
def _two_hundred_bits():
    before, flint.ctx.prec = flint.ctx.prec, 200
    yield
    flint.ctx.prec = before


def lifted(operation: Callable[[ca.SX], ca.SX]) -> ca.Function:
    x = ca.SX.sym("x")
    return inclusion(ca.Function("f", [x], [operation(x)], ["x"], ["y"]))


def bounds(
    function: ca.Function, lower: list[float], upper: list[float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    results = function.map(len(lower))(ca.DM(lower).T, ca.DM(upper).T)
    low, high, valid = (np.array(result).ravel() for result in results)
    return low, high, valid


def encloses(below: float, exact: object, above: float) -> bool:
    """Whether the 200-bit ball is nowhere certainly outside."""
    return not exact < flint.arb(below) and not exact > flint.arb(above)


def trig_points(seed: int) -> list[float]:
    rng = random.Random(seed)
    points = [0.0, 1e4, -1e4, 5e-324, 1e-300, -1e-20, 1.0, -1.0]
    while len(points) < POINTS:
        kind = len(points) % 4
        if kind == 0:
            points.append(rng.uniform(-1e4, 1e4))
        elif kind == 1:
            nearest = rng.randrange(-6366, 6367) * (math.pi / 2.0)
            points.append(nearest + rng.choice((0.0, 1.0, -1.0)) * 10.0 ** rng.uniform(-16, -1))
        elif kind == 2:
            points.append(rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-20, 0))
        else:
            points.append(rng.uniform(-4.0, 4.0))
    return [max(-1e4, min(1e4, point)) for point in points]


def uniform_points(low: float, high: float, seed: int) -> list[float]:
    rng = random.Random(seed)
    tiny = [rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-20, 0) for _ in range(POINTS // 2)]
    wide = [rng.uniform(low, high) for _ in range(POINTS // 2)]
    return [low, high, *(point for point in (*tiny, *wide) if low <= point <= high)]


def powers(seed: int, limit: int) -> list[float]:
    rng = random.Random(seed)
    near_one = [
        1.0 + rng.uniform(-1.0, 1.0) * 10.0 ** rng.uniform(-16, -1) for _ in range(POINTS // 2)
    ]
    return [1.0, 2.0**-limit, 2.0**limit, *near_one] + [
        2.0 ** rng.uniform(-limit, limit) for _ in range(POINTS // 2)
    ]


@dataclass(frozen=True)
class Case:
    operation: Callable[[ca.SX], ca.SX]
    exact: Callable[[object], object]
    points: list[float]
    error: Callable[[float, float], float]


CASES = {
    "sin": Case(
        ca.sin, lambda x: x.sin(), trig_points(1), lambda x, y: 2.0 * elementary_trig.SINE_ERROR
    ),
    "cos": Case(
        ca.cos, lambda x: x.cos(), trig_points(2), lambda x, y: 2.0 * elementary_trig.SINE_ERROR
    ),
    "tan": Case(
        ca.tan,
        lambda x: x.tan(),
        trig_points(3),
        lambda x, y: 2.0 * elementary_trig.TANGENT_ERROR * (1.0 + abs(y)) * math.hypot(1.0, y),
    ),
    "exp": Case(
        ca.exp,
        lambda x: x.exp(),
        uniform_points(-300.0, 300.0, 4),
        lambda x, y: 2.0 * elementary_exp.EXPONENTIAL_ERROR * y,
    ),
    "log": Case(
        ca.log,
        lambda x: x.log(),
        powers(5, 500),
        lambda x, y: 2.0 * elementary_exp.LOGARITHM_ERROR * (1.0 + abs(y)),
    ),
    "atan": Case(
        ca.atan,
        lambda x: x.atan(),
        [-1e307, 1e307, *(s * p for p in powers(6, 60) for s in (1.0, -1.0))],
        lambda x, y: 2.0 * elementary_inverse.ARC_TANGENT_ERROR,
    ),
    "asin": Case(
        ca.asin,
        lambda x: x.asin(),
        uniform_points(-1.0, 1.0, 7),
        lambda x, y: 1e-14 if abs(x) <= 0.9 else 1e-7,
    ),
    "acos": Case(
        ca.acos,
        lambda x: x.acos(),
        uniform_points(-1.0, 1.0, 8),
        lambda x, y: 1e-14 if abs(x) <= 0.9 else 1e-7,
    ),
    "sinh": Case(
        ca.sinh,
        lambda x: x.sinh(),
        uniform_points(-300.0, 300.0, 9),
        lambda x, y: 1e-14 + 1e-14 * abs(y),
    ),
    "cosh": Case(
        ca.cosh, lambda x: x.cosh(), uniform_points(-300.0, 300.0, 10), lambda x, y: 1e-14 * y
    ),
    "tanh": Case(
        ca.tanh, lambda x: x.tanh(), uniform_points(-150.0, 150.0, 11), lambda x, y: 1e-14
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_point_sets_contain_the_value_within_the_stated_error(name: str) -> None:
    case = CASES[name]
    low, high, valid = bounds(lifted(case.operation), case.points, case.points)
    refused = 0
    for x, below, above, ok in zip(case.points, low, high, valid, strict=True):
        if not ok:
            refused += 1
            assert name == "tan"
            assert abs(float(flint.arb(x).cos())) < 1.001 * elementary_trig.LEAST_COSINE
            continue
        exact = case.exact(flint.arb(x))
        assert encloses(below, exact, above), (x, below, above)
        error = case.error(x, float(exact)) * (1.0 + 1e-9) + 4.0 * U * abs(float(exact))
        slack = max(float(flint.arb(above) - exact), float(exact - flint.arb(below)))
        assert slack <= error, (x, slack / error)
    assert refused < len(case.points) // 4


@pytest.mark.parametrize(
    "name", ["exp", "log", "atan", "asin", "acos", "sinh", "cosh", "tanh", "tan"]
)
def test_intervals_contain_the_image_and_add_only_the_stated_error(name: str) -> None:
    case, rng = CASES[name], random.Random(name)
    ends = [sorted(rng.sample(case.points, 2)) for _ in range(1000)]
    if name == "tan":
        ends = [(a, min(a + rng.uniform(0.0, 1.0), 1e4)) for a, _ in ends]
    low, high, valid = bounds(lifted(case.operation), [a for a, _ in ends], [b for _, b in ends])
    assert valid.mean() > (0.4 if name == "tan" else 0.99)
    for (a, b), below, above, ok in zip(ends, low, high, valid, strict=True):
        if not ok:
            continue
        images = [case.exact(flint.arb(x)) for x in (a, b, rng.uniform(a, b))]
        if name == "cosh" and a <= 0.0 <= b:
            images.append(flint.arb(1))
        assert all(encloses(below, y, above) for y in images), (a, b)
        for end, exact in ((below, min(map(float, images))), (above, max(map(float, images)))):
            x = a if abs(float(images[0]) - end) <= abs(float(images[1]) - end) else b
            allowed = case.error(x, exact) * (1.0 + 1e-9) + 8.0 * U * abs(exact)
            assert abs(end - exact) <= allowed, (a, b, end, exact)


def exact_range(a: float, b: float, delay: int) -> tuple[object, object]:
    """Range of cos(x - delay pi/2) over [a, b] by counting extrema in 200-bit arithmetic."""
    pi, shift = flint.arb.pi(), flint.arb(delay) / 2
    turns = [flint.arb(x) / pi - shift for x in (a, b)]
    first, last = int(turns[0].ceil().unique_fmpz()), int(turns[1].floor().unique_fmpz())
    values = [(pi * turn).cos() for turn in turns]
    extrema = {index % 2 for index in range(first, min(last, first + 1) + 1)}
    low = flint.arb(-1) if 1 in extrema else min(values, key=float)
    high = flint.arb(1) if 0 in extrema else max(values, key=float)
    return low, high


@pytest.mark.parametrize(("operation", "delay"), [(ca.cos, 0), (ca.sin, 1)])
def test_extrema_inside_are_counted(operation: Callable[[ca.SX], ca.SX], delay: int) -> None:
    rng = random.Random(20 + delay)
    ends = []
    for k in range(4000):
        centre = rng.randrange(-6300, 6300) * (math.pi / 2.0)
        steps = [rng.choice((0.0, 10.0 ** rng.uniform(-14, 0.9))) for _ in range(2)]
        low = centre + (0.0 if k % 3 == 0 else rng.choice((-1.0, 1.0)) * steps[0])
        ends.append((max(low, -1e4), min(low + steps[1], 1e4)))
    lows, highs, valid = bounds(lifted(operation), [a for a, _ in ends], [b for _, b in ends])
    assert valid.all()
    for (a, b), below, above in zip(ends, lows, highs, strict=True):
        low, high = exact_range(a, b, delay)
        assert encloses(below, low, above), (a, b)
        assert encloses(below, high, above), (a, b)
        assert float(low) - below < 3e-15, (a, b)
        assert above - float(high) < 3e-15, (a, b)


def test_tan_is_refused_across_every_pole_and_only_near_them() -> None:
    poles = [(2 * k + 1) * (math.pi / 2.0) for k in range(-3183, 3183)]
    across = [(pole - gap, pole + gap) for pole in poles for gap in (0.0, 1e-13, 1e-9, 0.5)]
    across.append((-1.0, 20.0))
    _, _, valid = bounds(lifted(ca.tan), [a for a, _ in across], [b for _, b in across])
    assert not valid.any()
    beside = [pole + gap for pole in poles for gap in (-1e-5, 1e-5)]
    assert bounds(lifted(ca.tan), beside, beside)[2].all()


@pytest.mark.parametrize(
    ("name", "inside", "outside"),
    [
        ("sin", 1e4, math.nextafter(1e4, math.inf)),
        ("cos", -1e4, math.nextafter(-1e4, -math.inf)),
        ("tan", 1e4, 1e5),
        ("exp", 300.0, 300.1),
        ("exp", -300.0, -300.1),
        ("log", 2.0**-500, 0.0),
        ("log", 2.0**500, -1.0),
        ("asin", 1.0, math.nextafter(1.0, 2.0)),
        ("acos", -1.0, math.nextafter(-1.0, -2.0)),
    ],
)
def test_arguments_outside_the_range_are_invalid(name: str, inside: float, outside: float) -> None:
    function = lifted(CASES[name].operation)
    _, _, valid = bounds(
        function, [inside, outside, min(inside, outside)], [inside, outside, max(inside, outside)]
    )
    assert valid.tolist() == [1.0, 0.0, 0.0]


def test_truncation_of_the_sine_polynomial_is_proved_by_ball_arithmetic() -> None:
    taylor = [0, 1]
    for degree in range(3, 43, 2):
        taylor += [0, -flint.fmpq(taylor[-1]) / (degree * (degree - 1))]
    stored = [0] * len(taylor)
    for k, coefficient in enumerate(elementary_trig.SINE_COEFFICIENTS):
        stored[2 * k + 1] = flint.fmpq(*coefficient.as_integer_ratio())
    difference = flint.arb_poly(
        [flint.fmpq(a) - flint.fmpq(b) for a, b in zip(stored, taylor, strict=True)]
    )
    end, pieces = flint.arb("1.5709"), 512
    half = end / (2 * pieces)
    rest = end**43 / flint.arb.fac_ui(43)
    worst = flint.arb(0)
    for k in range(pieces):
        shifted = difference(flint.arb_poly([half * (2 * k + 1), 1])).coeffs()
        size = sum((abs(c) * half**i for i, c in enumerate(shifted)), flint.arb(0))
        worst = max(worst, size + rest, key=lambda ball: float(ball.upper()))
    assert worst < flint.arb(2) ** -52
    assert float(worst) > 2.0**-55
