"""A file that grows by whole blocks, so that neither a full disk nor a kill tears what it holds."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import final


@final
class BlockFile:
    """A new file at `path`, open for appending whole blocks. Raises OSError where it exists."""

    def __init__(self, path: Path) -> None:
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        self.size = 0

    def append(self, block: bytes | bytearray) -> int:
        """Write a block and wait until the disk has it; returns where it begins.

        Raises OSError when the disk does not take it; the file then ends where it ended before.
        """
        begin = self.size
        try:
            self._write(block, begin)
            os.fdatasync(self._fd)
        except OSError:
            with contextlib.suppress(OSError):
                # The next block would be written over the rest in any case.
                os.ftruncate(self._fd, begin)
            raise
        self.size += len(block)
        return begin

    def replace(self, block: bytes, begin: int) -> None:
        """Write over bytes that are there."""
        self._write(block, begin)

    def close(self) -> None:
        """Close the file."""
        os.close(self._fd)

    def _write(self, block: bytes | bytearray, begin: int) -> None:
        view = memoryview(block)
        done = 0
        while done < len(view):
            done += os.pwrite(self._fd, view[done:], begin + done)


@final
class Spool:
    """What python-can's writers take for a file: keeps what they write until `commit`."""

    def __init__(self, file: BlockFile) -> None:
        self._file = file
        self._block = bytearray()
        self._head: bytearray | None = None
        self.closed = False

    def write(self, content: str | bytes | memoryview) -> int:
        """Keep bytes, or text as UTF-8."""
        kept = self._block if self._head is None else self._head
        kept += content.encode() if isinstance(content, str) else content
        return len(content)

    def commit(self) -> None:
        """Hand what is kept to the file. Raises OSError, after which it is kept no longer."""
        block, self._block = self._block, bytearray()
        if block:
            self._file.append(block)

    def tell(self) -> int:
        """Size of the file with what is kept."""
        return self._file.size + len(self._block)

    def seekable(self) -> bool:
        """To the beginning only, where a BLF file's header is written anew at its end."""
        return True

    def seek(self, offset: int) -> int:
        """What is written from now on replaces the file's first bytes."""
        if offset != 0:
            raise OSError(f"expected to go to the beginning of the file, got offset {offset}")
        self._head = bytearray()
        return 0

    def flush(self) -> None:
        """Nothing: `commit` decides when the disk is written."""

    def close(self) -> None:
        """Write what is left, and the new beginning. Raises OSError like `commit`."""
        if self.closed:
            return
        self.closed = True
        self.commit()
        if self._head and self._file.size >= len(self._head):
            self._file.replace(bytes(self._head), 0)
