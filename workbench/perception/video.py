"""Videos as frames with the times that the file itself states."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from workbench.errors import InputError
from workbench.perception.images import Frame

# Streams of one file may end this much apart and their stated end be rounded.
_LATEST_S: Final = 0.5


def video_length(path: str | Path) -> int:
    """About how many images a video has, at least 1: what its head says, or else its packets.

    Raises InputError for a file that is no video.
    """
    import av

    with _opened(Path(path)) as container:
        stream = container.streams.video[0]
        count = int(stream.frames)
        if not count:
            # What is damaged is told when the images are read.
            with contextlib.suppress(av.FFmpegError):
                for packet in container.demux(stream):
                    count += packet.size > 0
        return max(count, 1)


def video_frames(path: str | Path) -> Iterator[Frame]:
    """The images of a video's first video stream, each at its own time stamp (s).

    The times are those of the stream, which need not begin at 0 nor be evenly spaced. Raises
    InputError for a file that is no video, is damaged or ends early, shows no image, has times
    that do not increase, or wants its images turned before they are shown. Needs PyAV, of the
    extra `perception`.
    """
    place = Path(path)
    name, last_s = place.name, -math.inf
    with _opened(place) as container:
        for number, frame in enumerate(_decoded(place, container), start=1):
            where = f"{name}, image {number}"
            if frame.is_corrupt:
                raise InputError(f"{where}: it is damaged; fetch the video again")
            if getattr(frame, "rotation", 0) != 0:
                raise InputError(
                    f"{where}: the file wants its images turned by {frame.rotation} degrees, and "
                    "the camera file is of images as they are; write the video again turned"
                )
            if frame.time is None or not float(frame.time) > last_s:
                raise InputError(
                    f"{where}: expected a time stamp after {last_s!r} s, got {frame.time!r}; take "
                    "the video apart into images with a frames.csv"
                )
            last_s = float(frame.time)
            yield Frame(where, last_s, frame.to_ndarray(format="rgb24"))
    if last_s == -math.inf:
        raise InputError(f"{place}: expected a video, found no image in it")


def _opened(path: Path) -> Any:
    import av

    if not path.is_file():
        raise InputError(f"{path}: no such video")
    try:
        container = av.open(str(path))
    except (av.FFmpegError, OSError, ValueError) as error:
        raise InputError(f"{path}: expected a video, but it cannot be read ({error})") from None
    if not container.streams.video:
        container.close()
        raise InputError(f"{path}: expected a video, found no images in it")
    return container


def _decoded(path: Path, container: Any) -> Iterator[Any]:
    """The first video stream's frames; damage that the decoder can tell is an error."""
    import av

    stream, end_s = container.streams.video[0], 0.0
    stream.codec_context.options = {"err_detect": "explode"}
    try:
        for packet in container.demux():
            if packet.pts is not None:
                end_s = max(end_s, float((packet.pts + (packet.duration or 0)) * packet.time_base))
            if packet.stream is stream:
                yield from packet.decode()
    except (av.FFmpegError, OSError, ValueError) as error:
        raise InputError(f"{path}: the video is damaged or ends early ({error})") from None
    stated_s = float(container.duration or 0) / av.time_base
    # Others of the usual containers fail to read on where they end early.
    if "matroska" in container.format.name and end_s < stated_s - _LATEST_S:
        raise InputError(
            f"{path}: the video ends early, after {end_s:.2f} s of the {stated_s:.2f} s that it "
            "states; fetch it again"
        )
