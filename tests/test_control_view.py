"""Linearisation, poles and margins match closed forms; without look-ahead no gains stabilise."""

import cmath
import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.controllers import PathFollowing, SpeedPid, SteeringPid, Track
from workbench.errors import InputError
from workbench.models import ClosedLoop, PathBicycle, PlaneBicycle, Ranged, system_from_casadi
from workbench.models.control_view import (
    Linearisation,
    linearise,
    margins,
    quick_study,
    stability,
)
from workbench.models.vehicle import Vehicle, gem_e2

gain = st.floats(0.01, 10.0)


def straight_loop(
    kp: float, ki: float, kd: float, look_ahead: float, speed: float = 2.8
) -> Linearisation:
    loop = ClosedLoop(
        PathBicycle(1.75, 0.6, Ranged.exactly("curvature", "1/m", 0.0)),
        PathFollowing(
            SteeringPid(kp, ki, kd, look_ahead, rate_limit_radps=0.2),
            SpeedPid(1.0, 0.1, accel_min_mps2=-2.0, accel_max_mps2=1.0),
        ),
        Track(speed),
    )
    return linearise(loop, {"speed": speed}, cyclic=("station",))


def lateral_polynomial(
    kp: float, ki: float, kd: float, look_ahead: float, v: float = 2.8
) -> list[float]:
    """s^4 L + (kd s^2 + kp s + ki)(l v s + v^2), from e'' = v psi', psi' = v steering / L."""
    return [
        1.75,
        kd * look_ahead * v,
        kd * v**2 + kp * look_ahead * v,
        kp * v**2 + ki * look_ahead * v,
        ki * v**2,
    ]


def assert_poles_contain(poles: tuple[complex, ...], roots: np.ndarray) -> None:
    for root in roots:
        assert min(abs(pole - root) for pole in poles) < 1e-6


@settings(max_examples=50, deadline=None)
@given(gain, gain, gain, st.floats(0.5, 4.0), st.floats(0.5, 8.0))
def test_characteristic_polynomial_is_the_closed_form(
    kp: float, ki: float, kd: float, look_ahead: float, speed: float
) -> None:
    linear = straight_loop(kp, ki, kd, look_ahead, speed)
    lateral = np.array(lateral_polynomial(kp, ki, kd, look_ahead, speed)) / 1.75
    along = np.array([1.0, 1.0, 0.1])
    expected = np.polymul(lateral, along)
    found = np.poly(linear.state_matrix)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


@settings(max_examples=100, deadline=None)
@given(gain, st.one_of(st.just(0.0), gain), gain)
def test_without_look_ahead_no_gains_are_asymptotically_stable(
    kp: float, ki: float, kd: float
) -> None:
    linear = straight_loop(kp, ki, kd, 0.0)
    # The lateral poles sum to zero: one that is damped is paid for by one that grows.
    lateral = [linear.names.index(n) for n in ("offset", "steering", "heading_error")]
    assert sum(linear.state_matrix[k, k] for k in lateral) == 0.0
    verdict = stability(linear.poles())
    assert not verdict.stable
    assert max(pole.real for pole in verdict.offending) > -1e-9


def test_benchmark_gains_are_stable_with_look_ahead() -> None:
    linear = straight_loop(0.6, 0.05, 1.0, 2.0)
    assert stability(linear.poles()).stable
    assert_poles_contain(linear.poles(), np.roots(lateral_polynomial(0.6, 0.05, 1.0, 2.0)))
    assert_poles_contain(linear.poles(), np.roots([1.0, 1.0, 0.1]))


def test_verdict_lists_every_offending_pole() -> None:
    verdict = stability((1.0 + 2.0j, 1.0 - 2.0j, 0.0, -1e-12, -1.0))
    assert list(verdict.offending) == [1.0 + 2.0j, 1.0 - 2.0j, 0.0, -1e-12]
    assert "+1+2j" in verdict.message
    assert stability((-0.1, -5.0)).stable


@pytest.mark.parametrize("frequency", [0.1, 1.0, 3.0, 20.0])
def test_loop_transfers_are_the_closed_forms(frequency: float) -> None:
    kp, ki, kd, ahead, v = 0.6, 0.05, 1.0, 2.0, 2.8
    linear = straight_loop(kp, ki, kd, ahead)
    s = 1j * frequency
    steering = linear.loop_transfer(command="steering_rate_command", actuated="steering")
    expected = (kp + ki / s + kd * s) * (v**2 + ahead * v * s) / (1.75 * s**3)
    assert complex(steering(s)) == pytest.approx(expected, rel=1e-9)
    along = linear.loop_transfer(command="acceleration_command", actuated="speed")
    assert complex(along(s)) == pytest.approx((1.0 + 0.1 / s) / s, rel=1e-9)


def test_margins_are_where_the_loop_becomes_unstable() -> None:
    kp, ki, kd, ahead, v = 0.6, 0.05, 1.0, 2.0, 2.8
    linear = straight_loop(kp, ki, kd, ahead)
    found = margins(linear.loop_transfer(command="steering_rate_command", actuated="steering"))

    def stable_with(factor: float) -> bool:
        scaled = straight_loop(kp * factor, ki * factor, kd * factor, ahead)
        return stability(scaled.poles()).stable

    assert found.gain_margin < 1.0
    assert stable_with(found.gain_margin * 1.01)
    assert not stable_with(found.gain_margin * 0.99)
    s = 1j * found.crossover_radps
    loop = (kp + ki / s + kd * s) * (v**2 + ahead * v * s) / (1.75 * s**3)
    assert abs(loop) == pytest.approx(1.0, abs=1e-6)
    phase = math.degrees(cmath.phase(-loop))
    assert found.phase_margin_deg == pytest.approx(phase, abs=1e-4)
    assert found.delay_margin_s == pytest.approx(math.radians(phase) / found.crossover_radps)


def test_jacobian_agrees_with_finite_differences_on_an_arc() -> None:
    loop = ClosedLoop(
        PathBicycle(1.75, None, Ranged("curvature", "1/m", 0.1, 0.0, 0.2)),
        PathFollowing(SteeringPid(0.6, 0.05, 1.0, 2.0, None), SpeedPid(1.0, 0.1, None, None)),
        Track(2.8),
    )
    point = {"speed": 2.8, "steering": math.atan(0.175)}
    linear = linearise(loop, point, cyclic=("station",))
    ode = loop.ode
    field, p = ode.function(), ode.parameter_values()
    base = np.array([point.get(name, 0.0) for name in ode.names])
    step = 1e-6
    for column, name in enumerate(linear.names):
        shift = step * (np.array(ode.names) == name)
        change = field(base + shift, p, [0.1]).full() - field(base - shift, p, [0.1]).full()
        np.testing.assert_allclose(
            linear.state_matrix[:, column], change.ravel()[1:] / (2 * step), atol=1e-7
        )
    shifted = field(base, p, [0.1 + step]).full() - field(base, p, [0.1 - step]).full()
    np.testing.assert_allclose(
        linear.disturbance_matrix[:, 0], shifted.ravel()[1:] / (2 * step), atol=1e-7
    )
    system = linear.state_space()
    assert (system.nstates, system.ninputs, system.noutputs) == (6, 1, 6)


def changed(
    vehicle: Vehicle, *, derivative_rad_per_m: float = 1.0, look_ahead_m: float = 2.0
) -> Vehicle:
    gains = dataclasses.replace(
        vehicle.steering_pid, derivative_rad_per_m=derivative_rad_per_m, look_ahead_m=look_ahead_m
    )
    return dataclasses.replace(vehicle, steering_pid=gains)


def test_quick_study_of_the_shipped_vehicle_has_nothing_to_warn_of() -> None:
    study = quick_study(gem_e2())
    assert study.verdict.stable
    assert study.warnings == ()
    assert len(study.poles) == 6
    assert 30.0 < study.steering_margins.phase_margin_deg < 90.0
    assert math.isinf(study.speed_margins.gain_margin)


def test_quick_study_warns_of_unstable_gains_and_names_the_poles() -> None:
    study = quick_study(changed(gem_e2(), look_ahead_m=0.0))
    assert not study.verdict.stable
    assert any("+0.2853" in warning for warning in study.warnings)
    assert any("look_ahead_m is 0" in warning for warning in study.warnings)
    negative = quick_study(changed(gem_e2(), derivative_rad_per_m=-1.0))
    assert any("derivative_rad_per_m is -1.0" in warning for warning in negative.warnings)


def test_quick_study_warns_of_thin_margins() -> None:
    study = quick_study(changed(gem_e2(), derivative_rad_per_m=0.6, look_ahead_m=1.0))
    assert study.verdict.stable
    assert any("steering loop" in warning for warning in study.warnings)


def test_points_that_do_not_rest_and_unknown_names_are_refused() -> None:
    loop = ClosedLoop(
        PlaneBicycle(1.75, 0.6),
        PathFollowing(SteeringPid(0.6, 0.05, 1.0, 2.0, 0.2), SpeedPid(1.0, 0.1, -2.0, 1.0)),
        Track(2.8),
    )
    with pytest.raises(InputError, match=r"'x' changes at 2\.8"):
        linearise(loop, {"speed": 2.8})
    with pytest.raises(InputError, match="'steering' changes"):
        linearise(loop, {"speed": 2.8, "y": 0.3}, cyclic=("x",))
    with pytest.raises(InputError, match="unknown names"):
        linearise(loop, {"velocity": 2.8}, cyclic=("x",))
    with pytest.raises(InputError, match="not cyclic"):
        linearise(loop, {"speed": 2.8}, cyclic=("x", "y"))
    symbol = ca.SX.sym("z")
    other = linearise(system_from_casadi(symbol, -2 * symbol, ("z",)), {})
    assert other.poles() == (-2.0 + 0.0j,)


def test_a_command_at_its_limit_cannot_be_broken_open() -> None:
    linear = straight_loop(0.6, 0.05, 1.0, 2.0)
    with pytest.raises(InputError, match="is not 'acceleration_command'"):
        linear.loop_transfer(command="acceleration_command", actuated="steering")
