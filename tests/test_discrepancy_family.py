"""Every proved discrepancy contains pairs of runs, and the better norms are better on B1."""

from __future__ import annotations

import functools
import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark, b1, b2, b2_path
from workbench.models.system import Ode, system_from_casadi
from workbench.reach import compute_tube
from workbench.sensitivity import (
    BlockGrowth,
    Discrepancy,
    Effort,
    EuclideanNorm,
    Form,
    GrowthMatrix,
    Inputs,
    Norm,
    OptimalMetric,
    WeightedNorm,
    derive_discrepancy,
)
from workbench.sensitivity.blockwise import BlockwiseGrowth
from workbench.sensitivity.discrepancy import DerivationMethod
from workbench.sensitivity.sampling import instants, rollout, sample_initial_states
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box

_HORIZON_S = 3.0
_SIDES = ((-1.0, 9.0), (-0.8, 0.9), (-0.6, 0.6), (2.0, 3.2), (-0.5, 0.5), (-2.0, 2.0), (-2.0, 2.0))
_VERTICES = Effort(Form.VERTICES, 1e4, 32)
_COVERED = Effort(Form.CENTRE_RADIUS, 1e4, 32)
_SHARED = Inputs.SHARED
_METHODS: dict[str, DerivationMethod] = {
    "max": WeightedNorm(Norm.MAX, None, 32, _SHARED),
    "sum": WeightedNorm(Norm.SUM, None, 32, _SHARED),
    "euclidean": EuclideanNorm(None, 32, _SHARED),
    "matrix": GrowthMatrix(32, _SHARED),
    "metric, vertices": OptimalMetric(_VERTICES, _SHARED),
    "metric, centre": OptimalMetric(_COVERED, _SHARED),
    "blocks, vertices": BlockGrowth(None, _VERTICES, _SHARED),
    "blocks, centre": BlockGrowth(None, _COVERED, _SHARED),
}
_COARSE = Effort(Form.CENTRE_RADIUS, 1e4, 8)
_ON_KINKS: dict[str, DerivationMethod] = {
    "euclidean on kinks": EuclideanNorm(None, 8, _SHARED),
    "metric on kinks": OptimalMetric(_COARSE, _SHARED),
    "blocks on kinks": BlockGrowth(None, _COARSE, _SHARED),
}


@functools.cache
def _region(name: str) -> Box:
    """The hull of the tube on B1, a box that the runs do not leave on the loops with kinks."""
    benchmark = _named(name)
    if name != "B1":
        return Box.from_intervals(dict(zip(benchmark.system.ode.names, _SIDES, strict=True)))
    tube = compute_tube(
        benchmark.system,
        initial_set=benchmark.initial_set,
        horizon_s=_HORIZON_S,
    )
    lower, upper = tube.lower.min(axis=0), tube.upper.max(axis=0)
    return Box(tube.names, tuple(lower.tolist()), tuple(upper.tolist()))


def _named(name: str) -> Benchmark:
    return {"B1": b1(), "B2": b2(), "B2-path": b2_path()}[name]


@functools.cache
def _bound(name: str, method: str) -> Discrepancy:
    return derive_discrepancy(
        _named(name).system,
        region=_region(name),
        horizon_s=_HORIZON_S,
        method=(_METHODS | _ON_KINKS)[method],
    )


def _growth(name: str, method: str) -> Array:
    """Proved over sampled growth of every coordinate at the horizon."""
    benchmark = _named(name)
    states = sample_initial_states(benchmark.initial_set, count=1000, seed=1)
    runs = rollout(benchmark.system, states, horizon_s=_HORIZON_S, step_s=0.05)[:, -1]
    radius = 0.5 * (runs.max(axis=0) - runs.min(axis=0))
    reached = _bound(name, method).radius(benchmark.initial_set.radius, _HORIZON_S)
    return np.asarray(np.array(reached) / radius)


@pytest.mark.parametrize(
    ("name", "method"),
    [
        *(("B1", method) for method in _METHODS),
        *(("B2", method) for method in _ON_KINKS),
        ("B2-path", "metric on kinks"),
    ],
)
def test_pairs_of_runs_stay_within_the_bound(name: str, method: str) -> None:
    benchmark, bound = _named(name), _bound(name, method)
    assert bound.rigor is Rigor.ENCLOSED
    states = sample_initial_states(benchmark.initial_set, count=400, seed=7)
    rng = np.random.default_rng(1)
    base = 0.1 * np.array(benchmark.initial_set.center) + 0.9 * states[:50]
    near = base + 1e-4 * rng.normal(size=(50, 7)) * (np.array(benchmark.initial_set.radius) > 0.0)
    states = np.concatenate([states[rng.permutation(400)], near, base])
    runs = rollout(benchmark.system, states, horizon_s=_HORIZON_S, step_s=0.05)
    assert np.all((runs >= _region(name).lower) & (runs <= _region(name).upper))
    pairs = [
        *zip(runs[:200], runs[200:400], strict=True),
        *zip(runs[400:450], runs[450:], strict=True),
    ]
    for first, second in pairs:
        gaps = np.nextafter(np.abs(first[0] - second[0]), np.inf)
        for k, t in list(enumerate(instants(_HORIZON_S, 0.05).tolist()))[::20]:
            assert np.all(np.abs(first[k] - second[k]) <= np.array(bound.radius(gaps, t)) + 1e-7)


@pytest.mark.parametrize("method", list(_METHODS))
@given(
    first=st.floats(0.0, 1.5),
    second=st.floats(0.0, 1.5),
    shares=st.lists(st.floats(0.0, 2.0), min_size=7, max_size=7),
)
@settings(max_examples=10, deadline=None)
def test_stopping_on_the_way_never_helps(
    method: str, first: float, second: float, shares: list[float]
) -> None:
    """Semigroup: a box read off half way and taken on is no smaller."""
    bound = _bound("B1", method)
    start = [s * r for s, r in zip(shares, _region("B1").radius, strict=True)]
    direct = np.array(bound.radius(start, first + second))
    stopped = np.array(bound.radius(bound.radius(start, first), second))
    assert np.all(stopped >= direct * (1.0 - 1e-9) - 1e-20)
    doubled = np.array(bound.radius([2.0 * r for r in start], first))
    np.testing.assert_allclose(
        doubled, 2.0 * np.array(bound.radius(start, first)), rtol=1e-9, atol=1e-150
    )


def test_the_metric_beats_the_fixed_norms_on_b1_and_the_blocks_beat_the_metric() -> None:
    mean = {name: float(np.exp(np.log(_growth("B1", name)).mean())) for name in _METHODS}
    assert all(np.all(_growth("B1", name) > 0.999) for name in _METHODS)
    fixed = min(mean[name] for name in ("max", "sum", "euclidean"))
    for form in ("vertices", "centre"):
        assert mean[f"metric, {form}"] < 0.5 * fixed
        assert mean[f"blocks, {form}"] < 0.75 * mean[f"metric, {form}"]
        assert mean[f"blocks, {form}"] < 0.2 * mean["matrix"]


@pytest.mark.parametrize("method", ["euclidean", "metric, vertices", "blocks, vertices"])
def test_cells_of_the_proof_cover_the_region_and_carry_their_hulls(method: str) -> None:
    bound, region = _bound("B1", method), _region("B1")
    assert bound.proof is not None
    cells = bound.proof.cells
    assert bound.proof.inputs is Inputs.SHARED
    points = np.random.default_rng(0).uniform(region.lower, region.upper, (200, 7))
    inside = (points[:, None] >= cells.lower) & (points[:, None] <= cells.upper)
    assert np.all(inside.all(axis=2).sum(axis=1) > 0)
    assert np.all(np.isfinite(cells.jacobian_lower) & np.isfinite(cells.jacobian_upper))
    assert isinstance(bound.growth, BlockwiseGrowth)
    assert bound.growth.condition(region.radius) >= 1.0


def _linear(matrix: Array) -> Ode:
    x = ca.SX.sym("x", len(matrix))
    return system_from_casadi(x, ca.DM(matrix) @ x, tuple("abcdefg"[: len(matrix)]))


def _of_linear(matrix: Array, method: DerivationMethod, horizon_s: float) -> BlockwiseGrowth:
    system = _linear(matrix)
    region = Box.around(dict.fromkeys(system.names, 0.0), radius=dict.fromkeys(system.names, 1.0))
    bound = derive_discrepancy(system, region=region, horizon_s=horizon_s, method=method)
    assert isinstance(bound.growth, BlockwiseGrowth)
    return bound.growth


def test_the_euclidean_rate_of_a_linear_system_is_its_matrix_measure() -> None:
    matrix = np.array([[-1.0, 4.0, 0.5], [-0.5, -2.0, 1.0], [0.25, 0.0, 0.75]])
    weights = np.array([1.0, 2.0, 0.5])
    method = EuclideanNorm(dict(zip("abc", weights.tolist(), strict=True)), 1, _SHARED)
    moved = matrix * weights[:, None] / weights[None, :]
    expected = np.linalg.eigvalsh(0.5 * (moved + moved.T))[-1]
    growth = _of_linear(matrix, method, 1.0)
    assert growth.comparison[0][0] == pytest.approx(expected, abs=1e-11)
    assert growth.comparison[0][0] >= expected - 1e-14


@pytest.mark.parametrize("form", list(Form))
def test_an_oscillator_decays_at_its_real_part_and_translations_do_not_grow(form: Form) -> None:
    # Position c is moved by the oscillator and moves nothing: it stays out of the metric.
    matrix = np.array([[0.0, 1.0, 0.0], [-4.0, -0.4, 0.0], [1.0, 0.0, 0.0]])
    for method in (
        OptimalMetric(Effort(form, 1e4, 1), _SHARED),
        BlockGrowth((("a", "b"), ("c",)), Effort(form, 1e4, 1), _SHARED),
    ):
        growth = _of_linear(matrix, method, 100.0)
        assert growth.blocks == ((0, 1), (2,))
        assert -0.2 <= growth.comparison[0][0] < -0.199
        assert growth.comparison[1][1] == 0.0
        assert growth.comparison[0][1] == 0.0
        # |c| grows by at most the integral of a decaying norm.
        assert growth.half_widths((1.0, 0.0, 0.0), 100.0)[2] < 5.0 * 2.0


def test_blocks_by_feedback_are_found_and_cascades_are_exact() -> None:
    growth = _of_linear(
        np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]),
        BlockGrowth(None, Effort(Form.VERTICES, 1e4, 1), _SHARED),
        2.0,
    )
    assert growth.blocks == ((0,), (1,), (2,))
    t = 1.5
    expected = (1.0 + 2.0 * t + 3.0 * t * t / 2.0, 2.0 + 3.0 * t, 3.0)
    assert growth.half_widths((1.0, 2.0, 3.0), t) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Effort(Form.VERTICES, 0.5, 1), "condition_max"),
        (lambda: Effort(Form.VERTICES, math.nan, 1), "condition_max"),
        (lambda: Effort(Form.VERTICES, 10.0, 0), "at least 1 cell"),
        (lambda: EuclideanNorm({"a": 0.0}, 1, _SHARED), "weights > 0"),
        (lambda: EuclideanNorm(None, 0, _SHARED), "at least 1 cell"),
    ],
)
def test_unusable_methods_are_named(make: object, message: str) -> None:
    assert callable(make)
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("blocks", [(("a",),), (("a",), ("a", "b")), (("a", "b"), ())])
def test_blocks_that_are_no_partition_are_refused(blocks: tuple[tuple[str, ...], ...]) -> None:
    with pytest.raises(InputError, match="exactly one"):
        _of_linear(np.eye(2), BlockGrowth(blocks, Effort(Form.VERTICES, 10.0, 1), _SHARED), 1.0)
