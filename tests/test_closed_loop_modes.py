"""VehicleBrake stands from the closed-form time on; ReferenceZeroBrake never quite stops."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from workbench.controllers import (
    PathFollowing,
    ReferenceZeroBrake,
    SpeedPid,
    SteeringPid,
    VehicleBrake,
)
from workbench.errors import InputError
from workbench.models import ClosedLoop, Disturbance, EstimationError, PlaneBicycle, System
from workbench.models.benchmarks import b1_brake

BRAKE = VehicleBrake(2.0, 3.0, delay_s=0.1, build_up_s=0.2, stop_speed_mps=0.2)


def controller(speed_integral: float) -> PathFollowing:
    return PathFollowing(
        SteeringPid(0.6, 0.05, 1.0, 2.0, rate_limit_radps=0.2),
        SpeedPid(1.0, speed_integral, accel_min_mps2=-2.0, accel_max_mps2=1.0),
    )


def simulate(
    system: System, start: dict[str, float], times: np.ndarray, w: tuple[float, ...] = ()
) -> dict[str, np.ndarray]:
    ode = system.ode
    field, p = ode.function(), ode.parameter_values()
    solution = solve_ivp(
        lambda _, x: field(x, p, w).full().ravel(),
        (times[0], times[-1]),
        [start.get(name, 0.0) for name in ode.names],
        t_eval=times,
        rtol=1e-10,
        atol=1e-12,
        max_step=0.02,
    )
    return dict(zip(ode.names, solution.y, strict=True))


def brake_loop(mode: VehicleBrake = BRAKE) -> ClosedLoop:
    return ClosedLoop(PlaneBicycle(1.75, 0.6), controller(0.1), mode)


@settings(max_examples=10, deadline=None)
@given(st.floats(0.5, 4.0), st.floats(2.0, 3.0))
def test_vehicle_brake_stands_exactly_from_the_closed_form_time_on(
    speed: float, deceleration: float
) -> None:
    stop = BRAKE.standstill_time_s(speed, deceleration)
    assert stop == pytest.approx(0.1 + 0.2 / 2 + speed / deceleration)
    times = np.array([0.0, stop - 1e-3, stop + 1e-6, stop + 0.5, stop + 3.0])
    run = simulate(brake_loop(), {"speed": speed, "y": 0.3}, times, (deceleration,))
    assert run["speed"][1] == pytest.approx(1e-3 * deceleration, abs=1e-6)
    assert run["speed"][2] == pytest.approx(-1e-6 * deceleration, abs=1e-6)
    for name in ("x", "y", "heading", "steering", "offset_integral"):
        assert run[name][2:] == pytest.approx(run[name][4], abs=1e-6)


@settings(deadline=None)
@given(st.floats(-10.0, 0.0), st.floats(-1.0, 1.0), st.floats(0.0, 10.0))
def test_at_standstill_nothing_moves_but_clock_and_raw_speed(
    raw_speed: float, other: float, clock: float
) -> None:
    ode = brake_loop().ode
    state = [0.0, other, other, raw_speed, other, other, other, clock]
    rates = ode.function()(state, ode.parameter_values(), [2.5]).full().ravel()
    moving = dict(zip(ode.names, rates, strict=True))
    assert moving.pop("brake_clock") == 1.0
    assert -2.5 <= moving.pop("speed") <= 0.0
    assert set(moving.values()) == {0.0}


def test_stopping_distance_on_a_straight_line_has_its_closed_form() -> None:
    run = simulate(brake_loop(), {"speed": 2.8}, np.array([0.0, 5.0]), (2.0,))
    # Speed loses d t^2 / (2 b) during build-up b, then d per second.
    after_build_up = 2.8 - 2.0 * 0.2 / 2
    distance = 2.8 * 0.3 - 2.0 * 0.2**2 / 6 + after_build_up**2 / (2 * 2.0)
    assert run["x"][-1] == pytest.approx(distance, abs=1e-6)


def test_slow_car_stops_within_the_build_up() -> None:
    stop = BRAKE.standstill_time_s(0.1, 2.0)
    assert stop == pytest.approx(0.1 + math.sqrt(2 * 0.1 * 0.2 / 2.0))
    run = simulate(brake_loop(), {"speed": 0.1}, np.array([0.0, stop - 1e-4, stop + 1e-4]), (2.0,))
    assert run["speed"][1] > 0.0 > run["speed"][2]
    assert BRAKE.standstill_time_s(0.0, 2.0) == 0.0


def test_steering_freezes_below_the_stop_speed_and_fades_continuously() -> None:
    ode = brake_loop().ode
    field, p = ode.function(), ode.parameter_values()

    def steering_rates(speed: float) -> tuple[float, float]:
        rates = field([0, 0.3, 0, speed, 0, 0, 0, 5.0], p, [2.0]).full().ravel()
        return float(rates[2]), float(rates[6])

    assert steering_rates(0.2) == (0.0, 0.0)
    assert steering_rates(-5.0) == (0.0, 0.0)
    assert steering_rates(0.3) == pytest.approx((-0.5 * 0.18, 0.5 * 0.3))
    assert steering_rates(0.4) == pytest.approx((-0.18, 0.3))
    assert steering_rates(2.0) == pytest.approx((-0.18, 0.3))


def test_standstill_lasts_under_disturbance_and_estimation_error() -> None:
    loop = ClosedLoop(
        PlaneBicycle(1.75, 0.6),
        controller(0.1),
        BRAKE,
        estimation_error=EstimationError(speed_mps=0.05),
        disturbance=Disturbance(acceleration_mps2=0.5),
    )
    bounds = {w.name: w for w in loop.ode.disturbances}
    worst = tuple(
        {"brake_deceleration": 2.0, "speed_estimate_error": 0.05, "acceleration_disturbance": 0.5}[
            name
        ]
        for name in bounds
    )
    run = simulate(loop, {"speed": 2.0, "y": 0.3}, np.array([0.0, 2.0, 6.0]), worst)
    assert run["speed"][1] < 0.0
    assert run["x"][1] == run["x"][2]
    with pytest.raises(InputError, match="standstill lasts only if"):
        ClosedLoop(
            PlaneBicycle(1.75, 0.6),
            controller(0.1),
            BRAKE,
            disturbance=Disturbance(acceleration_mps2=2.0),
        )


def test_reference_zero_brake_never_quite_stops() -> None:
    times = np.linspace(0.0, 8.0, 81)
    run = simulate(b1_brake().system, {"speed": 2.5}, times)
    np.testing.assert_allclose(run["speed"], 2.5 * np.exp(-times), rtol=1e-7)
    assert (run["speed"] > 0.0).all()


def test_reference_zero_brake_with_an_integral_reverses() -> None:
    loop = ClosedLoop(PlaneBicycle(1.75, 0.6), controller(0.1), ReferenceZeroBrake())
    run = simulate(loop, {"speed": 2.5}, np.linspace(0.0, 20.0, 201))
    assert run["speed"].min() < -0.1
    assert run["x"].max() - run["x"][-1] > 0.5


def test_speed_integral_rests_while_the_vehicle_brakes() -> None:
    run = simulate(brake_loop(), {"speed": 2.0}, np.array([0.0, 1.0, 3.0]), (2.5,))
    assert (run["speed_integral"] == 0.0).all()


def test_without_delay_and_build_up_there_is_no_clock() -> None:
    mode = VehicleBrake(2.0, 3.0, delay_s=0.0, build_up_s=0.0, stop_speed_mps=0.2)
    assert "brake_clock" not in brake_loop(mode).ode.names
    assert brake_loop().ode.names[-1] == "brake_clock"
    assert mode.standstill_time_s(3.0, 2.0) == 1.5


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((-2.0, 3.0, 0.1, 0.2, 0.2), "0 < deceleration_min"),
        ((3.0, 2.0, 0.1, 0.2, 0.2), "deceleration_min_mps2 <= deceleration_max_mps2"),
        ((2.0, 3.0, 0.1, 0.0, 0.2), "build_up_s > 0"),
        ((2.0, 3.0, -0.1, 0.2, 0.2), "delay_s >= 0"),
        ((2.0, 3.0, 0.1, 0.2, 0.0), "stop_speed_mps > 0"),
        ((2.0, math.nan, 0.1, 0.2, 0.2), "finite"),
    ],
)
def test_impossible_brakes_are_refused(numbers: tuple[float, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        VehicleBrake(*numbers)
