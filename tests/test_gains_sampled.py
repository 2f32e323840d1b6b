"""The held loop's exact matrix is the matrix exponential's, and loses stability where runs do."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sampled_runs import Plain, sampled_runs
from scipy.linalg import expm

from workbench.controllers.sampling import IntegralStep, Jitter, Sampling, SentCommand
from workbench.errors import InputError
from workbench.models.gains.held import (
    HeldLoop,
    Timing,
    characteristic_of,
    control_points,
    curve,
    floats,
    schur_stable,
    spectral_radius,
)
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.over_speed import over_speed
from workbench.models.gains.spectral import (
    critical_delay,
    matrices,
    radius,
    sampled_map,
    steady_sampling,
)
from workbench.models.vehicle import gem_e2

LOOP = LateralLoop.of(gem_e2())
GAIN = st.floats(-2.0, 3.0, width=16)
LOOPS = st.builds(
    LateralLoop, st.just(1.75), st.floats(-3.0, 6.0, width=16), st.floats(0.0, 6.0, width=16),
    GAIN, st.one_of(st.just(0.0), GAIN), GAIN,
)  # fmt: skip
PERIODS, DELAYS = st.floats(0.015625, 0.5, width=16), st.floats(0.0, 2.5, width=16)


def stepped(loop: LateralLoop, period: float, delay: float, z: np.ndarray) -> np.ndarray:
    """One sample later, by matrix exponentials of each stretch with one command."""
    v, base = loop.speed_mps, loop.wheelbase_m
    A = np.zeros((4, 4))
    A[0, 1], A[1, 2], A[2, 3] = v, v / base, 1.0
    integral = 1 if loop.integral else 0
    count = len(z) - 3 - integral
    ahead = z[0] + loop.look_ahead_m * z[1]
    ahead_rate = v * z[1] + loop.look_ahead_m * v * z[2] / base
    summed = z[3] if integral else 0.0
    command = -(loop.proportional * ahead + loop.integral * summed + loop.derivative * ahead_rate)
    sent = [command, *z[3 + integral :]]
    x, now = z[:3], 0.0
    for back in range(count, -1, -1):
        until = period if back == 0 else np.clip(delay - (back - 1) * period, 0.0, period)
        begin = np.clip(delay - back * period, 0.0, period)
        assert begin == pytest.approx(now, abs=1e-12)
        x = (expm(A * (until - begin)) @ np.append(x, sent[back]))[:3]
        now = until
    tail = [z[3] + period * ahead] if integral else []
    return np.array([*x, *tail, *sent[:count]])


@settings(max_examples=80, deadline=None)
@given(LOOPS, PERIODS, DELAYS, st.integers(0, 1000))
def test_exact_matrix_is_the_exponentials(
    loop: LateralLoop, period: float, periods: float, seed: int
) -> None:
    delay = period * periods
    timing = Timing.of(steady_sampling(period, delay))
    held = HeldLoop.of(loop, timing)
    F = floats(held.steady(timing))
    assert F.shape == (held.size, held.size) == (len(held.names),) * 2
    z = np.random.default_rng(seed).normal(size=held.size)
    expected = stepped(loop, period, delay, z)
    np.testing.assert_allclose(F @ z, expected, atol=1e-9 * (1.0 + np.abs(F).max()) * held.size)


@settings(max_examples=60, deadline=None)
@given(LOOPS, PERIODS, DELAYS)
def test_matrices_of_many_points_are_the_exact_ones(
    loop: LateralLoop, period: float, periods: float
) -> None:
    delay = period * periods
    timing = Timing.of(steady_sampling(period, delay))
    held = HeldLoop.of(loop, timing)
    exact = held.steady(timing)
    values = {name: np.array([float(value)]) for name, value in loop.exact().items()}
    acting = [np.array([float(timing.acting(k)[0])]) for k in range(held.commands)]
    F = matrices(values, np.array([period]), np.array([period]), acting)
    found = float(radius(F, integral=bool(loop.integral))[0])
    # Eigenvalues that meet are known only to a root of the rounding.
    assert found == pytest.approx(spectral_radius(exact), rel=1e-3, abs=1e-3)


@settings(max_examples=60, deadline=None)
@given(LOOPS, PERIODS, DELAYS)
def test_schur_and_cohn_agree_with_eigenvalues(
    loop: LateralLoop, period: float, periods: float
) -> None:
    timing = Timing.of(steady_sampling(period, period * periods))
    F = HeldLoop.of(loop, timing).steady(timing)
    found = spectral_radius(F)
    if abs(found - 1.0) > 1e-2:
        assert schur_stable(F) == (found < 1.0)
    np.testing.assert_allclose(
        [float(c) for c in characteristic_of(F)], np.poly(floats(F)), rtol=1e-6, atol=1e-6
    )


def test_without_delay_it_is_python_controls_zero_order_hold() -> None:
    v, base, period = 2.8, 1.75, 0.1
    A = np.array([[0, v, 0], [0, 0, v / base], [0, 0, 0]])
    plant = control.ss(A, [[0], [0], [1]], np.eye(3), np.zeros((3, 1)))
    held = control.sample_system(plant, period, "zoh")
    loop = dataclasses.replace(LOOP, integral=0.0)
    kp, kd, ahead = loop.proportional, loop.derivative, loop.look_ahead_m
    law = np.array([[-kp, -(kp * ahead + kd * v), -kd * ahead * v / base]])
    timing = Timing.of(steady_sampling(period, 0.0))
    F = floats(HeldLoop.of(loop, timing).steady(timing))
    np.testing.assert_allclose(F, np.asarray(held.A) + np.asarray(held.B) @ law, atol=1e-12)


def test_fast_samples_decay_as_the_continuous_loop() -> None:
    timing = Timing.of(steady_sampling(1e-3, 0.0))
    rate = np.log(spectral_radius(HeldLoop.of(LOOP, timing).steady(timing))) / 1e-3
    assert rate == pytest.approx(LOOP.poles()[0].real, rel=1e-3)


@pytest.mark.parametrize("speed", [1.0, 2.8, 5.0])
def test_critical_delay_is_the_delay_margin_less_half_a_period(speed: float) -> None:
    loop = LOOP.at({"speed": speed})
    found = critical_delay(loop, 0.05, 0.6)
    assert found.stable_s is not None
    assert found.unstable_s is not None
    assert 0.0 < found.unstable_s - found.stable_s < 2e-5
    margin = over_speed(loop, speed, speed + 1.0, points=2).points[0].delay_s
    assert found.unstable_s == pytest.approx(margin - 0.025, rel=0.01)


def test_critical_delay_says_what_it_did_not_find() -> None:
    assert critical_delay(LOOP, 0.02, 0.1).unstable_s is None
    assert critical_delay(LOOP, 0.02, 9.0).stable_s == pytest.approx(0.24)
    assert critical_delay(LOOP.at({"look-ahead": 0.0}), 0.02, 0.5).stable_s is None


@pytest.mark.parametrize(("factor", "grows"), [(0.85, False), (1.15, True)])
def test_runs_of_the_nonlinear_loop_change_at_the_critical_delay(
    factor: float, grows: bool
) -> None:
    period = 0.1
    critical = critical_delay(LOOP, period, 0.5)
    assert critical.stable_s is not None
    delay = factor * critical.stable_s
    sampling = steady_sampling(period, delay)
    start = np.zeros((1, 7))
    start[0, 1], start[0, 3] = 1e-5, 2.8
    times = np.arange(0.0, 24.0, 0.25)
    sent = (SentCommand.exactly(0.0, 0.0),) * sampling.commands_sent
    rows = sampled_runs(Plain(), sampling, sent, states=start, times=times, seed=1)[0]
    # The loop's slow pole decays either way: the swing shows in the steering.
    early, late = (np.abs(rows[a:b, 2]).max() for a, b in ((24, 48), (72, 96)))
    assert bool(late > early) is grows


def test_maps_agree_with_single_matrices() -> None:
    found = sampled_map(
        LOOP, (1 / 30, 0.05), ("speed", (0.5, 5.0)), ("delay", (0.0, 0.3)), points=5
    )
    for i, speed in enumerate(found.x):
        for j, delay in enumerate(found.y):
            timing = Timing.of(steady_sampling(1 / 30, float(delay)))
            exact = HeldLoop.of(LOOP.at({"speed": float(speed)}), timing).steady(timing)
            assert found.radius[j, i] == pytest.approx(spectral_radius(exact), abs=1e-6)
    assert len(found.rows()) == 25
    slow = sampled_map(LOOP, (0.1, 0.05), ("period", (0.1, 1.0)), ("delay", (0.0, 0.3)), points=4)
    timing = Timing.of(steady_sampling(float(slow.x[2]), float(slow.y[3])))
    exact = HeldLoop.of(LOOP, timing).steady(timing)
    assert slow.radius[3, 2] == pytest.approx(spectral_radius(exact), abs=1e-6)


@settings(max_examples=100, deadline=None)
@given(st.fractions(0, 1, max_denominator=1000), st.fractions(0, 1, max_denominator=1000),
       st.fractions(0, 1, max_denominator=1000))  # fmt: skip
def test_control_points_surround_the_curve(a: Fraction, width: Fraction, share: Fraction) -> None:
    b = a + width
    points, t = control_points((a, b)), a + share * width
    if width == 0:
        assert points == (curve(a),)
        return
    weights = [
        (1 - share) ** 3, 3 * share * (1 - share) ** 2, 3 * share**2 * (1 - share), share**3
    ]  # fmt: skip
    for k in range(3):
        assert sum(w * p[k] for w, p in zip(weights, points, strict=True)) == curve(t)[k]


def test_timings_that_cannot_be_handled_are_refused_in_words() -> None:
    def sampling(period: float, measurement: tuple[float, float], late: float) -> Sampling:
        return Sampling(period, 0.0, Jitter.CLOCK, measurement, (late, late), IntegralStep.NOMINAL)

    timing = Timing.of(sampling(0.1, (0.0, 0.05), 0.0))
    with pytest.raises(InputError, match="one gap and one delay"):
        HeldLoop.of(LOOP, timing).steady(timing)
    with pytest.raises(InputError, match="at most 12 periods"):
        HeldLoop.of(LOOP, Timing.of(sampling(0.01, (0.0, 0.0), 0.5)))
    with pytest.raises(InputError, match="two different axes"):
        sampled_map(LOOP, (0.1, 0.0), ("kp", (0.0, 1.0)), ("kp", (0.0, 1.0)), points=3)
    with pytest.raises(InputError, match="at most 40 periods"):
        sampled_map(LOOP, (0.01, 0.0), ("kp", (0.0, 1.0)), ("delay", (0.0, 1.0)), points=3)
    with pytest.raises(InputError, match="periods > 0"):
        sampled_map(LOOP, (0.01, 0.0), ("kp", (0.0, 1.0)), ("period", (0.0, 1.0)), points=3)
