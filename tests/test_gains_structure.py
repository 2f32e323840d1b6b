"""The lateral polynomial is that of the model; with look-ahead 0 no gains make it stable."""

from __future__ import annotations

from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.controllers import PathFollowing, SpeedPid, SteeringPid, Track
from workbench.models import ClosedLoop, PathBicycle, Ranged
from workbench.models.control_view import linearise
from workbench.models.gains.lateral import LateralLoop, Schedule, characteristic
from workbench.models.gains.routh import Reason, conditions, stability_pieces
from workbench.models.polynomials import Polynomial
from workbench.models.vehicle import gem_e2

FIELDS = (
    "wheelbase_m", "speed_mps", "look_ahead_m", "proportional", "integral", "derivative"
)  # fmt: skip
ANY = st.floats(-5.0, 5.0)
POSITIVE = st.floats(0.01, 5.0)


def symbolic() -> dict[str, Polynomial]:
    return {name: Polynomial.atom(k) for k, name in enumerate(FIELDS)}


def determinant_coefficients(matrix: list[list[Polynomial]]) -> list[Polynomial]:
    """det(s I - A), highest power first, by Faddeev and LeVerrier in the ring of polynomials."""
    size, zero = len(matrix), Polynomial()
    found = [Polynomial.number(1)]
    power = [[zero] * size for _ in range(size)]
    for k in range(1, size + 1):
        power = [
            [power[i][j] + (found[-1] if i == j else zero) for j in range(size)]
            for i in range(size)
        ]
        moved = []
        for row in matrix:
            entries = []
            for j in range(size):
                total = zero
                for m in range(size):
                    total = total + row[m] * power[m][j]
                entries.append(total)
            moved.append(entries)
        power = moved
        trace = zero
        for i in range(size):
            trace = trace + power[i][i]
        found.append(trace.scaled(Fraction(-1, k)))
    return found


def test_polynomial_is_the_determinant_of_the_equations_symbolically() -> None:
    p = symbolic()
    per_base, zero = Polynomial.atom(9), Polynomial()
    v, ahead = p["speed_mps"], p["look_ahead_m"]
    kp, ki, kd = p["proportional"], p["integral"], p["derivative"]
    matrix = [
        [zero, v, zero, zero],
        [zero, zero, v * per_base, zero],
        [-kp, -(kp * ahead + kd * v), -(kd * ahead * v * per_base), -ki],
        [Polynomial.number(1), ahead, zero, zero],
    ]
    found = determinant_coefficients(matrix)
    given_by_formula = characteristic(p)
    for k in range(1, 5):
        assert found[k] == given_by_formula[k] * per_base
    assert found[0] == Polynomial.number(1)


def model(steering: SteeringPid, speed: float) -> ClosedLoop:
    return ClosedLoop(
        PathBicycle(1.75, None, Ranged.exactly("curvature", "1/m", 0.0)),
        PathFollowing(steering, SpeedPid(1.0, 0.1, None, None)),
        Track(speed),
    )


def test_without_look_ahead_the_coefficient_is_zero_in_the_models_own_graph() -> None:
    ode = model(SteeringPid(0.6, 0.05, 1.0, 2.0, None), 2.8).ode
    straight = [0.0 if n != "speed" else ode.x[ode.names.index("speed")] for n in ode.names]
    jacobian = ca.substitute(ca.jacobian(ode.field, ode.x), ode.x, ca.vertcat(*straight))
    lateral = [ode.names.index(n) for n in ("offset", "steering", "heading_error")]
    trace = sum(jacobian[k, k] for k in lateral)
    names = [parameter.name for parameter in ode.parameters]
    ahead = ode.p[names.index("look_ahead")]
    assert ca.simplify(ca.substitute(trace, ahead, 0)).is_zero()
    assert not ca.simplify(trace).is_zero()


def test_without_look_ahead_the_coefficient_is_zero_as_a_polynomial() -> None:
    p = symbolic() | {"look_ahead_m": Polynomial()}
    found = characteristic(p)
    assert found[1] == Polynomial()
    assert characteristic(symbolic())[1] != Polynomial()
    assert found[2] != Polynomial()


@settings(max_examples=200, deadline=None)
@given(ANY, ANY, ANY, ANY)
def test_without_look_ahead_no_gains_are_stable(
    kp: float, ki: float, kd: float, speed: float
) -> None:
    loop = LateralLoop(1.75, speed, 0.0, kp, ki, kd)
    assert conditions(loop).reason() is Reason.NO_DAMPING
    assert max(pole.real for pole in loop.poles()) >= -1e-6
    pieces = stability_pieces(loop, "kd", -10.0, 10.0)
    assert [piece.reason for piece in pieces] == [Reason.NO_DAMPING]


@settings(max_examples=50, deadline=None)
@given(ANY, st.one_of(st.just(0.0), ANY), ANY, st.floats(0.0, 8.0), st.floats(-5.0, 5.0))
def test_polynomial_is_that_of_the_linearised_model(
    kp: float, ki: float, kd: float, ahead: float, speed: float
) -> None:
    linear = linearise(
        model(SteeringPid(kp, ki, kd, ahead, None), speed), {"speed": speed}, cyclic=("station",)
    )
    names = ("offset", "heading_error", "steering", "offset_integral")
    rows = [linear.names.index(name) for name in names]
    lateral = linear.state_matrix[np.ix_(rows, rows)]
    loop = LateralLoop(1.75, speed, ahead, kp, ki, kd)
    expected = np.array([float(c) for c in characteristic(loop.exact())]) / 1.75
    np.testing.assert_allclose(np.poly(lateral), expected, atol=1e-6 * np.abs(expected).max())
    kept = 4 if ki else 3
    state = loop.state_space()
    np.testing.assert_allclose(np.asarray(state.A), lateral[:kept, :kept], atol=1e-12)


def test_a_wrong_sign_of_the_law_would_show() -> None:
    right = LateralLoop.of(gem_e2())
    assert conditions(right).reason() is Reason.STABLE
    for name in ("kp", "ki", "kd"):
        turned = right.at({name: -right.value(name)})
        assert conditions(turned).reason() is not Reason.STABLE
    assert conditions(right.at({"speed": -2.8})).reason() is Reason.NO_DAMPING


@settings(max_examples=100, deadline=None)
@given(POSITIVE, st.one_of(st.just(0.0), POSITIVE), POSITIVE, POSITIVE, POSITIVE)
def test_schedules_move_the_poles_as_they_say(
    kp: float, ki: float, kd: float, ahead: float, speed: float
) -> None:
    # Powers of two, so that the scheduled gains carry no rounding and the law is exact.
    loop = LateralLoop(1.75, 2.0, ahead, kp, ki, kd)
    for power in (-2, 1, 3):
        r = Fraction(2) ** power
        present = loop.polynomial()
        same = Schedule.TIME.at(loop, 2.0 * float(r))
        assert same.polynomial() == present
        spread = Schedule.DISTANCE.at(loop, 2.0 * float(r)).polynomial()
        assert spread == tuple(c * r**k for k, c in enumerate(present))
    fixed = Schedule.FIXED.at(loop, speed)
    assert (fixed.proportional, fixed.look_ahead_m, fixed.speed_mps) == (kp, ahead, speed)


@pytest.mark.parametrize("name", ["kp", "ki", "kd", "look-ahead", "speed"])
def test_values_are_changed_by_name(name: str) -> None:
    loop = LateralLoop.of(gem_e2()).at({name: 0.25})
    assert loop.value(name) == 0.25
