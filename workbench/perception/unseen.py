"""Where people may be whom the camera cannot see: beside its view, and behind whatever it sees."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.estimation.camera import Camera
from workbench.estimation.outward import minus, plus, product, quotient
from workbench.estimation.ranging import BoundingBox, Sight
from workbench.estimation.ranging_frames import disc_in_global
from workbench.runtime.arc import Interval, hull
from workbench.runtime.onboard.dead_reckoning import Pose
from workbench.runtime.person_guard import Disc
from workbench.runtime.policies.cycle import Watched


@final
@dataclass(frozen=True, slots=True)
class View:
    """What the detector is relied on to find: somebody upright between near_m and far_m ahead whose
    line is inset_px or more from the left and right border, and behind no other box.

    slices: discs per edge of the view and per shadow; more of them are smaller, and the monitor
    takes 32 people. assumed: whether the monitor is told of somebody in each of them; otherwise
    that nobody is there is a limit.
    """

    near_m: float
    far_m: float
    inset_px: float
    slices: int
    assumed: bool

    def __post_init__(self) -> None:
        if not (0.0 < self.near_m < self.far_m < math.inf and self.slices >= 1):
            raise InputError(
                "expected 0 < near_m < far_m and slices >= 1, got "
                f"{self.near_m!r}, {self.far_m!r}, {self.slices!r}"
            )
        if not 0.0 <= self.inset_px < math.inf:
            raise InputError(f"inset_px: expected a number >= 0, got {self.inset_px!r}")

    def limits(self, camera: Camera) -> tuple[str, ...]:
        """What is covered neither by who is seen nor by who is assumed, in sentences."""
        unseen = "nobody comes from beside the view, nor from behind whoever and whatever is seen"
        return (
            *(() if self.assumed else (unseen,)),
            f"beside and behind what the {camera.name} looks at, and nearer than {self.near_m:g} m "
            "before it, nobody is looked for: where the car goes must lie in the view",
            f"between {self.near_m:g} m and {self.far_m:g} m ahead, the detector finds everybody "
            "whose middle is in view and behind no box",
            "whatever hides people without being detected itself casts no shadow here",
        )


@final
@dataclass(frozen=True, slots=True)
class Unseen:
    """Where somebody may be who is not seen: {(F, L): F in ahead_m, L / F in sides, and L up to
    pad_m beyond} in the level frame below the camera, and discs in the global frame that cover it.
    """

    ahead_m: Interval
    sides: Interval
    pad_m: float
    discs: tuple[Disc, ...]


def edges(sight: Sight, view: View, *, pose: Pose) -> tuple[Unseen, Unseen]:
    """The left and the right edge of the view from near_m to far_m.

    Whoever comes into the view between the two crosses an edge on the way, at a time t >= 0 at a
    point of some disc. From then on they are in that disc, grown at their speed limit: so one
    person assumed in each disc, with any velocity, stands for everybody beyond the edge.
    """
    width, height = sight.camera.size_px
    rows, whole = (0.0, float(height)), (view.near_m, view.far_m)

    def edge(u_px: float) -> Unseen:
        sides = tangents(sight, columns_px=(u_px, u_px), rows_px=rows, error_px=0.0)
        return _covered(sight, sides, view, ahead_m=whole, pad_m=0.0, pose=pose)

    return edge(view.inset_px), edge(width - view.inset_px)


def shadow(
    sight: Sight, box: BoundingBox, view: View, *, from_m: float, pad_m: float, pose: Pose
) -> Unseen | None:
    """Everything behind a box, from from_m ahead to far_m; None where from_m is beyond that.

    The shadow's position (F, L) has L / F between the columns of the box, edges and pose being as
    unsure as the camera file says, and L up to pad_m beyond.
    """
    begin = max(from_m, view.near_m)
    if begin >= view.far_m:
        return None
    boxes, residual = sight.camera.boxes, sight.camera.lens.residual_px
    sides = tangents(
        sight,
        columns_px=(box.left_px, box.right_px),
        rows_px=(box.top_px, box.bottom_px),
        error_px=max(boxes.edge_px, boxes.contact_px) + 2.0 * residual,
    )
    return _covered(sight, sides, view, ahead_m=(begin, view.far_m), pad_m=pad_m, pose=pose)


def tangents(sight: Sight, *, columns_px: Interval, rows_px: Interval, error_px: float) -> Interval:
    """L / F along all lines of sight through a part of the image: with a, b column and row,
    (a cos(roll) - b sin(roll)) / (cos(pitch) + sin(pitch) (a sin(roll) + b cos(roll)))."""
    a = hull(*(sight.column(u_px, error_px) for u_px in columns_px))
    b = hull(*(sight.row(v_px, error_px) for v_px in rows_px))
    left = minus(product(a, sight.cos_roll), product(b, sight.sin_roll))
    up = plus(product(a, sight.sin_roll), product(b, sight.cos_roll))
    return quotient(left, plus(sight.cos_pitch, product(sight.sin_pitch, up)))


def watched_disc(camera: Camera, view: View, *, pose: Pose) -> Watched:
    """The disc about the rear axle that reaches far_m ahead of the camera, as `Observation` wants
    it; of it, only what `View.limits` leaves is watched.

    A point within R of the middle of the pose's box is at most R + b + c from below the camera, b
    the box's half diagonal and c the mounting's distance from the axle.
    """
    middle = Disc.around(pose.x, pose.y)
    mounting = camera.mounting
    ahead = max(map(abs, mounting.forward_m))
    aside = max(map(abs, mounting.left_m))
    less_m = (middle.radius + math.hypot(ahead, aside)) * (1.0 + 2.0**-49)
    left_m = math.nextafter(view.far_m - less_m, -math.inf)
    return Watched(middle.x, middle.y, max(left_m, 0.0))


def _covered(
    sight: Sight, sides: Interval, view: View, *, ahead_m: Interval, pad_m: float, pose: Pose
) -> Unseen:
    """The region with its discs, which are of slices of one ratio."""
    if not -math.inf < sides[0] <= sides[1] < math.inf:
        raise InputError(
            "expected lines of sight ahead of the camera; its pitch and roll leave some upright or "
            "behind it, narrow them"
        )
    from_m, until_m = ahead_m
    ratio = until_m / from_m
    inner = [from_m * ratio ** (k / view.slices) for k in range(1, view.slices)]
    cuts: Sequence[float] = [from_m, *(min(max(c, from_m), until_m) for c in inner), until_m]
    found = []
    for ahead in itertools.pairwise(cuts):
        beside = plus(product(ahead, sides), (-pad_m, pad_m))
        found.append(disc_in_global(sight.camera, ahead, beside, pose=pose))
    return Unseen(ahead_m, sides, pad_m, tuple(found))
