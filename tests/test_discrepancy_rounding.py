"""Bounds are evaluated upward: no result lies below the exact one, and few digits are lost."""

from __future__ import annotations

import math
from decimal import Context, Decimal
from fractions import Fraction

import casadi as ca
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.models import system_from_casadi
from workbench.sensitivity import GrowthMatrix, Inputs, derive_discrepancy, jacobian
from workbench.sensitivity.growth_matrix import MetzlerGrowth
from workbench.sensitivity.rounding import exp_integral_up, exp_up, mul_up, sum_up
from workbench.sensitivity.weighted_norm import ExponentialGrowth, Norm
from workbench.sets import Box

_PRECISE = Context(prec=60, Emin=-999_999, Emax=999_999)


@given(st.floats(-745.0, 709.0))
def test_exp_is_not_below_the_exact_one(exponent: float) -> None:
    exact = Decimal(exponent).exp(_PRECISE)
    bound = exp_up(exponent)
    assert Decimal(bound) >= exact
    assert Decimal(bound) <= exact * (1 + Decimal(2) ** -50) + Decimal(2) ** -1073


def test_exp_far_out_stays_true() -> None:
    assert exp_up(-1e6) > 0.0
    assert exp_up(1e6) == math.inf


@given(st.lists(st.floats(0.0, 1e6), min_size=1, max_size=6))
def test_sums_and_products_are_not_below_the_exact_ones(values: list[float]) -> None:
    exact = [Fraction(value) for value in values]
    assert Fraction(sum_up(values)) >= sum(exact)
    assert Fraction(mul_up(*values)) >= math.prod(exact)
    assert Fraction(sum_up(values)) <= sum(exact) * (1 + Fraction(1, 10**14)) + Fraction(1, 2**1070)


@given(st.floats(-5.0, 5.0), st.floats(0.01, 100.0), st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_scalar_growth_is_not_below_the_exact_one(
    rate: float, weight: float, radius: float, t: float
) -> None:
    growth = ExponentialGrowth(Norm.MAX, (weight, 1.0), rate, (0.0, 0.0))
    other = growth.half_widths((radius, 0.0), t)[1]
    exact = _PRECISE.multiply(
        _PRECISE.multiply(Decimal(weight), Decimal(radius)),
        _PRECISE.multiply(Decimal(rate), Decimal(t)).exp(_PRECISE),
    )
    assert Decimal(other) >= exact
    assert Decimal(other) <= exact * (1 + Decimal("1e-13")) + Decimal("1e-300")


@given(
    st.lists(st.floats(0.01, 3.0), min_size=4, max_size=4),
    st.floats(-4.0, 2.0),
    st.floats(0.0, 3.0),
)
def test_matrix_growth_is_not_below_the_exact_one(
    entries: list[float], diagonal: float, t: float
) -> None:
    matrix = ((diagonal, entries[0]), (entries[1], diagonal - entries[2]))
    bound = MetzlerGrowth(matrix, (0.0, 0.0)).half_widths((1.0, entries[3]), t)
    # exp(M t) as exp(M t / 8) applied eight times, in fractions of 300 bits.
    scaled = [[Fraction(value) * Fraction(t) / 8 for value in row] for row in matrix]
    exact = [Fraction(1), Fraction(entries[3])]
    for _ in range(8):
        term, total = exact, list(exact)
        for k in range(1, 45):
            term = [
                sum((a * b for a, b in zip(row, term, strict=True)), Fraction(0)) / k
                for row in scaled
            ]
            term = [Fraction(round(value * 2**300), 2**300) for value in term]
            total = [a + b for a, b in zip(total, term, strict=True)]
        exact = total
    for got, true in zip(bound, exact, strict=True):
        assert Fraction(got) >= true - Fraction(1, 2**280)
        assert got == pytest.approx(float(true), rel=1e-11, abs=1e-25)


def test_nothing_is_derived_where_rounding_is_not_to_nearest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(jacobian, "float_mode_fault", lambda: "rounding is not to nearest")
    x = ca.SX.sym("x")
    with pytest.raises(InputError, match="rounding is not to nearest"):
        derive_discrepancy(
            system_from_casadi(x, -x, ("x",)),
            region=Box(("x",), (-1.0,), (1.0,)),
            horizon_s=1.0,
            method=GrowthMatrix(cells=1, inputs=Inputs.SHARED),
        )


def test_growth_that_leaves_the_doubles_is_infinite_and_not_wrong() -> None:
    assert MetzlerGrowth(((1000.0,),), (0.0,)).half_widths((1.0,), 10.0) == (math.inf,)
    assert ExponentialGrowth(Norm.MAX, (1.0,), 1000.0, (0.0,)).half_widths((1.0,), 10.0) == (
        math.inf,
    )


@given(st.floats(1e-3, 50.0) | st.floats(-50.0, -1e-3), st.floats(1e-3, 10.0))
def test_the_integral_of_an_exponential_is_rounded_up(rate: float, t: float) -> None:
    digits = Context(prec=400, Emin=-999_999, Emax=999_999)
    z = digits.multiply(Decimal(rate), Decimal(t))
    exact = digits.divide(digits.multiply(digits.subtract(z.exp(digits), 1), Decimal(t)), z)
    bound = Decimal(exp_integral_up(rate, t))
    assert bound >= exact
    assert bound <= exact * Decimal(1.0 + 1e-12) + Decimal("1e-300")


@pytest.mark.parametrize("exponent", [1e-17, -1e-17, 1e-9, -1e-9, -2000.0, 699.0])
def test_the_integral_is_right_where_it_is_delicate(exponent: float) -> None:
    digits = Context(prec=400, Emin=-999_999, Emax=999_999)
    exact = digits.divide(digits.subtract(Decimal(exponent).exp(digits), 1), Decimal(exponent))
    assert exact <= Decimal(exp_integral_up(exponent, 1.0)) <= exact * Decimal(1.0 + 1e-12)
    assert exp_integral_up(800.0, 1.0) == math.inf
