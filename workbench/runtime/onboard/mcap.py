"""Writes MCAP files (mcap.dev/spec) whose chunks are whole on disk one after the other.

The uncompressed subset: schemas and channels first, then chunks with message indexes, then the
summary. A file that breaks off anywhere is readable up to its last whole chunk.
"""

from __future__ import annotations

import enum
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime.onboard.recorder_file import BlockFile

MAGIC: Final = b"\x89MCAP0\r\n"
_LIBRARY: Final = "workbench"


class Op(enum.IntEnum):
    """What a record is."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    DATA_END = 0x0F


@final
@dataclass(slots=True)
class _Chunk:
    """The chunk that is being filled: its records, and (time, offset) of messages by channel."""

    records: bytearray = field(default_factory=bytearray)
    index: dict[int, list[tuple[int, int]]] = field(default_factory=dict)


@final
class McapWriter:
    """Writes one file; channels and metadata are declared before the first `commit`.

    profile: what the file's header says of its use; empty: nothing in particular.
    """

    def __init__(self, file: BlockFile, *, profile: str = "") -> None:
        self._file = file
        head = record(Op.HEADER, text(profile) + text(_LIBRARY))
        # Everything before the first chunk, until a disk has taken it.
        self._before = bytearray(MAGIC + head)
        self._declared = bytearray()
        self._metadata: list[bytes] = []
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._chunk = _Chunk()
        self._chunk_indexes: list[bytes] = []
        self._counts: dict[int, int] = {}
        self._times: tuple[int, int] | None = None

    def channel(self, topic: str, *, schema_name: str, schema: bytes) -> int:
        """Declare a topic with JSON messages; `schema`: a JSON schema. Returns its number."""
        key = (schema_name, schema)
        number = self._schemas.get(key)
        if number is None:
            number = self._schemas[key] = len(self._schemas) + 1
            body = struct.pack("<H", number) + text(schema_name) + text("jsonschema")
            self._declare(record(Op.SCHEMA, body + sized(schema)))
        channel = len(self._counts) + 1
        self._counts[channel] = 0
        body = struct.pack("<HH", channel, number) + text(topic) + text("json") + sized(b"")
        self._declare(record(Op.CHANNEL, body))
        return channel

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add values for the whole file."""
        pairs = b"".join(text(key) + text(value) for key, value in values.items())
        content = record(Op.METADATA, text(name) + sized(pairs))
        if not self._before:
            raise InputError(f"metadata {name!r}: expected before the first commit; move it there")
        place = struct.pack("<QQ", len(self._before), len(content))
        self._metadata.append(record(Op.METADATA_INDEX, place + text(name)))
        self._before += content

    def add(self, channel: int, log_ns: int, data: bytes) -> None:
        """Add a message to the chunk that is being filled."""
        chunk = self._chunk
        entries = chunk.index.setdefault(channel, [])
        entries.append((log_ns, len(chunk.records)))
        number = self._counts[channel] + len(entries) - 1
        head = struct.pack("<HIQQ", channel, number, log_ns, log_ns)
        chunk.records += record(Op.MESSAGE, head + data)

    @property
    def chunk_bytes(self) -> int:
        """Size of the chunk that is being filled."""
        return len(self._chunk.records)

    def commit(self) -> None:
        """Write the chunk. Raises OSError, after which its messages are lost and the file is as
        before."""
        chunk, self._chunk = self._chunk, _Chunk()
        if self._before:
            self._file.append(self._before)
            self._before.clear()
        if not chunk.records:
            return
        first, last = _span(chunk)
        body = struct.pack("<QQQ", first, last, len(chunk.records))
        body += struct.pack("<I", zlib.crc32(chunk.records)) + text("")
        body += struct.pack("<Q", len(chunk.records)) + chunk.records
        block = record(Op.CHUNK, body)
        indexes, offsets = _message_indexes(chunk)
        begin = self._file.append(block + indexes)
        self._chunk_indexes.append(_chunk_index(chunk, (begin, len(block)), offsets, len(indexes)))
        for channel, entries in chunk.index.items():
            self._counts[channel] += len(entries)
        known = self._times or (first, last)
        self._times = min(known[0], first), max(known[1], last)

    def finish(self) -> None:
        """Write the last chunk, the summary and the end. Raises OSError like `commit`."""
        self.commit()
        summary = bytes(self._declared) + self._statistics()
        summary += b"".join(self._metadata) + b"".join(self._chunk_indexes)
        head = record(Op.DATA_END, struct.pack("<I", 0))
        place = struct.pack("<QQ", self._file.size + len(head), 0)
        frame = struct.pack("<BQ", Op.FOOTER, len(place) + 4) + place
        crc = struct.pack("<I", zlib.crc32(summary + frame))
        self._file.append(head + summary + frame + crc + MAGIC)

    def _declare(self, content: bytes) -> None:
        if not self._before:
            raise InputError("expected channels before the first commit; declare them earlier")
        self._declared += content
        self._before += content

    def _statistics(self) -> bytes:
        counts = {channel: count for channel, count in self._counts.items() if count}
        first, last = self._times or (0, 0)
        sizes = (len(self._schemas), len(self._counts), 0, len(self._metadata))
        body = struct.pack("<QHIII", sum(counts.values()), *sizes)
        body += struct.pack("<IQQ", len(self._chunk_indexes), first, last)
        pairs = b"".join(struct.pack("<HQ", *pair) for pair in counts.items())
        return record(Op.STATISTICS, body + sized(pairs))


def record(op: Op, body: bytes | bytearray) -> bytes:
    """A record: what it is, its length, its content."""
    return struct.pack("<BQ", op, len(body)) + body


def text(value: str) -> bytes:
    """A string: its length, then UTF-8."""
    return sized(value.encode())


def sized(content: bytes) -> bytes:
    """Bytes after their length."""
    return struct.pack("<I", len(content)) + content


def _span(chunk: _Chunk) -> tuple[int, int]:
    times = [time for entries in chunk.index.values() for time, _ in entries]
    return min(times), max(times)


def _message_indexes(chunk: _Chunk) -> tuple[bytes, dict[int, int]]:
    """The records that follow a chunk, and by channel where in them its own begins."""
    content, offsets = bytearray(), {}
    for channel, entries in chunk.index.items():
        offsets[channel] = len(content)
        pairs = b"".join(struct.pack("<QQ", *entry) for entry in entries)
        content += record(Op.MESSAGE_INDEX, struct.pack("<H", channel) + sized(pairs))
    return bytes(content), offsets


def _chunk_index(
    chunk: _Chunk, place: tuple[int, int], offsets: Mapping[int, int], length: int
) -> bytes:
    """place: where in the file the chunk's record begins, and its length."""
    begin, size = place
    pairs = b"".join(
        struct.pack("<HQ", channel, begin + size + offset) for channel, offset in offsets.items()
    )
    body = struct.pack("<QQQQ", *_span(chunk), begin, size) + sized(pairs)
    body += struct.pack("<Q", length) + text("")
    body += struct.pack("<QQ", len(chunk.records), len(chunk.records))
    return record(Op.CHUNK_INDEX, body)
