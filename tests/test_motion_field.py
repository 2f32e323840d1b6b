"""The field points to the goal and away from others, equally hard on both of a pair; its symbolic
form, its array form and hand-written formulas agree; F, G, H and the noise are the exact ones."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from workbench.errors import InputError
from workbench.estimation.field_paths import Others, TowardGoal, paths, starts
from workbench.estimation.motion_filter import Estimate
from workbench.estimation.potential_field import (
    Field,
    Repulsion,
    attraction,
    double_integrator,
    field_step,
    repulsion,
    vehicle_repulsion,
)

FIELD = Field(3.0, 2.0, Repulsion(0.8, 0.4), Repulsion(2.0, 1.5))
ALONE = Field(3.0, 2.0, Repulsion(0.0, 0.4), Repulsion(0.0, 1.5))
metres = st.floats(-20.0, 20.0)
points = st.tuples(metres, metres).map(np.array)


@given(points, points, st.floats(0.1, 3.0))
def test_from_rest_attraction_points_to_the_goal(place, goal, speed):
    distance = np.hypot(*(goal - place))
    assume(distance > 1e-3)
    u = np.ravel(attraction(ca.DM(place), ca.DM.zeros(2), ca.DM(goal), speed, FIELD).full())
    unit = (goal - place) / distance
    assert u @ unit > 0.0
    assert abs(u[0] * unit[1] - u[1] * unit[0]) < 1e-9
    np.testing.assert_allclose(
        u, speed * (goal - place) / np.sqrt(distance**2 + 4.0) / 3.0, atol=1e-12
    )


@given(points, points, st.floats(0.1, 3.0))
def test_attraction_is_minus_the_gradient_of_its_potential(place, goal, speed):
    p = ca.SX.sym("p", 2)
    potential = speed * ca.sqrt(ca.sumsqr(ca.DM(goal) - p) + 4.0) / 3.0
    force = attraction(p, ca.DM.zeros(2), ca.DM(goal), speed, FIELD)
    off = ca.Function("off", [p], [force + ca.gradient(potential, p)])(place)
    assert float(ca.norm_inf(off)) < 1e-12


@given(points, points)
def test_two_equal_people_are_pushed_equally_hard_the_opposite_way(a, b):
    law = FIELD.obstacle
    of_a, of_b = (
        np.ravel(repulsion(ca.DM(x), ca.DM(y), 0.5, law).full()) for x, y in ((a, b), (b, a))
    )
    assert np.array_equal(of_a, -of_b)
    assert of_a @ (a - b) >= 0.0


@given(points, st.floats(0.0, 6.28))
def test_repulsion_does_not_depend_on_how_the_plane_is_turned(away, angle):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    plain = np.ravel(repulsion(ca.DM(away), ca.DM.zeros(2), 0.5, FIELD.obstacle).full())
    turned = np.ravel(repulsion(ca.DM(turn @ away), ca.DM.zeros(2), 0.5, FIELD.obstacle).full())
    np.testing.assert_allclose(turned, turn @ plain, atol=1e-12)


def test_repulsion_has_its_strength_at_the_edge_and_falls_by_e_per_reach():
    law = Repulsion(0.8, 0.4)
    pushes = [float(repulsion(ca.DM([d, 0]), ca.DM.zeros(2), 0.5, law)[0]) for d in (0.5, 0.9)]
    np.testing.assert_allclose(pushes, [0.8, 0.8 / np.e], rtol=1e-4)


def test_a_vehicle_pushes_from_its_nearest_side():
    car = ca.DM([0.0, 0.0, 0.0, 3.5, 1.3, 0.9])
    for place, way in (((1.0, 3.0), (0, 1)), ((1.0, -3.0), (0, -1)), ((6.0, 0.0), (1, 0)),
                       ((-4.0, 0.0), (-1, 0))):  # fmt: skip
        u = np.ravel(vehicle_repulsion(ca.DM(place), car, FIELD.vehicle).full())
        np.testing.assert_allclose(u / np.hypot(*u), way, atol=1e-12)
    at_side = float(vehicle_repulsion(ca.DM([1.0, 0.9]), car, FIELD.vehicle)[1])
    at_bumper = float(vehicle_repulsion(ca.DM([3.5, 0.0]), car, FIELD.vehicle)[0])
    np.testing.assert_allclose([at_side, at_bumper], [2.0, 2.0], rtol=1e-3)


@given(st.floats(0.01, 2.0))
def test_double_integrator_is_the_exponential_of_its_generator(step_s):
    model = double_integrator(step_s, acceleration_mps2=0.7, measurement_m=0.2)
    generator = np.zeros((6, 6))
    generator[:2, 2:4] = generator[2:4, 4:] = np.eye(2)
    exact = expm(step_s * generator)
    np.testing.assert_allclose(model.F, exact[:4, :4], atol=1e-12)
    np.testing.assert_allclose(model.G, exact[:4, 4:], atol=1e-12)
    assert np.array_equal(model.H, [[1, 0, 0, 0], [0, 1, 0, 0]])
    noise = 0.7 * np.random.default_rng(1).normal(size=(40_000, 2)) @ model.G.T
    np.testing.assert_allclose(np.cov(noise.T), model.Q, atol=0.05 * model.Q.max())
    np.testing.assert_allclose(model.R, 0.04 * np.eye(2))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_symbolic_and_array_forms_agree_with_people_and_vehicles_around(seed):
    rng = np.random.default_rng(seed)
    known = [Estimate(0.0, rng.normal(size=(3, 2)), np.eye(3)) for _ in range(4)]
    discs, cars = rng.normal(size=(4, 2, 5)), rng.normal(size=(4, 1, 7))
    discs[..., 4], cars[..., 3], cars[..., 4], cars[..., 5] = 0.3, 3.0, 1.0, 0.9
    goals, leads = rng.normal(size=(4, 2)) * 5.0, rng.uniform(0.0, 2.0, (4, 3))
    together = paths(FIELD, starts(known), goals, leads, others=Others(discs, cars))
    for k, each in enumerate(known):
        alone = TowardGoal(FIELD).places_m(
            each, 0.0, leads[k], goal_m=goals[k], others=Others(discs[k], cars[k])
        )
        np.testing.assert_allclose(alone, together[k], atol=1e-10)


def test_one_step_is_f_x_plus_g_u():
    state, goal = np.array([1.0, 2.0, 0.3, -0.4]), np.array([4.0, 6.0])
    model = double_integrator(0.1, acceleration_mps2=0.0, measurement_m=0.0)
    u = (1.2 * np.array([3.0, 4.0]) / np.sqrt(29.0) - state[2:]) / 3.0
    step = field_step(ALONE, 0.1, obstacles=0, vehicles=0)
    after = np.ravel(step(state, goal, 1.2, np.zeros((3, 0)), np.zeros((6, 0))).full())
    np.testing.assert_allclose(after, model.F @ state + model.G @ u, atol=1e-14)


def test_a_person_arrives_and_stays():
    known = Estimate(0.0, np.array([[0.0, 0.0], [0.0, 1.3], [0.0, 0.0]]), np.eye(3))
    way = TowardGoal(ALONE).places_m(
        known, 0.0, np.arange(0.0, 60.0, 1.0), goal_m=(10.0, 0.0), others=Others.none()
    )
    off = np.hypot(*(way - [10.0, 0.0]).T)
    assert off[0] == pytest.approx(10.0)
    assert off[-20:].max() < 0.05


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match="relaxation_s"):
        Field(0.0, 1.0, FIELD.obstacle, FIELD.vehicle)
    with pytest.raises(InputError, match="strength"):
        Repulsion(-1.0, 1.0)
    with pytest.raises(InputError, match="step above 0"):
        double_integrator(0.0, acceleration_mps2=1.0, measurement_m=1.0)
    known = Estimate(1.0, np.zeros((3, 2)), np.eye(3))
    with pytest.raises(InputError, match="the last measurement"):
        TowardGoal(ALONE).places_m(known, 0.0, [0.5], goal_m=(1, 1), others=Others.none())
    with pytest.raises(InputError, match="finite metres"):
        TowardGoal(ALONE).places_m(known, 1.0, [0.5], goal_m=(1, np.nan), others=Others.none())
