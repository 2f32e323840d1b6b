"""Claim: inclusion functions contain the exact range, or say that they do not (valid = 0)."""

from __future__ import annotations

import itertools
import math
import shutil
import subprocess
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inclusion_cases import random_boxes, random_function
from inclusion_models import lifted, planar_field

from workbench.models.graph import graph_of
from workbench.sensitivity import validity
from workbench.sensitivity.inclusion import inclusion, lift
from workbench.sensitivity.intervals import SymbolicInterval
from workbench.sensitivity.validity import Validity

finite = st.floats(-1e6, 1e6)


@pytest.fixture
def balls():
    flint = pytest.importorskip("flint", reason="python-flint (ball arithmetic) is not installed")
    before, flint.ctx.prec = flint.ctx.prec, 200
    import inclusion_balls

    yield inclusion_balls
    flint.ctx.prec = before


@pytest.mark.parametrize("name", ["RELATIVE", "ABSOLUTE"])
def test_a_missing_rounding_term_would_be_caught(balls, monkeypatch, name: str) -> None:
    monkeypatch.setattr(validity, name, 0.0)
    if name == "RELATIVE":
        functions = [random_function(seed) for seed in range(20)]
        boxes = random_boxes(1, 20)
    else:
        x = ca.SX.sym("x", 3)
        functions = [ca.Function("f", [x], [x[0] * x[1] * x[2]], ["x"], ["y"])]
        boxes = (np.full((3, 1), 0.7e-107),) * 3
    caught = [balls.tally_of(function, inclusion(function), boxes).wrong for function in functions]
    assert sum(caught) > 0


@pytest.mark.parametrize("name", ["SINE_ERROR", "TANGENT_ERROR"])
def test_a_missing_elementary_error_would_be_caught(balls, monkeypatch, name: str) -> None:
    from workbench.sensitivity import elementary_trig

    monkeypatch.setattr(elementary_trig, name, 0.0)
    x = ca.SX.sym("x", 3)
    function = ca.Function("f", [x], [ca.sin(x), ca.tan(x)], ["x"], ["y", "z"])
    assert balls.tally_of(function, inclusion(function), random_boxes(2, 100)).wrong > 0


@settings(max_examples=200, deadline=None)
@given(ends=st.tuples(finite, finite, finite, finite))
def test_products_and_sums_match_the_four_corners(ends: tuple[float, ...]) -> None:
    a, b = sorted(ends[:2]), sorted(ends[2:])
    for operation in (lambda x, y: x + y, lambda x, y: x - y, lambda x, y: x * y):
        low, high, valid = map(float, lifted(operation, 2)(a[0], a[1], b[0], b[1]))
        corners = [operation(x, y) for x, y in itertools.product(a, b)]
        assert valid == 1.0
        assert low <= min(corners) <= max(corners) <= high
        assert high - low <= (max(corners) - min(corners)) + 1e-15 * max(map(abs, corners)) + 1e-300


@pytest.mark.parametrize(
    ("operation", "argument", "expected"),
    [
        (lambda x: x * x, (-1.0, 2.0), (0.0, 4.0)),
        (lambda x: x * x, (-3.0, -2.0), (4.0, 9.0)),
        (lambda x: ca.SX.binary(ca.OP_CONSTPOW, x, 4), (-1.5, 1.0), (0.0, 5.0625)),
        (lambda x: x**7, (-1.5, -1.0), (-17.0859375, -1.0)),
        (lambda x: x * x * x * x, (-1.0, 1.5), (0.0, 5.0625)),
        (lambda x: ca.SX.binary(ca.OP_CONSTPOW, x, 3), (-2.0, 1.0), (-8.0, 1.0)),
        (lambda x: ca.SX.binary(ca.OP_CONSTPOW, x, -3), (-2.0, -1.0), (-1.0, -0.125)),
        (lambda x: ca.SX.binary(ca.OP_POW, x, 0.5), (4.0, 9.0), (2.0, 3.0)),
        (lambda x: x**2.5, (0.0, 4.0), (0.0, 32.0)),
        (lambda x: x**-1.5, (4.0, 9.0), (1.0 / 27.0, 0.125)),
        (lambda x: x**0.1, (0.0, 1.0), (0.0, 1.0)),
        (lambda x: x**-0.1, (1.0, 2.0), (2.0**-0.1, 1.0)),
        (lambda x: 2**x, (-1.0, 3.0), (0.5, 8.0)),
        (lambda x: (1 + x) ** (-x), (1.0, 1.0), (0.5, 0.5)),
        (lambda x: ca.atan2(1, x), (-1.0, 1.0), (math.pi / 4, 3 * math.pi / 4)),
        (lambda x: ca.atan2(-1, x), (-1.0, 1.0), (-3 * math.pi / 4, -math.pi / 4)),
        (lambda x: ca.atan2(x, 1), (-1.0, 1.0), (-math.pi / 4, math.pi / 4)),
        (lambda x: ca.atan2(x, -1), (1.0, 2.0), (math.pi - math.atan(2.0), 3 * math.pi / 4)),
        (lambda x: ca.atan2(x, -1), (-2.0, -1.0), (-3 * math.pi / 4, math.atan(2.0) - math.pi)),
        (lambda x: 1 / x, (2.0, 4.0), (0.25, 0.5)),
        (lambda x: -3 / x, (-2.0, -1.0), (1.5, 3.0)),
        (lambda x: x / -4, (-2.0, 1.0), (-0.25, 0.5)),
        (ca.fabs, (-2.0, 1.0), (0.0, 2.0)),
        (lambda x: ca.fmin(ca.fmax(x, -1), 1), (-5.0, 0.5), (-1.0, 0.5)),
        (lambda x: ca.if_else(x < 1, 5, 6), (0.0, 0.5), (5.0, 5.0)),
        (lambda x: ca.if_else(x < 1, 5, 6), (1.0, 2.0), (6.0, 6.0)),
        (lambda x: ca.if_else(x < 1, 5, 6), (0.5, 2.0), (5.0, 6.0)),
        (lambda x: ca.eq(x, 1), (1.0, 1.0), (1.0, 1.0)),
        (lambda x: ca.eq(x, 1), (0.0, 1.0), (0.0, 1.0)),
        (lambda x: ca.ne(x, 1), (2.0, 3.0), (1.0, 1.0)),
        (lambda x: ca.logic_or(x < 0, x > 1), (0.25, 0.5), (0.0, 0.0)),
        (lambda x: ca.logic_and(x < 0, x), (-2.0, -1.0), (1.0, 1.0)),
        (lambda x: ca.logic_not(x), (0.0, 0.0), (1.0, 1.0)),
        (lambda x: ca.logic_not(x), (0.0, 1.0), (0.0, 1.0)),
    ],
)
def test_known_ranges_are_tight(operation, argument, expected) -> None:
    low, high, valid = map(float, lifted(operation, 1)(*argument))
    assert valid == 1.0
    assert low <= expected[0] <= expected[1] <= high
    assert (low, high) == pytest.approx(expected, rel=1e-14, abs=1e-14)


def test_names_shapes_and_sparsity_are_kept() -> None:
    a, b = ca.SX.sym("a", 2, 3), ca.SX.sym("b", ca.Sparsity.lower(3))
    function = ca.Function(
        "f", [a, b], [a @ b, ca.SX(2, 2), a[0, 0] * b], ["a", "b"], ["p", "z", "q"]
    )
    bounds = inclusion(function)
    assert bounds.name_in() == ["a_lower", "a_upper", "b_lower", "b_upper"]
    outputs = ["p_lower", "p_upper", "z_lower", "z_upper", "q_lower", "q_upper", "valid"]
    assert bounds.name_out() == outputs
    assert all(bounds.sparsity_out(2 * j) == function.sparsity_out(j) for j in range(3))
    at = np.arange(6.0).reshape(2, 3), np.tril(np.arange(9.0).reshape(3, 3))
    result = bounds(at[0], at[0], at[1], at[1])
    for j, exact in enumerate((at[0] @ at[1], np.zeros((2, 2)), at[0][0, 0] * at[1])):
        assert np.all(np.array(result[2 * j]) <= exact)
        assert np.all(exact <= np.array(result[2 * j + 1]))
    assert float(result[-1]) == 1.0


def test_lift_takes_expressions_as_bounds_and_keeps_their_rounding() -> None:
    x, centre, radius = (ca.SX.sym(name) for name in ("x", "centre", "radius"))
    lower, upper = centre - radius, centre + radius
    bounds = lift([x + radius, x * x], [x, radius], [lower, radius], [upper, radius])
    function = ca.Function("f", [centre, radius], [*bounds.lower, *bounds.upper, bounds.valid])
    low, _, high, _, valid = map(float, function(1.0, 1e20))
    assert valid == 1.0
    assert low <= (1.0 - 1e20) + 1e20 <= high
    assert float(function(math.nan, 1.0)[-1]) == 0.0
    assert float(function(0.0, -1.0)[-1]) == 0.0


def test_ranges_without_outward_rounding_are_cheaper_and_lie_inside() -> None:
    x, field = planar_field()
    a, b = ca.SX.sym("a", 7), ca.SX.sym("b", 7)
    rounded, plain = (lift([field], [x], [a], [b], outward=outward) for outward in (True, False))
    functions = [
        ca.Function("f", [a, b], [*bounds.lower, *bounds.upper, bounds.valid])
        for bounds in (rounded, plain)
    ]
    assert functions[1].n_instructions() < 0.8 * functions[0].n_instructions()
    (low, high, valid), (low_plain, high_plain, valid_plain) = (
        map(np.array, function(np.full(7, -0.1), np.full(7, 0.2))) for function in functions
    )
    assert valid == valid_plain == 1.0
    assert np.all(low <= low_plain)
    assert np.all(low_plain < high_plain)
    assert np.all(high_plain <= high)
    np.testing.assert_allclose((low_plain, high_plain), (low, high), rtol=1e-13)


def test_intervals_can_be_used_by_hand() -> None:
    a, b, validity_ = ca.SX.sym("a"), ca.SX.sym("b"), Validity()
    x = SymbolicInterval.between(a, b, validity_)
    y = (2.0 - x) / 4.0 + x.hull(1.0).scale(0.3) - x.square() * 0.5
    results = [y.lower, y.upper, x.magnitude(), x.width(), validity_.result()]
    low, high, magnitude, width, valid = map(float, ca.Function("f", [a, b], results)(-3.0, 0.5))
    assert (magnitude, valid) == (3.0, 1.0)
    assert 3.5 <= width <= 3.5 + 1e-14
    assert (low, high) == pytest.approx((0.375 - 0.9 - 4.5, 1.25 + 0.3), abs=1e-14)


def test_building_leaves_casadi_as_it_was_and_keeps_the_rounding_constants() -> None:
    for setting in (True, False):
        ca.GlobalOptions.setSimplificationOnTheFly(setting)
        bounds = lifted(lambda a, b: (a + b) * 0.1 * b, 2)
        assert ca.GlobalOptions.getSimplificationOnTheFly() == setting
        constants = {node.constant for node in graph_of(bounds).nodes}
        assert {2.0**-52, 2.0**-1021} <= constants
    ca.GlobalOptions.setSimplificationOnTheFly(True)


def test_compiled_code_gives_the_same_bits(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler (cc)")
    x, field = planar_field()
    function = inclusion(ca.Function("f", [x], [field, ca.jacobian(field, x)]))
    generator = ca.CodeGenerator("bounds")
    generator.add(function)
    generator.generate(f"{tmp_path}/")
    flags = ["-O2", "-ffp-contract=off", "-fno-fast-math", "-fPIC", "-shared"]
    source, library = tmp_path / "bounds.c", tmp_path / "bounds.so"
    subprocess.run([compiler, *flags, str(source), "-o", str(library), "-lm"], check=True)
    compiled = ca.external(function.name(), str(library))
    rng = np.random.default_rng(5)
    for _ in range(50):
        centre, radius = rng.normal(size=7), 10.0 ** rng.uniform(-9, 0, size=7)
        for mine, theirs in zip(
            function(centre - radius, centre + radius),
            compiled(centre - radius, centre + radius),
            strict=True,
        ):
            np.testing.assert_array_equal(np.array(mine), np.array(theirs))


def test_the_planar_field_stays_cheap() -> None:
    x, field = planar_field()
    assert inclusion(ca.Function("f", [x], [field])).n_instructions() <= 600
