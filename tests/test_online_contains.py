"""No trajectory leaves an online tube: closed forms, pressing runs, random loops, every step."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from online_cases import (
    CASES,
    Case,
    Online,
    compiled,
    derived,
    functions_of,
    pushes,
    seen,
    steps_of,
)
from tube_cases import Array, box, disturbed, system_of

from workbench.bench.campaign import check_loop
from workbench.bench.containment import bounds_at
from workbench.bench.random_loops import RandomLoop, random_loops
from workbench.claims import Rigor
from workbench.codegen.online_tube import OnlineTube
from workbench.errors import InputError
from workbench.models import Ranged, system_from_casadi
from workbench.models.benchmarks import all_benchmarks
from workbench.reach import ReachTube, TubeStatus
from workbench.reach.online.budget import Ranges
from workbench.reach.online.enclosed import enclosed_functions
from workbench.reach.online.functions import online_functions
from workbench.reach.online.model import OnlineModel
from workbench.sets import Box

FORMS = (False, True)


def kernel_of(case: Case) -> OnlineTube:
    functions = derived(case.system, case.initial_set, case.step_s, case.quadratic, case.region)
    return compiled(functions, steps=steps_of(case.horizon_s, case.step_s))


def tube_of(case: Case) -> ReachTube:
    kernel = kernel_of(case)
    return kernel.tube(case.initial_set, horizon_s=case.horizon_s, step_s=case.step_s)


@pytest.mark.parametrize("quadratic", FORMS)
@pytest.mark.parametrize("name", CASES)
def test_pressing_runs_stay_inside(name: str, quadratic: bool) -> None:
    case, runs = CASES[name], seen(name)
    kernel = compiled(
        functions_of(name, quadratic=quadratic), steps=steps_of(case.horizon_s, case.step_s)
    )
    tube = kernel.tube(case.initial_set, horizon_s=case.horizon_s, step_s=case.step_s)
    assert tube.status is TubeStatus.COMPLETE
    assert tube.rigor is Rigor.ENCLOSED
    lower, upper = bounds_at(tube, runs.times)
    allowance = 1e-13 * (1.0 + np.maximum(np.abs(runs.low), np.abs(runs.high)))
    assert np.all(runs.low >= lower - allowance)
    assert np.all(runs.high <= upper + allowance)


@pytest.mark.parametrize("quadratic", FORMS)
@pytest.mark.parametrize("step_s", [0.13, 0.0101])
@pytest.mark.parametrize("name", ["pendulum", "nested"])
def test_the_campaign_proves_no_escape_at_any_step(
    name: str, step_s: float, quadratic: bool
) -> None:
    case = CASES[name]
    loop = dataclasses.replace(case.loop, horizon_s=0.6)
    result = check_loop(loop, Online(step_s, quadratic), count=150, seed=3)
    assert result.complete
    assert result.escapes == result.undecided == 0


def triangular_top(times: Array, push: float) -> Array:
    """Largest x of x' = y^2 + w, y' = z, z' = 0 from x = 0, y <= 0.01, z <= 1, w <= push."""
    return np.asarray(((0.01 + times) ** 3 - 0.01**3) / 3 + push * times)


@pytest.mark.parametrize("step_s", [0.2, 0.1, 0.05, 0.02, 0.01])
def test_the_quadratic_form_reaches_its_own_extreme(step_s: float) -> None:
    """The quadratic form is exact here, so whatever it forgets shows."""
    case = dataclasses.replace(CASES["triangular"], step_s=step_s, quadratic=True)
    tube = tube_of(case)
    assert tube.status is TubeStatus.COMPLETE
    gap = tube.upper_at[:, 0] - triangular_top(tube.times, 0.01)
    assert np.all(gap >= -1e-15)
    assert gap[-1] < 2e-3 * step_s


@pytest.mark.parametrize("ratio", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("rate", [3.0, 6.0])
def test_bounds_of_earlier_steps_serve_sets_of_another_shape(ratio: float, rate: float) -> None:
    """What is linear in the initial state decays while what the push adds grows: y = y0 e^(-rate t)
    + (push / rate) (1 - e^(-rate t)) at the most, and x' = y^2 from 0."""
    push = rate * ratio * 0.3
    ode = disturbed(
        lambda x, _p, w: [x[1] * x[1], -rate * x[1] + w[0]], ("x", "y"),
        disturbances=pushes(push),
    )  # fmt: skip
    case = Case(ode, box(x=(0.0, 0.0), y=(-0.3, 0.3)), 2.0, 0.02, quadratic=True)
    tube = tube_of(case)
    assert tube.status is TubeStatus.COMPLETE
    t, held = tube.times, push / rate
    lost = 0.3 - held
    top = held**2 * t + 2 * held * lost * (1 - np.exp(-rate * t)) / rate
    top = top + lost**2 * (1 - np.exp(-2 * rate * t)) / (2 * rate)
    assert np.all(tube.upper_at[:, 0] >= top - 1e-14)


@settings(max_examples=12, deadline=None)
@given(
    st.integers(1, 120), st.floats(-1e3, 1e3), st.floats(-3.0, 3.0), st.sampled_from([0.1, 0.07])
)
def test_rounding_is_covered_exactly(count: int, x: float, y: float, step_s: float) -> None:
    """x' = y, y' = 0 from one point: the exact rational solution lies inside at every instant."""
    tube = DRIFT.tube(box(x=(x, x), y=(y, y)), horizon_s=count * step_s, step_s=step_s)
    assert tube.status is TubeStatus.COMPLETE
    for k in range(len(tube.times) - 1):
        exact = Fraction(x) + Fraction(y) * k * Fraction(step_s)
        assert Fraction(tube.lower_at[k, 0]) <= exact <= Fraction(tube.upper_at[k, 0])


DRIFT = kernel_of(
    Case(
        system_of(lambda _x, y: [y, 0 * y], "x", "y"), box(x=(0.0, 0.0), y=(0.0, 0.0)), 12.0, 0.1,
        region=2e3,
    )
)  # fmt: skip


@pytest.mark.parametrize("quadratic", FORMS)
def test_benchmark_loops_for_five_seconds(quadratic: bool) -> None:
    for benchmark in all_benchmarks():
        if benchmark.name not in (("B1",) if quadratic else ("B1", "B2")):
            continue
        loop = RandomLoop(benchmark.name, benchmark.system, benchmark.initial_set, 5.0)  # type: ignore[arg-type]
        result = check_loop(loop, Online(0.047, quadratic), count=200, seed=8)
        assert result.proved_until_s > 1.0
        assert result.escapes == result.undecided == 0


def test_random_loops_have_no_escape() -> None:
    until = 0.0
    for index, loop in enumerate(random_loops(3, seed=11)):
        if index not in (0, 2):
            continue
        step_s, quadratic = (0.1, 0.05, 0.037)[index % 3], index % 2 == 0
        result = check_loop(loop, Online(step_s, quadratic), count=120, seed=index)
        assert result.escapes == result.undecided == 0
        until += result.proved_until_s
    assert until > 1.0


def test_sets_without_width_and_of_huge_width() -> None:
    name = "pendulum"
    kernel = compiled(functions_of(name, quadratic=True), steps=30)
    point = kernel.tube(box(a=(0.7, 0.7), b=(0.0, 0.0)), horizon_s=1.0, step_s=0.1)
    assert point.status is TubeStatus.COMPLETE
    huge = kernel.tube(box(a=(-5.0, 5.0), b=(-5.0, 5.0)), horizon_s=1.0, step_s=0.1)
    assert huge.status is not TubeStatus.COMPLETE
    outside = kernel.tube(box(a=(6.5, 6.6), b=(0.0, 0.0)), horizon_s=1.0, step_s=0.1)
    assert outside.status is not TubeStatus.COMPLETE
    assert len(outside.lower) == 0


@pytest.mark.parametrize("name", ["fabs", "quotient"])
@pytest.mark.parametrize("quadratic", FORMS)
def test_one_input_or_none_is_no_special_case(name: str, quadratic: bool) -> None:
    assert functions_of(name, quadratic=quadratic).model.n_v == 1


def test_a_ranged_parameter_is_not_forgotten() -> None:
    """A tube that calls itself proved covers every parameter value or refuses."""
    ode = disturbed(
        lambda x, p, _w: [p[0] * x[0]], ("x",),
        parameters=(Ranged.symmetric("p", "1", 0.5),), disturbances=(),
    )  # fmt: skip
    start = Box.from_intervals({"x": (1.0, 1.0)})
    try:
        kernel = compiled(derived(ode, start, 0.1, False, 6.0), steps=10)
        tube = kernel.tube(start, horizon_s=1.0, step_s=0.1)
    except InputError:
        return
    assert tube.upper_at[-1, 0] >= np.exp(0.5)


@pytest.mark.parametrize("limited", [False, True])
def test_followed_axes_that_no_second_derivative_joins(limited: bool) -> None:
    """x' = -x, alone or limited: the quadratic form has columns and no pairs, in both kernels."""
    x = ca.SX.sym("x")
    ode = system_from_casadi(x, ca.fmax(ca.fmin(-x, 0.95), -0.95) if limited else -x, ("x",))
    start = Box.from_intervals({"x": (0.9, 1.1)})
    values = np.array(OnlineModel.of(ode).form.parameter_values())
    region = Box.from_intervals({"x": (-3.0, 3.0)})
    ranges = Ranges(region, (values, values), (np.zeros(0), np.zeros(0)), 0.1)
    for build in (online_functions, enclosed_functions):
        tube = compiled(build(ode, ranges, quadratic=("x",)), steps=10).tube(
            start, horizon_s=1.0, step_s=0.1
        )
        assert tube.status is TubeStatus.COMPLETE
        rate = 0.95 if limited else 1.1
        # The top: held by the limit until it is reached, then e-folding.
        top = 0.95 * np.exp(-(1.0 - 0.15 / 0.95)) if limited else rate * np.exp(-1.0)
        assert 0.0 <= tube.upper_at[-1, 0] - top < (0.05 if limited else 1e-6)


@pytest.mark.campaign
@pytest.mark.parametrize("quadratic", FORMS)
def test_a_million_trajectories(quadratic: bool) -> None:
    """N and W are active in many of these loops; both forms see half of the trajectories."""
    followed, loops = 0, 60
    for index, loop in enumerate(random_loops(loops, seed=23)):
        step_s = (0.1, 0.05, 0.025, 0.01)[index % 4]
        result = check_loop(loop, Online(step_s, quadratic), count=500_000 // 40, seed=index)
        assert result.escapes == result.undecided == 0, result
        followed += result.trajectories
    assert followed >= 500_000
