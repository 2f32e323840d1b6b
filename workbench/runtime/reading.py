"""A file read once and as it is: regular, of bounded size, whole."""

from __future__ import annotations

import errno
import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench.errors import InputError


@final
@dataclass(frozen=True, slots=True)
class Reading:
    """What one opened file held; mode: its permission bits at that moment."""

    content: bytes
    mode: int


def read_once(path: Path, *, most_bytes: int) -> Reading:
    """Open `path` once and return all it holds.

    Symbolic links are not followed, and nothing but a regular file is read: a pipe could keep the
    reader waiting, a device give without end. Raises InputError, also on a file of more than
    `most_bytes`, and on one whose length changes meanwhile.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            return _whole(path, descriptor, most_bytes)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise _no_regular_file(path, "a symbolic link") from None
        raise InputError(
            f"{path}: expected a file that can be read, got: {error.strerror}; "
            "check the path and its permissions"
        ) from None


def _whole(path: Path, descriptor: int, most_bytes: int) -> Reading:
    found = os.fstat(descriptor)
    if not stat.S_ISREG(found.st_mode):
        raise _no_regular_file(path, "a folder, pipe or device")
    if found.st_size > most_bytes:
        raise InputError(
            f"{path}: expected at most {most_bytes} bytes, got {found.st_size}; "
            "this is not the file that belongs here, copy it again"
        )
    with os.fdopen(descriptor, "rb", closefd=False) as file:
        content = file.read(found.st_size + 1)
    if len(content) != found.st_size:
        raise InputError(
            f"{path}: expected {found.st_size} bytes as its length said, got another number; it "
            "changes while it is read: try again when nobody writes there"
        )
    return Reading(content, stat.S_IMODE(found.st_mode))


def _no_regular_file(path: Path, found: str) -> InputError:
    return InputError(f"{path}: expected a regular file, got {found}; put the file itself there")
