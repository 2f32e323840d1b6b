"""Graphs shared by the tests of the inclusion functions."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from workbench.sensitivity.inclusion import inclusion


def lifted(operation: Callable[..., ca.SX], count: int) -> ca.Function:
    symbols = [ca.SX.sym(name) for name in "abc"[:count]]
    return inclusion(ca.Function("f", symbols, [operation(*symbols)]))


def planar_field() -> tuple[ca.SX, ca.SX]:
    x = ca.SX.sym("x", 7)
    _, y, steering, speed, heading, speed_integral, offset_integral = ca.vertsplit(x)
    offset = y + 2.0 * ca.sin(heading)
    yaw_rate = speed * ca.tan(steering) / 1.75
    offset_rate = speed * ca.sin(heading) + 2.0 * ca.cos(heading) * yaw_rate
    command = -(0.6 * offset + 0.05 * offset_integral + offset_rate)
    acceleration = 2.8 - speed + 0.1 * speed_integral
    rates = (speed * ca.cos(heading), speed * ca.sin(heading), command, acceleration)
    return x, ca.vertcat(*rates, yaw_rate, 2.8 - speed, offset)
