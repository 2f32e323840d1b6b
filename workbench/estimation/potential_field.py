"""Potential field that moves people: goals attract, obstacles, people and vehicles repel.

A person is a point with position p (m) and velocity v (m/s). The field gives the acceleration u;
the double integrator turns it into motion, x_k = F x_(k-1) + G u + w, y_k = H x_k + e, with x the
stacked position and velocity. All of it is symbolic: derivatives, code and maps over many people
come from the same expressions.
Source: Particke et al. 2017 (generalised potential field approach), as the paper uses it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError

Symbol = Any
"""A CasADi expression: SX, MX or DM."""

NEAR_M = 1e-3
"""Below this distance a repulsion fades to zero, as it has no direction at its source."""


@final
@dataclass(frozen=True, slots=True)
class Repulsion:
    """What keeps people away: strength_mps2 (m/s^2) at the edge, reach_m over which it falls to
    1/e. Raises InputError unless the strength is 0 or more and the reach is above 0."""

    strength_mps2: float
    reach_m: float

    def __post_init__(self) -> None:
        if not (0.0 <= self.strength_mps2 < math.inf and 0.0 < self.reach_m < math.inf):
            raise InputError(
                "expected a repulsion with strength >= 0 m/s^2 and reach > 0 m, "
                f"got {self.strength_mps2} and {self.reach_m}"
            )


@final
@dataclass(frozen=True, slots=True)
class Field:
    """Numbers of the field.

    relaxation_s: how soon a velocity turns to the wanted one; softening_m: people slow down within
    about this distance of their goal; obstacle, vehicle: repulsion of discs (other people and
    things that stand) and of vehicles. Raises InputError unless both lengths are above 0.
    """

    relaxation_s: float
    softening_m: float
    obstacle: Repulsion
    vehicle: Repulsion

    def __post_init__(self) -> None:
        for each in fields(self)[:2]:
            value = getattr(self, each.name)
            if not 0.0 < value < math.inf:
                raise InputError(f"{each.name}: expected a number above 0, got {value}")


def attraction(
    position: Symbol, velocity: Symbol, goal: Symbol, speed: Symbol, field: Field
) -> Symbol:
    """Acceleration (2,) in m/s^2 towards a goal.

    u = (speed (goal - p) / sqrt(|goal - p|^2 + softening^2) - v) / relaxation: minus the gradient
    of the potential speed sqrt(|goal - p|^2 + softening^2) / relaxation, and a friction that lets
    the velocity settle. position, goal (2,) in m, velocity (2,) and speed in m/s, all symbolic.
    Where v = 0 it points to the goal and is zero only at the goal.
    """
    way = goal - position
    wanted = speed * way / ca.sqrt(ca.sumsqr(way) + field.softening_m**2)
    return (wanted - velocity) / field.relaxation_s


def repulsion(position: Symbol, source: Symbol, radius: Symbol, law: Repulsion) -> Symbol:
    """Acceleration (2,) in m/s^2 away from a disc.

    u = strength exp(-(d - radius) / reach) (p - source) / d, d = sqrt(|p - source|^2 + 1e-6 m^2):
    strength at the edge, more within. position, source (2,) and radius in m, symbolic. Of two
    equal people each is pushed as hard as the other, the opposite way. At the centre it is zero.
    """
    away = position - source
    distance = ca.sqrt(ca.sumsqr(away) + NEAR_M**2)
    return law.strength_mps2 * ca.exp((radius - distance) / law.reach_m) * away / distance


def vehicle_repulsion(position: Symbol, vehicle: Symbol, law: Repulsion) -> Symbol:
    """Acceleration (2,) in m/s^2 away from a vehicle, taken as a stadium.

    vehicle: (6,) x, y (m), heading (rad) of the reference point, front, rear (m, outward from it),
    half width (m). The repulsion of a disc of the half width whose centre is the point nearest to
    the person of the axis from half a width before the rear to half a width behind the front. The
    corners of the rectangle stand out of the stadium by up to 0.41 half widths: this is a model of
    what people do, not of what the vehicle occupies.
    """
    x, y, heading, front, rear, half_width = ca.vertsplit(vehicle)
    forward = ca.vertcat(ca.cos(heading), ca.sin(heading))
    origin = ca.vertcat(x, y)
    along = ca.dot(position - origin, forward)
    nearest = ca.fmin(ca.fmax(along, half_width - rear), front - half_width)
    return repulsion(position, origin + nearest * forward, half_width, law)


@final
@dataclass(frozen=True, slots=True, eq=False)
class DoubleIntegrator:
    """x_k = F x_(k-1) + G u_(k-1) + w_k, y_k = H x_k + e_k for x = (px, py, vx, vy).

    F (4, 4), G (4, 2), H (2, 4); w ~ N(0, Q) with Q = acceleration_mps2^2 G G^T, an acceleration
    that is constant over a step and independent of the others; e ~ N(0, R), R = measurement_m^2 I.
    """

    F: NDArray[np.float64]
    G: NDArray[np.float64]
    H: NDArray[np.float64]
    Q: NDArray[np.float64]
    R: NDArray[np.float64]


def double_integrator(
    step_s: float, *, acceleration_mps2: float, measurement_m: float
) -> DoubleIntegrator:
    """The matrices for steps of step_s: exact for an acceleration that is constant over a step.

    acceleration_mps2, measurement_m: standard deviations per axis of process and measurement.
    Raises InputError unless step_s > 0 and both deviations are 0 or more.
    """
    if not (0.0 < step_s < math.inf and acceleration_mps2 >= 0.0 and measurement_m >= 0.0):
        raise InputError(
            "expected a step above 0 s and deviations of 0 or more, got "
            f"{step_s}, {acceleration_mps2} and {measurement_m}"
        )
    one, none = np.eye(2), np.zeros((2, 2))
    G = np.vstack([0.5 * step_s**2 * one, step_s * one])
    return DoubleIntegrator(
        F=np.block([[one, step_s * one], [none, one]]),
        G=G,
        H=np.hstack([one, none]),
        Q=acceleration_mps2**2 * (G @ G.T),
        R=measurement_m**2 * one,
    )


def field_step(field: Field, step_s: float, *, obstacles: int, vehicles: int) -> ca.Function:
    """CasADi function of one step of a person, without noise: F x + G u.

    Inputs: state (4,), goal (2,), speed (m/s), obstacles (3, n) as x, y, radius, vehicles (6, m)
    as in `vehicle_repulsion`; output: state (4,). With no obstacles or vehicles the inputs have no
    columns; an obstacle that does not exist is one far away. Accelerations are not limited.
    """
    state, goal, speed = ca.SX.sym("state", 4), ca.SX.sym("goal", 2), ca.SX.sym("speed")
    discs, cars = ca.SX.sym("obstacles", 3, obstacles), ca.SX.sym("vehicles", 6, vehicles)
    position, velocity = state[:2], state[2:]
    u = attraction(position, velocity, goal, speed, field)
    for k in range(obstacles):
        u += repulsion(position, discs[:2, k], discs[2, k], field.obstacle)
    for k in range(vehicles):
        u += vehicle_repulsion(position, cars[:, k], field.vehicle)
    model = double_integrator(step_s, acceleration_mps2=0.0, measurement_m=0.0)
    after = ca.mtimes(ca.DM(model.F), state) + ca.mtimes(ca.DM(model.G), u)
    names = ["state", "goal", "speed", "obstacles", "vehicles"]
    return ca.Function(
        "field_step", [state, goal, speed, discs, cars], [ca.densify(after)], names, ["after"]
    )
