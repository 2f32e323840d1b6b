"""The campaign's own trajectories are right: enclosures contain the exact ones, floats agree.

Exact answers are closed forms, rational numbers, and ball arithmetic of another library.
"""

from __future__ import annotations

import math
from fractions import Fraction

import casadi as ca
import flint
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.bench.balls import ONE, PLACES, Ball, BallAlgebra, UndecidedError, hull
from workbench.bench.closed_parts import closed_part
from workbench.bench.lanes import Accuracy, Inputs, trajectories
from workbench.bench.taylor import TaylorField, taylor_field
from workbench.bench.validated_point import PointRun, enclose_point
from workbench.errors import InputError
from workbench.models.benchmarks import b1, b2, b2_noise, b2_path
from workbench.sensitivity.sampling import rollout, sample_initial_states

ALGEBRA = BallAlgebra()
NONE = ca.SX(0, 1)
numbers = st.floats(-50.0, 50.0).map(lambda value: round(value, 9))
radii = st.floats(0.0, 0.5)
shares = st.fractions(-1, 1)
FEW = settings(max_examples=60, deadline=None)


@st.composite
def balls(draw: st.DrawFn) -> tuple[Ball, Fraction]:
    """A ball and a number in it, in units of 1."""
    mid, rad = Ball.of(draw(numbers)).mid, int(draw(radii) * ONE)
    return Ball(mid, rad), (mid + draw(shares) * rad) / ONE


def contains(ball: Ball, value: Fraction) -> bool:
    return ball.lower <= value * ONE <= ball.upper


@FEW
@given(balls(), balls(), st.integers(1, 40))
def test_every_operation_contains_the_exact_result(
    left: tuple[Ball, Fraction], right: tuple[Ball, Fraction], divisor: int
) -> None:
    (a, x), (b, y) = left, right
    assert contains(a + b, x + y)
    assert contains(a - b, x - y)
    assert contains(-a, -x)
    assert contains(a * b, x * y)
    assert contains(a * divisor, x * divisor)
    assert contains(a / -divisor, x / -divisor)
    assert contains(hull(a, b), x)
    assert contains(hull(a, b), y)
    assert contains(ALGEBRA.convolve([a, b], [b, a]), x * x + y * y)
    assert contains(ALGEBRA.least((a, b), (a, b), 0), min(x, y))
    if b.lower > 0 or b.upper < 0:
        assert contains(a / b, x / y)
    else:
        with pytest.raises(UndecidedError):
            a / b


@FEW
@given(st.floats(-15.9, 15.9))
def test_sine_and_cosine_agree_with_another_library(angle: float) -> None:
    flint.ctx.prec = 400
    sine, cosine = ALGEBRA.sine_cosine(Ball.of(angle))
    for ball, exact in ((sine, flint.arb(angle).sin()), (cosine, flint.arb(angle).cos())):
        scaled = exact * flint.arb(2) ** PLACES
        assert flint.arb(ball.lower) <= scaled <= flint.arb(ball.upper)


def test_an_angle_out_of_range_is_refused() -> None:
    with pytest.raises(UndecidedError, match="range"):
        ALGEBRA.sine_cosine(Ball.of(17.0))


def field_of(rate: ca.SX, x: ca.SX, w: ca.SX = NONE) -> TaylorField:
    return taylor_field(ca.Function("f", [x, NONE, w], [rate]))


def ends(ball: Ball) -> tuple[Fraction, Fraction]:
    return Fraction(ball.lower, ONE), Fraction(ball.upper, ONE)


def test_a_pole_in_time_is_enclosed_to_25_digits_and_not_crossed() -> None:
    x = ca.SX.sym("x")
    run = PointRun(field_of(x * x, x), [0.5], [], [], [[]])
    found = enclose_point(run, [0.0, 0.5, 1.75])
    assert found is not None
    for time, (ball,) in zip([0.0, 0.5, 1.75], found, strict=True):
        low, high = ends(ball)
        assert low <= 1 / (2 - Fraction(time)) <= high
        assert high - low < Fraction(1, 10**24)
    assert enclose_point(run, [2.5]) is None


def test_a_disturbance_switches_exactly_when_it_says() -> None:
    x, w = ca.SX.sym("x"), ca.SX.sym("w")
    run = PointRun(field_of(w, x, w), [0.125], [], [0.1, 0.3], [[1.0], [-2.0], [0.5]])
    found = enclose_point(run, [0.05, 0.3, 1.0])
    assert found is not None
    tenth, three = Fraction(0.1), Fraction(0.3)
    level = Fraction(1, 8) + tenth - 2 * (three - tenth)
    exact = [Fraction(1, 8) + Fraction(0.05), level, level + (1 - three) / 2]
    for (ball,), value in zip(found, exact, strict=True):
        low, high = ends(ball)
        assert low <= value <= high
        assert high - low < Fraction(1, 10**40)


@pytest.mark.parametrize("form", ["clip", "fabs"])
def test_a_kink_is_crossed(form: str) -> None:
    x = ca.SX.sym("x")
    limited = (
        ca.fmin(ca.fmax(x, -1), 1) if form == "clip" else 0.5 * (ca.fabs(x + 1) - ca.fabs(x - 1))
    )
    found = enclose_point(PointRun(field_of(-limited, x), [2.0], [], [], [[]]), [0.5, 1.0, 2.0])
    assert found is not None
    flint.ctx.prec = 200
    exact = (flint.arb(1.5), flint.arb(1), flint.arb(-1).exp())
    for (ball,), value in zip(found, exact, strict=True):
        assert (value * flint.arb(2) ** PLACES).overlaps(
            flint.arb(flint.arb(ball.mid), flint.arb(ball.rad))
        )
        assert ball.rad < ONE >> 55


def test_a_run_that_stays_on_a_kink_is_left_undecided() -> None:
    x = ca.SX.sym("x")
    assert enclose_point(PointRun(field_of(ca.fabs(x), x), [0.0], [], [], [[]]), [1.0]) is None


@pytest.mark.parametrize("benchmark", [b1, b2, b2_noise, b2_path])
def test_floats_agree_with_enclosures_and_with_another_integrator(benchmark) -> None:
    loop = benchmark()
    ode = loop.system.ode
    rng = np.random.default_rng(5)
    states = sample_initial_states(loop.initial_set, count=40, seed=3)
    inputs = random_inputs(ode, states, rng)
    times = np.linspace(0.0, 2.0, 41)
    field = taylor_field(ode.function())
    runs = trajectories(field, inputs, times, Accuracy(16, 1e-14))
    lane = 7
    found = enclose_point(
        PointRun(
            field,
            states[lane].tolist(),
            ode.parameter_values(),
            inputs.switches[lane].tolist(),
            inputs.values[lane].tolist(),
        ),
        times.tolist(),
    )
    assert found is not None
    enclosed = np.array([[ball.mid / ONE for ball in row] for row in found])
    assert np.abs(enclosed - runs.states[:, :, lane]).max() < 1e-13
    held = inputs.values[:, :1].repeat(inputs.values.shape[1], axis=1)
    constant = Inputs(states, inputs.parameters, inputs.switches, held)
    reference = rollout(
        ode, states, horizon_s=2.0, step_s=0.005, disturbances=held[:, 0] if held.size else None
    )
    runs = trajectories(field, constant, times, Accuracy(16, 1e-14))
    assert np.abs(runs.states.transpose(2, 0, 1) - reference[:, ::10]).max() < 1e-5


def random_inputs(ode, states: np.ndarray, rng: np.random.Generator) -> Inputs:
    count, ranges = len(states), ode.disturbances
    limits = np.array([(r.lower, r.upper) for r in ranges]).reshape(-1, 2)
    switches = np.sort(rng.uniform(0.0, 2.0, (count, 3)), axis=1)
    upper = rng.random((count, 4, len(ranges))) < 0.5
    values = np.where(upper, limits[:, 1], limits[:, 0])
    return Inputs(states, np.tile(ode.parameter_values(), (count, 1)), switches, values)


def test_a_part_moves_as_the_whole_does() -> None:
    """At its rate limit the steering of B2 is a line, whatever else the car does."""
    loop = b2()
    ode = loop.system.ode
    whole = taylor_field(ode.function())
    speed = closed_part(whole, ode.names.index("speed"), {})
    assert [ode.names[i] for i in speed.states] == ["speed", "speed_integral"]
    assert len(speed.field.nodes) < len(whole.nodes) / 2
    steering = ode.names.index("steering")
    state = np.array(loop.initial_set.center)
    state[1], state[5:] = 3.0, 0.0
    values = np.zeros((1, 1, 0))
    inputs = Inputs(state[None], np.array([ode.parameter_values()]), np.zeros((1, 0)), values)
    runs = trajectories(whole, inputs, np.array([0.0, 0.25]), Accuracy(16, 1e-14))
    stays = runs.crossed_s[:, 0] > 0.25
    sides = {
        kink: bool(first)
        for kink, sure, first in zip(whole.kinks, stays, runs.first[:, 0], strict=True)
        if sure
    }
    assert len(sides) == len(whole.kinks) == 6
    part = closed_part(whole, steering, sides)
    assert part.states.tolist() == [steering]
    names = [ode.parameters[i].name for i in part.parameters]
    assert names == ["steering_rate_min"]
    found = enclose_point(PointRun(part.field, [state[steering]], [-0.2], [], [[]]), [0.25])
    assert found is not None
    assert math.isclose(found[0][0].mid / ONE, runs.states[1, steering, 0], abs_tol=1e-15)


def test_a_limited_disturbance_switches() -> None:
    x, w = ca.SX.sym("x"), ca.SX.sym("w")
    field = field_of(ca.fmin(w, 1), x, w)
    values = np.array([[[3.0], [-2.0]], [[3.0], [2.0]]])
    inputs = Inputs(np.zeros((2, 1)), np.zeros((2, 0)), np.full((2, 1), 0.5), values)
    runs = trajectories(field, inputs, np.array([1.0]), Accuracy(16, 1e-14))
    assert np.allclose(runs.states[0, 0], [-0.5, 1.0], atol=1e-15)


def test_a_disturbed_kink_is_met_when_the_disturbance_switches() -> None:
    x, w = ca.SX.sym("x"), ca.SX.sym("w")
    field = field_of(ca.fmin(x + w, 1), x, w)
    values = np.array([[[3.0], [-2.0]], [[3.0], [2.5]]])
    inputs = Inputs(np.zeros((2, 1)), np.zeros((2, 0)), np.full((2, 1), 0.5), values)
    runs = trajectories(field, inputs, np.array([1.0]), Accuracy(16, 1e-14))
    assert runs.first.tolist() == [[False, False]]
    assert runs.crossed_s.tolist() == [[0.5, np.inf]]


def test_a_gain_of_zero_cuts_a_part_off() -> None:
    x, gain = ca.SX.sym("x", 2), ca.SX.sym("gain")
    whole = taylor_field(ca.Function("f", [x, gain, NONE], [ca.vertcat(gain * x[1] - x[0], x[0])]))
    assert closed_part(whole, 0, {}).states.tolist() == [0, 1]
    assert closed_part(whole, 0, {}, [0]).states.tolist() == [0]


def test_a_run_that_leaves_the_numbers_is_nan_from_there_on() -> None:
    x = ca.SX.sym("x")
    inputs = Inputs(
        np.array([[1.0], [0.1]]), np.zeros((2, 0)), np.zeros((2, 0)), np.zeros((2, 1, 0))
    )
    runs = trajectories(field_of(x * x, x), inputs, np.array([0.5, 2.0]), Accuracy(16, 1e-14))
    assert np.isfinite(runs.states[0]).all()
    assert np.isnan(runs.states[1, 0, 0])
    assert abs(runs.states[1, 0, 1] - 1 / 8) < 1e-14


def test_an_operation_without_a_recurrence_is_refused_by_name() -> None:
    x = ca.SX.sym("x")
    with pytest.raises(InputError, match="tanh"):
        field_of(ca.tanh(x), x)
