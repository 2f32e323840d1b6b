"""The vehicle's side of the log: hands entries to a process of its own, and never waits for it."""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Final, final

import workbench
from workbench.errors import InputError
from workbench.runtime.onboard.recorder_entries import (
    FRAMES,
    TURN,
    LoggedFrame,
    Mark,
    ReadClock,
    turn_frames,
    turn_record,
)
from workbench.runtime.onboard.recorder_header import FORMAT, HEADER_FILE, LogHeader
from workbench.runtime.onboard.recorder_pipe import REPORT, Outbox

if TYPE_CHECKING:
    from workbench.runtime.onboard.core import Core, Request, TurnResult
    from workbench.runtime.onboard.intake import BusError

_START_S: Final = 10.0
_REPORT_BYTES: Final = 65536
_PROGRAM: Final = (
    "import sys; sys.path.insert(0, sys.argv[1]); "
    "from workbench.runtime.onboard.recorder_process import run; run(sys.argv[2:])"
)


@final
@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """folder: new, or without a log; can_suffix: form of the raw log, .asc, .blf or .log; flush_s:
    at most so much is lost when the recorder dies; waiting_bytes: kept for a recorder that does not
    keep up, beside the pipe's own 1 MiB, before entries are dropped."""

    folder: Path
    can_suffix: str = ".asc"
    flush_s: float = 1.0
    waiting_bytes: int = 4 << 20

    def __post_init__(self) -> None:
        if self.can_suffix not in (".asc", ".blf", ".log"):
            raise InputError(f"can_suffix: expected .asc, .blf or .log, got {self.can_suffix!r}")
        if not 0.01 <= self.flush_s <= 60.0:
            raise InputError(f"flush_s: expected 0.01 to 60 seconds, got {self.flush_s!r}")
        if self.waiting_bytes < 0:
            raise InputError(f"waiting_bytes: expected 0 or more, got {self.waiting_bytes!r}")


@final
@dataclass(frozen=True, slots=True)
class RecorderState:
    """written: entries that reached the disk, counted in both files; lost: entries dropped here;
    failed: entries that the disk did not take; error: its last word, empty while all is well;
    alive: the recorder runs, or ended as it was told. `in_order` False is worth an ALERT, never
    more."""

    written: int
    lost: int
    failed: int
    error: str
    alive: bool

    @property
    def in_order(self) -> bool:
        """Is everything on record so far, and will it be?"""
        return self.alive and not self.lost and not self.failed


@final
class Recorder:
    """A log under way. No method but `start` and `close` waits; none but `start` raises."""

    def __init__(self, process: subprocess.Popen[bytes], outbox: Outbox, reports_fd: int) -> None:
        self._process = process
        self._outbox = outbox
        self._reports_fd = reports_fd
        self._report = bytes(REPORT.size)
        self._said_lost = 0
        self._at_us = 0
        self._faults: object = ()

    @classmethod
    def start(cls, header: LogHeader, settings: RecorderSettings) -> Recorder:
        """Start the process and wait until it can write; before the loop starts.

        Raises InputError when the folder cannot be written or already holds a log.
        """
        folder = settings.folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with (folder / HEADER_FILE).open("x", encoding="utf-8") as file:
                file.write(header.to_json())
        except OSError as error:
            raise InputError(
                f"expected a folder for a new log, got {folder} ({error.strerror}); name another"
            ) from error
        entries, reports = os.pipe(), os.pipe()
        root = Path(workbench.__file__).parent.parent
        words = (folder.absolute(), settings.can_suffix, settings.flush_s, entries[0], reports[1])
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", _PROGRAM, str(root), *map(str, words)],
            stdin=subprocess.DEVNULL,
            pass_fds=(entries[0], reports[1]),
            # Ctrl-C is for the loop; the log ends when the loop has ended.
            start_new_session=True,
        )
        os.close(entries[0])
        os.close(reports[1])
        outbox = Outbox(entries[1], most_bytes=settings.waiting_bytes)
        recorder = cls(process, outbox, reports[0])
        recorder._await_start(folder)
        recorder.mark(Mark.START, FORMAT, 0)
        return recorder

    def _await_start(self, folder: Path) -> None:
        ready = select.select([self._reports_fd], [], [], _START_S)[0]
        if not ready or not os.read(self._reports_fd, REPORT.size):
            self._process.kill()
            self._process.wait()
            self._outbox.close()
            os.close(self._reports_fd)
            raise InputError(
                f"expected a recorder that can write to {folder}, it did not start; its own "
                "message stands above"
            )
        os.set_blocking(self._reports_fd, False)

    def received(self, identifier: int, data: bytes, at_us: int, *, upstream: bool = False) -> None:
        """A frame was given to the core."""
        self._frames(LoggedFrame(at_us, identifier, bytes(data), False, upstream))

    def mark(self, mark: Mark, number: int, at_us: int) -> None:
        """Something else was."""
        self._frames(LoggedFrame.mark(mark, number, at_us=at_us))

    def turn(self, result: TurnResult, ended_us: int | None) -> None:
        """The frames that a turn made, and what its clock said; takes microseconds, so that sending
        need not wait."""
        try:
            frames = turn_frames(result, ended_us)
        except Exception:
            # What cannot be told must not end the loop.
            self._outbox.lost += 1
        else:
            self._frames(*frames)

    def details(self, result: TurnResult) -> None:
        """What the turn found and decided; when its frames are on their way."""
        try:
            changed = result.faults != self._faults or result.events
            self._faults = result.faults
            if result.decision is not None or changed:
                self._outbox.put((TURN, turn_record(result)))
        except Exception:
            # As above.
            self._outbox.lost += 1

    def state(self) -> RecorderState:
        """How the log is doing; for every turn, or now and then."""
        self._outbox.catch_up()
        with contextlib.suppress(OSError):
            reports = os.read(self._reports_fd, _REPORT_BYTES)
            if reports:
                self._report = reports[-REPORT.size :]
        written, failed, number = REPORT.unpack(self._report)
        error = os.strerror(number) if number > 0 else ""
        alive = not self._outbox.gone and self._process.poll() in (None, 0)
        return RecorderState(written, self._outbox.lost, failed, error, alive)

    def close(self, *, wait_s: float = 10.0) -> RecorderState:
        """Let the recorder write all it has, up to wait_s twice; afterwards it is ended."""
        self._frames()
        self._outbox.finish(wait_s)
        try:
            self._process.wait(wait_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        state = self.state()
        os.close(self._reports_fd)
        return state

    def _frames(self, *frames: LoggedFrame) -> None:
        if frames:
            self._at_us = frames[0].at_us
        lost = self._outbox.lost
        if lost > self._said_lost:
            gap = LoggedFrame.mark(Mark.LOST, lost - self._said_lost, at_us=self._at_us)
            frames = (gap, *frames)
        values = tuple((f.at_us, f.identifier, f.data, f.made, f.upstream) for f in frames)
        if values and self._outbox.put((FRAMES, values)):
            self._said_lost = lost


@final
class RecordedCore:
    """A core whose every input and turn is on record, in the order in which it got them."""

    def __init__(self, core: Core, recorder: Recorder) -> None:
        self._core = core
        self._recorder = recorder

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        """As the core's."""
        self._core.receive(identifier, data, at_us)
        self._recorder.received(identifier, data, at_us)

    def receive_upstream(self, identifier: int, data: bytes, at_us: int) -> None:
        """As the core's."""
        self._core.receive_upstream(identifier, data, at_us)
        self._recorder.received(identifier, data, at_us, upstream=True)

    def bus_error(self, kind: BusError, at_us: int) -> None:
        """As the core's."""
        self._core.bus_error(kind, at_us)
        self._recorder.mark(Mark.BUS_ERROR, _place(kind), at_us)

    def request(self, request: Request, at_us: int) -> None:
        """As the core's."""
        self._core.request(request, at_us)
        self._recorder.mark(Mark.REQUEST, _place(request), at_us)

    def turn(self, at_us: int, clock: Callable[[], int]) -> TurnResult:
        """As the core's; `Recorder.details` is to be called when its frames were sent."""
        read = ReadClock(clock)
        result = self._core.turn(at_us, read)
        self._recorder.turn(result, read.said_us)
        return result


def _place(member: Enum) -> int:
    """Where in its enumeration a member stands."""
    return list(type(member)).index(member)
