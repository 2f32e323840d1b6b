"""Local tubes give the known bounds of systems that can be solved, and lose nothing else."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from local_cases import local_methods
from scipy.linalg import expm
from tube_cases import box, disturbed, system_of

from workbench.errors import InputError
from workbench.models import Ranged
from workbench.reach import TubeStatus
from workbench.reach.local import (
    LocalBlocks,
    LocalEffort,
    LocalEuclidean,
    LocalGrowth,
    LocalLagrangian,
    LocalMetric,
    LocalNorm,
)
from workbench.sensitivity import EuclideanNorm, Inputs, Norm

STEP_S, HORIZON_S = 0.05, 1.0
LOSS = 1e-9


def test_disturbance_and_parameter_enter_as_the_closed_form_says() -> None:
    """x' = -2 x + p + w: r e^(-2t) + (1 - e^(-2t)) / 2 (|p| + |w|), in every method."""
    system = disturbed(
        lambda x, p, w: [-2.0 * x[0] + p[0] + w[0]],
        ("x",),
        parameters=(Ranged("p", "1", 0.0, -0.25, 0.25),),
        disturbances=(Ranged("w", "1", 0.0, 0.0, 0.5),),
    )
    for name, method in local_methods(STEP_S).items():
        tube = method.tube(system, initial_set=box(x=(0.75, 1.25)), horizon_s=HORIZON_S)
        decay = np.exp(-2.0 * tube.times)
        exact = 0.25 * decay + 0.5 * (1.0 - decay) * 0.5
        found = tube.half_width_at()[:, 0]
        assert tube.complete, name
        assert np.all(found >= exact * (1 - 1e-12)), name
        assert np.all(found <= exact * (1 + 1e-6) + 1e-12), name
        centre = decay + 0.25 * (1.0 - decay) / 2.0
        assert np.allclose(0.5 * (tube.lower_at + tube.upper_at)[:, 0], centre, atol=1e-9)


def test_a_cascade_grows_exactly_in_the_componentwise_and_the_lagrangian_bound() -> None:
    matrix = np.array([[-1.0, 2.0, 0.0], [0.0, 0.5, 1.0], [0.0, 0.0, -0.25]])
    system = system_of(lambda *x: list(ca.vertsplit(ca.DM(matrix) @ ca.vertcat(*x))), *"xyz")
    initial = box(x=(0.5, 1.5), y=(-0.25, 0.25), z=(0.0, 0.125))
    for method in (LocalGrowth(STEP_S), LocalLagrangian(STEP_S)):
        tube = method.tube(system, initial_set=initial, horizon_s=HORIZON_S)
        exact = np.array([np.abs(expm(matrix * t)) @ initial.radius for t in tube.times])
        assert np.all(tube.half_width_at() >= exact * (1 - 1e-12))
        assert np.all(tube.half_width_at() <= exact * (1 + LOSS) + 1e-9)


def test_a_rotation_keeps_its_circle_in_the_euclidean_norm_and_its_box_in_the_lagrangian() -> None:
    matrix = np.array([[0.0, -2.0], [2.0, 0.0]])
    system = system_of(lambda x, y: [-2.0 * y, 2.0 * x], "x", "y")
    initial = box(x=(0.5, 1.5), y=(-0.5, 0.5))
    circle = LocalEuclidean({"x": 1.0, "y": 1.0}, STEP_S).tube(
        system, initial_set=initial, horizon_s=HORIZON_S
    )
    # Until then the a priori boxes are smaller than the circle.
    assert np.allclose(circle.half_width_at()[6:], np.sqrt(0.5), rtol=LOSS)
    turned = LocalLagrangian(STEP_S).tube(system, initial_set=initial, horizon_s=HORIZON_S)
    exact = np.array([np.abs(expm(matrix * t)) @ initial.radius for t in turned.times])
    assert np.allclose(turned.half_width_at(), exact, rtol=LOSS)


def test_the_measures_of_known_matrices() -> None:
    """x' = -3 x + y, y' = x - 2 y: mu_inf = -1 with weights 1; mu_1 = -1."""
    system = system_of(lambda x, y: [-3.0 * x + y, x - 2.0 * y], "x", "y")
    initial = box(x=(-0.5, 0.5), y=(-0.25, 0.25))
    for norm, start in ((Norm.MAX, 0.5), (Norm.SUM, 0.75)):
        method = LocalNorm(norm, {"x": 1.0, "y": 1.0}, STEP_S)
        tube = method.tube(system, initial_set=initial, horizon_s=HORIZON_S)
        assert np.allclose(tube.upper_at[-1], start * np.exp(-1.0), rtol=LOSS)


def test_the_metric_of_a_stable_focus_decays_at_the_rate_of_its_eigenvalues() -> None:
    """No diagonal weights show decay; an optimal metric comes close to e^(-0.5 t)."""
    system = system_of(lambda x, y: [-0.5 * x - 4.0 * y, x - 0.5 * y], "x", "y")
    initial = box(x=(-0.2, 0.2), y=(-0.1, 0.1))
    effort = LocalEffort(8, 1e4, 1)
    for method in (LocalMetric(effort, 0.1), LocalBlocks((("x", "y"),), effort, 0.1)):
        tube = method.tube(system, initial_set=initial, horizon_s=4.0)
        widths = tube.half_width_at()
        assert np.all(widths[-1] < 1.6 * np.exp(-2.0) * widths[1])


def test_a_change_of_metric_is_taken_when_it_is_worth_it() -> None:
    """A focus whose axes trade their lengths over 2 s needs another metric at its end."""
    system = system_of(
        lambda x, y, t: [
            -0.2 * x - (4.0 - 1.875 * t) * y, (0.25 + 1.875 * t) * x - 0.2 * y, 1.0 + 0.0 * t
        ],
        "x", "y", "clock",
    )  # fmt: skip
    initial = box(x=(0.9, 1.1), y=(-0.1, 0.1), clock=(0.0, 0.0))
    areas = []
    for proposals in (1, 4):
        method = LocalMetric(LocalEffort(8, 1e4, proposals), 0.1)
        tube = method.tube(system, initial_set=initial, horizon_s=2.0)
        areas.append(tube.half_width_at()[-1, :2].prod())
    assert areas[1] < 0.8 * areas[0]


@pytest.mark.parametrize(
    ("field", "horizon_s", "status"),
    [
        (lambda x: [x * x], 3.0, TubeStatus.ENCLOSURE_FAILED),
        (lambda x: [1.0 / x], 3.0, TubeStatus.COMPLETE),
    ],
)
def test_a_solution_that_ends_ends_the_tube(
    field: object, horizon_s: float, status: object
) -> None:
    system = system_of(field, "x")  # type: ignore[arg-type]
    for method in local_methods(0.05).values():
        tube = method.tube(system, initial_set=box(x=(0.4, 0.6)), horizon_s=horizon_s)
        assert tube.status is status
        assert tube.complete or ("between t = " in tube.message and tube.times[-1] < 2.5)


def test_wrong_use_is_refused() -> None:
    with pytest.raises(InputError, match="expected a positive step_s in s, got 0"):
        LocalGrowth(0.0)
    with pytest.raises(InputError, match="at least 1 proposal"):
        LocalEffort(8, 1e4, 0)
    with pytest.raises(InputError, match="vertices from 0 to 14, got 15"):
        LocalEffort(15, 1e4, 1)
    with pytest.raises(InputError, match="condition_max >= 1"):
        LocalEffort(8, 0.5, 1)
    system = system_of(lambda x: [-x], "x")
    with pytest.raises(InputError, match="blocks with every state"):
        LocalBlocks((("y",),), LocalEffort(8, 1e4, 1), 0.1).tube(
            system, initial_set=box(x=(0.0, 1.0)), horizon_s=1.0
        )


@pytest.mark.parametrize("weight", [-1.0, 0.0, float("nan"), float("inf")])
def test_weights_that_make_no_norm_are_refused(weight: float) -> None:
    for make in (lambda w: LocalNorm(Norm.MAX, w, STEP_S), lambda w: LocalEuclidean(w, STEP_S)):
        with pytest.raises(InputError, match="expected finite weights > 0"):
            make({"x": weight, "y": 1.0})


@pytest.mark.parametrize("weight", [1e-200, 1e200])
def test_weights_whose_squares_leave_the_doubles_are_refused(weight: float) -> None:
    system, weights = system_of(lambda x, y: [-x + y, -y], "x", "y"), {"x": weight, "y": 1.0}
    sides = box(x=(-1.0, 1.0), y=(-1.0, 1.0))
    with pytest.raises(InputError, match="expected weights between 1e-150 and 1e150"):
        LocalEuclidean(weights, STEP_S).tube(system, initial_set=sides, horizon_s=HORIZON_S)
    with pytest.raises(InputError, match="expected weights between 1e-150 and 1e150"):
        EuclideanNorm(weights, 1, Inputs.SHARED).derive(system, region=sides, horizon_s=HORIZON_S)


@pytest.mark.parametrize("method", ["max", "sum", "euclidean"])
def test_a_pole_in_the_likely_region_alone_costs_no_tube(method: str) -> None:
    """x' = 1 / x from [0.4, 2]: x^2 = x0^2 + 2 t; the region that is asked for weights holds 0."""
    system = system_of(lambda x: [1.0 / x], "x")
    tube = local_methods(0.01)[method].tube(system, initial_set=box(x=(0.4, 2.0)), horizon_s=0.1)
    assert tube.complete
    for start in (0.4, 2.0):
        exact = np.sqrt(start**2 + 2.0 * tube.times)
        assert np.all((tube.lower_at[:, 0] <= exact) & (exact <= tube.upper_at[:, 0]))
