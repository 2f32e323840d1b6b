"""Public benchmarks of the reachability competition (nonlinear category), written anew."""

from __future__ import annotations

import casadi as ca
from tube_cases import box, disturbed, system_of

from workbench.models import Ode, Ranged
from workbench.sets import Box


def cube(system: Ode, center: tuple[float, ...], radius: float) -> Box:
    """The same radius in every state."""
    return Box.around(
        dict(zip(system.names, center, strict=True)), radius=dict.fromkeys(system.names, radius)
    )


def _laub_loomis(*x: ca.SX) -> list[ca.SX]:
    x1, x2, x3, x4, x5, x6, x7 = x
    return [
        1.4 * x3 - 0.9 * x1,
        2.5 * x5 - 1.5 * x2,
        0.6 * x7 - 0.8 * x2 * x3,
        2 - 1.3 * x3 * x4,
        0.7 * x1 - x4 * x5,
        0.3 * x1 - 3.1 * x6,
        1.8 * x6 - 1.6 * x2 * x7,
    ]


LAUB_LOOMIS = system_of(_laub_loomis, *(f"x{i}" for i in range(1, 8)))
LAUB_LOOMIS_CENTER = (1.2, 1.05, 1.5, 2.4, 1.0, 0.1, 0.45)

VAN_DER_POL = system_of(lambda x, y: [y, (1 - x * x) * y - x], "x", "y")
VAN_DER_POL_START = box(x=(1.25, 1.55), y=(2.35, 2.45))

COUPLED_VAN_DER_POL = disturbed(
    lambda x, p, w: [
        x[1],
        (1 - x[0] ** 2) * x[1] + p[0] * (x[2] - x[0]) - x[0],
        x[3],
        (1 - x[2] ** 2) * x[3] - p[0] * (x[2] - x[0]) - x[2],
    ],
    ("x1", "y1", "x2", "y2"),
    parameters=(Ranged("b", "", 2.0, 1.0, 3.0),),
)
COUPLED_START = box(x1=(1.25, 1.55), y1=(2.35, 2.45), x2=(1.25, 1.55), y2=(2.35, 2.45))

LOTKA_VOLTERRA = system_of(lambda x, y: [3 * x - 3 * x * y, x * y - y], "x", "y")
LOTKA_VOLTERRA_START = box(x=(1.288, 1.312), y=(1.0, 1.0))

ROBERTSON_START = box(x=(1.0, 1.0), y=(0.0, 0.0), z=(0.0, 0.0))


def robertson(b: float, c: float) -> Ode:
    """Stiff; x + y + z stays 1."""
    return system_of(
        lambda x, y, z: [-0.4 * x + b * y * z, 0.4 * x - b * y * z - c * y * y, c * y * y],
        "x",
        "y",
        "z",
    )


def _quadrotor(*x: ca.SX) -> list[ca.SX]:
    g, radius, arm, rotor, body = 9.81, 0.1, 0.5, 0.1, 1.0
    mass = body + 4 * rotor
    jx = jy = 0.4 * body * radius**2 + 2 * arm**2 * rotor
    jz = 0.4 * body * radius**2 + 4 * arm**2 * rotor
    _, _, x3, x4, x5, x6, roll, pitch, yaw, x10, x11, x12 = x
    s7, c7, s8, c8 = ca.sin(roll), ca.cos(roll), ca.sin(pitch), ca.cos(pitch)
    s9, c9 = ca.sin(yaw), ca.cos(yaw)
    force = mass * g - 10 * (x3 - 1) + 3 * x6
    return [
        c8 * c9 * x4 + (s7 * s8 * c9 - c7 * s9) * x5 + (c7 * s8 * c9 + s7 * s9) * x6,
        c8 * s9 * x4 + (s7 * s8 * s9 + c7 * c9) * x5 + (c7 * s8 * s9 - s7 * c9) * x6,
        s8 * x4 - s7 * c8 * x5 - c7 * c8 * x6,
        x12 * x5 - x11 * x6 - g * s8,
        x10 * x6 - x12 * x4 + g * c8 * s7,
        x11 * x4 - x10 * x5 + g * c8 * c7 - force / mass,
        x10 + s7 * ca.tan(pitch) * x11 + c7 * ca.tan(pitch) * x12,
        c7 * x11 - s7 * x12,
        (s7 / c8) * x11 + (c7 / c8) * x12,
        ((jy - jz) / jx) * x11 * x12 + (-roll - x10) / jx,
        ((jz - jx) / jy) * x10 * x12 + (-pitch - x11) / jy,
        ((jx - jy) / jz) * x10 * x11,
    ]


QUADROTOR = system_of(_quadrotor, *(f"x{i}" for i in range(1, 13)))


def quadrotor_start(half_width: float) -> Box:
    """Positions and velocities in [-half_width, half_width], angles and rates 0."""
    widths = [half_width] * 6 + [0.0] * 6
    return Box(QUADROTOR.names, tuple(-w for w in widths), tuple(widths))
