"""The filter's steps are an extended Kalman filter's: filterpy, the C code and laws agree."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from localisation_cases import (
    WHEELBASE_M,
    beliefs,
    c_text,
    compiled_functions,
    functions,
    hall,
)
from numpy.typing import NDArray
from scipy import optimize, stats

from workbench.errors import InputError
from workbench.estimation.accepted_ranges import accepted_error
from workbench.estimation.lanes import Array, lanes
from workbench.estimation.localisation_filter import filter_functions
from workbench.estimation.localisation_states import HYPOTHESES, WINDOW

ALL = np.ones(7)
GATE = stats.chi2.ppf(0.999, 1)
NORTH = np.array([20.0, 26.0, 3.0])


def bicycle(m: NDArray[Any], acceleration: float, rate: float, h: float) -> NDArray[Any]:
    """One midpoint step, written out by hand."""
    x, y, heading, v, steering, scale, zero = m
    half_turn = 0.5 * h * v * np.tan(steering) / WHEELBASE_M
    middle_v, middle = v + 0.5 * h * acceleration, heading + half_turn
    turn = h * middle_v * np.tan(steering + 0.5 * h * rate) / WHEELBASE_M
    return np.array([
        x + h * middle_v * np.cos(middle), y + h * middle_v * np.sin(middle), heading + turn,
        v + h * acceleration, steering + h * rate, scale, zero,
    ])  # fmt: skip


def derivatives(m: Array, *arguments: float) -> Array:
    """By complex steps, exact to rounding."""
    return np.array([bicycle(m + s, *arguments).imag / 1e-30 for s in 1e-30j * np.eye(7)]).T


def walk_by_hand(m: Array, h: float) -> Array:
    q, way = hall().motion, abs(m[3]) * h
    turn = np.array([[math.cos(m[2]), -math.sin(m[2])], [math.sin(m[2]), math.cos(m[2])]])
    walk = np.diag([
        0.0, 0.0, q.heading_slip**2 * way, q.acceleration**2 * h, q.steering_rate**2 * h,
        q.scale_walk**2 * h, q.zero_walk_rad**2 * h,
    ])  # fmt: skip
    walk[:2, :2] = turn @ np.diag([q.forward_slip**2 * way, q.lateral_slip**2 * way]) @ turn.T
    return walk


def by_hand_row(m: Array, beacon: Array) -> tuple[float, Array]:
    """Range and its derivatives, from the geometry."""
    a, c, s = hall().antenna, math.cos(m[2]), math.sin(m[2])
    dx = m[0] + c * a.forward_m - s * a.left_m - beacon[0]
    dy = m[1] + s * a.forward_m + c * a.left_m - beacon[1]
    d = math.sqrt(dx * dx + dy * dy + (a.height_m - beacon[2]) ** 2)
    turned = dx * (-s * a.forward_m - c * a.left_m) + dy * (c * a.forward_m - s * a.left_m)
    return d, np.array([[dx / d, dy / d, turned / d, 0, 0, 0, 0]])


def test_filterpy_says_the_same_of_every_step() -> None:
    rng = np.random.default_rng(5)
    error_m, deviation_m = accepted_error(hall().ranges)
    for mean, covariance in zip(*beliefs(rng, 20), strict=True):
        ekf = ExtendedKalmanFilter(dim_x=7, dim_z=1)
        ekf.x, ekf.P = mean.reshape(7, 1).copy(), covariance.copy()
        commands, h = (0.7, -0.1), 1.0 / 30.0
        step = derivatives(mean, *commands, h)
        half = 0.5 * (np.eye(7) + step)
        ekf.F, ekf.Q = step, half @ walk_by_hand(mean, h) @ half.T
        # filterpy moves a linear mean; the bicycle's own step takes its place.
        ekf.predict()
        ekf.x = bicycle(mean, *commands, h).reshape(7, 1)
        ours = functions().predict(mean, covariance, commands, h, 0)
        assert np.allclose(np.array(ours[0]), ekf.x, rtol=0, atol=1e-12)
        assert np.allclose(np.array(ours[1]), ekf.P, rtol=0, atol=1e-12)

        ekf.x, ekf.P = np.array(ours[0]), np.array(ours[1])
        near = by_hand_row(ekf.x[:, 0], NORTH)[0] + 0.05
        kinds: list[tuple[float, float, Any, Any, Any]] = [
            (near, deviation_m**2, lambda x: np.array([[by_hand_row(x[:, 0], NORTH)[0] + error_m]]),
             lambda x: by_hand_row(x[:, 0], NORTH)[1],
             lambda m, P, z: functions().range_update(m, P, z, NORTH, ALL)),
            (1.4, hall().reports.speed_mps**2, lambda x: x[3:4] * (1 + x[5:6]),
             lambda x: np.array([[0, 0, 0, 1 + x[5, 0], 0, x[3, 0], 0]]),
             lambda m, P, z: functions().report_speed(m, P, z, ALL)),
            (0.03, hall().reports.steering_rad**2, lambda x: x[4:5] + x[6:7],
             lambda x: np.array([[0, 0, 0, 0, 1, 0, 1]]),
             lambda m, P, z: functions().report_steering(m, P, z, ALL)),
        ]  # fmt: skip
        for value, noise, expected, row, update in kinds:
            found = update(ekf.x[:, 0], ekf.P, value)
            ekf.update(np.array([[value]]), row, expected, R=noise)
            assert np.allclose(np.array(found[0]), ekf.x, rtol=0, atol=1e-11)
            assert np.allclose(np.array(found[1]), ekf.P, rtol=0, atol=1e-11)


def test_compiled_code_gives_the_same_bits_without_a_heap() -> None:
    rng, n = np.random.default_rng(6), 50
    mean, covariance = beliefs(rng, n)
    learning = (rng.random((n, 7)) < 0.7).astype(float)
    beacon = np.array([[b.x_m, b.y_m, b.height_m] for b in hall().beacons])[rng.integers(0, 6, n)]
    ranges = np.linalg.norm(mean[:, :2] - beacon[:, :2], axis=1) + rng.normal(0, 1.0, n)
    places = np.array([[b.x_m, b.y_m, b.height_m] for b in hall().beacons] * 6)
    many = np.repeat(mean, HYPOTHESES, axis=0).reshape(n, HYPOTHESES, 7)
    many[:, :, 2] += rng.uniform(-9, 9, (n, HYPOTHESES))
    cases = [
        (mean, covariance, rng.normal(0, 1, (n, 2)), rng.uniform(0, 0.05, n), rng.random(n) < 0.5),
        (mean, covariance, rng.normal(1, 1, n), learning),
        (mean, covariance, rng.normal(0, 0.1, n), learning),
        (mean, covariance, ranges, beacon, learning),
        (np.tile(places, (n, 1, 1)), rng.uniform(5, 30, (n, WINDOW)), np.ones((n, WINDOW))),
        (many, np.repeat(covariance, HYPOTHESES, axis=0), rng.normal(0, 5, (n, HYPOTHESES))),
    ]  # fmt: skip
    pairs = zip(functions().all(), compiled_functions().all(), cases, strict=True)
    for ours, built, case in pairs:
        for a, b in zip(lanes(ours)(*case), lanes(built)(*case), strict=True):
            assert np.isfinite(a).all(), ours.name()
            assert a.tobytes() == b.tobytes(), ours.name()
    text = c_text(functions().all())
    assert not any(call in text for call in ("malloc", "calloc", "alloca", "printf"))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), off=st.floats(-3.0, 3.0), mask=st.integers(0, 127))
def test_what_the_gate_refuses_and_what_is_not_learned_stays(
    seed: int, off: float, mask: int
) -> None:
    means, covariances = beliefs(np.random.default_rng(seed), 1)
    mean, covariance = means[0], covariances[0]
    beacon, learning = (
        np.array([0.0, 25.0, 2.5]),
        np.array([float(mask >> k & 1) for k in range(7)]),
    )
    expected, _ = by_hand_row(mean, beacon)
    m, P, surprise, accepted, _ = (
        np.array(part).squeeze()
        for part in functions().range_update(mean, covariance, expected + off, beacon, learning)
    )
    assert bool(accepted) == (surprise <= GATE)
    fixed = learning == 0.0 if accepted else np.ones(7, dtype=bool)
    assert np.array_equal(m[fixed], mean[fixed])
    assert np.allclose(P.diagonal()[fixed], covariance.diagonal()[fixed], rtol=1e-12)
    assert np.linalg.eigvalsh(P).min() > -1e-12
    if accepted and learning.all():
        assert (P.diagonal() <= covariance.diagonal() * (1 + 1e-12)).all()


def test_the_gate_lets_the_stated_share_pass() -> None:
    rng, n = np.random.default_rng(7), 40_000
    mean, covariance = (np.repeat(part, n, axis=0) for part in beliefs(rng, 1))
    beacon = np.array([40.0, 25.0, 2.5])
    error_m, deviation_m = accepted_error(hall().ranges)
    truth, row = by_hand_row(mean[0], beacon)
    spread = math.sqrt((row @ covariance[0] @ row.T).item() + deviation_m**2)
    found = lanes(compiled_functions().range_update)(
        mean, covariance, truth + error_m + rng.normal(0, spread, n), np.tile(beacon, (n, 1)),
        np.ones((n, 7)),
    )  # fmt: skip
    refused = int((found[3] < 0.5).sum())
    assert stats.binom.cdf(refused, n, 0.001) > 1e-3
    assert stats.binom.sf(refused - 1, n, 0.001) > 1e-3


def test_error_of_accepted_ranges_is_that_of_drawn_ones() -> None:
    rng, n, ranges = np.random.default_rng(8), 4_000_000, hall().ranges
    error_m, deviation_m = accepted_error(ranges)
    e = rng.normal(0, ranges.deviation_m, n)
    e += (rng.random(n) < ranges.stray_share) * rng.exponential(ranges.stray_m, n)
    gate = math.sqrt(GATE) * deviation_m
    passed, moved = e[np.abs(e) <= gate], 0.02
    # An expectation that is `moved` too far, and one too near by as much.
    up, down = e[np.abs(e - moved) <= gate].mean(), e[np.abs(e + moved) <= gate].mean()
    kappa = (up - down) / (2 * moved)
    assert abs(passed.mean() - error_m) < 4 * deviation_m / math.sqrt(n)
    assert passed.std() / (1 - kappa) == pytest.approx(deviation_m, rel=3e-3)
    assert kappa > 0.02, "without it the deviation would be too small by a part that NEES shows"


def test_place_of_a_standing_antenna_is_the_least_squares_one() -> None:
    rng, site = np.random.default_rng(9), hall()
    places = np.array([[b.x_m, b.y_m, b.height_m] for b in site.beacons] * 6)
    for _ in range(20):
        truth = np.append(rng.uniform([5, 5], [35, 20]), site.antenna.height_m)
        ranges = np.linalg.norm(places - truth, axis=1) + rng.normal(0, 0.1, WINDOW)
        stray = rng.random(WINDOW) < 0.15
        ranges[stray] += rng.uniform(1.0, 8.0, stray.sum())
        received = rng.random(WINDOW) < 0.7
        place, covariance = functions().locate(places.T, ranges, received)
        found = np.append(np.array(place)[:, 0], site.antenna.height_m)
        kept = received & (np.abs(np.linalg.norm(places - found, axis=1) - ranges) <= 0.3)

        def residuals(at: Array, kept: Array = kept, ranges: Array = ranges) -> Array:
            antenna = np.append(at, site.antenna.height_m)
            return np.asarray(np.linalg.norm(places[kept] - antenna, axis=1) - ranges[kept])

        other = optimize.least_squares(residuals, truth[:2])
        assert np.allclose(found[:2], other.x, rtol=0, atol=1e-6)
        slope = np.asarray(other.jac)
        assert np.allclose(np.array(covariance), 0.1**2 * np.linalg.inv(slope.T @ slope), rtol=1e-4)
        deviation = math.sqrt(np.trace(np.array(covariance)))
        assert np.linalg.norm(found - truth) < 5 * deviation


def test_collapsed_hypotheses_have_the_moments_of_their_mixture() -> None:
    rng = np.random.default_rng(10)
    means, covariances = beliefs(rng, HYPOTHESES)
    means[:, 2] = 0.3 + 0.1 * rng.normal(0, 1, HYPOTHESES)
    logs = rng.normal(0, 1, HYPOTHESES)
    weights = np.exp(logs) / np.exp(logs).sum()
    mean = weights @ means
    off = means - mean
    spread = np.einsum("k,kij->ij", weights, covariances) + (weights * off.T) @ off
    turns = math.tau * rng.integers(-2, 3, HYPOTHESES)
    means[:, 2] += turns
    stacked = np.concatenate(list(covariances), axis=1)
    m, P = (np.array(part) for part in functions().collapse(means.T, stacked, logs))
    m[2] -= turns[np.argmax(logs)]
    assert np.allclose(m[:, 0], mean, rtol=0, atol=1e-12)
    assert np.allclose(P, spread, rtol=0, atol=1e-12)


def test_braking_ends_at_a_standstill_and_keeps_its_uncertainty() -> None:
    mean = np.array([10.0, 10.0, 0.2, 0.01, 0.0, 0.0, 0.0])
    covariance = np.diag([0.01, 0.01, 0.01, 4e-4, 1e-5, 1e-4, 1e-5])
    m, P = functions().predict(mean, covariance, [-2.0, 0.0], 1 / 30, 0)
    assert float(m[3]) == pytest.approx(0.0, abs=1e-15)
    assert float(P[3, 3]) >= 4e-4


@pytest.mark.parametrize("wheelbase", [0.0, -1.0, math.nan, math.inf])
def test_a_wheelbase_that_cannot_be_is_refused(wheelbase: float) -> None:
    with pytest.raises(InputError, match="wheelbase_m"):
        filter_functions(hall(), wheelbase_m=wheelbase)


def test_lanes_refuse_arrays_of_other_sizes() -> None:
    x = ca.SX.sym("x", 2)
    with pytest.raises(ValueError, match="expected 3 x 2 numbers"):
        lanes(ca.Function("double", [x], [2 * x]))(np.zeros((3, 3)))
