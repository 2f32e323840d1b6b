"""People who walk before a camera, painted: images, where everybody is, and a camera file."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
import PIL.Image

from workbench.estimation.camera import gem_e2_camera_path

SIZE = (640, 480)
RATE_HZ = 5.0
# The camera as it really is, within the intervals of `camera_file` and beside their middles.
FOCAL, CENTRE_U, CENTRE_V = 541.0, 320.5, 239.4
UP, PITCH, FORWARD = 1.59, 0.034, 1.13
WIDTH, TALL = 0.47, 1.75
RED, GREEN, BLUE, GROUND = (230, 20, 20), (20, 210, 20), (20, 20, 230), (120, 125, 120)

Place = Callable[[float], tuple[float, float]]
Pose = Callable[[float], tuple[float, float, float]]


@dataclass(frozen=True)
class Thing:
    """An upright board that faces the camera: middle on the ground over time, sides and colour."""

    colour: tuple[int, int, int]
    at: Place
    width: float = WIDTH
    tall: float = TALL


def standing(t_s: float) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


RED_WALKER = Thing(RED, lambda t: (10.0, 3.0 - 1.0 * t))
# Behind the wall from 1.4 s on, until they step out on the right.
GREEN_WALKER = Thing(GREEN, lambda t: (12.0, 1.75 - 1.1 * min(t, 2.0) - 1.1 * max(t - 5.0, 0.0)))
WALL = Thing(BLUE, lambda t: (8.0, -0.4), width=0.8, tall=2.0)
SCENE = (RED_WALKER, GREEN_WALKER, WALL)


def camera_file(path: Path) -> Path:
    """The shipped camera file with a lens for small images."""
    text = gem_e2_camera_path().read_text(encoding="utf-8")
    for key, value in (
        ("size_px", list(SIZE)), ("focal_x_px", [538.0, 542.0]), ("focal_y_px", [538.0, 542.0]),
        ("centre_x_px", [319.0, 321.0]), ("centre_y_px", [239.0, 241.0]),
    ):  # fmt: skip
        text, count = re.subn(rf"(?m)^{key} = \[.*?\]", f"{key} = {value}", text)
        assert count == 1
    path.write_text(text, encoding="utf-8")
    return path


def ahead_of_camera(place: tuple[float, float], pose: tuple[float, float, float]) -> complex:
    """Where it is in the level frame below the camera: ahead + beside i."""
    x, y, heading = pose
    return (complex(*place) - complex(x, y)) * np.exp(-1j * heading) - FORWARD


def corners(level: complex, thing: Thing) -> list[tuple[float, float]]:
    """Pixels of its four corners."""
    found = []
    for beside in (level.imag - 0.5 * thing.width, level.imag + 0.5 * thing.width):
        for z in (0.0, thing.tall):
            down = UP - z
            depth = level.real * math.cos(PITCH) + down * math.sin(PITCH)
            below = down * math.cos(PITCH) - level.real * math.sin(PITCH)
            found.append((CENTRE_U - FOCAL * beside / depth, CENTRE_V + FOCAL * below / depth))
    return found


def painted(things: Sequence[Thing], t_s: float, pose: tuple[float, float, float]) -> np.ndarray:
    """The image, the farthest first."""
    image = np.full((SIZE[1], SIZE[0], 3), GROUND, dtype=np.uint8)
    placed = [(ahead_of_camera(thing.at(t_s), pose), thing) for thing in things]
    for level, thing in sorted(placed, key=lambda each: -each[0].real):
        if level.real < 0.5:
            continue
        us, vs = zip(*corners(level, thing), strict=True)
        u = [min(max(round(edge), 0), SIZE[0]) for edge in (min(us), max(us))]
        v = [min(max(round(edge), 0), SIZE[1]) for edge in (min(vs), max(vs))]
        image[v[0] : v[1], u[0] : u[1]] = thing.colour
    return image


def times(seconds: float) -> list[float]:
    return [k / RATE_HZ for k in range(round(seconds * RATE_HZ) + 1)]


def images_of(
    folder: Path, things: Sequence[Thing], seconds: float, *, pose: Pose = standing
) -> Path:
    """A folder of images with frames.csv."""
    folder.mkdir()
    rows = []
    for k, t_s in enumerate(times(seconds)):
        PIL.Image.fromarray(painted(things, t_s, pose(t_s))).save(folder / f"{k:03d}.png")
        rows.append((f"{k:03d}.png", t_s))
    with (folder / "frames.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("file", "t"), *rows])
    return folder


def video_of(path: Path, images: Sequence[np.ndarray], *, stamps: Sequence[int] = ()) -> Path:
    """A lossless video at RATE_HZ, or with these time stamps in fifths of a second."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=round(RATE_HZ))
        stream.width, stream.height, stream.pix_fmt = images[0].shape[1], images[0].shape[0], "bgr0"
        for k, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts = stamps[k] if stamps else k
            container.mux(stream.encode(frame.reformat(format="bgr0")))
        container.mux(stream.encode(None))
    return path
