"""A proof under jitter bounds every schedule, a search only refutes, and forged proofs fail."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.controllers.sampling import IntegralStep, Jitter, Sampling
from workbench.errors import InputError
from workbench.models.gains import jitter
from workbench.models.gains.held import HeldLoop, Timing, floats, schur_stable
from workbench.models.gains.jitter import (
    Answer,
    Judged,
    jitter_study,
    judge,
    positive_definite,
    prove_contraction,
)
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.schedules import acting_times, drawn_schedules, worst_pattern
from workbench.models.gains.spectral import matrices, steady_sampling
from workbench.models.gains.study import default_sampling
from workbench.models.vehicle import gem_e2

LOOP = LateralLoop.of(gem_e2())
CLOCK = default_sampling()
DRIFT = dataclasses.replace(CLOCK, jitter=Jitter.DRIFT, measurement_delay_s=(0.0, 0.004))
LATE = Sampling(
    0.1, 0.02, Jitter.DRIFT, (0.0, 0.0), (0.0, 0.05), IntegralStep.MEASURED
)  # fmt: skip
PROVED = {
    name: (sampling, prove_contraction(LOOP, sampling, most_corners=300))
    for name, sampling in (("clock", CLOCK), ("drift", DRIFT), ("late", LATE))
}


@pytest.mark.parametrize("name", PROVED)
def test_the_vehicles_timing_is_proved(name: str) -> None:
    _, proof = PROVED[name]
    assert proof is not None
    assert 0.9 < proof.rate < 1.0
    assert proof.metric.shape == (len(proof.names),) * 2


@pytest.mark.parametrize("name", PROVED)
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_every_sample_of_every_schedule_contracts_as_proved(name: str, seed: int) -> None:
    sampling, proof = PROVED[name]
    assert proof is not None
    rng = np.random.default_rng(seed)
    gaps, latencies, steps = drawn_schedules(sampling, 6, 8, rng)
    acting = acting_times(gaps, latencies, Timing.of(sampling).commands)
    values = {key: np.broadcast_to(float(v), gaps.shape) for key, v in LOOP.exact().items()}
    F = matrices(values, steps, gaps, acting)
    P = proof.metric
    z = rng.normal(size=(6, 8, len(P)))
    after = np.einsum("nkij,nkj->nki", F, z)
    grown = np.einsum("nki,ij,nkj->nk", after, P, after)
    before = np.einsum("nki,ij,nkj->nk", z, P, z)
    assert np.all(grown <= proof.rate**2 * before * (1 + 1e-9))


@pytest.mark.parametrize("name", PROVED)
def test_no_schedule_found_is_slower_than_proved(name: str) -> None:
    sampling, proof = PROVED[name]
    assert proof is not None
    worst = worst_pattern(LOOP, sampling, patterns=100, seed=3)
    assert worst.growth <= proof.rate
    low, high = Timing.of(sampling).gap
    assert all(float(low) - 1e-12 <= gap <= float(high) + 1e-12 for gap in worst.gaps_s)


def test_without_jitter_the_search_finds_the_spectral_radius() -> None:
    still = dataclasses.replace(CLOCK, jitter_s=0.0)
    timing = Timing.of(still)
    F = floats(HeldLoop.of(LOOP, timing).steady(timing))
    expected = float(np.abs(np.linalg.eigvals(F)).max())
    assert worst_pattern(LOOP, still, patterns=2, seed=1).growth == pytest.approx(expected)


@pytest.mark.parametrize("name", PROVED)
def test_a_forged_metric_fails_the_exact_check(name: str) -> None:
    sampling, proof = PROVED[name]
    assert proof is not None
    timing = Timing.of(sampling)
    corners = list(HeldLoop.of(LOOP, timing).corners(timing))
    assert jitter._checked(proof.metric, corners, proof.rate)
    assert not jitter._checked(-proof.metric, corners, proof.rate)
    assert not jitter._checked(np.eye(len(proof.metric)), corners, proof.rate)
    assert not jitter._checked(proof.metric, corners, proof.rate * 0.99)
    turned = HeldLoop.of(LOOP.at({"kd": -LOOP.derivative}), timing)
    assert not jitter._checked(proof.metric, list(turned.corners(timing)), proof.rate)


def test_unstable_loops_are_refuted_and_never_proved() -> None:
    for name, value in (("look-ahead", 0.0), ("kd", -1.0), ("kp", -0.5)):
        found = judge(LOOP.at({name: value}), CLOCK, patterns=20, seed=1)
        assert found.proof is None
        assert found.answer is Answer.REFUTED
    slow = Sampling(0.4, 0.0, Jitter.CLOCK, (0.0, 0.0), (0.0, 0.3), IntegralStep.NOMINAL)
    late = judge(LOOP, slow, patterns=200, seed=1)
    assert late.answer is Answer.REFUTED


def test_neither_proof_nor_refutation_is_called_open() -> None:
    _, proof = PROVED["clock"]
    worst = worst_pattern(LOOP, CLOCK, patterns=2, seed=1)
    assert Judged(CLOCK, None, worst).answer is Answer.OPEN
    assert Judged(CLOCK, proof, worst).answer is Answer.PROVED
    assert prove_contraction(LOOP, CLOCK, most_corners=15) is None


def test_a_delay_that_varies_destabilises_where_no_fixed_delay_does() -> None:
    # Why eigenvalues are not enough: each fixed delay is stable, taken in turn they are not.
    period, high = 0.25, 0.065
    loop = LOOP.at({"speed": 5.0})
    for delay in np.linspace(0.0, high, 9):
        timing = Timing.of(steady_sampling(period, float(delay)))
        assert schur_stable(HeldLoop.of(loop, timing).steady(timing))
    sampling = Sampling(
        period, 0.0, Jitter.CLOCK, (0.0, 0.0), (0.0, high), IntegralStep.NOMINAL
    )  # fmt: skip
    found = judge(loop, sampling, patterns=400, seed=1)
    assert found.answer is Answer.REFUTED
    assert found.worst.growth > 1.01
    assert len(found.worst.gaps_s) > 1


def test_a_study_has_one_row_per_jitter() -> None:
    found = jitter_study(LOOP, CLOCK, (0.0, 0.002), patterns=5, seed=1)
    assert [row["jitter_s"] for row in found.rows()] == [0.0, 0.002]
    assert {row["answer"] for row in found.rows()} == {Answer.PROVED.value}
    with pytest.raises(InputError, match="jitter_s"):
        jitter_study(LOOP, CLOCK, (0.02,), patterns=5, seed=1)


MATRICES = st.integers(1, 4).flatmap(
    lambda n: st.lists(st.lists(st.integers(-4, 4), min_size=n, max_size=n), min_size=n, max_size=n)
)


@settings(max_examples=150, deadline=None)
@given(MATRICES, st.integers(-3, 8))
def test_positive_definite_agrees_with_eigenvalues(rows: list[list[int]], shift: int) -> None:
    half = np.array(rows)
    matrix = half + half.T + shift * np.eye(len(half), dtype=int)
    least = np.linalg.eigvalsh(matrix)[0]
    if abs(least) > 1e-9:
        assert positive_definite(matrix.tolist()) == (least > 0.0)
