"""Where a person stands, from the box around them in an image: by their width, and by their feet.

Level frame: origin on the ground below the camera, x ahead as the camera looks, y to the left of
it, z up. Camera frame: the same turned by roll, then pitch; a point of it at (X, Y, V) is seen at
the column a = Y / X and the row b = V / X. A ground point (F, L) of the level frame has
X0 = F cos(pitch) + h sin(pitch), h the camera's height, and at height z above it
X(z) = X0 - z sin(pitch), Y(z) = Y0 + z cos(pitch) sin(roll).
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import ClassVar, final

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.estimation.camera import Camera, Shape
from workbench.estimation.outward import (
    cosine,
    meet,
    minus,
    outward,
    plus,
    product,
    quotient,
    sine,
)
from workbench.runtime.arc import Interval

_EVERYWHERE: Interval = (-math.inf, math.inf)
_HALF: Interval = (0.5, 0.5)
# Above the rounding of a mean of two pixels, each within 1e6.
_MIDDLE_PX = 1e-9


@final
class Edge(enum.Enum):
    """A side of a box behind which more of the person may be."""

    LEFT = "left"
    RIGHT = "right"
    BOTTOM = "bottom"


@final
@dataclass(frozen=True, slots=True)
class BoundingBox:
    """A box in the image (px; u to the right, v down). hidden: edges that are not the person's own,
    as the border of the image or somebody in front cuts them off; more may be beyond."""

    left_px: float
    top_px: float
    right_px: float
    bottom_px: float
    hidden: frozenset[Edge] = frozenset()

    def __post_init__(self) -> None:
        values = (self.left_px, self.top_px, self.right_px, self.bottom_px)
        finite = all(abs(value) <= 1e6 for value in values)
        if not (finite and self.left_px < self.right_px and self.top_px < self.bottom_px):
            raise InputError(
                "expected a box with left < right and top < bottom within +-1e6 px, got left, top, "
                f"right, bottom {values!r}"
            )


@final
class RangingStatus(enum.Enum):
    """FOUND: a bounded set; CONTRADICTION: no position agrees with the assumptions, one of them is
    wrong; UNBOUNDED: the box shows no farthest position."""

    FOUND = "FOUND"
    CONTRADICTION = "CONTRADICTION"
    UNBOUNDED = "UNBOUNDED"


@final
@dataclass(frozen=True, slots=True)
class RangingAnswer:
    """What a box says of a position, in the level frame (m).

    ahead_m: by both routes; by_width_m, by_contact_m: by one alone, without an upper end where it
    gives none; None: no position. beside_m: to the left. Both are None unless the status is FOUND.
    ENCLOSED, given the camera file, flat ground and `BoundingBox.hidden`.
    """

    status: RangingStatus
    reason: str
    ahead_m: Interval | None
    beside_m: Interval | None
    by_width_m: Interval | None
    by_contact_m: Interval | None
    rigor: ClassVar[Rigor] = Rigor.ENCLOSED


@final
@dataclass(frozen=True, slots=True)
class Sight:
    """Lines of sight of a camera with intervals for what is unsure; see `sight_of`."""

    camera: Camera
    sin_pitch: Interval
    cos_pitch: Interval
    sin_roll: Interval
    cos_roll: Interval

    def column(self, u_px: float, error_px: float) -> Interval:
        """Columns a = (centre_x - u) / focal_x of a pixel that may be off."""
        lens = self.camera.lens
        offset = minus(lens.centre_x_px, outward((u_px - error_px, u_px + error_px)))
        return quotient(offset, lens.focal_x_px)

    def row(self, v_px: float, error_px: float) -> Interval:
        """Rows b = (centre_y - v) / focal_y of a pixel that may be off."""
        lens = self.camera.lens
        offset = minus(lens.centre_y_px, outward((v_px - error_px, v_px + error_px)))
        return quotient(offset, lens.focal_y_px)

    def depth_of(self, ahead_m: Interval) -> Interval:
        """X0 of ground points at F."""
        tilted = product(self.camera.mounting.up_m, self.sin_pitch)
        return plus(product(ahead_m, self.cos_pitch), tilted)

    def ahead_of(self, depth_m: Interval) -> Interval:
        """F of ground points at X0, the inverse of `depth_of`."""
        tilted = product(self.camera.mounting.up_m, self.sin_pitch)
        return quotient(minus(depth_m, tilted), self.cos_pitch)

    def beside_of(self, across_m: Interval, ahead_m: Interval) -> Interval:
        """L of ground points at Y0 and F: (Y0 - (F sin(pitch) - h cos(pitch)) sin(roll)) /
        cos(roll)."""
        down = product(self.camera.mounting.up_m, self.cos_pitch)
        lifted = product(minus(product(ahead_m, self.sin_pitch), down), self.sin_roll)
        return quotient(minus(across_m, lifted), self.cos_roll)


def sight_of(camera: Camera) -> Sight:
    """The camera's lines of sight, with its angles' sines and cosines."""
    pitch, roll = camera.mounting.pitch_rad, camera.mounting.roll_rad
    return Sight(camera, sine(pitch), cosine(pitch), sine(roll), cosine(roll))


def ranged(sight: Sight, box: BoundingBox, *, shape: Shape) -> RangingAnswer:
    """The set of positions (F, L) that agree with the box.

    With p, q the columns of the left and right edge, w the silhouette's width, c = cos(pitch)
    sin(roll), and z, z' the unknown heights within [0, tallest] at which the edges are seen:
    p X(z) = Y(z) + m + w/2 and q X(z') = Y(z') + m - w/2, |m| <= middle. Hence
    width: X0 (p - q) = w + (z - z') c + (p z - q z') sin(pitch), p - q being the box's width over
    focal_x;
    contact: the lowest point touches the flat ground at most `contact` from the position:
    F = h cot(pitch + angle below the axis) +- contact, see `on_ground`;
    beside: from the mean of both edges, in which w drops out, and from each edge alone.
    A hidden edge bounds from one side only: the person is nearer than it says, or as near.
    Assumes: a person upright on the ground, wholly before the camera; a lowest point that, where it
    is seen, touches the ground within the box's columns. ENCLOSED under these and the camera file.
    """
    by_width = _by_width(sight, box, shape)
    by_contact = _by_contact(sight, box, shape)
    if by_contact is None:
        return _contradiction("the feet are seen above the horizon", by_width, None)
    ahead = meet(by_width, by_contact)
    if ahead is None:
        return _contradiction(
            f"by the width they are {_said(by_width)} ahead, by the feet {_said(by_contact)}",
            by_width,
            by_contact,
        )
    if not ahead[1] < math.inf:
        reason = f"at least {ahead[0]:.2f} m ahead; neither width nor feet say how far at most"
        return RangingAnswer(RangingStatus.UNBOUNDED, reason, None, None, by_width, by_contact)
    beside = _beside(sight, box, shape, ahead)
    if beside is None:
        return _contradiction("the edges disagree about the side", by_width, by_contact)
    return RangingAnswer(RangingStatus.FOUND, "", ahead, beside, by_width, by_contact)


def on_ground(sight: Sight, row: Interval, columns: Interval) -> Interval | None:
    """F of flat ground that is seen at these rows and columns; None: nothing, it is all above.

    F = h (cos(pitch) + sin(pitch) g) / (sin(pitch) - cos(pitch) g) with g = a sin(roll) +
    b cos(roll), the cotangent of pitch - atan(g): it grows with g and falls with the pitch as long
    as the denominator is positive, so that it is largest and least at two corners. At or above the
    horizon there is no upper end.
    """
    low_pitch, high_pitch = sight.camera.mounting.pitch_rad
    height = sight.camera.mounting.up_m
    g = plus(product(columns, sight.sin_roll), product(row, sight.cos_roll))
    near, below = _cotangent(high_pitch, g[0])
    if below[1] <= 0.0:
        return None
    far, above = _cotangent(low_pitch, g[1])
    nearest = product(height, quotient(near, below))[0]
    return nearest, product(height, quotient(far, above))[1] if above[0] > 0.0 else math.inf


def _by_width(sight: Sight, box: BoundingBox, shape: Shape) -> Interval:
    error = _edge_error(sight)
    p, q = sight.column(box.left_px, error), sight.column(box.right_px, error)
    heights, tilt = (0.0, shape.tallest_m), product(sight.cos_pitch, sight.sin_roll)
    leaning = product((-shape.tallest_m, shape.tallest_m), tilt)
    slanting = minus(product(heights, p), product(heights, q))
    seen = plus(plus(shape.width_m, leaning), product(slanting, sight.sin_pitch))
    across = minus(
        outward((box.right_px - error, box.right_px + error)),
        outward((box.left_px - error, box.left_px + error)),
    )
    depth = quotient(product(seen, sight.camera.lens.focal_x_px), across)
    low, high = sight.ahead_of(depth)
    nearest = _nearest(sight, shape)
    if {Edge.LEFT, Edge.RIGHT} & box.hidden:
        low = nearest
    return min(max(low, nearest), high), high


def _by_contact(sight: Sight, box: BoundingBox, shape: Shape) -> Interval | None:
    lens, boxes = sight.camera.lens, sight.camera.boxes
    row = sight.row(box.bottom_px, math.nextafter(boxes.contact_px + lens.residual_px, math.inf))
    error = _edge_error(sight)
    left = 0.0 if Edge.LEFT in box.hidden else box.left_px
    right = sight.camera.size_px[0] if Edge.RIGHT in box.hidden else box.right_px
    columns = (sight.column(right, error)[0], sight.column(left, error)[1])
    ground = on_ground(sight, row, columns)
    if Edge.BOTTOM in box.hidden:
        return _nearest(sight, shape), _farthest(ground, shape)
    if ground is None:
        return None
    return plus(ground, (-shape.contact_m, shape.contact_m))


def _farthest(ground: Interval | None, shape: Shape) -> float:
    return math.inf if ground is None else plus(ground, (0.0, shape.contact_m))[1]


def _beside(sight: Sight, box: BoundingBox, shape: Shape, ahead: Interval) -> Interval | None:
    error = _edge_error(sight)
    p, q = sight.column(box.left_px, error), sight.column(box.right_px, error)
    heights, tilt = (0.0, shape.tallest_m), product(sight.cos_pitch, sight.sin_roll)
    depth = sight.depth_of(ahead)
    at_height = minus(depth, product(heights, sight.sin_pitch))
    aside = plus(product(heights, tilt), (-shape.middle_m, shape.middle_m))
    half = product(shape.width_m, _HALF)
    by_left = minus(minus(product(p, at_height), aside), half)
    by_right = plus(minus(product(q, at_height), aside), half)
    if Edge.LEFT in box.hidden:
        by_left = (by_left[0], math.inf)
    if Edge.RIGHT in box.hidden:
        by_right = (-math.inf, by_right[1])
    by_both = _EVERYWHERE
    if not {Edge.LEFT, Edge.RIGHT} & box.hidden:
        mean = sight.column(0.5 * box.left_px + 0.5 * box.right_px, error + _MIDDLE_PX)
        slants = [plus(tilt, product(edge, sight.sin_pitch)) for edge in (p, q)]
        leaning = product(plus(*(product(heights, each) for each in slants)), _HALF)
        by_both = minus(minus(product(mean, depth), leaning), (-shape.middle_m, shape.middle_m))
    across = meet(by_left, by_right, by_both)
    return None if across is None else sight.beside_of(across, ahead)


def _nearest(sight: Sight, shape: Shape) -> float:
    """The least F of somebody before the camera: X(z) > 0 at a height z within [0, tallest]."""
    lowered = product((0.0, shape.tallest_m), sight.sin_pitch)[0]
    return sight.ahead_of((lowered, lowered))[0]


def _edge_error(sight: Sight) -> float:
    boxes, lens = sight.camera.boxes, sight.camera.lens
    return math.nextafter(boxes.edge_px + lens.residual_px, math.inf)


def _cotangent(pitch_rad: float, g: float) -> tuple[Interval, Interval]:
    """cos(pitch) + sin(pitch) g and sin(pitch) - cos(pitch) g."""
    c, s = cosine((pitch_rad, pitch_rad)), sine((pitch_rad, pitch_rad))
    return plus(c, product(s, (g, g))), minus(s, product(c, (g, g)))


def _contradiction(reason: str, by_width: Interval, by_contact: Interval | None) -> RangingAnswer:
    return RangingAnswer(RangingStatus.CONTRADICTION, reason, None, None, by_width, by_contact)


def _said(ahead_m: Interval) -> str:
    if ahead_m[1] == math.inf:
        return f"{ahead_m[0]:.2f} m or more"
    return f"{ahead_m[0]:.2f} m to {ahead_m[1]:.2f} m"
