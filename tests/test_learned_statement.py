"""Learned bounds state an (epsilon, delta) that the binomial tail supports, and keep it."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode, system_from_casadi
from workbench.sensitivity import LearnedExponential, learn_discrepancy
from workbench.sensitivity.sampling import instants, rollout, uniform_states
from workbench.sensitivity.scenario import pairs_needed, violation_bound
from workbench.sets.box import Box


def _pendulum() -> Ode:
    x = ca.SX.sym("x", 2)
    return system_from_casadi(x, ca.vertcat(x[1], -ca.sin(x[0]) - 0.3 * x[1]), ("angle", "rate"))


_SET = Box.around({"angle": 0.4, "rate": 0.0}, radius={"angle": 0.2, "rate": 0.1})


@pytest.mark.parametrize(
    ("epsilon", "delta", "parameters", "expected"),
    [
        (1e-3, 1e-6, 2, 16681),
        (1e-3, 1e-6, 14, 39396),
        (1e-3, 1e-6, 1, 13809),
        (1e-4, 1e-6, 2, 166877),
        (0.01, 1e-3, 2, 920),
        (0.05, 0.05, 1, 59),
        (0.05, 0.05, 2, 93),
    ],
)
def test_sample_counts_are_the_known_ones(
    epsilon: float, delta: float, parameters: int, expected: int
) -> None:
    assert pairs_needed(epsilon, delta=delta, parameters=parameters) == expected


def _tail(pairs: int, epsilon: float, parameters: int) -> float:
    return sum(
        math.comb(pairs, i) * epsilon**i * (1.0 - epsilon) ** (pairs - i) for i in range(parameters)
    )


@given(st.floats(0.01, 0.3), st.floats(1e-4, 0.2), st.integers(1, 6))
def test_count_is_the_smallest_that_meets_the_tail(
    epsilon: float, delta: float, parameters: int
) -> None:
    count = pairs_needed(epsilon, delta=delta, parameters=parameters)
    assert _tail(count, epsilon, parameters) <= delta * (1.0 + 1e-9)
    assert _tail(count - 1, epsilon, parameters) > delta * (1.0 - 1e-9)


@given(st.integers(20, 2000), st.integers(1, 6))
def test_violation_bound_is_what_the_count_supports(pairs: int, parameters: int) -> None:
    epsilon = violation_bound(pairs, delta=1e-3, parameters=parameters)
    assert _tail(pairs, epsilon, parameters) <= 1e-3 * (1.0 + 1e-9)
    assert _tail(pairs, 0.99 * epsilon, parameters) > 1e-3


def test_fewer_pairs_than_parameters_support_nothing() -> None:
    assert violation_bound(3, delta=1e-3, parameters=4) == 1.0


def test_fresh_pairs_from_the_same_distribution_obey_the_bound_as_often_as_stated() -> None:
    system = _pendulum()
    method = LearnedExponential.promising(0.02, delta=1e-6, system=system, seed=3, step_s=0.1)
    assert method.pairs == pairs_needed(0.02, delta=1e-6, parameters=4)
    learned = learn_discrepancy(system, initial_set=_SET, horizon_s=2.0, method=method)
    assert learned.rigor is Rigor.SAMPLED
    assert "uniform" in learned.condition
    assert "0.02" in learned.condition
    states = uniform_states(_SET, 4000, np.random.default_rng(99))
    runs = rollout(system, states, horizon_s=2.0, step_s=0.1)
    broken = 0
    for first, second in zip(runs[:2000], runs[2000:], strict=True):
        gaps = np.abs(first[0] - second[0])
        broken += any(
            np.any(np.abs(first[k] - second[k]) > np.array(learned.radius(gaps, t)) * (1.0 + 1e-12))
            for k, t in enumerate(instants(2.0, 0.1).tolist())
        )
    assert broken / 2000 <= 0.02


def test_same_seed_same_bound_other_seed_other_bound() -> None:
    def learn(seed: int) -> tuple[float, ...]:
        method = LearnedExponential(pairs=200, seed=seed, step_s=0.1, delta=1e-3)
        learned = learn_discrepancy(_pendulum(), initial_set=_SET, horizon_s=2.0, method=method)
        return learned.radius(_SET.radius, 2.0)

    assert learn(1) == learn(1)
    assert learn(1) != learn(2)


def test_a_state_without_initial_width_gets_an_amplitude_and_refuses_unseen_distances() -> None:
    box = Box.around({"angle": 0.4, "rate": 0.0}, radius={"angle": 0.2})
    method = LearnedExponential(pairs=500, seed=0, step_s=0.1, delta=1e-3)
    learned = learn_discrepancy(_pendulum(), initial_set=box, horizon_s=2.0, method=method)
    vertices = np.array(list(box.vertices()))
    runs = rollout(_pendulum(), vertices, horizon_s=2.0, step_s=0.1)
    widest = float(np.abs(runs[0] - runs[1])[:, 1].max())
    assert learned.radius({"angle": 0.4}, 2.0)[1] > 0.5 * widest
    with pytest.raises(InputError, match="did not vary"):
        learned.radius({"angle": 0.1, "rate": 0.1}, 1.0)


def test_a_state_that_never_moves_is_reported_as_such() -> None:
    x = ca.SX.sym("x", 2)
    system = system_from_casadi(x, ca.vertcat(-x[0], ca.SX(0)), ("moving", "still"))
    box = Box.around({"moving": 1.0, "still": 2.0}, radius={"moving": 0.5})
    method = LearnedExponential(pairs=50, seed=0, step_s=0.1, delta=1e-3)
    learned = learn_discrepancy(system, initial_set=box, horizon_s=1.0, method=method)
    assert learned.radius(box.radius, 1.0)[1] == 0.0


def test_parameter_ranges_are_drawn_and_shared_within_a_pair() -> None:
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    ranges = (Ranged("growth", "1/s", 0.0, -1.0, 1.0),)
    ode = Ode("grow", (Signal("x", ""),), ranges, (), x, p, ca.SX(0, 1), p * x)
    box = Box.around({"x": 5.0}, radius={"x": 0.5})
    method = LearnedExponential(pairs=500, seed=0, step_s=0.1, delta=1e-3)
    learned = learn_discrepancy(ode, initial_set=box, horizon_s=1.0, method=method)
    assert learned.radius([0.5], 1.0)[0] == pytest.approx(0.5 * math.exp(1.0), rel=0.02)
    assert "parameters uniform" in learned.condition


@pytest.mark.parametrize(
    ("box", "horizon_s", "step_s", "message"),
    [
        (Box.around({"angle": 0.4, "rate": 0.0}, radius={}), 1.0, 0.1, "width"),
        (Box.around({"angle": 0.4}, radius={"angle": 0.1}), 1.0, 0.1, "name the states"),
        (_SET, 1.0, 0.3, "whole steps"),
        (_SET, -1.0, 0.1, "horizon_s > 0"),
    ],
)
def test_unusable_input_is_named(box: Box, horizon_s: float, step_s: float, message: str) -> None:
    method = LearnedExponential(pairs=10, seed=0, step_s=step_s, delta=1e-3)
    with pytest.raises(InputError, match=message):
        learn_discrepancy(_pendulum(), initial_set=box, horizon_s=horizon_s, method=method)


def test_a_run_that_escapes_is_named() -> None:
    x = ca.SX.sym("x")
    system = system_from_casadi(x, x**3, ("x",))
    method = LearnedExponential(pairs=10, seed=0, step_s=0.1, delta=1e-3)
    box = Box.around({"x": 5.0}, radius={"x": 1.0})
    with pytest.raises(InputError, match="finite"):
        learn_discrepancy(system, initial_set=box, horizon_s=2.0, method=method)
