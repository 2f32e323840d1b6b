"""The ground a car can cover during one segment of a tube.

A CasADi Function with every operation rounded outward, so it evaluates and compiles alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.sensitivity.elementary import cos, sin
from workbench.sensitivity.intervals import SymbolicInterval
from workbench.sensitivity.validity import Validity, verbatim

# Covers the conversion of the centre and heading to single numbers, and the tolerance of 1e-6 m and
# 1e-6 rad within which a path table may contradict itself (`runtime.path`), over a few metres, m.
_PADDING_M = 1e-5
_MOST_ROTATION_RAD = 1.5


def occupancy_function() -> ca.Function:
    """Oriented rectangle that contains the body for every state of a path-coordinate box.

    In the frame of a path node, with delta = s - s_node and the curvature in [k]: the path turns by
    theta in [k] delta, its point lies at (delta cos, delta sin)([0, theta]), the reference point at
    that point + e (-sin, cos)(theta), and the body points along psi + theta. A rotation by at most
    rho about the middle heading moves a body point by at most half_width rho along the body and
    max(front, rear) rho across it; ok is 0 for a rho above 1.5.
    Inputs: lower, upper (3): station (m), offset (m), heading error (rad); node (4): station, x, y
    (m), heading (rad); curvature (2), 1/m; body (3): front, rear, half width in m.
    Outputs: rectangle (5): centre x, y (m), heading (rad), half length, half width (m); ok.
    """
    lower, upper = ca.SX.sym("lower", 3), ca.SX.sym("upper", 3)
    node, curvature, body = ca.SX.sym("node", 4), ca.SX.sym("curvature", 2), ca.SX.sym("body", 3)
    validity = Validity()

    def interval(low: ca.SX, high: ca.SX) -> SymbolicInterval:
        return SymbolicInterval.between(low, high, validity)

    station, offset, error = (interval(lower[i], upper[i]) for i in range(3))
    s_node, x_node, y_node, heading_node = (interval(node[i], node[i]) for i in range(4))
    delta = station - s_node
    turn = interval(curvature[0], curvature[1]) * delta
    swept = turn.hull(SymbolicInterval.exactly(0.0, validity))
    along = delta * cos(swept) - offset * sin(turn)
    across = delta * sin(swept) + offset * cos(turn)
    cover = _covering(along, across, error + turn, [interval(body[i], body[i]) for i in range(3)])
    cn, sn = cos(heading_node), sin(heading_node)
    x, y = x_node + cover.u * cn - cover.v * sn, y_node + cover.u * sn + cover.v * cn
    with verbatim():
        padding = _PADDING_M + x.width() + y.width()
        rectangle = ca.vertcat(
            (x.lower + x.upper) / 2, (y.lower + y.upper) / 2, heading_node.lower + cover.heading,
            cover.half_length.upper + padding, cover.half_width.upper + padding,
        )  # fmt: skip
        outputs = list(ca.cse([rectangle, validity.result()]))
    return ca.Function(
        "wb_occupancy", [lower, upper, node, curvature, body], outputs,
        ["lower", "upper", "node", "curvature", "body"], ["rectangle", "ok"],
    )  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class _Cover:
    """A rectangle in a node's frame: centre (u, v) in m, heading in rad, half sides in m."""

    u: SymbolicInterval
    v: SymbolicInterval
    heading: ca.SX
    half_length: SymbolicInterval
    half_width: SymbolicInterval


def _covering(
    along: SymbolicInterval,
    across: SymbolicInterval,
    heading: SymbolicInterval,
    body: list[SymbolicInterval],
) -> _Cover:
    """Rectangle around the body (front, rear, half width) for every reference point and heading."""
    front, rear, half_width = body
    direction, u_mid, v_mid = (_middle(each) for each in (heading, along, across))
    c, s = cos(direction), sin(direction)
    rotation = (heading - direction).absolute()
    # Beyond a quarter turn the front would come to lie behind the rear bumper.
    heading.validity.require(rotation.upper <= _MOST_ROTATION_RAD)
    spread_along, spread_across = (along - u_mid).absolute(), (across - v_mid).absolute()
    c_size, s_size = c.absolute(), s.absolute()
    ahead = (front - rear).scale(0.5)
    half_length = (front + rear).scale(0.5) + half_width * rotation
    half_across = half_width + front.maximum(rear) * rotation
    return _Cover(
        u_mid + ahead * c,
        v_mid + ahead * s,
        direction.lower,
        half_length + spread_along * c_size + spread_across * s_size,
        half_across + spread_along * s_size + spread_across * c_size,
    )


def _middle(interval: SymbolicInterval) -> SymbolicInterval:
    with verbatim():
        middle = (interval.lower + interval.upper) / 2
    return SymbolicInterval.between(middle, middle, interval.validity)
