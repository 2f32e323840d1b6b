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
# The tag by which cameras say that an image is to be turned before it is shown; 1: as it is.
_EXIF_ORIENTATION: Final = 0x0112


@final
@dataclass(frozen=True, slots=True)
class Frame:
    """One image (H, W, 3; 8-bit RGB), what to call it in messages, and when it was taken."""

    name: str
    t_s: float
    image: Image


def frames(folder: str | Path, *, rate_hz: float | None = None) -> Iterator[Frame]:
    """The images of a folder in the order of their times, as `timed_images` lists them."""
    for path, t_s in timed_images(folder, rate_hz=rate_hz):
        yield Frame(path.name, t_s, read_image(path))


def timed_images(
    folder: str | Path, *, rate_hz: float | None = None
) -> tuple[tuple[Path, float], ...]:
    """The image files of a folder with their times (s), in the order of these.

    Times come from `frames.csv` (columns file, t) in the folder; without it the images count in the
    order of their names, frame k at k / rate_hz. Raises InputError for a folder that is none, is
    empty or names files that it lacks, and for times that do not increase.
    """
    place = Path(folder)
    if not place.is_dir():
        found = "a file" if place.exists() else "nothing"
        raise InputError(f"{place}: no such folder of images; found {found}")
    if not Table.exists(place, "frames"):
        return tuple(_counted(place, rate_hz))
    if rate_hz is not None:
        raise InputError(
            f"{place}: expected times from frames.csv or from a rate, got both; leave the rate out"
        )
    return tuple(_stated(place))


def read_image(path: Path) -> Image:
    """One image file as (H, W, 3) of 8-bit RGB, pixels where the camera had them.

    Needs Pillow, of the extra `perception`. Raises InputError for what cannot be read, and for an
    image that is to be turned before it is shown: its columns are not the camera's.
    """
    try:
        import PIL.Image
    except ImportError:
        raise InputError(
            "reading images needs the perception extra (pillow is missing): "
            "pip install 'reach-workbench[perception]'"
        ) from None
    try:
        with PIL.Image.open(path) as opened:
            turned = opened.getexif().get(_EXIF_ORIENTATION, 1)
            image = np.asarray(opened.convert("RGB"), dtype=np.uint8)
    except (OSError, ValueError, SyntaxError, PIL.Image.DecompressionBombError) as error:
        raise InputError(f"{path}: cannot be read as an image ({error})") from error
    if turned != 1:
        raise InputError(
            f"{path}: its EXIF orientation {turned} says that it is to be turned before it is "
            "shown; turn its pixels for good, or remove the tag if the camera file is of the image "
            "as it is"
        )
    return image


def _counted(folder: Path, rate_hz: float | None) -> list[tuple[Path, float]]:
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in ENDINGS)
    if not paths:
        raise InputError(f"{folder}: expected images ({', '.join(ENDINGS)}), found none")
    if rate_hz is None or not 0.0 < rate_hz < math.inf:
        raise InputError(
            f"{folder}: expected a frames.csv with the columns file and t, or a rate above 0 "
            f"(images per s), got the rate {rate_hz!r}"
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
