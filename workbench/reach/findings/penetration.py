"""How close a body certainly is to a point: the other side of `occupancy`'s clearance."""

from __future__ import annotations

import casadi as ca

from workbench.sensitivity.elementary import cos, sin
from workbench.sensitivity.intervals import SymbolicInterval
from workbench.sensitivity.validity import Validity, verbatim

# Covers the 1e-6 m and 1e-6 rad within which a path table may contradict itself, over a few metres.
_PADDING_M = 1e-5


def distance_function() -> ca.Function:
    """A proved upper bound of the signed distance of a point from the body, for every pose of a
    path-coordinate box, in m; negative inside.

    In the body's frame the point is (u, v); with a = max(u - front, -rear - u) and b = |v| -
    half_width the distance is sqrt(max(a, 0)^2 + max(b, 0)^2), or max(a, b) inside. Poses as in
    `occupancy_function`, and a padding of the same size. Inputs: lower, upper (3): station, offset,
    heading error; node (4); curvature (2); body (3): front, rear, half width; point (2): x, y.
    Every operation is rounded outward; `ok` is 1 where all were defined.
    """
    lower, upper = ca.SX.sym("lower", 3), ca.SX.sym("upper", 3)
    node, curvature = ca.SX.sym("node", 4), ca.SX.sym("curvature", 2)
    body, at = ca.SX.sym("body", 3), ca.SX.sym("point", 2)
    validity = Validity()

    def interval(low: ca.SX, high: ca.SX) -> SymbolicInterval:
        return SymbolicInterval.between(low, high, validity)

    station, offset, error = (interval(lower[i], upper[i]) for i in range(3))
    s_node, x_node, y_node, heading_node = (interval(node[i], node[i]) for i in range(4))
    front, rear, half_width = (interval(body[i], body[i]) for i in range(3))
    dx, dy = interval(at[0], at[0]) - x_node, interval(at[1], at[1]) - y_node
    delta = station - s_node
    turn = interval(curvature[0], curvature[1]) * delta
    swept = turn.hull(SymbolicInterval.exactly(0.0, validity))
    c, s = cos(heading_node), sin(heading_node)
    along = dx * c + dy * s - (delta * cos(swept) - offset * sin(turn))
    across = dy * c - dx * s - (delta * sin(swept) + offset * cos(turn))
    c, s = cos(error + turn), sin(error + turn)
    u, v = along * c + across * s, across * c - along * s
    a = (u - front).maximum((rear + u).scale(-1.0))
    found = _signed(a, v.absolute() - half_width)
    padded = (found + SymbolicInterval.exactly(_PADDING_M, validity)).upper
    with verbatim():
        outputs = list(ca.cse([padded, validity.result()]))
    return ca.Function(
        "wb_distance", [lower, upper, node, curvature, body, at], outputs,
        ["lower", "upper", "node", "curvature", "body", "point"], ["distance", "ok"],
    )  # fmt: skip


def _signed(a: SymbolicInterval, b: SymbolicInterval) -> SymbolicInterval:
    """Upper bound of sqrt(max(a, 0)^2 + max(b, 0)^2), or of max(a, b) where both are <= 0."""
    zero = SymbolicInterval.exactly(0.0, a.validity)
    outside = (a.maximum(zero).square() + b.maximum(zero).square()).sqrt()
    with verbatim():
        inside = ca.logic_and(a.upper <= 0, b.upper <= 0)
        distance = ca.if_else(inside, ca.fmax(a.upper, b.upper), outside.upper)
    return SymbolicInterval(distance, distance, a.validity).watched()
