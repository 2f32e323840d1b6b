"""Entries from one process to another: who writes never waits, and what is lost is counted."""

from __future__ import annotations

import contextlib
import fcntl
import marshal
import os
import select
import struct
import time
from collections import deque
from collections.abc import Iterator
from typing import Any, Final, final

REPORT: Final = struct.Struct("<QQi")
"""What the recorder reports: entries written, entries that could not be, and the last error's
number (0: none)."""
_LENGTH: Final = struct.Struct("<I")
_BLOCK_BYTES: Final = 65536
# A writer that catches up after a pause must not do it all in one turn.
_MOST_BLOCKS_AT_ONCE: Final = 4
_PIPE_BYTES: Final = 1 << 20


@final
class Outbox:
    """The writing end of a pipe, which must not block; waiting entries take up to most_bytes.

    lost: entries that found no room, or nobody who reads; gone: nobody reads any more.
    """

    def __init__(self, fd: int, *, most_bytes: int) -> None:
        os.set_blocking(fd, False)
        with contextlib.suppress(OSError):
            # A smaller pipe serves as well; the entries wait here instead.
            fcntl.fcntl(fd, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
        self._fd = fd
        self._most_bytes = most_bytes
        self._waiting: deque[bytearray] = deque()
        self._waiting_bytes = 0
        self.lost = 0
        self.gone = False

    def put(self, entry: tuple[int, Any]) -> bool:
        """Hand over an entry of plain values; False: it is lost. Never waits, never raises."""
        try:
            content = marshal.dumps(entry)
        except ValueError:
            self.lost += 1
            return False
        record = _LENGTH.pack(len(content)) + content
        self.catch_up()
        written = self._written(record) if not self._waiting else 0
        rest = record[written:]
        # What has begun must be finished, or the reader could make nothing of what follows.
        full = written == 0 and self._waiting_bytes + len(rest) > self._most_bytes
        if self.gone or full:
            self.lost += 1
            return False
        if rest:
            self._keep(rest)
        return True

    def catch_up(self) -> None:
        """Send what waits, as far as the pipe takes it at once."""
        for _ in range(_MOST_BLOCKS_AT_ONCE):
            if not self._waiting:
                return
            block = self._waiting[0]
            written = self._written(block)
            self._waiting_bytes -= written
            if written < len(block):
                del block[:written]
                return
            self._waiting.popleft()

    @property
    def waiting_bytes(self) -> int:
        """What has not reached the pipe yet."""
        return self._waiting_bytes

    def _keep(self, rest: bytes) -> None:
        self._waiting_bytes += len(rest)
        if self._waiting and len(self._waiting[-1]) + len(rest) <= _BLOCK_BYTES:
            self._waiting[-1] += rest
        else:
            self._waiting.append(bytearray(rest))

    def _written(self, content: bytes | bytearray) -> int:
        try:
            return os.write(self._fd, content)
        except BlockingIOError:
            return 0
        except OSError:
            self.gone = True
            return 0

    def finish(self, wait_s: float) -> None:
        """Send what waits, for wait_s at most, and close the pipe; this waits."""
        end_s = time.monotonic() + wait_s
        while self._waiting and not self.gone and (left_s := end_s - time.monotonic()) > 0.0:
            select.select([], [self._fd], [], left_s)
            self.catch_up()
        self.close()

    def close(self) -> None:
        """Close the pipe; what still waits is lost."""
        os.close(self._fd)


@final
class Inbox:
    """Puts a stream of bytes back together; half an entry at its end is never given out."""

    def __init__(self) -> None:
        self._content = bytearray()

    def entries(self, received: bytes) -> Iterator[Any]:
        """The entries that are whole with these bytes."""
        content = self._content
        content += received
        begin = 0
        while len(content) - begin >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(content, begin)
            end = begin + _LENGTH.size + length
            if end > len(content):
                break
            yield marshal.loads(content[begin + _LENGTH.size : end])
            begin = end
        del content[:begin]
