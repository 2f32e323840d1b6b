"""The parts of the local bounds hold against closed forms and a second method each."""

from __future__ import annotations

from decimal import Decimal

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from tube_cases import Array, box, disturbed, system_of

from workbench.models import Ranged
from workbench.reach.local import Reference
from workbench.reach.local.growth import grown
from workbench.reach.local.mean_jacobian import mean_jacobian
from workbench.reach.local.transition import inverse_product, transition
from workbench.sensitivity.blockwise import rows
from workbench.sensitivity.growth_matrix import MetzlerGrowth
from workbench.sensitivity.interval_arrays import point
from workbench.sensitivity.jacobian import IntervalJacobian

SEEDS = st.integers(0, 2**32 - 1)


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_a_transition_holds_the_flows_of_all_matrices_that_vary_within(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centre = rng.normal(size=(4, 4)) * (rng.random((4, 4)) < 0.6)
    spread = 0.2 * rng.random((4, 4)) * (centre != 0.0)
    low, high = transition(centre - spread, centre + spread, 0.3)
    for _ in range(20):
        flow = np.eye(4)
        for _ in range(5):
            flow = expm((centre + spread * rng.choice([-1.0, 1.0], (4, 4))) * 0.06) @ flow
        assert np.all((low <= flow + 1e-13) & (flow <= high + 1e-13))
    exact = expm(centre * 0.3)
    tight = transition(centre, centre, 0.3)
    assert np.all((tight[0] <= exact + 1e-14) & (exact <= tight[1] + 1e-14))
    # What the series leaves out grows with the seventh power of the matrix.
    size = 0.3 * np.abs(centre).sum(axis=1).max()
    assert np.all(tight[1] - tight[0] < 4e-7 * size**7 + 1e-12)


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_the_inverse_of_a_frame_is_enclosed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    frame, factor = rng.normal(size=(2, 4, 4))
    product, slack = inverse_product(frame, point(frame @ factor))
    # frame @ factor is rounded by at most a few units of |frame| |factor|.
    rounding = 1e-14 * np.abs(np.linalg.inv(frame)) @ np.abs(frame) @ np.abs(factor)
    assert np.all(product[0] - slack - rounding <= factor)
    assert np.all(factor <= product[1] + slack + rounding)
    assert not np.isfinite(inverse_product(np.ones((3, 3)), point(np.eye(3)))[1]).any()


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.floats(0.01, 3.0))
def test_comparison_systems_grow_as_in_the_other_implementation(seed: int, length_s: float) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.random((3, 3)) * (rng.random((3, 3)) < 0.7)
    np.fill_diagonal(matrix, 2.0 * rng.normal(size=3))
    start, felt = rng.random((2, 3))
    end, throughout = grown(matrix, start, felt, length_s)
    other = MetzlerGrowth(rows(matrix), tuple(felt.tolist()))
    for t in np.linspace(0.0, length_s, 5):
        reached = np.array(other.half_widths(tuple(start.tolist()), float(t)))
        assert np.all(reached <= throughout * (1 + 1e-9))
    assert np.allclose(end, reached, rtol=1e-9)
    whole = np.zeros((4, 4))
    whole[:3, :3], whole[:3, 3] = matrix, felt
    assert np.all(end >= (expm(whole * length_s) @ np.append(start, 1.0))[:3] * (1 - 1e-12))


@pytest.mark.parametrize("start", [5e-324, 1e-320, 1e-309])
def test_the_growth_of_subnormal_distances_is_rounded_up(start: float) -> None:
    for rate in np.linspace(50.0, 99.0, 50):
        end, _ = grown(np.array([[rate]]), np.array([start]), np.zeros(1), 1.0)
        assert Decimal(float(end[0])) >= Decimal(float(rate)).exp() * Decimal(start)


def mean_of(
    field: object, near: tuple[float, float], wide: tuple[float, float]
) -> tuple[Array, Array]:
    jacobian = IntervalJacobian(system_of(field, "x"))  # type: ignore[arg-type]
    ends = [(np.array([[low]]), np.array([[high]])) for low, high in (near, wide)]
    found = mean_jacobian(jacobian, near=ends[0], box=ends[1])
    assert found is not None
    return found


def test_the_mean_jacobian_of_a_square_is_a_sum_and_half_as_wide() -> None:
    low, high = mean_of(lambda x: [x * x], (0.9, 1.1), (0.0, 2.0))
    assert low[0, 0] <= 0.9
    assert high[0, 0] >= 3.1
    assert high[0, 0] - low[0, 0] < 0.65 * 4.0


def test_the_mean_jacobian_of_a_clip_holds_every_chord() -> None:
    low, high = mean_of(lambda x: [ca.fmin(x, 1.0)], (0.5, 0.5), (-1.0, 3.0))
    chord = (1.0 - 0.5) / (3.0 - 0.5)
    assert 0.0 < low[0, 0] <= chord
    assert high[0, 0] >= 1.0


def test_a_pole_has_no_mean_jacobian() -> None:
    jacobian = IntervalJacobian(system_of(lambda x: [1.0 / x], "x"))
    near, wide = ((np.array([[a]]), np.array([[b]])) for a, b in ((1.0, 1.0), (-1.0, 2.0)))
    assert mean_jacobian(jacobian, near=near, box=wide) is None


def test_the_reference_is_the_run_from_the_middle_with_inputs_in_the_middle() -> None:
    system = disturbed(
        lambda x, p, w: [p[0] + w[0] + 0.0 * x[0]],
        ("x",),
        parameters=(Ranged("p", "1", 0.0, 0.0, 2.0),),
        disturbances=(Ranged("w", "1", 0.0, -1.0, 3.0),),
    )
    reference = Reference.of(system, initial_set=box(x=(0.0, 1.0)), horizon_s=1.0, step_s=0.1)
    assert np.allclose(reference.tube.lower_at[-1], [2.5, 1.0, 1.0])
    assert reference.radius.tolist() == [
        np.nextafter(0.5, 1.0),
        np.nextafter(1.0, 2.0),
        np.nextafter(2.0, 3.0),
    ]
