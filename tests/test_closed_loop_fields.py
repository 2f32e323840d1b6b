"""The closed loop's field is the written law: deviation rate, limits, back-calculation, n and w."""

import math
from collections.abc import Mapping

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.controllers import PathFollowing, SpeedPid, SteeringPid, Track
from workbench.errors import InputError
from workbench.models import (
    ClosedLoop,
    Disturbance,
    EstimationError,
    Ode,
    PathBicycle,
    PathFrame,
    PlaneBicycle,
    Ranged,
    System,
)
from workbench.models.benchmarks import b1, b2, b2_noise, b2_path, b2_slow

GAINS = {"kp": 0.6, "ki": 0.05, "kd": 1.0, "l": 2.0, "kpv": 1.0, "kiv": 0.1, "vr": 2.8}
WHEELBASE = 1.75

coordinate = st.floats(-2.0, 2.0)
states = st.tuples(
    st.floats(-50.0, 50.0),
    coordinate,
    st.floats(-0.9, 0.9),
    st.floats(-1.0, 5.0),
    st.floats(-1.2, 1.2),
    coordinate,
    coordinate,
)


def evaluate(
    system: System, state: object, disturbance: Mapping[str, float] | None = None
) -> list[float]:
    ode = system.ode
    w = [(disturbance or {}).get(signal.name, signal.nominal) for signal in ode.disturbances]
    return [float(v) for v in ode.function()(state, ode.parameter_values(), w).full().ravel()]


def reference(
    state: tuple[float, ...],
    *,
    rate_limit: float,
    curvature: float = 0.0,
    n: tuple[float, float, float] = (0.0, 0.0, 0.0),
    w: tuple[float, float] = (0.0, 0.0),
) -> list[float]:
    """B2 in plain Python, written from the equations; curvature 0 is the plane."""
    _, e, steering, v, psi, speed_integral, offset_integral = state
    slope = math.tan(min(max(steering, -0.6), 0.6)) / WHEELBASE

    def rates(e: float, v: float, psi: float) -> tuple[float, float, float]:
        along = v * math.cos(psi) / (1.0 - curvature * e)
        return along, v * math.sin(psi), v * slope - curvature * along

    along, e_rate, psi_rate = rates(e, v, psi)
    e_read, psi_read, v_read = e + n[0], psi + n[1], v + n[2]
    _, e_read_rate, psi_read_rate = rates(e_read, v_read, psi_read)
    g = GAINS
    ahead = e_read + g["l"] * math.sin(psi_read)
    ahead_rate = e_read_rate + g["l"] * math.cos(psi_read) * psi_read_rate
    u_raw = -(g["kp"] * ahead + g["ki"] * offset_integral + g["kd"] * ahead_rate)
    u = min(max(u_raw, -rate_limit), rate_limit)
    a_raw = g["kpv"] * (g["vr"] - v_read) + g["kiv"] * speed_integral
    a = min(max(a_raw, -2.0), 1.0)
    return [
        along,
        e_rate,
        u + w[1],
        a + w[0],
        psi_rate,
        g["vr"] - v_read - (a_raw - a),
        ahead + (u_raw - u),
    ]


@settings(deadline=None)
@given(states)
def test_limits_and_back_calculation_match_plain_python(state: tuple[float, ...]) -> None:
    for benchmark, limit in ((b2(), 0.2), (b2_slow(), 0.1)):
        expected = reference(state, rate_limit=limit)
        assert evaluate(benchmark.system, state) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@settings(deadline=None)
@given(states)
def test_path_form_matches_plain_python(state: tuple[float, ...]) -> None:
    expected = reference(state, rate_limit=0.2, curvature=0.1)
    assert evaluate(b2_path().system, state) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@settings(deadline=None)
@given(states, st.tuples(*[st.floats(-1.0, 1.0)] * 5))
def test_estimation_error_enters_the_controller_and_disturbance_the_plant(
    state: tuple[float, ...], unit: tuple[float, ...]
) -> None:
    n = (0.1 * unit[0], 0.02 * unit[1], 0.05 * unit[2])
    w = (0.1 * unit[3], 0.01 * unit[4])
    names = (
        "position_error_lateral",
        "heading_estimate_error",
        "speed_estimate_error",
        "acceleration_disturbance",
        "steering_rate_disturbance",
    )
    values = evaluate(b2_noise().system, state, dict(zip(names, (*n, *w), strict=True)))
    assert values == pytest.approx(reference(state, rate_limit=0.2, n=n, w=w), rel=1e-12, abs=1e-12)


def test_disturbance_signals_appear_only_with_non_zero_bounds() -> None:
    assert b2().system.ode.disturbances == ()
    bounds = {w.name: (w.lower, w.upper) for w in b2_noise().system.ode.disturbances}
    assert bounds == {
        "position_error_lateral": (-0.1, 0.1),
        "heading_estimate_error": (-0.02, 0.02),
        "speed_estimate_error": (-0.05, 0.05),
        "acceleration_disturbance": (-0.1, 0.1),
        "steering_rate_disturbance": (-0.01, 0.01),
    }


def deviation_rate_from_command(ode: Ode, state: np.ndarray, w: list[float]) -> float:
    """e_l' recovered from the raw command: u = -(kp e_l + ki I + kd e_l')."""
    commands = ca.Function("c", [ode.x, ode.p, ode.w], [dict(ode.outputs)["steering_rate_command"]])
    raw = float(commands(state, ode.parameter_values(), w))
    ahead = state[1] + GAINS["l"] * math.sin(state[4])
    return float(-raw - GAINS["kp"] * ahead - GAINS["ki"] * state[6])


@settings(max_examples=50, deadline=None)
@given(states, st.floats(-0.15, 0.15))
def test_deviation_rate_is_the_derivative_along_the_flow(
    state: tuple[float, ...], curvature: float
) -> None:
    loops: list[tuple[Ode, list[float]]] = [
        (b1().system.ode, []),
        (b2().system.ode, []),
        (
            ClosedLoop(
                PathFrame(curvature, curvature).bicycle(WHEELBASE, 0.6),
                PathFollowing(
                    SteeringPid(0.6, 0.05, 1.0, 2.0, rate_limit_radps=0.2),
                    SpeedPid(1.0, 0.1, accel_min_mps2=-2.0, accel_max_mps2=1.0),
                ),
                Track(2.8),
            ).ode,
            [curvature],
        ),
    ]
    x = np.array(state)
    step = 1e-6
    for ode, w in loops:
        slope = ode.function()(x, ode.parameter_values(), w).full().ravel()
        ahead = [z[1] + GAINS["l"] * math.sin(z[4]) for z in (x - step * slope, x + step * slope)]
        numerical = (ahead[1] - ahead[0]) / (2 * step)
        assert deviation_rate_from_command(ode, x, w) == pytest.approx(
            numerical, abs=1e-6 * max(1.0, float(np.abs(slope).max())) ** 2
        )


@settings(deadline=None)
@given(states)
def test_actuators_stay_inside_their_limits(state: tuple[float, ...]) -> None:
    for benchmark, limit in ((b2(), 0.2), (b2_slow(), 0.1), (b2_path(), 0.2)):
        rates = evaluate(benchmark.system, state)
        assert -limit <= rates[2] <= limit
        assert -2.0 <= rates[3] <= 1.0


@settings(deadline=None)
@given(st.floats(0.6, 1.5), st.floats(0.1, 5.0))
def test_steering_beyond_its_limit_turns_no_tighter(steering: float, speed: float) -> None:
    at_limit = evaluate(b2().system, [0, 0, 0.6, speed, 0, 0, 0])
    beyond = evaluate(b2().system, [0, 0, steering, speed, 0, 0, 0])
    assert beyond[4] == at_limit[4] == pytest.approx(speed * math.tan(0.6) / WHEELBASE)


def test_integral_of_a_saturated_steering_falls_back() -> None:
    # Far left of the path the raw command is far below -0.2; without back-calculation I' = e_l = 3.
    rates = evaluate(b2().system, [0, 3.0, 0, 2.8, 0, 0, 10.0])
    assert rates[6] == pytest.approx(3.0 + (-(0.6 * 3.0 + 0.05 * 10.0) + 0.2))


def test_every_constant_is_a_parameter_symbol() -> None:
    for benchmark in (b1(), b2(), b2_path(), b2_noise()):
        function = benchmark.system.ode.function()
        constants = {
            function.instruction_constant(k)
            for k in range(function.n_instructions())
            if function.instruction_id(k) == ca.OP_CONST
        }
        assert constants <= {0.0, 1.0}


def test_ode_is_the_same_object_each_time() -> None:
    system = b1().system
    assert system.ode is system.ode


def test_parameter_ranges_widen_one_parameter() -> None:
    loop = ClosedLoop(
        PlaneBicycle(WHEELBASE, None),
        PathFollowing(SteeringPid(0.6, 0.05, 1.0, 2.0, None), SpeedPid(1.0, 0.1, None, None)),
        Track(2.8),
        parameter_ranges={"wheelbase": (1.7, 1.8)},
    )
    ranges = {p.name: (p.lower, p.nominal, p.upper) for p in loop.ode.parameters}
    assert ranges["wheelbase"] == (1.7, 1.75, 1.8)
    assert ranges["look_ahead"] == (2.0, 2.0, 2.0)


def test_misuse_is_answered_with_the_mend() -> None:
    controller = PathFollowing(
        SteeringPid(0.6, 0.05, 1.0, 2.0, None), SpeedPid(1.0, 0.1, None, None)
    )
    plant = PlaneBicycle(WHEELBASE, None)
    with pytest.raises(InputError, match="nearest is 'wheelbase'"):
        ClosedLoop(plant, controller, Track(2.8), parameter_ranges={"wheel_base": (1.0, 2.0)})
    with pytest.raises(InputError, match=r"wheelbase_m: expected .* > 0, got -1.75"):
        PlaneBicycle(-1.75, None)
    with pytest.raises(InputError, match="steering_limit_rad"):
        PathBicycle(WHEELBASE, 2.0, Ranged.exactly("curvature", "1/m", 0.1))
    with pytest.raises(InputError, match="expected a limit > 0"):
        SteeringPid(0.6, 0.05, 1.0, 2.0, rate_limit_radps=-0.2)
    with pytest.raises(InputError, match="accel_min_mps2 < 0 < accel_max_mps2"):
        SpeedPid(1.0, 0.1, accel_min_mps2=2.0, accel_max_mps2=1.0)
    with pytest.raises(InputError, match="finite"):
        Track(math.nan)
    with pytest.raises(InputError, match="change_mps as"):
        Track(2.0, (0.1, 0.2))
    with pytest.raises(InputError, match="change_upper_mps"):
        Track(2.0, (0.0, math.inf))
    with pytest.raises(InputError, match="lateral_m: expected a bound >= 0"):
        EstimationError(lateral_m=-0.1)
    with pytest.raises(InputError, match="acceleration_mps2"):
        Disturbance(acceleration_mps2=math.inf)
