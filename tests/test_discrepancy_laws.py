"""Derived discrepancies contain pairs of runs, are homogeneous, and tighten with more cells."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.models.benchmarks import Benchmark, b1, b2, b2_noise, b2_path
from workbench.sensitivity import (
    Discrepancy,
    GrowthMatrix,
    Inputs,
    Norm,
    WeightedNorm,
    derive_discrepancy,
)
from workbench.sensitivity.discrepancy import DerivationMethod
from workbench.sensitivity.growth_matrix import MetzlerGrowth
from workbench.sensitivity.jacobian import IntervalJacobian
from workbench.sensitivity.sampling import instants, rollout, sample_initial_states, uniform_states
from workbench.sensitivity.weighted_norm import ExponentialGrowth
from workbench.sets.box import Box

_SIDES = ((-1.0, 6.0), (-0.7, 0.8), (-0.6, 0.6), (2.0, 3.2), (-0.5, 0.5), (-2.0, 2.0), (-2.0, 2.0))
_HORIZON_S = 1.5
_METHODS: tuple[DerivationMethod, ...] = (
    GrowthMatrix(cells=64, inputs=Inputs.SHARED),
    WeightedNorm(norm=Norm.MAX, weights=None, cells=64, inputs=Inputs.SHARED),
    WeightedNorm(norm=Norm.SUM, weights=None, cells=64, inputs=Inputs.SHARED),
)


def _region(benchmark: Benchmark) -> Box:
    return Box.from_intervals(dict(zip(benchmark.system.ode.names, _SIDES, strict=True)))


def _derive(benchmark: Benchmark, method: DerivationMethod) -> Discrepancy:
    return derive_discrepancy(
        benchmark.system, region=_region(benchmark), horizon_s=_HORIZON_S, method=method
    )


@pytest.mark.parametrize("method", _METHODS, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize("benchmark", [b1(), b2(), b2_path(), b2_noise()], ids=lambda b: b.name)
def test_pairs_of_runs_stay_within_the_bound(
    benchmark: Benchmark, method: DerivationMethod
) -> None:
    bound = _derive(benchmark, method)
    states = sample_initial_states(benchmark.initial_set, count=400, seed=7)
    states = states[np.random.default_rng(1).permutation(400)]
    runs = rollout(benchmark.system, states, horizon_s=_HORIZON_S, step_s=0.05)
    region = _region(benchmark)
    assert np.all((runs >= np.array(region.lower)) & (runs <= np.array(region.upper)))
    for first, second in zip(runs[:200], runs[200:], strict=True):
        gaps = np.nextafter(np.abs(first[0] - second[0]), np.inf)
        for k, t in list(enumerate(instants(_HORIZON_S, 0.05).tolist()))[::10]:
            assert np.all(np.abs(first[k] - second[k]) <= np.array(bound.radius(gaps, t)) + 1e-7)


@pytest.mark.parametrize("benchmark", [b1(), b2()], ids=lambda b: b.name)
def test_near_pairs_spread_at_most_as_the_bound_says_and_nearly_so(benchmark: Benchmark) -> None:
    """Over a short time the bound is within a third of the truth, so a missing entry would show."""
    bound = _derive(benchmark, GrowthMatrix(cells=512, inputs=Inputs.SHARED))
    states = uniform_states(benchmark.initial_set, 300, np.random.default_rng(0))
    t = 0.05
    runs = rollout(benchmark.system, states, horizon_s=t, step_s=0.05)[:, -1]
    for axis in range(7):
        shift = np.zeros(7)
        shift[axis] = 1e-4
        moved = rollout(benchmark.system, states + shift, horizon_s=t, step_s=0.05)[:, -1]
        reached = np.abs(moved - runs).max(axis=0)
        promised = np.array(bound.radius((1.000001 * shift).tolist(), t))
        assert np.all(reached <= promised)
        assert promised[axis] <= 1.35 * reached[axis]


@pytest.mark.parametrize("benchmark", [b1(), b2()], ids=lambda b: b.name)
def test_interval_jacobians_contain_the_jacobian_at_points(benchmark: Benchmark) -> None:
    ode = benchmark.system.ode
    jacobian = ca.Function("j", [ode.x, ode.p], [ca.densify(ca.jacobian(ode.field, ode.x))])
    enclosure = IntervalJacobian(benchmark.system)
    centres = uniform_states(_region(benchmark), 300, np.random.default_rng(3))
    cells = enclosure.on(centres - 0.01, centres + 0.01)
    points = centres + np.random.default_rng(4).uniform(-0.01, 0.01, centres.shape)
    for k, point in enumerate(points):
        value = np.array(jacobian(point, ode.parameter_values()))
        assert np.all(value >= cells.jacobian_lower[k] - 1e-12)
        assert np.all(value <= cells.jacobian_upper[k] + 1e-12)
    # Most small cells lie on one side of every limit, where the enclosure must be sharp.
    width = (cells.jacobian_upper - cells.jacobian_lower).max(axis=(1, 2))
    assert np.median(width) < 0.3


@pytest.mark.parametrize("method", _METHODS, ids=lambda m: type(m).__name__)
@given(scale=st.floats(1e-3, 1e3), t=st.floats(0.0, _HORIZON_S))
@settings(max_examples=20, deadline=None)
def test_bounds_are_homogeneous_and_monotone_in_the_radius(
    method: DerivationMethod, scale: float, t: float
) -> None:
    bound = _B1_BOUNDS[type(method), getattr(method, "norm", None)]
    radius = b1().initial_set.radius
    wide = bound.radius([scale * r for r in radius], t)
    np.testing.assert_allclose(
        wide, scale * np.array(bound.radius(radius, t)), rtol=1e-9, atol=1e-300
    )
    assert np.all(np.array(bound.radius([1.1 * r for r in radius], t)) >= bound.radius(radius, t))


_B1_BOUNDS = {(type(m), getattr(m, "norm", None)): _derive(b1(), m) for m in _METHODS}


@pytest.mark.parametrize("norm", list(Norm))
def test_scalar_bounds_with_a_positive_rate_grow_in_time(norm: Norm) -> None:
    bound = _B1_BOUNDS[WeightedNorm, norm]
    assert isinstance(bound.growth, ExponentialGrowth)
    assert bound.growth.rate_per_s > 0.0
    radius = b1().initial_set.radius
    curve = np.array([bound.radius(radius, t) for t in instants(_HORIZON_S, 0.1).tolist()])
    assert np.all(np.diff(curve, axis=0) > 0.0)


def test_splitting_the_region_tightens_both_kinds() -> None:
    def rate(cells: int) -> float:
        growth = _derive(
            b1(), WeightedNorm(norm=Norm.MAX, weights=None, cells=cells, inputs=Inputs.SHARED)
        ).growth
        assert isinstance(growth, ExponentialGrowth)
        return growth.rate_per_s

    def matrix(cells: int) -> np.ndarray:
        growth = _derive(b1(), GrowthMatrix(cells=cells, inputs=Inputs.SHARED)).growth
        assert isinstance(growth, MetzlerGrowth)
        return np.array(growth.matrix)

    assert rate(128) < 0.97 * rate(1)
    assert np.all(matrix(128) <= matrix(1))
    assert np.any(matrix(128) < 0.97 * matrix(1))
