"""Derived discrepancies of systems with known growth equal it, and never fall below."""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca
import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import expm

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode, system_from_casadi
from workbench.sensitivity import (
    Discrepancy,
    GrowthMatrix,
    Inputs,
    Norm,
    WeightedNorm,
    derive_discrepancy,
)
from workbench.sensitivity.growth_matrix import MetzlerGrowth
from workbench.sensitivity.weighted_norm import ExponentialGrowth
from workbench.sets.box import Box

Array = npt.NDArray[np.float64]
_TIMES = (0.0, 0.1, 1.0, 2.5)


def _linear(matrix: Array) -> Ode:
    names = tuple("abcdefg"[: len(matrix)])
    x = ca.SX.sym("x", len(matrix))
    return system_from_casadi(x, ca.DM(matrix) @ x, names)


def _region(system: Ode, radius: float = 1.0) -> Box:
    return Box.around(dict.fromkeys(system.names, 0.0), radius=dict.fromkeys(system.names, radius))


def _growth(
    matrix: Array, norm: Norm = Norm.MAX, weights: Mapping[str, float] | None = None
) -> Discrepancy:
    system = _linear(matrix)
    method = WeightedNorm(norm=norm, weights=weights, cells=1, inputs=Inputs.SHARED)
    return derive_discrepancy(system, region=_region(system), horizon_s=2.5, method=method)


def _by_matrix(system: Ode, region: Box, cells: int = 1) -> Discrepancy:
    return derive_discrepancy(
        system, region=region, horizon_s=2.5, method=GrowthMatrix(cells=cells, inputs=Inputs.SHARED)
    )


def _rate(bound: Discrepancy) -> float:
    assert isinstance(bound.growth, ExponentialGrowth)
    return bound.growth.rate_per_s


@pytest.mark.parametrize("rate", [-2.0, 0.0, 0.7])
def test_one_state_grows_by_its_exponential(rate: float) -> None:
    system = _linear(np.array([[rate]]))
    by_norm = _growth(np.array([[rate]]))
    by_matrix = _by_matrix(system, _region(system))
    for bound in (by_norm, by_matrix):
        assert bound.rigor is Rigor.ENCLOSED
        for t in _TIMES:
            exact = 0.5 * math.exp(rate * t)
            assert exact * (1 - 1e-15) <= bound.radius([0.5], t)[0] <= exact * (1 + 1e-12)


def test_cooperative_systems_grow_exactly_by_their_matrix() -> None:
    matrix = np.array([[-1.0, 0.5, 0.0], [0.2, -3.0, 2.0], [0.0, 1.0, 0.3]])
    system = _linear(matrix)
    bound = _by_matrix(system, _region(system))
    start = np.array([0.1, 2.0, 0.0])
    for t in _TIMES:
        exact = expm(matrix * t) @ start
        np.testing.assert_allclose(bound.radius(start.tolist(), t), exact, rtol=1e-12, atol=1e-30)


def test_a_cascade_grows_polynomially() -> None:
    system = _linear(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]))
    bound = _by_matrix(system, _region(system))
    for t in _TIMES:
        expected = (1.0 + 2.0 * t + 3.0 * t * t / 2.0, 2.0 + 3.0 * t, 3.0)
        assert bound.radius([1.0, 2.0, 3.0], t) == pytest.approx(expected, rel=1e-13)


def test_the_measures_are_row_and_column_sums() -> None:
    matrix = np.array([[-1.0, 4.0], [-0.5, -2.0]])
    weights = {"a": 1.0, "b": 2.0}
    # W M W^-1 = [[-1, 2], [-1, -2]].
    assert _rate(_growth(matrix, Norm.MAX, weights)) == pytest.approx(1.0, rel=1e-14)
    assert _rate(_growth(matrix, Norm.SUM, weights)) == pytest.approx(0.0, abs=1e-14)
    assert _growth(matrix, Norm.MAX, weights).radius([1.0, 1.0], 0.0) == pytest.approx((2.0, 1.0))
    assert _growth(matrix, Norm.SUM, weights).radius([1.0, 1.0], 0.0) == pytest.approx((3.0, 1.5))


@pytest.mark.parametrize("norm", list(Norm))
def test_chosen_weights_find_the_decay_that_unit_weights_miss(norm: Norm) -> None:
    matrix = np.array([[-1.0, 100.0], [0.001, -2.0]])
    unit = _growth(matrix, norm, {"a": 1.0, "b": 1.0})
    chosen = _growth(matrix, norm)
    best = float(np.linalg.eigvals(matrix).real.max())
    assert _rate(unit) > 90.0
    assert best <= _rate(chosen) < 2.0
    for t in _TIMES:
        true = np.abs(expm(matrix * t)) @ np.array([1.0, 1.0])
        assert np.all(np.array(chosen.radius([1.0, 1.0], t)) >= true)


def test_weights_trade_the_rate_against_the_spread_of_the_horizon() -> None:
    # The Perron weights give rate -0.9 at a spread of 10000; over 0.01 s spread costs more.
    matrix = np.array([[-1.0, 1e-4], [100.0, -1.0]])
    system = _linear(matrix)
    for horizon_s, low, high in ((0.01, 5.0, 101.0), (50.0, -1.0, -0.85)):
        bound = derive_discrepancy(
            system,
            region=_region(system),
            horizon_s=horizon_s,
            method=WeightedNorm(norm=Norm.MAX, weights=None, cells=1, inputs=Inputs.SHARED),
        )
        assert low <= _rate(bound) <= high


def test_a_clip_has_the_slopes_of_both_branches_and_decided_regions_only_one() -> None:
    x = ca.SX.sym("x")
    system = system_from_casadi(x, -ca.fmin(ca.fmax(5.0 * x, -1.0), 1.0), ("x",))

    def rate(low: float, high: float) -> float:
        region = Box.from_intervals({"x": (low, high)})
        growth = _by_matrix(system, region).growth
        assert isinstance(growth, MetzlerGrowth)
        return growth.matrix[0][0]

    assert rate(-1.0, 1.0) == pytest.approx(0.0, abs=1e-300)
    assert rate(-0.19, 0.19) == pytest.approx(-5.0, rel=1e-14)
    assert rate(0.3, 1.0) == pytest.approx(0.0, abs=1e-300)


def test_the_slope_of_an_absolute_value_is_one() -> None:
    x = ca.SX.sym("x")
    bound = _by_matrix(
        system_from_casadi(x, ca.fabs(x), ("x",)), Box.from_intervals({"x": (-1.0, 1.0)})
    )
    assert bound.radius([1.0], 1.0)[0] == pytest.approx(math.e, rel=1e-12)


def test_parameter_and_disturbance_ranges_enter_the_suprema() -> None:
    x, p, w = ca.SX.sym("x"), ca.SX.sym("p"), ca.SX.sym("w")
    ode = Ode(
        "ranged",
        (Signal("x", ""),),
        (Ranged("p", "1/s", 1.0, 0.5, 2.0),),
        (Ranged("w", "1/s", 0.0, -0.25, 0.25),),
        x,
        p,
        w,
        (w - p) * x,
    )
    growth = _by_matrix(ode, Box.around({"x": 0.0}, radius={"x": 1.0})).growth
    assert isinstance(growth, MetzlerGrowth)
    assert growth.matrix[0][0] == pytest.approx(-0.25, rel=1e-14)


def test_axes_without_influence_may_be_left_out_and_others_may_not() -> None:
    x = ca.SX.sym("x", 2)
    system = system_from_casadi(x, ca.vertcat(x[1] ** 2, -x[1]), ("place", "rate"))
    bound = _by_matrix(system, Box.from_intervals({"rate": (-1.0, 1.0)}))
    assert bound.radius({"rate": 0.1}, 0.0) == (0.0, 0.1)
    with pytest.raises(InputError, match="rate"):
        _by_matrix(system, Box.from_intervals({"place": (-1.0, 1.0)}))


def test_a_pole_in_the_region_is_named() -> None:
    x = ca.SX.sym("x")
    system = system_from_casadi(x, ca.tan(x), ("x",))
    with pytest.raises(InputError, match="could not be enclosed"):
        _by_matrix(system, Box.from_intervals({"x": (1.0, 2.0)}), cells=8)


@pytest.mark.parametrize(
    ("radius", "t_s", "message"),
    [
        ([0.1], 3.0, "longer horizon"),
        ([0.1], -1.0, "time in"),
        ([-0.1], 1.0, "radius >= 0"),
        ([math.nan], 1.0, "radius >= 0"),
        ([0.1, 0.1], 1.0, "1 radii"),
        ({"z": 0.1}, 1.0, "unknown states"),
    ],
)
def test_unusable_queries_are_named(
    radius: list[float] | dict[str, float], t_s: float, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        _growth(np.array([[-1.0]])).radius(radius, t_s)


def test_unusable_methods_and_fields_are_named() -> None:
    with pytest.raises(InputError, match="at least 1 cell"):
        GrowthMatrix(cells=0, inputs=Inputs.SHARED)
    with pytest.raises(InputError, match="weights > 0"):
        WeightedNorm(norm=Norm.MAX, weights={"a": -1.0}, cells=1, inputs=Inputs.SHARED)
    with pytest.raises(InputError, match="one weight for each"):
        _growth(np.array([[-1.0]]), weights={"b": 1.0})
    x = ca.SX.sym("x")
    jump = ca.if_else(x > 0, -1.0, 1.0)
    with pytest.raises(InputError, match=r"continuous|derivative"):
        _by_matrix(system_from_casadi(x, jump, ("x",)), Box.from_intervals({"x": (-1.0, 1.0)}))
