"""The benchmark loops and their initial sets are the published ones, number by number."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.models.benchmarks import (
    PATH_STATES,
    PLANE_STATES,
    all_benchmarks,
    b1,
    b1_brake,
    b1_small,
    b2,
    b2_path,
)

small = st.floats(-1.0, 1.0)


def b1_field(z: np.ndarray, reference_speed: float, speed_integral_gain: float) -> np.ndarray:
    """B1 written once more, straight from its description."""
    _, y, delta, v, theta, iv, ie = z
    e = y + 2 * np.sin(theta)
    theta_rate = v * np.tan(delta) / 1.75
    e_rate = v * np.sin(theta) + 2 * np.cos(theta) * theta_rate
    return np.array(
        [
            v * np.cos(theta),
            v * np.sin(theta),
            -(0.6 * e + 0.05 * ie + 1 * e_rate),
            1 * (reference_speed - v) + speed_integral_gain * iv,
            theta_rate,
            reference_speed - v,
            e,
        ]
    )


@settings(deadline=None)
@given(st.tuples(small, small, small, st.floats(-1.0, 5.0), small, small, small))
def test_b1_and_b1_brake_match_an_independent_field(state: tuple[float, ...]) -> None:
    for benchmark, reference_speed, gain in ((b1(), 2.8, 0.1), (b1_brake(), 0.0, 0.0)):
        ode = benchmark.system.ode
        values = ode.function()(state, ode.parameter_values(), []).full().ravel()
        expected = b1_field(np.array(state), reference_speed, gain)
        np.testing.assert_allclose(values, expected, rtol=1e-13, atol=1e-13)


def test_state_names_and_units() -> None:
    assert b1().system.ode.names == PLANE_STATES
    assert b2_path().system.ode.names == PATH_STATES
    units = tuple(signal.unit for signal in b1().system.ode.states)
    assert units == ("m", "m", "rad", "m/s", "rad", "m", "m s")


@pytest.mark.parametrize(
    ("benchmark_loop", "radius"),
    [
        (b1(), (0.2, 0.2, 0.02, 0.2, 0.05, 0.0, 0.0)),
        (b1_small(), (0.05, 0.05, 0.005, 0.05, 0.01, 0.0, 0.0)),
        (b2_path(), (0.2, 0.2, 0.02, 0.2, 0.05, 0.0, 0.0)),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_initial_sets(benchmark_loop: object, radius: tuple[float, ...]) -> None:
    box = benchmark_loop.initial_set  # type: ignore[attr-defined]
    assert box.center == pytest.approx((0.0, 0.3, 0.0, 2.5, 0.0, 0.0, 0.0), abs=1e-15)
    assert box.radius == pytest.approx(radius, abs=1e-15)


def test_names_are_distinct_and_sets_fit_their_systems() -> None:
    loops = all_benchmarks()
    assert len({loop.name for loop in loops}) == len(loops) == 7
    assert all(loop.initial_set.names == loop.system.ode.names for loop in loops)


def test_reference_motion_is_a_fixed_point_of_the_loop() -> None:
    for benchmark in (b1(), b2()):
        ode = benchmark.system.ode
        rates = ode.function()([5.0, 0, 0, 2.8, 0, 0, 0], ode.parameter_values(), [])
        np.testing.assert_array_equal(rates.full().ravel(), [2.8, 0, 0, 0, 0, 0, 0])


def test_arc_is_followed_with_the_steering_that_fits_it() -> None:
    ode = b2_path().system.ode
    steady = [1.0, 0, np.arctan(0.1 * 1.75), 2.8, 0, 0, 0]
    rates = ode.function()(steady, ode.parameter_values(), [0.1]).full().ravel()
    np.testing.assert_allclose(rates, [2.8, 0, 0, 0, 0, 0, 0], atol=1e-15)
