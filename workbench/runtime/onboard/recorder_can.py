"""Raw CAN through python-can's writers and readers, with every microsecond kept.

All three forms count time from the core's start. BLF and ASC store times relative to the first
entry, and keep of that entry's own time no more than milliseconds or nothing at all; a marker at
time 0 makes it 0.
"""

from __future__ import annotations

import enum
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast, final

import can

from workbench.errors import InputError
from workbench.runtime.onboard.bus import EXTENDED, FLEXIBLE, REMOTE, heard
from workbench.runtime.onboard.recorder_entries import MARK_ID, LoggedFrame
from workbench.runtime.onboard.recorder_file import Spool

if TYPE_CHECKING:
    from workbench.runtime.onboard.intake import BusError

# Frames per container of a BLF file: one that is lost must not tear a frame in the next, which
# python-can does to frames that lie across the end of its 128 KiB.
_MOST_IN_CONTAINER: Final = 1000
_VEHICLE: Final = 0
_UPSTREAM: Final = 1
"""Channels of the two buses."""


class CanForm(enum.Enum):
    """Form of the raw log, by its file's ending."""

    ASC = ".asc"
    BLF = ".blf"
    CANDUMP = ".log"


@final
class _BlfWriter(can.BLFWriter):
    """Closes its container when it is told to, not only when it is full."""

    def commit(self) -> None:
        """Hand what is kept to the file."""
        self._flush()


@final
class CanLog:
    """A raw log that `spool` takes; `commit` makes it whole up to the last frame."""

    def __init__(self, spool: Spool, form: CanForm) -> None:
        file = cast(Any, spool)
        self._spool = spool
        self._since_commit = 0
        self._writer: _BlfWriter | can.ASCWriter | can.CanutilsLogWriter
        if form is CanForm.CANDUMP:
            self._writer = can.CanutilsLogWriter(file)
        elif form is CanForm.ASC:
            self._writer = can.ASCWriter(file)
            self._writer.log_event("workbench", 0.0)
        else:
            self._writer = _BlfWriter(file)
            self._writer.log_event("workbench", 0.0)

    def frame(self, frame: LoggedFrame) -> None:
        """One frame, or mark, which is kept until `commit`."""
        self._writer.on_message_received(message_of(frame))
        self._since_commit += 1

    @property
    def full(self) -> bool:
        """Must `commit` come before another frame does?"""
        return self._since_commit >= _MOST_IN_CONTAINER

    def commit(self) -> None:
        """Hand all frames to the disk. Raises OSError, after which they are lost."""
        self._since_commit = 0
        if isinstance(self._writer, _BlfWriter):
            self._writer.commit()
        self._spool.commit()

    def close(self) -> None:
        """As `commit`, and write the file's end."""
        self._writer.stop()


def message_of(frame: LoggedFrame) -> can.Message:
    """The frame as python-can knows it; its time is the nearest double to the microsecond."""
    identifier = frame.identifier
    remote = bool(identifier & REMOTE)
    # The bit of FLEXIBLE is one of an extended identifier's own as well.
    flexible = bool(identifier & FLEXIBLE) and not remote and frame.identifier != MARK_ID
    flags = EXTENDED | REMOTE | (FLEXIBLE if flexible else 0)
    return can.Message(
        timestamp=frame.at_us / 1e6,
        arbitration_id=identifier & ~flags,
        is_extended_id=bool(identifier & EXTENDED),
        is_remote_frame=remote,
        is_fd=flexible,
        is_rx=not frame.made,
        channel=_UPSTREAM if frame.upstream else _VEHICLE,
        data=frame.data,
    )


def frame_of(message: can.Message) -> LoggedFrame | BusError:
    """What a log holds, as the core takes it; error frames as the error that they report."""
    said = heard(message)
    if said.error is not None:
        return said.error
    at_us = round(message.timestamp * 1e6)
    upstream = message.channel in (_UPSTREAM, f"can{_UPSTREAM}")
    return LoggedFrame(at_us, said.identifier, said.data, not message.is_rx, upstream)


def read_can(path: Path) -> Iterator[tuple[int, LoggedFrame | BusError]]:
    """(us, entry) of a BLF, ASC or candump log in its order.

    A log that breaks off in the middle of a line or block ends with the last whole frame. Raises
    InputError for what python-can cannot read at all.
    """
    expected = f"expected a log of CAN frames (.blf, .asc, or .log of candump), got {path}"
    if path.suffix.lower() not in {form.value for form in CanForm}:
        raise InputError(f"{expected}; name a file with one of these endings")
    read = 0
    try:
        with can.LogReader(path) as reader:
            for message in reader:
                yield round(message.timestamp * 1e6), frame_of(message)
                read += 1
    except OSError as error:
        raise InputError(f"{expected} ({error.strerror or error})") from error
    except Exception as error:
        # python-can's readers fail in many ways at a torn end, and in the same ways at once where
        # the file is none of theirs.
        if read == 0:
            raise InputError(f"{expected}, which cannot be read ({error!r:.200})") from error
