"""Trajectories with inputs of their own stay within the bounds, and closed forms are met."""

from __future__ import annotations

import math
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from workbench.errors import InputError
from workbench.models.benchmarks import b2_noise
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode
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
from workbench.sensitivity.discrepancy import DerivationMethod
from workbench.sensitivity.growth_matrix import MetzlerGrowth
from workbench.sensitivity.inputs import mismatch
from workbench.sensitivity.jacobian import IntervalJacobian
from workbench.sets.box import Box

_EFFORT = Effort(Form.VERTICES, 1e4, 4)
_DIFFERENT = (Inputs.SAME_PARAMETERS, Inputs.AGAINST_NOMINAL, Inputs.INDEPENDENT)


def _methods(inputs: Inputs) -> dict[str, DerivationMethod]:
    return {
        "max": WeightedNorm(Norm.MAX, None, 4, inputs),
        "sum": WeightedNorm(Norm.SUM, None, 4, inputs),
        "euclidean": EuclideanNorm(None, 4, inputs),
        "matrix": GrowthMatrix(4, inputs),
        "metric": OptimalMetric(_EFFORT, inputs),
        "blocks": BlockGrowth(None, _EFFORT, inputs),
    }


def _ode(
    field: ca.SX, x: ca.SX, p: ca.SX | None = None, w: ca.SX | None = None,
    ranges: dict[str, tuple[float, float, float]] | None = None,
) -> Ode:  # fmt: skip
    """p, w: their symbols; ranges: symbol name -> (nominal, lower, upper)."""

    def ranged(symbols: ca.SX | None) -> tuple[Ranged, ...]:
        names = [s.name() for s in ca.symvar(symbols)] if symbols is not None else []
        return tuple(Ranged(name, "", *(ranges or {})[name]) for name in names)

    empty = ca.SX(0, 1)
    states = tuple(Signal(f"x{i}", "") for i in range(x.numel()))
    p_symbols, w_symbols = (empty if s is None else s for s in (p, w))
    return Ode("test", states, ranged(p), ranged(w), x, p_symbols, w_symbols, field)


def _region(ode: Ode, radius: float = 1.0) -> Box:
    return Box.around(dict.fromkeys(ode.names, 0.0), radius=dict.fromkeys(ode.names, radius))


def _derived(ode: Ode, method: DerivationMethod, horizon_s: float = 2.0) -> Discrepancy:
    return derive_discrepancy(ode, region=_region(ode), horizon_s=horizon_s, method=method)


@pytest.mark.parametrize("name", list(_methods(Inputs.SHARED)))
@pytest.mark.parametrize(
    ("inputs", "gap"),
    [(Inputs.SHARED, 0.0), (Inputs.AGAINST_NOMINAL, 0.375), (Inputs.INDEPENDENT, 0.5)],
)
def test_one_state_with_a_disturbance_meets_its_closed_form(
    name: str, inputs: Inputs, gap: float
) -> None:
    """x' = -x + w with w in [-0.125, 0.375] around 0: e^-t r + (1 - e^-t) gap."""
    x, w = ca.SX.sym("x"), ca.SX.sym("w")
    ode = _ode(-x + w, x, w=w, ranges={"w": (0.0, -0.125, 0.375)})
    bound = _derived(ode, _methods(inputs)[name])
    for t in (0.0, 0.1, 1.0, 2.0):
        exact = 0.25 * math.exp(-t) + gap * (1.0 - math.exp(-t))
        assert exact * (1.0 - 1e-14) <= bound.radius([0.25], t)[0] <= exact * (1.0 + 1e-10)


def test_a_cooperative_pair_meets_the_integral_of_its_exponential() -> None:
    matrix = np.array([[-1.0, 0.5], [0.25, -0.5]])
    x, w = ca.SX.sym("x", 2), ca.SX.sym("w", 1)
    ode = _ode(
        ca.DM(matrix) @ x + ca.vertcat(0, 2 * w),
        x,
        w=w,
        ranges={"w_0": (0, -1, 1), "w": (0, -1, 1)},
    )
    bound = _derived(ode, GrowthMatrix(1, Inputs.INDEPENDENT))
    t, start = 1.5, np.array([0.1, 0.2])
    steps = np.linalg.solve(matrix, expm(matrix * t) - np.eye(2))
    exact = expm(matrix * t) @ start + steps @ np.array([0.0, 4.0])
    np.testing.assert_allclose(bound.radius(start.tolist(), t), exact, rtol=1e-11)


def test_mismatch_adds_what_every_input_can_do() -> None:
    x, p, w = ca.SX.sym("x", 2), ca.SX.sym("p"), ca.SX.sym("w")
    ode = _ode(
        ca.vertcat(-p * x[0] + 3.0 * w, -x[1] + w * x[0]),
        x, p=p, w=w, ranges={"p": (2.0, 1.0, 2.5), "w": (0.25, -0.5, 0.5)},
    )  # fmt: skip
    region = Box.from_intervals({"x0": (-2.0, 1.0), "x1": (-1.0, 1.0)})
    cells = IntervalJacobian(ode).start(region)
    expected = {
        Inputs.SHARED: (0.0, 0.0),
        Inputs.SAME_PARAMETERS: (3.0, 2.0),
        Inputs.AGAINST_NOMINAL: (2.0 * 1.0 + 3.0 * 0.75, 2.0 * 0.75),
        Inputs.INDEPENDENT: (2.0 * 1.5 + 3.0, 2.0),
    }
    for inputs, values in expected.items():
        found = mismatch(ode, region=region, inputs=inputs, cells=cells)
        assert found == pytest.approx(values, rel=1e-14)
        assert all(a >= b for a, b in zip(found, values, strict=True))


def test_a_parameter_that_is_exact_is_shared_though_no_double() -> None:
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    ode = _ode(-p * x, x, p=p, ranges={"p": (0.1, 0.1, 0.1)})
    cells = IntervalJacobian(ode).start(_region(ode))
    assert mismatch(ode, region=_region(ode), inputs=Inputs.INDEPENDENT, cells=cells) == (0.0,)


@pytest.mark.parametrize(
    ("interval", "expected"),
    [((-1.0, 1.0), 2.0), ((5.0, 6.0), 0.5), ((-0.1, 0.1), 2.0)],
)
def test_limits_that_are_parameters_count_where_they_may_be_met(
    interval: tuple[float, float], expected: float
) -> None:
    # clip(x + 2 w, -1, h): by w 2 inside and 0 at the limit; by h 1 at the limit.
    x, h, w = ca.SX.sym("x"), ca.SX.sym("h"), ca.SX.sym("w")
    ode = _ode(
        ca.fmin(ca.fmax(x + 2.0 * w, -1.0), h), x, p=h, w=w,
        ranges={"h": (1.0, 1.0, 1.5), "w": (0.0, -0.5, 0.5)},
    )  # fmt: skip
    region = Box.from_intervals({"x0": interval})
    cells = IntervalJacobian(ode).start(region)
    found = mismatch(ode, region=region, inputs=Inputs.INDEPENDENT, cells=cells)[0]
    assert found >= expected
    rng = np.random.default_rng(0)
    field = ode.function()
    states = rng.uniform(*interval, 2000)
    values = [
        [
            float(field(s, h, w))
            for h, w in zip(rng.uniform(1, 1.5, 2), rng.uniform(-0.5, 0.5, 2), strict=True)
        ]
        for s in states.tolist()
    ]
    assert max(abs(a - b) for a, b in values) <= found
    if interval == (5.0, 6.0):
        assert found == pytest.approx(expected, rel=1e-12)


def test_limits_within_limits_pass_on_what_they_feel() -> None:
    # clip(x + clip(3 w, -1, 1) / 2, -2, 2): 1.5 per w where both are inside, 0 where one is not.
    x, w = ca.SX.sym("x"), ca.SX.sym("w")
    inner = ca.fmin(ca.fmax(3.0 * w, -1.0), 1.0)
    field = ca.fmin(ca.fmax(x + 0.5 * inner, -2.0), 2.0)
    for ends, interval, expected in (
        ((-0.25, 0.25), (-1.0, 1.0), 0.75),
        ((0.5, 0.75), (-1.0, 1.0), 0.0),
        ((-0.25, 0.25), (3.0, 4.0), 0.0),
    ):
        ode = _ode(field, x, w=w, ranges={"w": (ends[0], *ends)})
        region = Box.from_intervals({"x0": interval})
        cells = IntervalJacobian(ode).start(region)
        found = mismatch(ode, region=region, inputs=Inputs.INDEPENDENT, cells=cells)
        assert found == pytest.approx((expected,), rel=1e-12, abs=1e-300)
        assert found[0] >= expected


def test_an_axis_that_only_the_inputs_feel_must_be_in_the_region() -> None:
    x, w = ca.SX.sym("x", 2), ca.SX.sym("w")
    # The first state's effect on the second goes through w alone when w is 0 in the Jacobian.
    ode = _ode(ca.vertcat(-x[0], -x[1] + w * x[0] ** 2), x, w=w, ranges={"w": (0.0, 0.0, 1.0)})
    linear = _ode(ca.vertcat(-x[0], -x[1] + w * x[0]), x, w=w, ranges={"w": (0.0, 0.0, 1.0)})
    method = GrowthMatrix(1, Inputs.INDEPENDENT)
    region = Box.from_intervals({"x1": (-1.0, 1.0)})
    for each in (ode, linear):
        with pytest.raises(InputError, match="x0"):
            derive_discrepancy(each, region=region, horizon_s=1.0, method=method)


@pytest.mark.parametrize("inputs", _DIFFERENT)
@pytest.mark.parametrize("name", list(_methods(Inputs.SHARED)))
@given(seed=st.integers(0, 10**6))
@settings(max_examples=5, deadline=None)
def test_pairs_with_their_own_inputs_stay_within_the_bound(
    name: str, inputs: Inputs, seed: int
) -> None:
    """A pendulum with a limited, disturbed torque; disturbances jump at random times."""
    bound = _PENDULUM[name, inputs]
    rng = np.random.default_rng(seed)
    step = _ODE.function()
    states = [rng.uniform(-0.4, 0.4, 2) for _ in range(2)]
    gains = [float(rng.uniform(0.5, 0.7)) for _ in range(2)]
    start = np.nextafter(np.abs(states[0] - states[1]), np.inf)
    if inputs is Inputs.SAME_PARAMETERS:
        gains[1] = gains[0]
    pushes = [0.3 * rng.choice([-1.0, 1.0]) for _ in range(2)]
    for k in range(1, 101):
        if rng.random() < 0.05:
            pushes = [0.3 * rng.choice([-1.0, 1.0]) for _ in range(2)]
        if inputs is Inputs.AGAINST_NOMINAL:
            gains[1], pushes[1] = 0.6, 0.0
        for i in range(2):
            states[i] = _stepped(step, states[i], gains[i], float(pushes[i]))
        assert all(np.all(np.abs(s) <= 3.0) for s in states)
        reached = np.abs(states[0] - states[1])
        if k % 20 == 0:
            assert np.all(reached <= np.array(bound.radius(start.tolist(), 0.02 * k)) + 1e-6)


def _stepped(field: ca.Function, x: np.ndarray, gain: float, push: float) -> np.ndarray:
    def slope(state: np.ndarray) -> np.ndarray:
        return np.array(field(state, gain, push)).ravel()

    h = 0.02
    a = slope(x)
    b = slope(x + 0.5 * h * a)
    c = slope(x + 0.5 * h * b)
    return np.asarray(x + h / 6.0 * (a + 2 * b + 2 * c + slope(x + h * c)))


def _pendulum() -> Ode:
    x, gain, push = ca.SX.sym("x", 2), ca.SX.sym("gain"), ca.SX.sym("push")
    torque = ca.fmin(ca.fmax(-gain * x[0] + push, -0.25), 0.25)
    return _ode(
        ca.vertcat(x[1], -ca.sin(x[0]) - 0.5 * x[1] + torque), x, p=gain, w=push,
        ranges={"gain": (0.6, 0.5, 0.7), "push": (0.0, -0.3, 0.3)},
    )  # fmt: skip


_ODE = _pendulum()
_PENDULUM = {
    (name, inputs): derive_discrepancy(
        _ODE, region=_region(_ODE, 3.0), horizon_s=2.0, method=method
    )
    for inputs in _DIFFERENT
    for name, method in _methods(inputs).items()
}


def test_what_differs_never_lowers_a_bound() -> None:
    for name in _methods(Inputs.SHARED):
        own = _PENDULUM[name, Inputs.INDEPENDENT].radius([0.1, 0.1], 2.0)
        nominal = _PENDULUM[name, Inputs.AGAINST_NOMINAL].radius([0.1, 0.1], 2.0)
        same = _PENDULUM[name, Inputs.SAME_PARAMETERS].radius([0.1, 0.1], 2.0)
        assert all(a >= b for a, b in zip(own, nominal, strict=True))
        assert all(a >= b for a, b in zip(own, same, strict=True))


def test_noise_of_the_shipped_kind_enters_every_state_it_touches() -> None:
    """B2-noise: readings enter the steering rate, the acceleration and both integrals."""
    ode = b2_noise().system.ode
    sides = (
        (-1.0, 9.0),
        (-0.7, 0.8),
        (-0.3, 0.3),
        (2.2, 3.0),
        (-0.3, 0.3),
        (-1.0, 1.0),
        (-1.0, 1.0),
    )
    region = Box.from_intervals(dict(zip(ode.names, sides, strict=True)))
    bound = derive_discrepancy(
        ode, region=region, horizon_s=1.0, method=GrowthMatrix(16, Inputs.AGAINST_NOMINAL)
    )
    assert isinstance(bound.growth, MetzlerGrowth)
    felt = dict(zip(ode.names, bound.growth.mismatch, strict=True))
    assert felt["x"] == felt["y"] == felt["heading"] == 0.0
    # Acceleration: its own 0.1 m/s^2, and the speed reading 0.05 m/s through a gain of 1.
    assert felt["speed"] == pytest.approx(0.15, rel=1e-9)
    assert felt["steering"] >= float(Fraction(1, 100) + Fraction(6, 100))
    assert "nominal" in bound.condition
