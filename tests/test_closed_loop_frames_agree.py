"""The plane and the path form of the closed loop describe the same motion."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from workbench.models import PathFrame, PlaneFrame, System
from workbench.models.vehicle import gem_e2

RADIUS = 10.0
START = (0.0, 0.3, 0.02, 2.5, 0.05, 0.0, 0.0)
TIMES = np.linspace(0.0, 5.0, 26)


def integrate(slope: Callable[[np.ndarray], np.ndarray], start: tuple[float, ...]) -> np.ndarray:
    """Tight tolerances, and a step small against the corners of the limits."""
    solution = solve_ivp(
        lambda _, z: slope(z),
        (0.0, float(TIMES[-1])),
        start,
        t_eval=TIMES,
        rtol=1e-10,
        atol=1e-12,
        max_step=0.01,
    )
    return np.asarray(solution.y)


def simulate(system: System, w: tuple[float, ...], start: tuple[float, ...] = START) -> np.ndarray:
    ode = system.ode
    field, p = ode.function(), ode.parameter_values()
    return integrate(lambda x: np.asarray(field(x, p, w).full()).ravel(), start)


def test_on_a_straight_line_all_states_agree() -> None:
    vehicle = gem_e2()
    plane = simulate(vehicle.closed_loop(vehicle.track(), PlaneFrame()), ())
    path = simulate(vehicle.closed_loop(vehicle.track(), PathFrame(0.0, 0.0)), (0.0,))
    np.testing.assert_allclose(path, plane, atol=1e-10)


def wrapped(angle: float) -> float:
    return math.remainder(angle, 2 * math.pi)


def plane_bicycle_on_a_circle(z: np.ndarray, turn: float) -> np.ndarray:
    """B2 in the plane; offset and heading error by geometry of a circle through the origin.

    turn = +1: centre (0, R), driven counter-clockwise; turn = -1: centre (0, -R), clockwise.
    """
    x, y, steering, v, heading, speed_integral, offset_integral = z
    distance = math.hypot(x, y - turn * RADIUS)
    offset = turn * (RADIUS - distance)
    tangent = math.atan2(turn * x, turn * (turn * RADIUS - y))
    psi = wrapped(heading - tangent)
    yaw_rate = v * math.tan(min(max(steering, -0.6), 0.6)) / 1.75
    # The tangent turns with the angle of the position about the centre.
    tangent_rate = turn * v * math.cos(psi) / distance
    ahead = offset + 2.0 * math.sin(psi)
    ahead_rate = v * math.sin(psi) + 2.0 * math.cos(psi) * (yaw_rate - tangent_rate)
    u_raw = -(0.6 * ahead + 0.05 * offset_integral + ahead_rate)
    u = min(max(u_raw, -0.2), 0.2)
    a_raw = 2.8 - v + 0.1 * speed_integral
    a = min(max(a_raw, -2.0), 1.0)
    return np.array(
        [
            v * math.cos(heading),
            v * math.sin(heading),
            u,
            a,
            yaw_rate,
            2.8 - v - (a_raw - a),
            ahead + u_raw - u,
        ]
    )


@pytest.mark.parametrize("turn", [1.0, -1.0], ids=["left", "right"])
def test_on_an_arc_the_path_form_maps_to_the_plane_motion(turn: float) -> None:
    vehicle = gem_e2()
    curvature = turn / RADIUS
    loop = vehicle.closed_loop(vehicle.track(), PathFrame(curvature, curvature))
    path = simulate(loop, (curvature,))
    plane = integrate(lambda z: plane_bicycle_on_a_circle(z, turn), START)
    station, offset, heading_error = path[0], path[1], path[4]
    angle = curvature * station
    radius = RADIUS - turn * offset
    x = radius * np.sin(np.abs(angle))
    y = turn * (RADIUS - radius * np.cos(angle))
    np.testing.assert_allclose(x, plane[0], atol=1e-7)
    np.testing.assert_allclose(y, plane[1], atol=1e-7)
    np.testing.assert_allclose(angle + heading_error, plane[4], atol=1e-7)
    np.testing.assert_allclose(path[[2, 3, 5, 6]], plane[[2, 3, 5, 6]], atol=1e-7)


def test_the_arc_is_no_straight_line() -> None:
    # Guards the comparison above: with a wrong curvature the two forms differ visibly.
    vehicle = gem_e2()
    loop = vehicle.closed_loop(vehicle.track(), PathFrame(0.0, 0.1))
    assert np.abs(simulate(loop, (0.1,))[1] - simulate(loop, (0.09,))[1]).max() > 1e-3
