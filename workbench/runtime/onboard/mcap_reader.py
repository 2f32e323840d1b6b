"""Reads the messages of uncompressed MCAP files in their order, also of files that break off."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final, final

from workbench.errors import InputError
from workbench.runtime.onboard.mcap import MAGIC, Op

_HEAD: Final = struct.Struct("<BQ")
_CHUNK: Final = struct.Struct("<QQQI")
_MESSAGE: Final = struct.Struct("<HIQQ")


@final
@dataclass(frozen=True, slots=True)
class McapMessage:
    """One message of a topic."""

    topic: str
    log_ns: int
    data: bytes


@final
@dataclass(frozen=True, slots=True)
class McapMetadata:
    """Values for the whole file."""

    name: str
    values: dict[str, str]


@final
@dataclass(frozen=True, slots=True)
class BrokenOff:
    """The file ends here, without the end that a file which was closed has."""

    offset: int


@final
class _TornError(Exception):
    """A record ends before its content does."""


def read_mcap(path: Path) -> Iterator[McapMessage | McapMetadata | BrokenOff]:
    """Messages and metadata in the file's order; BrokenOff last where its end is missing.

    What was never completely written is not given out. Raises InputError for a file of another
    kind, for compressed chunks, messages outside of chunks, and chunks whose checksum is wrong.
    """
    topics: dict[int, str] = {}
    with _opened(path) as file:
        size = os.fstat(file.fileno()).st_size
        place = len(MAGIC)
        while True:
            try:
                op, body = _record(file, size)
                if op == Op.FOOTER and file.read(len(MAGIC)) == MAGIC:
                    return
                if op == Op.FOOTER:
                    raise _TornError
                if op == Op.MESSAGE:
                    # Nothing but a chunk's checksum tells a message from what looks like one.
                    raise ValueError("a message outside of chunks")
                content = list(_meant(op, body, topics))
            except _TornError:
                yield BrokenOff(place)
                return
            except ValueError as error:
                raise InputError(
                    f"{path}, byte {place}: expected an uncompressed MCAP file, got {error}; "
                    "fetch it again, or rewrite it with `mcap decompress`"
                ) from error
            yield from content
            place = file.tell()


def _opened(path: Path) -> IO[bytes]:
    try:
        file = path.open("rb")
    except OSError as error:
        raise InputError(f"expected an MCAP file at {path}, got {error.strerror}") from error
    start = file.read(len(MAGIC))
    if start != MAGIC:
        file.close()
        raise InputError(
            f"{path}: expected an MCAP file, which starts with {MAGIC!r}, got {start!r}; name "
            "another file"
        )
    return file


def _record(file: IO[bytes], size: int) -> tuple[int, bytes]:
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        raise _TornError
    op, length = _HEAD.unpack(head)
    if length > size - file.tell():
        raise _TornError
    return op, file.read(length)


def _meant(op: int, body: bytes, topics: dict[int, str]) -> Iterator[McapMessage | McapMetadata]:
    """What a record holds for a reader; ValueError where it is not what it should be."""
    try:
        if op == Op.CHANNEL:
            (number,) = struct.unpack_from("<H", body)
            topic = _text(body, 4)[0]
            if topics.setdefault(number, topic) != topic:
                raise ValueError(f"a second topic {topic!r} for channel {number}")
        elif op == Op.MESSAGE:
            channel, _, log_ns, _ = _MESSAGE.unpack_from(body)
            yield McapMessage(topics[channel], log_ns, body[_MESSAGE.size :])
        elif op == Op.METADATA:
            name, end = _text(body, 0)
            yield McapMetadata(name, _mapping(body, end))
        elif op == Op.CHUNK:
            yield from _chunk(body, topics)
    except (struct.error, KeyError) as error:
        raise ValueError(f"a record of kind {op} that is no such record ({error!r})") from error


def _chunk(body: bytes, topics: dict[int, str]) -> Iterator[McapMessage | McapMetadata]:
    _, _, size, crc = _CHUNK.unpack_from(body)
    compression, end = _text(body, _CHUNK.size)
    if compression:
        raise ValueError(f"a chunk compressed by {compression}")
    records = memoryview(body)[end + 8 :]
    if len(records) != size or (crc and zlib.crc32(records) != crc):
        raise ValueError("a chunk whose length or checksum is wrong")
    place = 0
    while place < size:
        op, length = _HEAD.unpack_from(records, place)
        place += _HEAD.size
        if length > size - place:
            raise ValueError("a chunk whose last record is longer than the chunk")
        yield from _meant(op, bytes(records[place : place + length]), topics)
        place += length


def _text(body: bytes, begin: int) -> tuple[str, int]:
    """A string, and where what follows it begins."""
    (length,) = struct.unpack_from("<I", body, begin)
    end = begin + 4 + length
    if end > len(body):
        raise struct.error("a string longer than its record")
    return body[begin + 4 : end].decode(), end


def _mapping(body: bytes, begin: int) -> dict[str, str]:
    values = {}
    end = begin + 4
    while end < len(body):
        key, end = _text(body, end)
        values[key], end = _text(body, end)
    return values
