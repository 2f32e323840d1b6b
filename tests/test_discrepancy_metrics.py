"""Growth in a quadratic norm is proved: exact fractions confirm it, and too small a rate fails."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from exact_matrices import exact, product, semidefinite
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.sensitivity.blockwise import BlockwiseGrowth, _extents, box_norm, rows
from workbench.sensitivity.metric_bounds import (
    Form,
    coupling_bounds,
    diagonal_rates,
    metric_rates,
)
from workbench.sensitivity.metric_program import MetricProgram
from workbench.sensitivity.metric_proposal import Aim, propose_metric
from workbench.sensitivity.vectorised import Array

_SEEDS = st.integers(0, 10**6)


def _decays(metric: Array, matrix: Array, rate: float) -> bool:
    """2 r P - A^T P - P A >= 0, in fractions."""
    P, A = exact(metric), exact(matrix)
    PA = product(P, A)
    size = len(P)
    return semidefinite(
        [
            [2 * Fraction(rate) * P[i][j] - PA[i][j] - PA[j][i] for j in range(size)]
            for i in range(size)
        ]
    )


def _random_metric(rng: np.random.Generator, size: int) -> Array:
    root = rng.normal(size=(size, size)) + 0.5 * np.eye(size)
    metric = root @ root.T + 0.05 * np.eye(size)
    return np.asarray(0.5 * (metric + metric.T))


def _random_hull(rng: np.random.Generator, size: int, uncertain: int) -> tuple[Array, Array]:
    lower = rng.normal(size=(size, size))
    width = np.zeros(size * size)
    width[rng.permutation(size * size)[:uncertain]] = rng.uniform(0.01, 1.0, uncertain)
    return lower, lower + width.reshape(size, size)


def _ends(lower: Array, upper: Array) -> list[Array]:
    free = np.argwhere(upper > lower)
    found = []
    for choice in itertools.product((False, True), repeat=len(free)):
        matrix = lower.copy()
        for (i, j), high in zip(free, choice, strict=True):
            matrix[i, j] = upper[i, j] if high else lower[i, j]
        found.append(matrix)
    return found


@given(_SEEDS, st.integers(2, 4), st.integers(0, 4))
@settings(max_examples=25, deadline=None)
def test_proved_rates_hold_at_every_vertex_in_fractions(
    seed: int, size: int, uncertain: int
) -> None:
    rng = np.random.default_rng(seed)
    metric = _random_metric(rng, size)
    lower, upper = _random_hull(rng, size, uncertain)
    tight, wide = (
        float(metric_rates(lower[None], upper[None], metric=metric, form=form)[0]) for form in Form
    )
    assert all(_decays(metric, matrix, tight) for matrix in _ends(lower, upper))
    assert tight <= wide + 1e-9
    # A rate that is a little smaller already fails in fractions: the proof gives nothing away.
    smaller = tight - 1e-9 * (1.0 + abs(tight))
    assert not all(_decays(metric, matrix, smaller) for matrix in _ends(lower, upper))


@given(_SEEDS, st.integers(1, 3), st.integers(1, 3))
@settings(max_examples=25, deadline=None)
def test_couplings_bound_the_gain_and_are_attained(seed: int, targets: int, sources: int) -> None:
    rng = np.random.default_rng(seed)
    row, column = _random_metric(rng, targets), _random_metric(rng, sources)
    lower = rng.normal(size=(targets, sources))
    upper = lower + rng.uniform(0.0, 1.0, lower.shape) * (rng.random(lower.shape) < 0.5)
    tight, wide = (
        float(coupling_bounds(lower[None], upper[None], row=row, column=column, form=form)[0])
        for form in Form
    )
    root, base = np.linalg.cholesky(row).T, np.linalg.inv(np.linalg.cholesky(column).T)
    gains = [np.linalg.norm(root @ matrix @ base, 2) for matrix in _ends(lower, upper)]
    assert max(gains) <= tight * (1.0 + 1e-12)
    assert tight <= max(gains) * (1.0 + 1e-6) + 1e-8
    assert tight <= wide * (1.0 + 1e-9)


@given(_SEEDS, st.integers(2, 3))
@settings(max_examples=15, deadline=None)
def test_sign_vertices_give_the_exact_rate_of_a_diagonal_metric(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    lower, upper = _random_hull(rng, size, 6 if size == 3 else 4)
    squared = rng.uniform(0.1, 10.0, size)
    rate = float(diagonal_rates(lower[None], upper[None], squared_weights=squared)[0])
    metric = np.diag(squared)
    by_vertices = float(
        metric_rates(lower[None], upper[None], metric=metric, form=Form.VERTICES)[0]
    )
    assert all(_decays(metric, matrix, rate) for matrix in _ends(lower, upper))
    assert rate == pytest.approx(by_vertices, abs=1e-9)


def test_many_states_take_row_sums_and_stay_sound() -> None:
    rng = np.random.default_rng(3)
    lower = rng.normal(size=(14, 14))
    upper = lower + 0.1
    rate = float(diagonal_rates(lower[None], upper[None], squared_weights=np.ones(14))[0])
    for _ in range(50):
        matrix = np.where(rng.random((14, 14)) < 0.5, lower, upper)
        assert np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[-1] <= rate


def test_a_metric_that_is_perturbed_loses_its_rate_and_one_that_is_none_proves_nothing() -> None:
    # x'' = -x - 0.2 x': the Lyapunov metric gives the real part -0.1; no metric gives less.
    matrix = np.array([[0.0, 1.0], [-1.0, -0.2]])
    metric = np.array([[1.0, 0.1], [0.1, 1.0]])

    def rate(P: Array) -> float:
        return float(metric_rates(matrix[None], matrix[None], metric=P, form=Form.VERTICES)[0])

    assert rate(metric) == pytest.approx(-0.1, abs=1e-9)
    perturbed = metric + np.array([[0.0, 1e-4], [1e-4, 0.0]])
    assert rate(perturbed) > -0.1 + 1e-6
    assert _decays(perturbed, matrix, rate(perturbed))
    assert not _decays(perturbed, matrix, -0.1)
    assert rate(np.array([[1.0, 2.0], [2.0, 1.0]])) == np.inf


def test_hulls_that_are_not_enclosed_prove_nothing() -> None:
    lower, upper = np.full((1, 2, 2), -np.inf), np.full((1, 2, 2), np.inf)
    for form in Form:
        assert metric_rates(lower, upper, metric=np.eye(2), form=form)[0] == np.inf
        both = coupling_bounds(lower, upper, row=np.eye(2), column=np.eye(2), form=form)
        assert both[0] == np.inf
    assert diagonal_rates(lower, upper, squared_weights=np.ones(2))[0] == np.inf


def test_too_many_extreme_matrices_are_refused() -> None:
    lower = np.zeros((1, 4, 4))
    with pytest.raises(InputError, match="CENTRE_RADIUS"):
        metric_rates(lower, lower + 1.0, metric=np.eye(4), form=Form.VERTICES)


@given(_SEEDS, st.integers(1, 4))
@settings(max_examples=25, deadline=None)
def test_boxes_around_ellipsoids_and_ellipsoids_around_boxes_are_exact(
    seed: int, size: int
) -> None:
    rng = np.random.default_rng(seed)
    metric = _random_metric(rng, size)
    radius = rng.uniform(0.0, 2.0, size)
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=size))) * radius
    largest = max(
        (sum(a * b * c for a, row in zip(v, exact(metric), strict=True)
             for b, c in zip(row, v, strict=True)))
        for v in (list(map(Fraction, corner)) for corner in corners.tolist())
    )  # fmt: skip
    bound = box_norm(rows(metric), tuple(radius.tolist()))
    assert Fraction(bound) ** 2 >= largest
    assert bound == pytest.approx(float(largest) ** 0.5, rel=1e-12, abs=1e-150)
    expected = np.sqrt(np.diag(np.linalg.inv(metric)))
    np.testing.assert_allclose(_extents(rows(metric)), expected, rtol=1e-9)


def test_what_is_no_norm_bounds_nothing() -> None:
    growth = BlockwiseGrowth(((0, 1),), (((1.0, 2.0), (2.0, 1.0)),), ((0.0,),), (0.0, 0.0))
    assert growth.half_widths((1.0, 1.0), 1.0) == (np.inf, np.inf)


@pytest.mark.parametrize("form", list(Form))
def test_the_program_finds_the_real_part_of_an_oscillator(form: Form) -> None:
    # Undamped in unit weights over a long time: only the right metric decays.
    matrix = np.array([[0.0, 1.0], [-4.0, -0.4]])
    aim = Aim(horizon_s=100.0, condition_max=1e4, diagonal=False, form=form)
    metric = propose_metric(matrix[None], matrix[None], scale=np.array([1.0, 2.0]), aim=aim)
    rate = metric_rates(matrix[None], matrix[None], metric=metric, form=form)[0]
    assert -0.2 <= rate < -0.199
    assert np.array_equal(metric, metric.T)


def test_units_change_the_metric_and_not_the_rate() -> None:
    matrix = np.array([[-1.0, 3.0], [-2.0, -0.5]])
    aim = Aim(horizon_s=5.0, condition_max=1e4, diagonal=False, form=Form.VERTICES)
    rates = []
    for unit in (1.0, 1e-6, 1e6):
        scale = np.array([1.0, unit])
        scaled = matrix * scale[:, None] / scale[None, :]
        metric = propose_metric(scaled[None], scaled[None], scale=scale, aim=aim)
        rates.append(metric_rates(scaled[None], scaled[None], metric=metric, form=Form.VERTICES)[0])
    assert rates == pytest.approx([rates[0]] * 3, abs=1e-4)


@pytest.mark.parametrize("form", list(Form))
def test_eigenvalues_that_lie_raise_the_rate_and_break_no_proof(
    form: Form, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(5)
    metric = _random_metric(rng, 3)
    lower, upper = _random_hull(rng, 3, 3)
    honest = float(metric_rates(lower[None], upper[None], metric=metric, form=form)[0])
    true = np.linalg.eigvalsh
    monkeypatch.setattr(np.linalg, "eigvalsh", lambda a: true(a) - 0.5 * abs(true(a)).max() - 1.0)
    lied = float(metric_rates(lower[None], upper[None], metric=metric, form=form)[0])
    assert honest - 1e-9 <= lied < np.inf
    assert all(_decays(metric, matrix, lied) for matrix in _ends(lower, upper))


def test_a_solver_that_lies_costs_tightness_and_not_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    matrix = np.array([[0.0, 1.0], [-4.0, -0.4]])
    wrong = np.array([[1.0, 0.99], [0.99, 1.0]])
    monkeypatch.setattr(MetricProgram, "solve", lambda self, rate: wrong)
    aim = Aim(horizon_s=1.0, condition_max=1e4, diagonal=False, form=Form.VERTICES)
    metric = propose_metric(matrix[None], matrix[None], scale=np.ones(2), aim=aim)
    for each in (metric, wrong):
        rate = metric_rates(matrix[None], matrix[None], metric=each, form=Form.VERTICES)[0]
        assert _decays(each, matrix, float(rate))
