"""The process that writes the log; runs until the vehicle's loop is gone, then closes the files."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, final

from workbench.runtime.onboard.mcap import McapWriter
from workbench.runtime.onboard.recorder_can import CanForm, CanLog
from workbench.runtime.onboard.recorder_entries import TURN, LoggedFrame, Mark
from workbench.runtime.onboard.recorder_file import BlockFile, Spool
from workbench.runtime.onboard.recorder_header import HEADER_FILE, LogHeader
from workbench.runtime.onboard.recorder_log import McapLog
from workbench.runtime.onboard.recorder_pipe import REPORT, Inbox

MCAP_FILE: Final = "monitor.mcap"
CAN_STEM: Final = "can"
_READ_BYTES: Final = 1 << 20
_CHUNK_BYTES: Final = 1 << 20
_NICE: Final = 5


@final
class _Sink:
    """One of the two files: counts what was handed to the disk and what it did not take."""

    def __init__(self, commit: Callable[[], None]) -> None:
        self._commit = commit
        self._open = 0
        self.written = 0
        self.failed = 0
        self.error = 0

    def take(self, write: Callable[[], None]) -> None:
        """One entry; whatever goes wrong with it must not keep the next ones away."""
        try:
            self._open += 1
            write()
        except OSError as error:
            self._lose(error)
        except Exception as error:
            self._open -= 1
            self.failed += 1
            print(f"recorder: an entry cannot be written: {error!r}", file=sys.stderr)  # noqa: T201

    def commit(self) -> int:
        """Hand everything to the disk; returns how many entries it did not take."""
        failed = self.failed
        try:
            self._commit()
            self.written += self._open
            self._open, self.error = 0, 0
        except OSError as error:
            self._lose(error)
        return self.failed - failed

    def _lose(self, error: OSError) -> None:
        self.failed += self._open
        self._open = 0
        self.error = error.errno or -1


@final
class _Files:
    """MCAP and raw CAN of one run."""

    def __init__(self, folder: Path, form: CanForm) -> None:
        header = LogHeader.read(folder / HEADER_FILE)
        self._mcap_file = BlockFile(folder / MCAP_FILE)
        self._can_file = BlockFile(folder / f"{CAN_STEM}{form.value}")
        self._writer = McapWriter(self._mcap_file)
        self._log = McapLog(self._writer, header)
        self._can = CanLog(Spool(self._can_file), form)
        self._sinks = (_Sink(self._writer.commit), _Sink(self._can.commit))
        self._at_us = 0

    def take(self, entry: Any) -> None:
        """One entry of the loop."""
        log, raw = self._sinks
        kind, content = entry
        if kind == TURN:
            log.take(lambda: self._log.turn(content))
            return
        for values in content:
            frame = LoggedFrame(*values)
            self._at_us = frame.at_us
            log.take(lambda frame=frame: self._log.frame(frame))  # type: ignore[misc]
            raw.take(lambda frame=frame: self._can.frame(frame))  # type: ignore[misc]
            meant = frame.meant
            if meant is not None and meant[0] is Mark.LOST:
                self._log.lost(frame.at_us, meant[1], "the recorder did not keep up")

    @property
    def full(self) -> bool:
        """Is there enough to be written before its time?"""
        return self._writer.chunk_bytes >= _CHUNK_BYTES or self._can.full

    def commit(self) -> bytes:
        """Hand everything to the disk; returns the report for the loop."""
        for sink, topic_error in zip(self._sinks, ("MCAP", "raw CAN"), strict=True):
            lost = sink.commit()
            if lost:
                why = f"{topic_error}: {os.strerror(max(sink.error, 0))}"
                self._log.lost(self._at_us, lost, why)
        written, failed = (sum(getattr(s, n) for s in self._sinks) for n in ("written", "failed"))
        return REPORT.pack(written, failed, max(sink.error for sink in self._sinks))

    def close(self) -> None:
        """Write the files' ends, as far as the disk takes them."""
        self.commit()
        for end in (self._writer.finish, self._can.close):
            with contextlib.suppress(OSError):
                end()


def run(arguments: Sequence[str]) -> None:
    """Copy entries from one pipe to the files, and report on another.

    arguments: folder, form, time between two commits in s, the pipes' two numbers.
    """
    folder, form, flush_s, entries_fd, reports_fd = arguments
    _step_back()
    os.set_blocking(int(reports_fd), False)
    files = _Files(Path(folder), CanForm(form))
    _report(int(reports_fd), files.commit())
    _copy(files, int(entries_fd), int(reports_fd), float(flush_s))
    files.close()
    _report(int(reports_fd), files.commit())


def _copy(files: _Files, entries_fd: int, reports_fd: int, flush_s: float) -> None:
    inbox = Inbox()
    due_s = time.monotonic() + flush_s
    while True:
        left_s = due_s - time.monotonic()
        if left_s <= 0.0:
            _report(reports_fd, files.commit())
            due_s = time.monotonic() + flush_s
            continue
        if not select.select([entries_fd], [], [], left_s)[0]:
            continue
        received = os.read(entries_fd, _READ_BYTES)
        if not received:
            return
        for entry in inbox.entries(received):
            files.take(entry)
            if files.full:
                _report(reports_fd, files.commit())


def _report(fd: int, report: bytes) -> None:
    # A loop that reads no reports, or is gone, must not stop the log.
    with contextlib.suppress(OSError):
        os.write(fd, report)


def _step_back() -> None:
    """Be less urgent than the loop, which may have handed down its real-time class."""
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with contextlib.suppress(OSError):
        os.nice(_NICE)
