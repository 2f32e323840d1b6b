"""A rectangle and a disc that moves and grows in a time window: proved gap, and cheap boxes.

CasADi Functions that evaluate and compile alike. The places are computed in plain floats; a proved
budget, a share of the sum M of all sizes that enter, covers every rounding. With u = 2^-53 and
s = fl(end - from_s), off by u |s|: a centre p + v s errs by 3.1 u (|p| + |v s|), a radius
r + g s + q s^2 / 2 by 7 u (|r| + |g s| + q s^2), each later sum by u M. What only chooses where to
look needs no budget. Where M is finite nothing has overflowed; a NaN or infinity makes `ok` 0.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.sensitivity.elementary import cos, sin
from workbench.sensitivity.intervals import SymbolicInterval
from workbench.sensitivity.validity import LARGEST, Validity, verbatim

# Shares of M. A box takes a centre, a radius, and four more sums: below 12 u, so that 16 u suffice.
_BOX_BUDGET = 2.0**-49
# A gap takes products with the direction (3 u), sums (5 u), and the heading's cosine and sine, off
# by 16 u each: below 32 u for the half sides and 20 u for all else, so that 64 u suffice.
_GAP_BUDGET = 2.0**-47
_TINY = 1e-290
# Places and sizes beyond this are no car's.
_FARTHEST_M = 1e8
# Directions are made a little shorter than 1; as floats their square errs by less than 4 u, so that
# their true length lies between _LEAST_SQUARE^(1/2) (1 - 2 u) and 1 once these limits are met.
_SHORTER = 1.0 - 2.0**-46
_MOST_SQUARE, _LEAST_SQUARE = 1.0 - 2.0**-48, 1.0 - 2.0**-43
# Below this squared length (m^2) a difference of places gives no direction.
_NO_LENGTH = 1e-24


@functools.cache
def car_function() -> ca.Function:
    """What all people share of one rectangle: the direction of its heading, and a box around it.

    Input: rectangle (5): centre x, y (m), heading (rad), half length, half width (m).
    Outputs: car (6): cosine and sine of the heading, within 2^-49, then x lower, x upper, y lower,
    y upper (m) of the box, rounded outward; ok. The enclosures of `cos` and `sin` are 26 u wide and
    contain the true value, so that their rounded middles err by less than 16 u = 2^-49.
    """
    rectangle, validity = ca.SX.sym("rectangle", 5), Validity()
    points = [SymbolicInterval.between(v, v, validity) for v in ca.vertsplit(rectangle)]
    x, y, heading, half_length, half_width = points
    for number in (rectangle[0], rectangle[1], rectangle[3], rectangle[4]):
        validity.require(ca.fabs(number) <= _FARTHEST_M)
    validity.require(rectangle[3] >= 0.0)
    validity.require(rectangle[4] >= 0.0)
    c, s = cos(heading), sin(heading)
    c_size, s_size = c.absolute(), s.absolute()
    half_x = half_length * c_size + half_width * s_size
    half_y = half_length * s_size + half_width * c_size
    box = [(x - half_x).lower, (x + half_x).upper, (y - half_y).lower, (y + half_y).upper]
    with verbatim():
        middles = [(each.lower + each.upper) / 2 for each in (c, s)]
        outputs = list(ca.cse([ca.vertcat(*middles, *box), validity.result()]))
    return ca.Function("wb_car", [rectangle], outputs, ["rectangle"], ["car", "ok"])


@functools.cache
@verbatim()
def box_function() -> ca.Function:
    """A box that contains the disc of one piece at every time of a window.

    The centre moves on a line and the radius is convex, so the disc stays in the hull of the places
    at the ends, each widened by the larger radius.
    Inputs: piece (8): from_s, x, y, vx, vy, radius, growth, growth2 (see `DiscPiece`); window (2):
    start and end in s. Outputs: box (4): x lower, x upper, y lower, y upper (m); ok.
    """
    piece, window = ca.SX.sym("piece", 8), ca.SX.sym("window", 2)
    swept = _swept(piece, window)
    budget = _BOX_BUDGET * swept.sizes + _TINY
    radius = ca.fmax(*swept.radii)
    ends = []
    for first, last in zip(*swept.places, strict=True):
        ends += [(ca.fmin(first, last) - radius) - budget, (ca.fmax(first, last) + radius) + budget]
    ok = ca.logic_and(swept.ordered, swept.sizes <= LARGEST / 4)
    outputs = list(ca.cse([ca.vertcat(*ends), ok]))
    return ca.Function("wb_box", [piece, window], outputs, ["piece", "window"], ["box", "ok"])


@functools.cache
@verbatim()
def gap_function() -> ca.Function:
    """A proved lower bound of the distance between a rectangle and a moving disc, in m.

    For a direction n with |n| <= 1, at every time of the window: distance >= n . (P(s) - c) - R(s)
    - a |n . e| - b |n . e'|, with c, a, b, e, e' the rectangle's centre, half sides and directions.
    P is linear and R convex in s, so the right side is concave and least at an end of the window.
    Every n gives a bound; the best of four is taken, which is the distance between rectangle and
    swept disc (R replaced by its chord) when they are apart: from the rectangle's nearest point to
    the centre at the start, and at the end, and across both slanted sides of the hull of both
    discs.
    Where they overlap the bound is negative; as |n| >= 1 - 2^-43 it is then enlarged by 2^-42.
    Inputs: rectangle (5) and car (6), see `car_function`; piece (8) and window (2), see
    `box_function`. Outputs: gap, m; ok.
    """
    rectangle, car = ca.SX.sym("rectangle", 5), ca.SX.sym("car", 6)
    piece, window = ca.SX.sym("piece", 8), ca.SX.sym("window", 2)
    swept = _swept(piece, window)
    nx, ny = _direction(rectangle, car, swept)
    square = nx * nx + ny * ny
    start = nx * (piece[1] - rectangle[0]) + ny * (piece[2] - rectangle[1])
    drift = nx * piece[3] + ny * piece[4]
    first, last = (
        (start + drift * time) - radius
        for time, radius in zip(swept.times, swept.radii, strict=True)
    )
    along, across = nx * car[0] + ny * car[1], ny * car[0] - nx * car[1]
    half = rectangle[3] * ca.fabs(along) + rectangle[4] * ca.fabs(across)
    sizes = swept.sizes + ca.sum1(ca.fabs(rectangle))
    gap = (ca.fmin(first, last) - half) - (_GAP_BUDGET * sizes + _TINY)
    proved = ca.if_else(gap >= 0.0, gap, gap * (1.0 + 2.0**-42))
    conditions = (
        rectangle[3] >= 0.0, rectangle[4] >= 0.0, square <= _MOST_SQUARE, square >= _LEAST_SQUARE,
        sizes <= LARGEST / 4, ca.fabs(proved) <= LARGEST,
    )  # fmt: skip
    ok = functools.reduce(ca.logic_and, conditions, swept.ordered)
    return ca.Function(
        "wb_gap", [rectangle, car, piece, window], list(ca.cse([proved, ok])),
        ["rectangle", "car", "piece", "window"], ["gap", "ok"],
    )  # fmt: skip


def separation_functions() -> list[ca.Function]:
    """Every Function that a kernel needs for the separation from people."""
    return [car_function(), box_function(), gap_function()]


_Pair = tuple[ca.SX, ca.SX]


@final
@dataclass(frozen=True, slots=True)
class _Swept:
    """Times since the piece's start, places and radii at both ends of a window; all floats.

    sizes: M of the module's text; ordered: whether the window and the piece make sense.
    """

    times: _Pair
    places: tuple[_Pair, _Pair]
    radii: _Pair
    sizes: ca.SX
    ordered: ca.SX


def _swept(piece: ca.SX, window: ca.SX) -> _Swept:
    from_s, x, y, vx, vy, radius, growth, growth2 = ca.vertsplit(piece)
    times = (window[0] - from_s, window[1] - from_s)
    longest = ca.fmax(ca.fabs(times[0]), ca.fabs(times[1]))
    radii = [(radius + growth * t) + (0.5 * growth2) * (t * t) for t in times]
    sizes = (ca.fabs(x) + ca.fabs(y)) + (ca.fabs(vx) + ca.fabs(vy)) * longest
    sizes = sizes + ((ca.fabs(radius) + ca.fabs(growth) * longest) + growth2 * (longest * longest))
    return _Swept(
        times,
        ((x + vx * times[0], y + vy * times[0]), (x + vx * times[1], y + vy * times[1])),
        (ca.fmax(radii[0], 0.0), ca.fmax(radii[1], 0.0)),
        sizes,
        ca.logic_and(growth2 >= 0.0, window[0] <= window[1]),
    )


def _direction(rectangle: ca.SX, car: ca.SX, swept: _Swept) -> _Pair:
    """A direction of nearly unit length that separates well; proves nothing."""
    c, s = car[0], car[1]
    half = (rectangle[3], rectangle[4])
    places = []
    for x, y in swept.places:
        dx, dy = x - rectangle[0], y - rectangle[1]
        places.append((c * dx + s * dy, c * dy - s * dx))
    first_radius, last_radius = swept.radii
    candidates = [_away(place, half) for place in places]
    grown = last_radius - first_radius
    candidates += [_across(places, grown, candidates[1], side=side) for side in (-1.0, 1.0)]

    def separation(n: _Pair) -> ca.SX:
        first, last = (n[0] * u + n[1] * v for u, v in places)
        nearer = ca.fmin(first - first_radius, last - last_radius)
        return nearer - (half[0] * ca.fabs(n[0]) + half[1] * ca.fabs(n[1]))

    best, value = candidates[0], separation(candidates[0])
    for candidate in candidates[1:]:
        other = separation(candidate)
        better = other > value
        best = (
            ca.if_else(better, candidate[0], best[0]),
            ca.if_else(better, candidate[1], best[1]),
        )
        value = ca.if_else(better, other, value)
    along, across = _SHORTER * best[0], _SHORTER * best[1]
    return c * along - s * across, s * along + c * across


def _away(place: _Pair, half: _Pair) -> _Pair:
    """From the nearest point of the rectangle (in its own frame) to `place`; inside, through the
    nearest side."""
    u, v = place
    a, b = ca.fabs(u) - half[0], ca.fabs(v) - half[1]
    out_u, out_v = ca.fmax(a, 0.0), ca.fmax(b, 0.0)
    square = out_u * out_u + out_v * out_v
    outside, sideways = square > _NO_LENGTH, a < b
    length = ca.sqrt(square)
    n_u = ca.if_else(outside, out_u / length, ca.if_else(sideways, 0.0, 1.0))
    n_v = ca.if_else(outside, out_v / length, ca.if_else(sideways, 1.0, 0.0))
    return ca.if_else(u < 0.0, -n_u, n_u), ca.if_else(v < 0.0, -n_v, n_v)


def _across(places: list[_Pair], grown: ca.SX, otherwise: _Pair, *, side: float) -> _Pair:
    """Normal of the common tangent of both discs on one side (-1 or 1) of their way; `otherwise`
    where one disc contains the other."""
    (u, v), (u_end, v_end) = places
    e_u, e_v = u_end - u, v_end - v
    square = e_u * e_u + e_v * e_v
    slanted = ca.logic_and(square > _NO_LENGTH, grown * grown < square)
    inverse = 1.0 / ca.sqrt(square)
    e_u, e_v, lean = e_u * inverse, e_v * inverse, grown * inverse
    upright = side * ca.sqrt(ca.fmax(1.0 - lean * lean, 0.0))
    n_u, n_v = lean * e_u - upright * e_v, lean * e_v + upright * e_u
    return ca.if_else(slanted, n_u, otherwise[0]), ca.if_else(slanted, n_v, otherwise[1])
