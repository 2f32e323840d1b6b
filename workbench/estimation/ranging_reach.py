"""Up to which distance a stated error of a person's position holds, by what the camera file says.

`python -m workbench.estimation.ranging_reach` prints the table of docs/ranging.md.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

from workbench.estimation.camera import Camera, Shape, gem_e2_camera_path, load_camera
from workbench.estimation.outward import middle
from workbench.estimation.ranging import BoundingBox, Edge, RangingAnswer, Sight, ranged, sight_of
from workbench.estimation.ranging_frames import in_global
from workbench.runtime.arc import Interval
from workbench.runtime.onboard.dead_reckoning import Pose

PAPER_ERROR_M: Final = 0.5
STEP_M: Final = 0.1
FARTHEST_M: Final = 20.0
_HEIGHT_M: Final = 1.7
KNOWN_POSE: Final = Pose((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))


def by_width_alone_m(
    error_m: float, *, width_m: float, width_error_m: float, pixel_error: float, focal_px: float
) -> float:
    """To first order, the distance d with error d dw/w + 2 e d^2/(f w): what width alone gives.

    >>> d = by_width_alone_m(0.5, width_m=0.47, width_error_m=0.1, pixel_error=0.0, focal_px=1e3)
    >>> round(d, 2)
    2.35
    """
    per_m = width_error_m / width_m
    per_m2 = 2.0 * pixel_error / (focal_px * width_m)
    return 2.0 * error_m / (per_m + math.sqrt(per_m * per_m + 4.0 * per_m2 * error_m))


def errors_m(
    sight: Sight, ahead_m: float, *, seen: Shape, assumed: Shape, pose: Pose = KNOWN_POSE
) -> Iterator[float]:
    """How far the answer's middle may be from the truth, for somebody straight ahead; inf where the
    answer has no end.

    The half diagonal of the global box, for every box that shows a person of 1.7 m with one
    combination of the ends of width, contact, pitch, height and pixel errors (`seen`), answered
    under `assumed`, which must not claim more. SAMPLED in the combinations; each answer is
    ENCLOSED.
    """
    for box in _boxes(sight.camera, ahead_m, seen):
        yield _half_diagonal_m(sight.camera, ranged(sight, box, shape=assumed), pose)


def spans_m(
    camera: Camera, *, seen: Shape, assumed: Shape, error_m: float, pose: Pose = KNOWN_POSE
) -> tuple[Interval, ...]:
    """All stretches of distance, on a grid of 0.1 m from 1 m to 20 m, on which `errors_m` stay
    within error_m."""
    sight = sight_of(camera)
    found: list[Interval] = []
    holding: list[float] = []
    for k in range(round(1.0 / STEP_M), round(FARTHEST_M / STEP_M) + 1):
        ahead_m = round(k * STEP_M, 6)
        errors = errors_m(sight, ahead_m, seen=seen, assumed=assumed, pose=pose)
        if all(error <= error_m for error in errors):
            holding.append(ahead_m)
        elif holding:
            found.append((holding[0], holding[-1]))
            holding = []
    return (*found, (holding[0], holding[-1])) if holding else tuple(found)


def _boxes(camera: Camera, ahead_m: float, shape: Shape) -> Iterator[BoundingBox]:
    lens, mounting, errors = camera.lens, camera.mounting, camera.boxes
    fx, fy = middle(lens.focal_x_px), middle(lens.focal_y_px)
    edge, bottom = errors.edge_px + lens.residual_px, errors.contact_px + lens.residual_px
    signs = (-1.0, 1.0)
    for width, pitch, up, e, b, g in itertools.product(
        shape.width_m, mounting.pitch_rad, mounting.up_m, signs, signs, signs
    ):
        depth = ahead_m * math.cos(pitch) + up * math.sin(pitch)
        half = 0.5 * fx * width / depth + e * edge
        touching = max(ahead_m + g * shape.contact_m, 0.01)
        v_feet = middle(lens.centre_y_px) + fy * math.tan(math.atan2(up, touching) - pitch)
        v_feet += b * bottom
        hidden = frozenset({Edge.BOTTOM}) if v_feet > camera.size_px[1] else frozenset()
        v_head = max(v_feet - fy * _HEIGHT_M / depth, 0.0)
        u = middle(lens.centre_x_px)
        if half > 0.0:
            yield BoundingBox(
                u - half,
                v_head,
                u + half,
                max(min(v_feet, camera.size_px[1]), v_head + 1.0),
                hidden,
            )


def _half_diagonal_m(camera: Camera, found: RangingAnswer, pose: Pose) -> float:
    if found.ahead_m is None or found.beside_m is None:
        return math.inf
    x, y = in_global(camera, found.ahead_m, found.beside_m, pose=pose)
    return 0.5 * math.hypot(x[1] - x[0], y[1] - y[0])


@final
@dataclass(frozen=True, slots=True)
class Case:
    """One row of the table: half widths of what is unsure about the shipped camera file's middle
    values; feet_m: contact_m; xy_m and heading_rad: of the vehicle's pose."""

    width_m: float
    pixel: float
    pitch_rad: float
    feet_m: float
    xy_m: float = 0.0
    heading_rad: float = 0.0

    def camera(self, base: Camera) -> Camera:
        """The shipped camera with this case's uncertainty; mounting and roll as the file says."""
        pitch = middle(base.mounting.pitch_rad)
        mounting = dataclasses.replace(
            base.mounting, pitch_rad=(pitch - self.pitch_rad, pitch + self.pitch_rad)
        )
        boxes = dataclasses.replace(base.boxes, edge_px=self.pixel, contact_px=self.pixel)
        return dataclasses.replace(base, mounting=mounting, boxes=boxes)

    def shape(self, base: Camera) -> Shape:
        """Somebody on foot with this case's uncertainty."""
        width = (0.47 - self.width_m, 0.47 + self.width_m)
        return dataclasses.replace(base.on_foot, width_m=width, contact_m=self.feet_m)

    def pose(self) -> Pose:
        """The vehicle's pose at the origin."""
        place = (-self.xy_m, self.xy_m)
        return Pose(place, place, (-self.heading_rad, self.heading_rad))


CASES: Final = (
    Case(0.0, 0.5, 0.002, 0.0),
    Case(0.0, 2.0, 0.008, 0.3),
    Case(0.02, 2.0, 0.008, 0.3),
    Case(0.05, 2.0, 0.008, 0.3),
    Case(0.1, 2.0, 0.008, 0.3),
    Case(0.1, 2.0, 0.008, 0.1),
    Case(0.1, 2.0, 0.002, 0.1),
    Case(0.1, 0.5, 0.002, 0.1),
    Case(0.1, 0.5, 0.002, 0.0),
    Case(0.1, 2.0, 0.002, 0.1, 0.1, 0.01),
    Case(0.1, 2.0, 0.002, 0.1, 0.2, 0.02),
)
# So wide, a route says nothing that the other does not.
_ANY_WIDTH: Final = (1e-3, 1e3)
_ANY_CONTACT_M: Final = 1e3


def reach_row(base: Camera, case: Case) -> str:
    """One row of the table: the case, then where 0.5 m holds by width, by feet and by both."""
    camera, seen, pose = case.camera(base), case.shape(base), case.pose()
    shapes = (
        dataclasses.replace(seen, contact_m=_ANY_CONTACT_M),
        dataclasses.replace(seen, width_m=_ANY_WIDTH),
        seen,
    )
    numbers = (case.width_m, case.pixel, case.pitch_rad, case.feet_m, case.xy_m, case.heading_rad)
    cells = [f"{number:g}" for number in numbers]
    for assumed in shapes:
        spans = spans_m(camera, seen=seen, assumed=assumed, error_m=PAPER_ERROR_M, pose=pose)
        cells.append(", ".join(f"{low:.1f} to {high:.1f}" for low, high in spans) or "nowhere")
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Print the rows of all cases."""
    base = load_camera(gem_e2_camera_path())
    for case in CASES:
        sys.stdout.write(reach_row(base, case) + "\n")


if __name__ == "__main__":
    main()
