"""Corners decide stability without delay, and counted roots agree with eigenvalues with delay."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.ranged_loop import (
    Car,
    Ranges,
    crossings,
    everywhere_stable_without_delay,
    exact_coefficients,
    stable_without_delay,
)
from workbench.models.vehicle import gem_e2
from workbench.reach.robustness.unstable import _right_roots, proved_unstable

Array = NDArray[np.float64]
LOOP = LateralLoop.of(gem_e2())
GAIN = st.floats(0.0625, 4.0, width=16)
LOOPS = st.builds(
    LateralLoop, st.just(1.75), st.floats(0.5, 6.0, width=16), st.floats(0.25, 6.0, width=16),
    GAIN, st.one_of(st.just(0.0), st.floats(-0.25, 2.0, width=16)), GAIN,
)  # fmt: skip


@st.composite
def ranges_of(draw: st.DrawFn) -> Ranges:
    base, scale = draw(st.floats(1.0, 2.0, width=16)), draw(st.floats(0.5, 1.25, width=16))
    wider = st.floats(0.0, 0.75, width=16)
    return Ranges((base, base + draw(wider)), (scale, scale + draw(wider)), (0.0, 0.0))


def matrices(loop: LateralLoop, car: Car) -> tuple[Array, Array]:
    """x' = A x + B x(t - delay), written down from the equations: offset, heading, steering, I."""
    known, true = loop.speed_mps, car.speed_scale * loop.speed_mps
    ahead, kp, ki, kd = loop.look_ahead_m, loop.proportional, loop.integral, loop.derivative
    A, B = np.zeros((4, 4)), np.zeros((4, 4))
    A[0, 1], A[1, 2] = true, true / car.wheelbase_m
    A[3, :2] = 1.0, ahead
    B[2] = -kp, -(kp * ahead + kd * known), -kd * ahead * known / loop.wheelbase_m, -ki
    keep = 4 if ki else 3
    return A[:keep, :keep], B[:keep, :keep]


def rightmost(loop: LateralLoop, car: Car, points: int = 24) -> float:
    """Largest real part of the roots, by Chebyshev collocation of the delay equation."""
    A, B = matrices(loop, car)
    if car.delay_s == 0.0:
        return float(np.linalg.eigvals(A + B).real.max())
    k = np.arange(points + 1)
    x = np.cos(np.pi * k / points)
    weight = np.where((k == 0) | (k == points), 2.0, 1.0) * (-1.0) ** k
    gap = x[:, None] - x[None, :] + np.eye(points + 1)
    D = weight[:, None] / weight[None, :] / gap
    D -= np.diag(D.sum(axis=1))
    n = len(A)
    whole = np.kron(D * 2.0 / car.delay_s, np.eye(n))
    whole[:n] = 0.0
    whole[:n, :n], whole[:n, -n:] = A, B
    return float(np.linalg.eigvals(whole).real.max())


@settings(max_examples=60, deadline=None)
@given(LOOPS, st.floats(1.0, 2.5), st.floats(0.5, 1.5))
def test_the_polynomial_is_that_of_the_state_space(
    loop: LateralLoop, base: float, scale: float
) -> None:
    car = Car(base, scale, 0.0)
    exact = [1.0, *(float(c) for c in exact_coefficients(loop, car))]
    A, B = matrices(loop, car)
    found = np.poly(A + B)
    assert np.allclose(found, exact[: len(found)], rtol=1e-9, atol=1e-9)


def test_the_nominal_car_has_the_polynomial_of_the_loop() -> None:
    car = Car(LOOP.wheelbase_m, 1.0, 0.0)
    base = LOOP.exact()["wheelbase_m"]
    assert exact_coefficients(LOOP, car) == tuple(c / base for c in LOOP.polynomial()[1:])


@settings(max_examples=60, deadline=None)
@given(LOOPS, ranges_of())
def test_corners_decide_without_delay(loop: LateralLoop, ranges: Ranges) -> None:
    rng = np.random.default_rng(0)
    inside = [Car(*(float(rng.uniform(*end)) for end in ranges.ends)) for _ in range(20)]
    worst = [rightmost(loop, car) for car in (*inside, *ranges.corners())]
    if everywhere_stable_without_delay(loop, ranges):
        assert max(worst) < 1e-9
    else:
        assert max(worst[len(inside) :]) > -1e-9


@settings(max_examples=60, deadline=None)
@given(LOOPS, st.floats(1.2, 2.4), st.floats(0.6, 1.4), st.floats(0.01, 2.0))
def test_counted_roots_agree_with_eigenvalues(
    loop: LateralLoop, base: float, scale: float, delay: float
) -> None:
    car = Car(base, scale, delay)
    found = rightmost(loop, car)
    if proved_unstable(loop, car):
        assert found > -1e-6
    elif found > 1e-3:
        # A root that rests on the axis without delay is the one case without an answer.
        assert abs(rightmost(loop, dataclasses.replace(car, delay_s=0.0))) < 1e-6


def test_the_delay_that_the_nominal_car_bears() -> None:
    ((low, high, direction),) = crossings(LOOP, Car(1.75, 1.0, 0.0))
    assert direction == 1
    assert float(low) ** 0.5 == pytest.approx(3.485259894, abs=1e-8)
    assert float(high - low) < 1e-20
    assert not proved_unstable(LOOP, Car(1.75, 1.0, 0.29198))
    assert rightmost(LOOP, Car(1.75, 1.0, 0.29198)) < 0.0
    assert proved_unstable(LOOP, Car(1.75, 1.0, 0.29200))
    assert rightmost(LOOP, Car(1.75, 1.0, 0.29200)) > 0.0


def test_without_delay_the_conditions_decide() -> None:
    bad = LOOP.at({"kp": 5.0, "kd": 0.1})
    assert proved_unstable(bad, Car(1.75, 1.0, 0.0))
    assert not stable_without_delay(bad, Car(1.75, 1.0, 0.0))
    assert not proved_unstable(LOOP, Car(1.75, 1.0, 0.0))


@settings(max_examples=60, deadline=None)
@given(LOOPS, st.floats(1.0, 2.5), st.floats(0.5, 1.5))
def test_sign_changes_count_roots_on_the_right(
    loop: LateralLoop, base: float, scale: float
) -> None:
    car = Car(base, scale, 0.0)
    count = _right_roots(exact_coefficients(loop, car))
    A, B = matrices(loop, car)
    real = np.linalg.eigvals(A + B).real
    if count is not None and np.abs(real).min() > 1e-7:
        assert count == int((real > 0.0).sum())


def test_sizes_keep_the_middle_and_stay_possible() -> None:
    ranges = Ranges((1.7, 1.8), (0.9, 1.1), (0.0, 0.1))
    assert ranges.at_size(1.0) is ranges
    assert ranges.at_size(0.0).corners() == (ranges.middle,)
    large = ranges.at_size(100.0)
    assert large.delay_s[0] == 0.0
    assert large.wheelbase_m[0] > 0.0
    assert large.speed_scale[0] > 0.0
    assert large.delay_s[1] == pytest.approx(5.05)


@pytest.mark.parametrize(
    "ends",
    [((1.8, 1.7), (1.0, 1.0), (0.0, 0.0)), ((0.0, 1.7), (1.0, 1.0), (0.0, 0.0)),
     ((1.7, 1.8), (-1.0, 1.0), (0.0, 0.0)), ((1.7, 1.8), (1.0, 1.0), (-0.1, 0.0)),
     ((1.7, 1.8), (1.0, 1.0), (0.0, float("inf")))],
)  # fmt: skip
def test_ranges_that_no_car_has_are_refused(
    ends: tuple[tuple[float, float], tuple[float, float], tuple[float, float]],
) -> None:
    with pytest.raises(InputError, match="LOW <= HIGH"):
        Ranges(*ends)
