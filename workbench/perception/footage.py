"""Images in the order of time, from a folder or from a video."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench.errors import InputError
from workbench.perception.images import Frame, frames, timed_images
from workbench.perception.video import video_frames, video_length


@final
@dataclass(frozen=True, slots=True)
class Footage:
    """frames: to be gone through once, read as they are asked for; count: about how many."""

    frames: Iterator[Frame]
    count: int


def footage(path: str | Path, *, rate_hz: float | None, start_s: float | None) -> Footage:
    """The images of a folder (`timed_images`) or of a video (`video_frames`).

    rate_hz: images per second, for a folder without frames.csv only; start_s: when the first image
    was taken, where the clock of the images is not that of the vehicle. Raises InputError as they
    do, and for a rate beside a video, which has times of its own.
    """
    place = Path(path)
    if not place.is_file():
        count = len(timed_images(place, rate_hz=rate_hz))
        return Footage(_shifted(frames(place, rate_hz=rate_hz), start_s), count)
    if rate_hz is not None:
        raise InputError(f"{place}: a video has times of its own; leave the rate out")
    return Footage(_shifted(video_frames(place), start_s), video_length(place))


def _shifted(found: Iterator[Frame], start_s: float | None) -> Iterator[Frame]:
    by_s: float | None = None if start_s is not None else 0.0
    for frame in found:
        if by_s is None:
            by_s = (start_s or 0.0) - frame.t_s
        yield dataclasses.replace(frame, t_s=frame.t_s + by_s)
