"""A local bound that forgets one of its terms is caught: a run escapes from its tube."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from local_cases import switching_runs
from scipy.linalg import eigh
from tube_cases import Array, box, dense_times, disturbed, escapes, march, starts, system_of

from workbench.models import Ode, Ranged
from workbench.reach import ReachTube
from workbench.reach.local import (
    LocalEuclidean,
    LocalGrowth,
    LocalLagrangian,
    Reference,
    along,
    growth,
    lagrangian,
    mean_jacobian,
    quadratic,
    transition,
)
from workbench.reach.local.quadratic import LocalEffort, QuadraticBound
from workbench.sensitivity.blockwise import rows
from workbench.sets import Box

SQUARE = system_of(lambda x: [x * x], "x")
SQUARE_SET = box(x=(0.2, 0.8))
DECAY = system_of(lambda x: [-x], "x")
ROTATION = system_of(lambda x, y: [-2.0 * y, 2.0 * x], "x", "y")
ROTATION_SET = box(x=(0.5, 1.5), y=(-0.5, 0.5))
PUSHED = disturbed(
    lambda x, p, w: [-x[0] + w[0]], ("x",), disturbances=(Ranged.symmetric("w", "1", 0.5),)
)


def count_escapes(system: Ode, initial: Box, tube: ReachTube) -> int:
    times = dense_times(tube, 50)
    return escapes(tube, times, march(system, starts(initial, 5), times))


def metric_tube() -> ReachTube:
    """A rotation in the metrics I and, offered at step 4, 100 I."""
    reference = Reference.of(ROTATION, initial_set=ROTATION_SET, horizon_s=1.0, step_s=0.1)
    plan = {0: (rows(np.eye(2)),), 4: (rows(100.0 * np.eye(2)),)}
    bound = QuadraticBound(
        ((0, 1),), plan, LocalEffort(8, 1e4, 2), np.ones(2), reference.tube.times
    )
    return along.run_along(reference, bound).tube


def test_the_factor_of_a_change_of_metric(monkeypatch: pytest.MonkeyPatch) -> None:
    assert count_escapes(ROTATION, ROTATION_SET, metric_tube()) == 0
    monkeypatch.setattr(quadratic, "change_factor", lambda _old, _new: 1.0)
    assert count_escapes(ROTATION, ROTATION_SET, metric_tube()) > 0


def test_a_taken_change_of_metric_keeps_the_set() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        roots = rng.normal(size=(2, 3, 3))
        old, new = (rows((r @ r.T + 0.1 * np.eye(3)).round(6)) for r in roots)
        state = quadratic.Ellipsoids(np.array([1.5]), (old,))
        moved = quadratic.changed(state, (new,))
        points = rng.normal(size=(500, 3))
        points *= 1.5 / np.sqrt(np.einsum("ki,ij,kj->k", points, np.array(old), points))[:, None]
        sizes = np.sqrt(np.einsum("ki,ij,kj->k", points, np.array(new), points))
        assert np.all(sizes <= moved.norms[0] * (1 + 1e-12))
        exact = np.sqrt(eigh(np.array(new), np.array(old), eigvals_only=True)[-1])
        assert 1.5 * exact * (1 - 1e-9) <= moved.norms[0] <= 1.5 * exact * (1 + 1e-6)


def widened(reference: Reference) -> Reference:
    """The reference with a looser, one-sided enclosure: as true as the first."""
    tube = reference.tube
    looser = dataclasses.replace(tube, upper=tube.upper + 0.3, upper_at=tube.upper_at + 0.3)
    return dataclasses.replace(reference, tube=looser)


def test_the_width_of_the_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    initial = box(x=(1.0, 1.1))
    reference = widened(Reference.of(DECAY, initial_set=initial, horizon_s=0.5, step_s=0.1))
    assert count_escapes(DECAY, initial, LocalGrowth(0.1).along(reference).tube) == 0

    def about_the_middle(lower: Array, upper: Array, half_widths: Array) -> tuple[Array, Array]:
        middle = 0.5 * (lower + upper)
        return middle - half_widths, middle + half_widths

    monkeypatch.setattr(along, "_around", about_the_middle)
    assert count_escapes(DECAY, initial, LocalGrowth(0.1).along(reference).tube) > 0


@pytest.mark.parametrize(
    "method", [LocalGrowth(0.1), LocalLagrangian(0.1), LocalEuclidean({"x": 1.0}, 0.1)]
)
def test_what_other_inputs_add(method: LocalGrowth, monkeypatch: pytest.MonkeyPatch) -> None:
    initial = box(x=(0.9, 1.1))

    def found() -> int:
        tube = method.tube(PUSHED, initial_set=initial, horizon_s=1.0)
        return escapes(tube, *switching_runs(PUSHED, initial, tube, count=50))

    assert found() == 0
    monkeypatch.setattr(along, "_felt", lambda lower, _upper, _radius: np.zeros(len(lower)))
    assert found() > 0


@pytest.mark.parametrize(
    "method", [LocalGrowth(0.1), LocalLagrangian(0.1), LocalEuclidean({"x": 1.0}, 0.1)]
)
def test_the_jacobian_away_from_the_reference(
    method: LocalGrowth, monkeypatch: pytest.MonkeyPatch
) -> None:
    def tube() -> ReachTube:
        return method.tube(SQUARE, initial_set=SQUARE_SET, horizon_s=0.8)

    assert count_escapes(SQUARE, SQUARE_SET, tube()) == 0
    true = mean_jacobian.mean_jacobian
    monkeypatch.setattr(
        along,
        "mean_jacobian",
        lambda jacobian, *, near, box: true(jacobian, near=near, box=near),
    )
    assert count_escapes(SQUARE, SQUARE_SET, tube()) > 0


def test_the_set_between_two_instants(monkeypatch: pytest.MonkeyPatch) -> None:
    initial = box(x=(-1.0, 1.0))

    def tube() -> ReachTube:
        return LocalGrowth(0.25).tube(DECAY, initial_set=initial, horizon_s=1.0)

    assert count_escapes(DECAY, initial, tube()) == 0
    true = growth.grown

    def ends_only(*arguments: object) -> tuple[Array, Array]:
        end, _ = true(*arguments)  # type: ignore[arg-type]
        return end, end

    monkeypatch.setattr(growth, "grown", ends_only)
    assert count_escapes(DECAY, initial, tube()) > 0


def test_the_series_of_a_transition(monkeypatch: pytest.MonkeyPatch) -> None:
    def tube() -> ReachTube:
        return LocalLagrangian(0.2).tube(ROTATION, initial_set=ROTATION_SET, horizon_s=1.0)

    assert count_escapes(ROTATION, ROTATION_SET, tube()) == 0
    monkeypatch.setattr(transition, "_ORDER", 2)
    assert count_escapes(ROTATION, ROTATION_SET, tube()) == 0
    monkeypatch.setattr(transition, "_tail", lambda _size, _length_s: 0.0)
    assert count_escapes(ROTATION, ROTATION_SET, tube()) > 0


def test_the_deformation_that_is_not_in_the_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    def tube() -> ReachTube:
        return LocalLagrangian(0.1).tube(SQUARE, initial_set=SQUARE_SET, horizon_s=0.8)

    assert count_escapes(SQUARE, SQUARE_SET, tube()) == 0
    monkeypatch.setattr(lagrangian.Deformation, "in_frame", lambda self: 0.0 * self.forced)
    assert count_escapes(SQUARE, SQUARE_SET, tube()) > 0
