"""From the level frame below a camera into the vehicle's and the global one, as intervals."""

from __future__ import annotations

import math

from workbench.estimation.camera import Camera
from workbench.estimation.outward import cosine, minus, plus, product, sine
from workbench.runtime.arc import Interval
from workbench.runtime.onboard.dead_reckoning import Pose
from workbench.runtime.person_guard import Disc


def in_vehicle(camera: Camera, ahead_m: Interval, beside_m: Interval) -> tuple[Interval, Interval]:
    """(longitudinal, lateral) from the middle of the rear axle: turned by yaw, then moved."""
    mounting = camera.mounting
    x, y = _turned(mounting.yaw_rad, ahead_m, beside_m)
    return plus(x, mounting.forward_m), plus(y, mounting.left_m)


def in_global(
    camera: Camera, ahead_m: Interval, beside_m: Interval, *, pose: Pose
) -> tuple[Interval, Interval]:
    """(x, y) for every pose of the vehicle's intervals, which must hold when the image was taken.

    The camera's yaw and the vehicle's heading turn together, and the mounting by the heading alone.
    """
    mounting = camera.mounting
    from_camera = _turned(plus(pose.heading, mounting.yaw_rad), ahead_m, beside_m)
    to_camera = _turned(pose.heading, mounting.forward_m, mounting.left_m)
    x = plus(pose.x, plus(to_camera[0], from_camera[0]))
    return x, plus(pose.y, plus(to_camera[1], from_camera[1]))


def disc_in_global(camera: Camera, ahead_m: Interval, beside_m: Interval, *, pose: Pose) -> Disc:
    """A disc with every position of the box, for every pose of the vehicle's intervals.

    Turning keeps distances: the disc around the box, and where its centre comes to lie. Smaller
    than the disc around `in_global` wherever the box is longer than wide and the vehicle turned.
    """
    whole = Disc.around(ahead_m, beside_m)
    centre = in_global(camera, (whole.x, whole.x), (whole.y, whole.y), pose=pose)
    moved = Disc.around(*centre)
    return Disc(moved.x, moved.y, math.nextafter(moved.radius + whole.radius, math.inf))


def _turned(angle: Interval, x: Interval, y: Interval) -> tuple[Interval, Interval]:
    c, s = cosine(angle), sine(angle)
    return minus(product(c, x), product(s, y)), plus(product(s, x), product(c, y))
