"""The inner hull lies inside every tube and the true hull, and its witnesses reach its ends."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tube_cases import disturbed, system_of

from workbench.bench import bounds_at
from workbench.bench.balls import ONE
from workbench.bench.taylor import taylor_field
from workbench.bench.validated_point import PointRun, enclose_point
from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models import Ranged
from workbench.models.benchmarks import Benchmark, b1, b2, b2_noise
from workbench.reach import ReachTube, TubeStatus, ValidatedTube, compute_tube
from workbench.reach.inner.choice_flow import ChoiceFlow
from workbench.reach.inner.choices import Choices
from workbench.reach.inner.extremes import Admissible, SearchEffort
from workbench.reach.inner.hull import InnerHull, inner_hull, proved_ratio
from workbench.reach.inner.point_runs import validated_runs
from workbench.sensitivity.sampling import rollout, sample_initial_states
from workbench.sets import Box

EFFORT = SearchEffort(starts=16, rounds=2, every=2, seed=1)
STEP_S = 0.05


def both(loop: Benchmark, horizon_s: float) -> tuple[InnerHull, ReachTube]:
    inner = inner_hull(
        loop.system,
        initial_set=loop.initial_set,
        horizon_s=horizon_s,
        step_s=STEP_S,
        effort=EFFORT,
    )
    tube = compute_tube(
        loop.system,
        initial_set=loop.initial_set,
        horizon_s=horizon_s,
        method=ValidatedTube(STEP_S),
    )
    return inner, tube


@settings(max_examples=15, deadline=None)
@given(st.floats(-2.0, -0.3), st.floats(0.0, 0.5), st.floats(0.01, 1.0))
def test_a_forced_linear_equation_is_reached_to_its_ends_and_not_beyond(
    rate: float, bound: float, radius: float
) -> None:
    system = disturbed(
        lambda x, p, w: [p * x + w],
        ("x",),
        parameters=(Ranged("rate", "1/s", rate, rate - 0.1, rate + 0.1),),
        disturbances=(Ranged.symmetric("push", "1/s", bound),),
    )
    inner = inner_hull(
        system,
        initial_set=Box(("x",), (1.0,), (1.0 + radius,)),
        horizon_s=1.0,
        step_s=0.25,
        effort=EFFORT,
    )
    # At positive states the largest value has the least decay and the strongest push throughout.
    for k, t in enumerate(inner.times.tolist()):
        slow = rate + 0.1
        true = (1.0 + radius) * math.exp(slow * t) + bound * math.expm1(slow * t) / slow
        assert inner.upper_at[k, 0] <= true * (1 + 1e-13)
        assert inner.upper_at[k, 0] >= true - 1e-6
    assert inner.rigor is Rigor.ENCLOSED
    witness = inner.witness_of("x", 4, upper=True)
    assert witness.initial_state == {"x": 1.0 + radius}
    assert witness.parameters == {"rate": rate + 0.1}
    assert np.all(witness.signal == bound)


@pytest.mark.parametrize(
    ("loop", "horizon_s", "most"), [(b1(), 1.0, 1.15), (b2(), 0.6, 1.3), (b2_noise(), 0.2, 3.0)]
)
def test_the_inner_hull_lies_in_the_tube_and_close_to_it(
    loop: Benchmark, horizon_s: float, most: float
) -> None:
    inner, tube = both(loop, horizon_s)
    assert inner.complete
    assert np.array_equal(inner.times, tube.times)
    assert np.all(inner.lower_at[1:] >= tube.lower_at[1:])
    assert np.all(inner.upper_at[1:] <= tube.upper_at[1:])
    ratio = proved_ratio(tube, inner)
    assert np.all(ratio[1:] >= 1.0)
    assert np.all(ratio[1:].mean(axis=0) <= most)
    low, high = bounds_at(tube, inner.times)
    assert np.all(ratio[1:] * inner.width_at()[1:] >= (high - low)[1:])


def test_the_search_reaches_as_far_as_many_samples() -> None:
    loop = b1()
    inner, _ = both(loop, 1.0)
    states = sample_initial_states(loop.initial_set, count=4000, seed=2)
    runs = rollout(loop.system, states, horizon_s=1.0, step_s=STEP_S / 2)[:, ::2]
    sampled = runs.max(axis=0) - runs.min(axis=0)
    assert np.all(inner.width_at() >= 0.999 * sampled - 1e-6)


def test_witnesses_reach_the_ends_when_run_again() -> None:
    loop, horizon_s = b2(), 0.6
    inner, _ = both(loop, horizon_s)
    last, n = len(inner.times) - 1, len(inner.names)
    faces = [
        inner.witness_of(name, last, upper=upper).initial_state
        for upper in (False, True)
        for name in inner.names
    ]
    assert all(loop.initial_set.contains(state) for state in faces)
    starts = np.array([list(state.values()) for state in faces])
    runs = rollout(loop.system, starts, horizon_s=horizon_s, step_s=horizon_s / 2400)[:, -1]
    assert np.all(np.diag(runs[:n]) <= inner.lower_at[last] + 1e-7)
    assert np.all(np.diag(runs[n:]) >= inner.upper_at[last] - 1e-7)


@pytest.mark.parametrize("loop", [b1(), b2(), b2_noise()], ids=lambda loop: loop.name)
def test_boxes_of_points_meet_the_balls_of_another_integrator(loop: Benchmark) -> None:
    ode, times = loop.system.ode, np.linspace(0.0, 6 * STEP_S, 7)
    rng = np.random.default_rng(4)
    states = np.array(loop.initial_set.lower) + (
        np.array(loop.initial_set.upper) - np.array(loop.initial_set.lower)
    ) * rng.integers(0, 2, (6, len(ode.states)))
    signals = np.stack(
        [rng.choice([w.lower, w.upper], (6, 6)) for w in ode.disturbances] or [np.zeros((6, 6))],
        axis=2,
    )[:, :, : len(ode.disturbances)]
    found = validated_runs(ode, Choices(states, np.zeros((6, 0)), signals), times)
    assert found.status is TubeStatus.COMPLETE
    assert np.all(found.upper - found.lower < 1e-4)
    for row in range(6):
        run = PointRun(
            taylor_field(ode.function()),
            states[row].tolist(),
            ode.parameter_values(),
            times[1:-1].tolist(),
            signals[row].tolist(),
        )
        balls = enclose_point(run, times.tolist())
        assert balls is not None
        for k, instant in enumerate(balls):
            for i, ball in enumerate(instant):
                assert ball.upper / ONE >= found.lower[k, row, i]
                assert ball.lower / ONE <= found.upper[k, row, i]


def test_a_run_that_ends_early_says_so() -> None:
    system = system_of(lambda x: [x * x], "x")
    inner = inner_hull(
        system, initial_set=Box(("x",), (0.5,), (1.0,)), horizon_s=2.0, step_s=0.25, effort=EFFORT
    )
    assert not inner.complete
    assert 0.5 <= inner.times[-1] < 1.0
    assert "between t =" in inner.message
    assert inner.upper_at[2, 0] == pytest.approx(2.0, abs=1e-6)
    assert inner.upper_at[2, 0] <= 2.0


def test_a_single_trajectory_has_no_inner_width() -> None:
    system = system_of(lambda x: [ca.sin(x)], "x")
    start = Box(("x",), (0.5,), (0.5,))
    inner = inner_hull(system, initial_set=start, horizon_s=0.5, step_s=0.25, effort=EFFORT)
    assert np.all(inner.width_at() == 0.0)
    assert np.all(inner.lower_at[1:] >= inner.upper_at[1:])
    tube = compute_tube(system, initial_set=start, horizon_s=0.5, method=ValidatedTube(0.25))
    assert np.all(np.isinf(proved_ratio(tube, inner)))


def test_instants_that_the_tube_lacks_have_no_ratio() -> None:
    loop = b1()
    inner, _ = both(loop, 0.2)
    short = compute_tube(
        loop.system, initial_set=loop.initial_set, horizon_s=0.1, method=ValidatedTube(STEP_S)
    )
    ratio = proved_ratio(short, inner)
    assert np.all(np.isfinite(ratio[1:3, :4]))
    assert np.all(np.isinf(ratio[3:]))


def choices_of(loop: Benchmark, count: int, intervals: int) -> tuple[Admissible, Choices]:
    ode = loop.system.ode
    admissible = Admissible.of(ode, loop.initial_set.reordered(ode.names), intervals)
    effort = SearchEffort(count, 0, 1, 3)
    return admissible, admissible.starts(effort).take(np.arange(count))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000), st.sampled_from([math.inf, 1.0, 0.1]))
def test_no_step_of_the_search_leaves_what_is_admissible(seed: int, step: float) -> None:
    admissible, base = choices_of(b2_noise(), 8, 4)
    rng = np.random.default_rng(seed)
    slopes = Choices(
        rng.normal(size=base.states.shape),
        rng.normal(size=base.constants.shape),
        rng.normal(size=base.signals.shape),
    )
    low, high = admissible.ends()
    for tried in (base, admissible.moved(base, slopes, step), *admissible.flips(base)):
        for name in ("states", "constants", "signals"):
            value = getattr(tried, name)
            assert np.all(value >= getattr(low, name))
            assert np.all(value <= getattr(high, name))


def test_adjoint_gradients_agree_with_differences() -> None:
    loop = b2_noise()
    ode, times = loop.system.ode, np.linspace(0.0, 8 * STEP_S, 9)
    _, base = choices_of(loop, 4, 8)
    flow = ChoiceFlow.of(ode, times)
    weights = np.random.default_rng(0).normal(size=(4, len(ode.states)))
    ends = np.array([8, 8, 5, 3])
    gradients = flow.gradients(base, ends, weights)

    def value(choices: Choices) -> np.ndarray:
        return np.asarray((flow.runs(choices)[np.arange(4), ends] * weights).sum(axis=1))

    small = 1e-6
    for i in range(len(ode.states)):
        shifted = base.states + small * np.eye(len(ode.states))[i]
        difference = (value(Choices(shifted, base.constants, base.signals)) - value(base)) / small
        assert gradients.states[:, i] == pytest.approx(difference, abs=1e-3)
    for k in (0, 2, 7):
        shifted = base.signals.copy()
        shifted[:, k, 1] += small
        difference = (value(Choices(base.states, base.constants, shifted)) - value(base)) / small
        assert gradients.signals[:, k, 1] == pytest.approx(difference, abs=1e-3)


def test_misuse_is_answered() -> None:
    system = system_of(lambda x: [-x], "x")
    one = Choices(np.ones((1, 1)), np.zeros((1, 0)), np.zeros((1, 2, 0)))
    with pytest.raises(InputError, match="exact differences"):
        validated_runs(system, one, np.array([0.0, 1e-17, 1.0]))
    with pytest.raises(InputError, match="expected starts >= 1"):
        SearchEffort(starts=0, rounds=1, every=1, seed=1)
    with pytest.raises(InputError, match="name the states"):
        inner_hull(
            b1().system,
            initial_set=Box(("x",), (0.0,), (1.0,)),
            horizon_s=1.0,
            step_s=0.1,
            effort=EFFORT,
        )
