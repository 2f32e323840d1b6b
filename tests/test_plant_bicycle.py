"""The bicycle plant follows the kinematic equations to a tight tolerance and never rolls back."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from workbench.errors import InputError
from workbench.simulation.plants.bicycle import BicycleChassis
from workbench.simulation.plants.chassis import Motion, Start

WHEELBASE_M, LIMIT_RAD = 1.75, 0.6
PHASES = st.lists(
    st.tuples(
        st.integers(-100, 50).map(lambda n: n / 50),
        st.integers(-40, 40).map(lambda n: n / 50),
        st.floats(0.05, 1.0),
    ),
    min_size=1, max_size=6,
)  # fmt: skip
Phases = list[tuple[float, float, float]]


def car(speed_mps: float = 0.0) -> BicycleChassis:
    return BicycleChassis(WHEELBASE_M, LIMIT_RAD, start=Start(1.0, -2.0, 0.3, speed_mps))


def driven(phases: Phases, *, speed_mps: float = 2.0, step_s: float = 0.005) -> Motion:
    """The motion at the end of phases of (acceleration, steering rate, duration)."""
    plant = car(speed_mps)
    for acceleration, rate, duration_s in phases:
        for _ in range(max(1, round(duration_s / step_s))):
            plant.advance(acceleration, rate, step_s)
    return plant.motion


def by_scipy(phases: Phases, *, speed_mps: float = 2.0, step_s: float = 0.005) -> list[float]:
    """The same by an adaptive integrator that is told where car and wheels stop."""
    x = np.array([1.0, -2.0, 0.3, speed_mps, 0.0])
    for acceleration, rate, duration_s in phases:
        end_s = max(1, round(duration_s / step_s)) * step_s
        stops_s = x[3] / -acceleration if acceleration < 0.0 else math.inf
        room = math.copysign(LIMIT_RAD, rate) - x[4]
        turns_s = room / rate if rate else math.inf
        cuts = sorted({0.0, end_s, *(t for t in (stops_s, turns_s) if 0.0 < t < end_s)})
        for begin, end in itertools.pairwise(cuts):
            a = acceleration if end <= stops_s else 0.0
            u = rate if end <= turns_s else 0.0

            def field(t: float, s: np.ndarray, a: float = a, u: float = u) -> list[float]:
                _, _, heading, v, steering = s
                turn = v * math.tan(steering) / WHEELBASE_M
                return [v * math.cos(heading), v * math.sin(heading), turn, a, u]

            found = solve_ivp(field, (begin, end), x, rtol=1e-11, atol=1e-12, method="DOP853")
            x = found.y[:, -1]
    return list(x)


@settings(max_examples=60, deadline=None)
@given(PHASES)
@example([(-2.0, 0.62, 1.0)])  # Stops within the step in which the wheels are at their limit.
def test_it_agrees_with_an_adaptive_integrator(phases: Phases) -> None:
    m = driven(phases)
    found = [m.x_m, m.y_m, m.heading, m.speed_mps, m.road_wheel_rad]
    assert found == pytest.approx(by_scipy(phases), abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(PHASES)
def test_neither_speed_nor_steering_leaves_its_limits(phases: Phases) -> None:
    m = driven(phases, speed_mps=0.3)
    assert m.speed_mps >= 0.0
    assert abs(m.road_wheel_rad) <= LIMIT_RAD


@settings(max_examples=30, deadline=None)
@given(PHASES)
def test_a_mirrored_drive_is_the_mirror_image(phases: Phases) -> None:
    plants = []
    for sign in (1.0, -1.0):
        plant = BicycleChassis(WHEELBASE_M, LIMIT_RAD, start=Start(0.0, 0.0, 0.0, 1.0))
        for acceleration, rate, duration_s in phases:
            plant.advance(acceleration, sign * rate, duration_s)
        plants.append(plant.motion)
    left, right = plants
    assert (left.x_m, left.y_m, left.heading) == (right.x_m, -right.y_m, -right.heading)


def test_wheels_stop_at_their_limit_within_a_step() -> None:
    m = driven([(0.0, 0.7, 2.0), (0.0, 0.0, 1.0)])
    found = [m.x_m, m.y_m, m.heading, m.speed_mps, m.road_wheel_rad]
    assert found == pytest.approx(by_scipy([(0.0, 0.7, 2.0), (0.0, 0.0, 1.0)]), abs=2e-8)
    assert m.road_wheel_rad == LIMIT_RAD


def test_a_circle_to_the_left_closes() -> None:
    plant = car(0.0)
    plant.advance(0.0, 0.2, 2.0)  # wheels to 0.4 rad while it stands
    radius_m = WHEELBASE_M / math.tan(0.4)
    plant.advance(1.0, 0.0, 2.0)
    place = plant.motion
    assert place.yaw_rate_radps == pytest.approx(2.0 / radius_m)
    plant.advance(0.0, 0.0, math.tau * radius_m / 2.0)
    assert plant.motion.heading - place.heading == pytest.approx(math.tau)
    assert (plant.motion.x_m, plant.motion.y_m) == pytest.approx((place.x_m, place.y_m), abs=1e-9)


def test_braking_ends_at_the_closed_form_distance_and_stays_there() -> None:
    plant = car(2.8)
    plant.advance(-2.0, 0.0, 5.0)
    stood = plant.motion
    assert math.hypot(stood.x_m - 1.0, stood.y_m + 2.0) == pytest.approx(2.8**2 / 4.0, abs=1e-12)
    plant.advance(-2.0, 0.2, 1.0)
    moved = plant.motion
    assert (moved.x_m, moved.y_m, moved.heading) == (stood.x_m, stood.y_m, stood.heading)
    assert moved.acceleration_mps2 == 0.0


def test_its_acceleration_is_the_mean_of_the_latest_advance() -> None:
    plant = car(0.01)
    plant.advance(-2.0, 0.0, 0.01)
    assert plant.motion.acceleration_mps2 == pytest.approx(-1.0)


def test_what_cannot_be_is_refused() -> None:
    for wheelbase_m, limit_rad in ((0.0, 0.6), (math.nan, 0.6), (1.75, 1.5), (1.75, 0.0)):
        with pytest.raises(InputError, match="wheelbase"):
            BicycleChassis(wheelbase_m, limit_rad, start=Start(0.0, 0.0, 0.0))
    for speed_mps in (-0.1, math.inf):
        with pytest.raises(InputError, match="start"):
            Start(0.0, 0.0, 0.0, speed_mps)
    for asked in ((math.nan, 0.0), (0.0, math.nan)):
        with pytest.raises(InputError, match="stays finite"):
            car(1.0).advance(*asked, 0.01)
