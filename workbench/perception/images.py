"""Folders of images as frames with times."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.tables import Table
from workbench.perception.letterbox import Image

ENDINGS: Final = (".png", ".jpg", ".jpeg", ".bmp", ".ppm", ".tif", ".tiff", ".webp")


@final
@dataclass(frozen=True, slots=True)
class Frame:
    """One image (H, W, 3; 8-bit RGB) and when it was taken."""

    path: Path
    t_s: float
    image: Image


def frames(folder: str | Path, *, rate_hz: float | None = None) -> Iterator[Frame]:
    """The images of a folder in the order of their times.

    Times come from `frames.csv` (columns file, t) in the folder; without it the images count in the
    order of their names, frame k at k / rate_hz. Raises InputError for a folder that is none, is
    empty or names files that it lacks, for times that do not increase, and for a video, which must
    be taken apart first: this package decodes images only.
    """
    place = Path(folder)
    if place.is_file():
        raise InputError(
            f"{place}: expected a folder of images, got a file; take a video apart first, e.g. "
            f"`ffmpeg -i {place.name} frames/%06d.png`, and give the folder and the video's rate"
        )
    if not place.is_dir():
        raise InputError(f"{place}: no such folder of images")
    timed = Table.exists(place, "frames")
    listed = _stated(place) if timed else _counted(place, rate_hz)
    for path, t_s in listed:
        yield Frame(path, t_s, read_image(path))


def read_image(path: Path) -> Image:
    """One image file as (H, W, 3) of 8-bit RGB. Needs Pillow, of the extra `perception`."""
    try:
        import PIL.Image
    except ImportError:
        raise InputError(
            "reading images needs the perception extra (pillow is missing): "
            "pip install 'reach-workbench[perception]'"
        ) from None
    try:
        with PIL.Image.open(path) as opened:
            return np.asarray(opened.convert("RGB"), dtype=np.uint8)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as an image ({error})") from error


def _counted(folder: Path, rate_hz: float | None) -> list[tuple[Path, float]]:
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in ENDINGS)
    if not paths:
        raise InputError(f"{folder}: expected images ({', '.join(ENDINGS)}), found none")
    if rate_hz is None or not 0.0 < rate_hz < math.inf:
        raise InputError(
            f"{folder}: expected a frames.csv with the columns file and t, or rate_hz above 0; got "
            f"rate_hz={rate_hz!r}"
        )
    return [(path, k / rate_hz) for k, path in enumerate(paths)]


def _stated(folder: Path) -> list[tuple[Path, float]]:
    listed: list[tuple[Path, float]] = []
    for row in Table.read(folder, "frames", ("file", "t")).rows:
        path, t_s = folder / row.text("file"), row.number("t")
        if not path.is_file():
            raise InputError(f"{row.place('file')}: the folder lacks {row.text('file')!r}")
        if listed and t_s <= listed[-1][1]:
            raise InputError(f"{row.place('t')}: expected times that increase, got {t_s!r}")
        listed.append((path, t_s))
    if not listed:
        raise InputError(f"{folder}: frames.csv lists no image")
    return listed
