"""The compiled single-track plant agrees with the same equations written out and integrated by
scipy, with the closed form of steady cornering, and with the bicycle as tyres get stiff."""

from __future__ import annotations

import dataclasses
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from workbench.errors import InputError
from workbench.simulation.plants.chassis import Start
from workbench.simulation.plants.single_track import (
    SingleTrack,
    SingleTrackChassis,
    gem_e2_single_track_path,
    load_single_track,
)

WHEELBASE_M, LIMIT_RAD, G = 1.75, 0.6, 9.81
GEM = load_single_track(gem_e2_single_track_path())


def car(
    speed_mps: float = 0.0, *, parameters: SingleTrack = GEM, step_s: float = 0.0025
) -> SingleTrackChassis:
    start = Start(1.0, -2.0, 0.3, speed_mps)
    return SingleTrackChassis(parameters, WHEELBASE_M, LIMIT_RAD, start=start, step_s=step_s)


def with_tyres(**changes: float) -> SingleTrack:
    return dataclasses.replace(GEM, tyres=dataclasses.replace(GEM.tyres, **changes))


def rates(state: np.ndarray, acceleration: float, rate: float) -> list[float]:
    """The equations once more, from forces at the wheels and Newton's law, for a moving car."""
    b, t = GEM.body, GEM.tyres
    _, _, heading, v, w, r, d, s_front, s_rear = state
    rear_m = WHEELBASE_M * b.front_load
    front_m = WHEELBASE_M - rear_m
    load_front, load_rear = b.mass_kg * G * b.front_load, b.mass_kg * G * (1.0 - b.front_load)
    front_share = b.front_drive if acceleration > 0.0 else b.front_brake
    pull_front = b.mass_kg * acceleration * front_share
    pull_rear = b.mass_kg * acceleration * (1.0 - front_share)
    # Velocities of the contact points in the frames of the wheels.
    at_front = np.array([[math.cos(d), math.sin(d)], [-math.sin(d), math.cos(d)]]) @ [
        v, w + front_m * r,
    ]  # fmt: skip
    at_rear = np.array([v, w - rear_m * r])
    damping = 0.5 * t.damping_s_per_m * (1.0 + math.cos(math.pi * min(v / t.fade_mps, 1.0)))

    def side(stiffness: float, load: float, pull: float, slip: float) -> float:
        most = math.sqrt((t.friction * load) ** 2 - pull**2)
        return -most * math.sin(t.shape * math.atan(stiffness * slip / (t.shape * t.friction)))

    side_front = side(t.front_per_rad, load_front, pull_front, s_front + damping * at_front[1])
    side_rear = side(t.rear_per_rad, load_rear, pull_rear, s_rear + damping * at_rear[1])
    force_x = pull_front * math.cos(d) - side_front * math.sin(d) + pull_rear
    force_x -= b.mass_kg * G * b.rolling_share
    force_front = pull_front * math.sin(d) + side_front * math.cos(d)
    forward = np.array([math.cos(heading), math.sin(heading)])
    place = v * forward + at_rear[1] * np.array([-forward[1], forward[0]])
    return [
        *place, r, force_x / b.mass_kg + r * w, (force_front + side_rear) / b.mass_kg - r * v,
        (front_m * force_front - rear_m * side_rear) / b.yaw_inertia_kgm2, rate,
        (at_front[1] - abs(at_front[0]) * s_front) / t.relaxation_m,
        (at_rear[1] - abs(at_rear[0]) * s_rear) / t.relaxation_m,
    ]  # fmt: skip


@settings(max_examples=15, deadline=None)
@given(st.floats(1.0, 4.0), st.floats(-0.8, 1.0), st.floats(-0.25, 0.25), st.floats(-0.25, 0.25))
def test_it_agrees_with_the_equations_written_out_and_integrated_by_scipy(
    speed_mps: float, acceleration: float, rate: float, later: float
) -> None:
    plant = car(speed_mps)
    x = np.array([1.0, -2.0, 0.3, speed_mps, *[0.0] * 5])
    for u in (rate, later):
        plant.advance(acceleration, u, 0.5)
        x = solve_ivp(
            lambda _t, s, u=u: rates(s, acceleration, u), (0.0, 0.5), x, rtol=1e-10, atol=1e-12,
            method="LSODA", max_step=0.01,
        ).y[:, -1]  # fmt: skip
    m = plant.motion
    rear_m = WHEELBASE_M * GEM.body.front_load
    found = [m.x_m, m.y_m, m.heading, m.speed_mps, m.lateral_mps, m.yaw_rate_radps]
    assert found == pytest.approx([*x[:4], x[4] - rear_m * x[5], x[5]], abs=1e-6)
    assert m.road_wheel_rad == pytest.approx(0.5 * (rate + later))


@pytest.mark.parametrize("speed_mps", [2.0, 4.0, 8.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_steady_cornering_follows_the_understeer_relation(speed_mps: float, side: float) -> None:
    steering = 0.01 * side
    plant = car(speed_mps)
    plant.advance(0.0, steering, 1.0)
    for _ in range(400):  # keeps its speed
        v = plant.motion.speed_mps
        plant.advance(G * GEM.body.rolling_share + 5.0 * (speed_mps - v), 0.0, 0.01)
    m = plant.motion
    expected = m.speed_mps * steering / (WHEELBASE_M + GEM.understeer_s2pm * m.speed_mps**2)
    assert m.yaw_rate_radps == pytest.approx(expected, rel=1e-3)
    assert GEM.understeer_s2pm > 0.0


def test_stiff_tyres_tend_to_the_bicycle() -> None:
    misses = []
    for factor in (1.0, 10.0, 100.0):
        parameters = with_tyres(
            front_per_rad=9.0 * factor, rear_per_rad=10.0 * factor, friction=20.0,
            relaxation_m=0.3 / factor,
        )  # fmt: skip
        plant = car(2.8, parameters=parameters, step_s=0.0025 / factor)
        plant.advance(0.0, 0.2, 1.0)
        plant.advance(0.0, -0.2, 0.5)
        m = plant.motion
        yaw_rate = m.speed_mps * math.tan(m.road_wheel_rad) / WHEELBASE_M
        misses.append((abs(m.yaw_rate_radps - yaw_rate), abs(m.lateral_mps)))
    for stiffer, softer in zip(misses[1:], misses, strict=False):
        assert stiffer[0] < 0.2 * softer[0]
        assert stiffer[1] < 0.2 * softer[1]


@settings(max_examples=20, deadline=None)
@given(st.floats(0.5, 4.0), st.floats(-0.2, 0.2), st.floats(0.3, 2.0))
def test_it_brakes_to_a_rest_that_absorbs(speed_mps: float, rate: float, hard: float) -> None:
    plant = car(speed_mps)
    plant.advance(0.0, rate, 1.0)
    speeds = []
    for _ in range(1600):
        plant.advance(-hard, 0.0, 0.01)
        speeds.append(plant.motion.speed_mps)
    assert all(later <= earlier for earlier, later in itertools.pairwise(speeds))
    stood = plant.motion
    assert (stood.speed_mps, stood.lateral_mps, stood.yaw_rate_radps) == (0.0, 0.0, 0.0)
    plant.advance(-hard, -rate, 1.0)
    later = plant.motion
    assert (later.x_m, later.y_m, later.heading) == (stood.x_m, stood.y_m, stood.heading)
    plant.advance(0.02, 0.0, 1.0)  # less than the rolling resistance
    assert plant.motion.speed_mps == 0.0
    plant.advance(0.5, 0.0, 1.0)
    assert plant.motion.speed_mps > 0.3


@settings(max_examples=20, deadline=None)
@given(st.floats(1.0, 5.0), st.floats(-0.25, 0.25))
def test_without_torque_it_never_gains_energy(speed_mps: float, rate: float) -> None:
    plant = car(speed_mps)
    rear_m, b = WHEELBASE_M * GEM.body.front_load, GEM.body
    before = math.inf
    for _ in range(200):
        # Turning the wheels does no work on the car: they are light and have no trail.
        plant.advance(0.0, rate, 0.01)
        m = plant.motion
        side = m.lateral_mps + rear_m * m.yaw_rate_radps
        energy = 0.5 * b.mass_kg * (m.speed_mps**2 + side**2)
        energy += 0.5 * b.yaw_inertia_kgm2 * m.yaw_rate_radps**2
        # What tyres store by bending is given back: at most C slip^2 / 2 sigma of each axle.
        assert energy <= before + 5.0
        before = energy
    assert before < 0.5 * b.mass_kg * speed_mps**2


def test_halving_the_step_divides_the_error_by_sixteen() -> None:
    ends = []
    for step_s in (0.02, 0.01, 0.0005):
        plant = car(3.0, step_s=step_s)
        plant.advance(0.4, 0.2, 1.0)
        plant.advance(0.4, -0.2, 1.0)
        ends.append(plant.motion)
    errors = [abs(end.y_m - ends[-1].y_m) + abs(end.heading - ends[-1].heading) for end in ends]
    assert 8.0 < errors[0] / errors[1] < 40.0


def test_tyres_saturate_at_their_friction() -> None:
    plant = car(8.0)
    plant.advance(0.0, 0.5, 1.0)
    m = plant.motion
    assert m.yaw_rate_radps * m.speed_mps < 1.02 * GEM.tyres.friction * G
    bicycle = 8.0 * math.tan(0.5) / WHEELBASE_M
    assert m.yaw_rate_radps < 0.6 * bicycle


def test_its_wheels_stop_at_their_limit() -> None:
    plant = car(2.0)
    plant.advance(0.0, 0.3, 3.0)
    assert plant.motion.road_wheel_rad == LIMIT_RAD
    plant.advance(0.0, -0.3, 1.0)
    assert plant.motion.road_wheel_rad == pytest.approx(LIMIT_RAD - 0.3)


def test_a_mirrored_drive_is_the_mirror_image() -> None:
    ends = []
    for side in (1.0, -1.0):
        plant = SingleTrackChassis(GEM, WHEELBASE_M, LIMIT_RAD, start=Start(0.0, 0.0, 0.0, 3.0))
        plant.advance(0.3, 0.2 * side, 1.5)
        ends.append(plant.motion)
    left, right = ends
    assert left.y_m > 0.5
    assert (left.x_m, left.y_m, left.heading) == (right.x_m, -right.y_m, -right.heading)


def test_what_is_not_finite_is_refused(tmp_path: Path) -> None:
    plant = car(1.0)
    with pytest.raises(InputError, match="stays finite"):
        plant.advance(0.0, math.nan, 0.01)
    with pytest.raises(InputError, match="wheelbase"):
        SingleTrackChassis(GEM, 0.0, LIMIT_RAD, start=Start(0.0, 0.0, 0.0))
    text = gem_e2_single_track_path().read_text()
    for old, new, said in (
        ("friction = 0.8", "friction = 0.0", "friction"),
        ("shape = 1.3", "shape = 2.5", "shape"),
        ("front_load = 0.48", "front_load = 1.0", "shares"),
        ("mass_kg", "mass_lb", "mass_lb"),
    ):
        path = tmp_path / "car.toml"
        path.write_text(text.replace(old, new))
        with pytest.raises(InputError, match=said):
            load_single_track(path)
