"""Claim: series of polynomials with radii hold the exact coefficients, for every deviation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.reach.validated.algebra import Algebra

balls = pytest.importorskip("validated_balls", reason="python-flint is not installed")
catchers = pytest.importorskip("validated_catchers", reason="python-flint is not installed")
OPERATIONS, operation = catchers.OPERATIONS, catchers.operation

# (deep, degree, shallow) of the algebras; 0 deep variables are those of point sets.
SHAPES = ((0, 0, 2), (1, 4, 1), (2, 2, 2), (3, 3, 0), (5, 2, 2), (2, 1, 1))
# Member 0 of each batch is a point, the last one wide.
SIZES = (0.0, 1e-6, 0.2)


@pytest.mark.parametrize("name", OPERATIONS)
def test_an_operation_contains_the_exact_coefficients(name: str) -> None:
    function, centers = operation(name), OPERATIONS[name][1]
    for seed, (deep, degree, shallow) in enumerate(SHAPES):
        algebra = Algebra.of(deep=deep, degree=degree, shallow=shallow)
        inputs = balls.Inputs.random(algebra, centers, SIZES, orders=6, seed=seed)
        assert balls.escapes(function, inputs) == 0, (deep, degree, shallow)


@settings(deadline=None, max_examples=80)
@given(
    name=st.sampled_from(sorted(OPERATIONS)),
    shape=st.tuples(st.integers(0, 4), st.integers(1, 4), st.integers(0, 2)),
    exponents=st.tuples(*[st.integers(-40, -1)] * 3),
    share=st.sampled_from([0.0, 1e-9, 0.3]),
    seed=st.integers(0, 2**32 - 1),
)
def test_operations_contain_whatever_the_sizes(
    name: str,
    shape: tuple[int, int, int],
    exponents: tuple[int, int, int],
    share: float,
    seed: int,
) -> None:
    deep, degree, shallow = shape
    algebra = Algebra.of(deep=deep, degree=degree if deep else 0, shallow=shallow)
    sizes = [0.3 * 2.0**e for e in exponents]
    inputs = balls.Inputs.random(
        algebra, OPERATIONS[name][1], sizes, orders=5, seed=seed, radius_share=share
    )
    assert balls.escapes(operation(name), inputs, deviations=2, seed=seed) == 0


@pytest.mark.parametrize("name", ["sum", "product", "constants", "quotient", "sin", "nested"])
def test_rounding_of_many_orders_is_in_the_radii_of_points(name: str) -> None:
    assert catchers.points_escape(name) == 0


@pytest.mark.parametrize(("name", "degree"), [("sqrt", 3), ("real power", 3)])
def test_powers_of_a_tiny_size_do_not_underflow(name: str, degree: int) -> None:
    algebra = Algebra.of(deep=1, degree=degree, shallow=0)
    inputs = balls.Inputs.random(
        algebra, (1e-80, 0.9), (1e-82,) * 8, orders=1, seed=1, radius_share=0.0
    )
    with np.errstate(all="ignore"):
        assert balls.escapes(operation(name), inputs) == 0


def test_the_radius_of_radii_is_never_rounded_down() -> None:
    assert catchers.rounded_radii() == 0


def test_products_that_underflow_are_in_the_radius() -> None:
    assert catchers.underflowing() == 0


@settings(deadline=None, max_examples=60)
@given(
    shape=st.tuples(st.integers(0, 2), st.integers(1, 3), st.integers(0, 1)),
    magnitudes=st.lists(st.integers(-300, 150), min_size=4, max_size=4),
    seed=st.integers(0, 2**32 - 1),
)
def test_bounds_hold_at_vertices_and_turning_points(
    shape: tuple[int, int, int], magnitudes: list[int], seed: int
) -> None:
    deep, degree, shallow = shape
    algebra = Algebra.of(deep=deep, degree=degree if deep else 0, shallow=shallow)
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.choice(np.array(magnitudes, dtype=float), algebra.size)
    coefficients = rng.normal(size=algebra.size) * scale
    assert catchers.unbounded_values(algebra, coefficients, float(scale[0] * (seed % 2))) == 0


def test_bounds_hold_where_squares_of_coefficients_underflow() -> None:
    algebra = Algebra.of(deep=1, degree=2, shallow=0)
    for size in (1e-170, 1e-250, 1e-305, 1e160, 4e307):
        assert catchers.unbounded_values(algebra, size * np.array([0.0, 1.0, 1.0]), 0.0) == 0


@pytest.mark.parametrize("scale", [1.0, 1e-200, 1e150])
def test_a_line_through_a_clip_misses_it_by_its_gap_at_most(scale: float) -> None:
    assert catchers.line_violations(5, scale) == 0
