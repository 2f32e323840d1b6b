"""Claim: validated tubes contain solutions known in closed form, at instants and within rows."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tube_cases import Array, box, disturbed, system_of

from workbench.claims import Rigor
from workbench.models import Ranged, benchmarks
from workbench.reach import ReachTube, compute_tube
from workbench.reach.validated.tube import ValidatedTube
from workbench.sets import Box

cases = pytest.importorskip("validated_cases", reason="python-flint is not installed")
flint = pytest.importorskip("flint", reason="python-flint is not installed")

SMOOTH, PLANAR, KINKED = cases.SMOOTH, cases.PLANAR, cases.KINKED
ALL = {form.name: form for form in (*SMOOTH, *PLANAR, *KINKED)}


@pytest.mark.parametrize("name", ALL)
def test_boxes_are_contained(name: str) -> None:
    form = ALL[name]
    tube = form.tube()
    assert (tube.complete, tube.rigor) == (True, Rigor.ENCLOSED)
    assert cases.escapes(tube, form, cases.points(form.start, 4), per_row=2) == []


def point_escapes(name: str, *, step_s: float = 0.05, count: int = 1) -> list[str]:
    """What a tube from single states misses of their exact solution."""
    form = ALL[name]
    found: list[str] = []
    for state in cases.points(form.start, count)[-count:]:
        found += cases.escapes(form.at(state).tube(step_s=step_s), form, state[None, :], per_row=1)
    return found


@pytest.mark.parametrize("name", ALL)
def test_points_are_contained_to_the_last_bit(name: str) -> None:
    assert point_escapes(name) == []


@pytest.mark.parametrize("step_s", [0.3, 0.7, 50.0])
@pytest.mark.parametrize("name", ["decay", "square", "oscillator", "clip", "sine"])
def test_long_steps_are_contained(name: str, step_s: float) -> None:
    """The truncation and the remainder are large here, and the last interval is a short one."""
    form = ALL[name]
    tube = form.tube(step_s=step_s)
    assert tube.complete
    assert tube.times[-1] == form.horizon_s
    assert cases.escapes(tube, form, cases.points(form.start, 3), per_row=9) == []


@pytest.mark.parametrize("degree", [1, 3, 4])
@pytest.mark.parametrize("name", ["square", "angle", "a cubic in the set", "two rates"])
def test_every_degree_contains(name: str, degree: int) -> None:
    form = ALL[name]
    tube = form.tube(degree=degree)
    assert cases.escapes(tube, form, cases.points(form.start, 4), per_row=1) == []


def exact_flow(matrix: Array, t: float, state: Array) -> list[Any]:
    """e^(A t) x in balls."""
    n = len(matrix)
    a = flint.arb_mat(n, n, [flint.arb(float(v)) * flint.arb(t) for v in matrix.ravel()])
    product = a.exp() * flint.arb_mat(n, 1, [flint.arb(float(v)) for v in state])
    return [product[i, 0] for i in range(n)]


@pytest.mark.parametrize("seed", range(3))
def test_linear_flows_are_contained_and_lose_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(3, 3))
    names = ("x", "y", "z")
    system = system_of(lambda *x: list(ca.vertsplit(ca.DM(matrix) @ ca.vertcat(*x))), *names)
    center = rng.normal(size=3)
    for radius in (0.0, 0.5):
        start = Box(names, tuple(center - radius), tuple(center + radius))
        tube = compute_tube(system, initial_set=start, horizon_s=2.0)
        assert tube.complete
        with cases.precise():
            for state in cases.points(start, 3):
                for k in (1, 7, 20, 40):
                    there = exact_flow(matrix, float(tube.times[k]), state)
                    for i, ball in enumerate(there):
                        assert not ball < float(tube.lower_at[k, i])
                        assert not ball > float(tube.upper_at[k, i])
            columns = [exact_flow(matrix, 2.0, column) for column in np.eye(3)]
            spread = np.abs(np.array(columns, dtype=float)).sum(axis=0)
        size = np.abs(tube.upper_at).max()
        assert np.all(tube.half_width_at()[-1] <= radius * spread * (1 + 1e-6) + 1e-9 * size)


@pytest.mark.parametrize(
    "turns", [10, pytest.param(100, marks=pytest.mark.campaign, id="a hundred")]
)
def test_a_rotating_box_does_not_wrap(turns: int) -> None:
    form = ALL["oscillator"]
    method = ValidatedTube(math.pi / 2)
    horizon_s = 2 * turns * math.pi
    tube = compute_tube(form.system, initial_set=form.start, horizon_s=horizon_s, method=method)
    assert tube.complete
    exact = 0.1 * (np.abs(np.cos(tube.times)) + np.abs(np.sin(tube.times)))
    assert np.all(tube.half_width_at() <= (exact * (1 + 1e-4))[:, None])
    kept = slice(-4, None)
    last = ReachTube(
        tube.times[kept], tube.lower[-3:], tube.upper[-3:], tube.lower_at[kept],
        tube.upper_at[kept], tube.names, tube.status, tube.rigor,
    )  # fmt: skip
    assert cases.escapes(last, form, cases.points(form.start, 2)) == []


def test_an_initial_radius_keeps_a_disturbed_point_from_wrapping() -> None:
    """The same bound for a point as for a tiny box around it."""
    system = disturbed(
        lambda x, p, w: [x[1], -ca.sin(x[0]) + w[0]],
        ("angle", "rate"),
        disturbances=(Ranged.symmetric("torque", "", 0.01),),
    )
    widths = []
    for radius in (0.0, 1e-9):
        start = Box.around({"angle": 0.5, "rate": 0.0}, radius={"angle": radius, "rate": radius})
        tube = compute_tube(system, initial_set=start, horizon_s=6.0, method=ValidatedTube(0.1))
        assert tube.complete
        widths.append(tube.half_width_at()[-1])
    assert np.all(widths[0] <= 1.01 * widths[1])


class TestDisturbances:
    """|w| <= 0.5 arbitrary in time: the worst input is known, and the tube is little wider."""

    @pytest.mark.parametrize("step_s", [0.05, 0.4])
    def test_a_decay_is_pushed_to_both_ends(self, step_s: float) -> None:
        w = (Ranged.symmetric("w", "", 0.5),)
        system = disturbed(lambda x, p, w: [-x[0] + w[0]], ("x",), disturbances=w)
        tube = compute_tube(
            system, initial_set=box(x=(1.0, 1.2)), horizon_s=2.0, method=ValidatedTube(step_s)
        )
        t = tube.times
        top = 1.2 * np.exp(-t) + 0.5 * (1 - np.exp(-t))
        bottom = 1.0 * np.exp(-t) - 0.5 * (1 - np.exp(-t))
        assert np.all(tube.upper_at[:, 0] >= top - 1e-15)
        assert np.all(tube.lower_at[:, 0] <= bottom + 1e-15)
        assert np.all(tube.half_width_at()[:, 0] <= (1.0 + 0.8 * step_s) * 0.5 * (top - bottom))

    def test_a_bang_bang_force_in_resonance(self) -> None:
        """The sup of the position is 0.5 times the integral of |sin|; w switches within rows."""
        w = (Ranged.symmetric("w", "", 0.5),)
        system = disturbed(lambda x, p, w: [x[1], -x[0] + w[0]], ("x", "y"), disturbances=w)
        start = box(x=(0.0, 0.0), y=(0.0, 0.0))
        tube = compute_tube(system, initial_set=start, horizon_s=7.0, method=ValidatedTube(0.1))

        def area(t: Array) -> Array:
            turns = np.floor(t / math.pi)
            return np.asarray(2 * turns + 1 - np.cos(t - turns * math.pi))

        worst = 0.5 * area(tube.times)
        assert np.all(tube.upper_at[:, 0] >= worst - 1e-15)
        assert np.all(tube.half_width_at()[1:, 0] <= 1.1 * worst[1:] + 2e-3)
        middle = 0.5 * (tube.times[:-1] + tube.times[1:])
        assert np.all(tube.upper[:, 0] >= 0.5 * area(middle))

    def test_a_constant_disturbance_with_an_offset(self) -> None:
        w = (Ranged("w", "", 3.0, 3.0, 3.0),)
        system = disturbed(lambda x, p, w: [w[0] * x[0]], ("x",), disturbances=w)
        tube = compute_tube(system, initial_set=box(x=(1.0, 1.0)), horizon_s=1.0)
        with cases.precise():
            exact = flint.arb(3).exp()
            assert not exact < float(tube.lower_at[-1, 0])
            assert not exact > float(tube.upper_at[-1, 0])
        assert tube.half_width_at()[-1, 0] < 1e-12


@pytest.mark.parametrize("spread", [0.0, 1e-3, 0.5])
def test_a_ranged_parameter_keeps_its_correlation(spread: float) -> None:
    """x' = -p x: every p for itself, exactly x0 e^(-p t)."""
    p = (Ranged("p", "", 1.0, 1.0 - spread, 1.0 + spread),)
    system = disturbed(lambda x, p, w: [-p[0] * x[0]], ("x",), parameters=p)
    tube = compute_tube(system, initial_set=box(x=(1.0, 1.5)), horizon_s=1.5)
    with cases.precise():
        for rate in (1.0 - spread, 1.0, 1.0 + spread, 1.0 + 0.3 * spread):
            for k, t in enumerate(tube.times):
                for start in (1.0, 1.5):
                    exact = flint.arb(start) * (-flint.arb(rate) * flint.arb(float(t))).exp()
                    assert not exact < float(tube.lower_at[k, 0])
                    assert not exact > float(tube.upper_at[k, 0])
    top, bottom = 1.5 * math.exp(-1.5 * (1 - spread)), math.exp(-1.5 * (1 + spread))
    assert tube.upper_at[-1, 0] - tube.lower_at[-1, 0] <= (1.0 + 2.0 * spread + 1e-6) * (
        top - bottom
    )


def loop_escapes() -> list[str]:
    """What the tube of the benchmark loop from one state misses of a run in 200 bits."""
    loop = benchmarks.b1()
    lower, upper = np.array(loop.initial_set.lower), np.array(loop.initial_set.upper)
    state = lower + 0.37 * (upper - lower)
    start = Box(loop.initial_set.names, tuple(state), tuple(state))
    tube = compute_tube(loop.system, initial_set=start, horizon_s=0.5)
    state = np.array(start.reordered(loop.system.ode.names).lower)
    rows = cases.precise_run(loop.system.ode, state, tube.times)
    return [
        f"{tube.times[k]}: state {i}"
        for k, row in enumerate(rows)
        for i, ball in enumerate(row)
        if ball < float(tube.lower_at[k, i]) or ball > float(tube.upper_at[k, i])
    ]


def test_the_benchmark_loop_from_a_point_is_contained_to_the_last_bit() -> None:
    assert loop_escapes() == []


def test_a_square_under_a_disturbance_holds_the_ends_that_are_reached() -> None:
    """x' = x^2 + w with |w| <= 0.3: the ends are reached by constant w, tan and tanh of time."""
    w = (Ranged.symmetric("w", "", 0.3),)
    system = disturbed(lambda x, p, w: [x[0] ** 2 + w[0]], ("x",), disturbances=w)
    method = ValidatedTube(0.2)
    tube = compute_tube(system, initial_set=box(x=(0.0, 0.4)), horizon_s=0.8, method=method)
    assert tube.complete
    root, t = math.sqrt(0.3), tube.times
    top, bottom = root * np.tan(root * t + math.atan(0.4 / root)), -root * np.tanh(root * t)
    assert np.all(tube.upper_at[:, 0] >= top - 1e-14)
    assert np.all(tube.lower_at[:, 0] <= bottom + 1e-14)
