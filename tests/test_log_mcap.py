"""Our MCAP files say to the reference reader what was written, and a file that breaks off anywhere
gives back, from its beginning, all that its whole chunks hold and nothing else."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_cases import EchoCore, header
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from workbench.errors import InputError
from workbench.runtime.onboard.mcap import MAGIC, McapWriter
from workbench.runtime.onboard.mcap_reader import (
    BrokenOff,
    McapMessage,
    McapMetadata,
    read_mcap,
)
from workbench.runtime.onboard.mcap_schemas import schemas
from workbench.runtime.onboard.recorder_entries import turn_record
from workbench.runtime.onboard.recorder_file import BlockFile
from workbench.runtime.onboard.recorder_header import LogHeader
from workbench.runtime.onboard.recorder_log import McapLog

Chunks = list[list[tuple[int, int, bytes]]]
CHUNKS = st.lists(
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 2**63), st.binary(max_size=20)), max_size=6
    ),
    max_size=4,
)
TOPICS = ("/a", "/b", "/ä")


@pytest.fixture(scope="module", autouse=True)
def _no_waiting_for_the_disk() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fdatasync", lambda _file: None)
        yield


def written(chunks: Chunks, *, finished: bool = True) -> bytes:
    """A file with these messages (topic, time, content), chunk by chunk."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        file = BlockFile(path)
        writer = McapWriter(file, profile="test")
        channels = [
            writer.channel(topic, schema_name=f"s{k % 2}", schema=b'{"type":"object"}')
            for k, topic in enumerate(TOPICS)
        ]
        writer.metadata("about", {"one": "1", "empty": ""})
        for chunk in chunks:
            for topic, time, data in chunk:
                writer.add(channels[topic], time, data)
            writer.commit()
        if finished:
            writer.finish()
        file.close()
        return path.read_bytes()


def ours(content: bytes) -> list[Any]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        path.write_bytes(content)
        return list(read_mcap(path))


def said(records: list[Any]) -> list[tuple[str, int, bytes]]:
    return [(m.topic, m.log_ns, m.data) for m in records if isinstance(m, McapMessage)]


def expected(chunks: Chunks) -> list[tuple[str, int, bytes]]:
    return [(TOPICS[topic], time, data) for chunk in chunks for topic, time, data in chunk]


@given(CHUNKS)
@settings(max_examples=40)
def test_the_reference_reader_finds_every_message_by_stream_and_by_index(chunks: Chunks) -> None:
    content = written(chunks)
    streamed = [
        (TOPICS[r.channel_id - 1], r.log_time, r.data)
        for r in StreamReader(BytesIO(content), validate_crcs=True).records
        if type(r).__name__ == "Message"
    ]
    assert streamed == expected(chunks)
    reader = make_reader(BytesIO(content), validate_crcs=True)
    indexed = [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages()]
    assert sorted(indexed) == sorted(expected(chunks))
    summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(expected(chunks))
    assert summary.statistics.chunk_count == len([chunk for chunk in chunks if chunk])
    assert {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()} == {
        "/a": "s0", "/b": "s1", "/ä": "s0"
    }  # fmt: skip
    for topic in range(3):
        assert summary.statistics.channel_message_counts.get(topic + 1, 0) == sum(
            each[0] == TOPICS[topic] for each in expected(chunks)
        )
    assert [m.metadata for m in reader.iter_metadata()] == [{"one": "1", "empty": ""}]


@given(CHUNKS)
@settings(max_examples=40)
def test_our_reader_finds_the_same(chunks: Chunks) -> None:
    records = ours(written(chunks))
    assert records[0] == McapMetadata("about", {"one": "1", "empty": ""})
    assert said(records) == expected(chunks)
    assert not any(isinstance(each, BrokenOff) for each in records)


CHUNKED: Chunks = [[(0, 5, b"x"), (1, 6, b"yy")], [(2, 7, b"")], [(0, 8, b"z"), (0, 9, b"z")]]


def test_a_file_cut_anywhere_gives_back_its_whole_chunks() -> None:
    content = written(CHUNKED)
    ends = [len(written(CHUNKED[:k], finished=False)) for k in range(len(CHUNKED) + 1)]
    for cut in range(len(MAGIC), len(content)):
        records = ours(content[:cut])
        # A chunk's indexes may be cut off; the chunk itself is whole before them.
        whole = sum(end <= cut for end in ends[1:])
        found = said(records)
        assert found == expected(CHUNKED)[: len(found)]
        assert len(found) >= len(expected(CHUNKED[:whole]))
        assert isinstance(records[-1], BrokenOff)


def test_a_flipped_bit_in_a_chunk_is_never_taken_for_a_message() -> None:
    content = written(CHUNKED, finished=False)
    start = len(written([[]], finished=False))
    for place in range(start, len(content)):
        for bit in (0, 3, 7):
            spoilt = bytearray(content)
            spoilt[place] ^= 1 << bit
            try:
                found = said(ours(bytes(spoilt)))
            except InputError:
                continue
            # Lost, or in what readers skip: but nothing that was never written.
            assert [each for each in expected(CHUNKED) if each in found] == found


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_compressed_files_are_refused_by_name(compression: CompressionType) -> None:
    content = BytesIO()
    writer = Writer(content, compression=compression)
    writer.start()
    channel = writer.register_channel("/a", "json", 0)
    writer.add_message(channel, 0, b"{}", 0)
    writer.finish()
    with pytest.raises(InputError, match=f"compressed by {compression.name.lower()}"):
        ours(content.getvalue())


def test_uncompressed_files_of_others_are_read_where_they_have_chunks() -> None:
    assert said(ours(of_others(chunked=True))) == [("/a", 3, b"{}")]
    with pytest.raises(InputError, match="outside of chunks"):
        ours(of_others(chunked=False))


def of_others(*, chunked: bool) -> bytes:
    content = BytesIO()
    writer = Writer(content, compression=CompressionType.NONE, use_chunking=chunked)
    writer.start()
    channel = writer.register_channel("/a", "json", 0)
    writer.add_message(channel, 3, b"{}", 3)
    writer.add_attachment(0, 0, "x", "text/plain", b"abc")
    writer.finish()
    return content.getvalue()


@pytest.mark.parametrize("content", [b"", b"\x89MCAP1\r\n", b"candump"])
def test_other_files_are_refused(content: bytes) -> None:
    with pytest.raises(InputError, match="expected an MCAP file"):
        ours(content)


def fits(value: Any, schema: dict[str, Any], place: str) -> None:
    """The value is what the schema says, and the schema leaves nothing of it out."""
    if "anyOf" in schema:
        words = [w for each in schema["anyOf"] for w in each.get("enum", ())]
        types = [each["type"] for each in schema["anyOf"] if "type" in each]
        assert value in words or kind_of(value) in types, f"{place}: {value!r}"
        return
    types = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    kind = kind_of(value)
    assert kind in types or (kind == "number" and value == int(value) and "integer" not in types)
    if kind == "array":
        for item in value:
            fits(item, schema["items"], f"{place}[]")
    elif kind == "object" and "additionalProperties" in schema:
        for item in value.values():
            fits(item, schema["additionalProperties"], f"{place}.*")
    elif kind == "object":
        assert set(value) == set(schema["properties"]), place
        for name, item in value.items():
            fits(item, schema["properties"][name], f"{place}.{name}")


def kind_of(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "boolean"
    if isinstance(value, int | float):
        return "integer" if isinstance(value, int) else "number"
    return {str: "string", list: "array", dict: "object"}[type(value)]


def messages_of_a_turn(folder: Path) -> list[McapMessage]:
    file = BlockFile(folder / "x.mcap")
    writer = McapWriter(file)
    log = McapLog(writer, header())
    core = EchoCore()
    for k in range(4):
        log.turn(turn_record(core.turn(1_000_000 + k, lambda: 1_001_000)))
    writer.finish()
    return [m for m in read_mcap(folder / "x.mcap") if isinstance(m, McapMessage)]


def test_every_message_is_what_its_schema_says(tmp_path: Path) -> None:
    texts = {topic: json.loads(text) for topic, (_, text) in schemas().items()}
    seen = set()
    for message in messages_of_a_turn(tmp_path):
        content = json.loads(message.data)
        seen.add(message.topic)
        if message.topic == "/scene":
            loosened(texts["/scene"])
        fits(content, texts[message.topic], message.topic)
    assert seen == {"/scene", "/decision", "/diagnostics"}


def loosened(schema: Any) -> None:
    """Whole numbers may stand where JSON's schema says number."""
    if isinstance(schema, dict):
        if schema.get("type") == "number":
            schema["type"] = ["number", "integer"]
        for item in schema.values():
            loosened(item)


def test_the_scene_shows_body_people_and_tubes_where_they_are(tmp_path: Path) -> None:
    messages = messages_of_a_turn(tmp_path)
    path, turn, *_ = (json.loads(m.data) for m in messages if m.topic == "/scene")
    assert [p["x"] for p in path["entities"][0]["lines"][0]["points"]] == [0.0, 1.0, 2.0, 3.0, 4.0]
    entities = {entity["id"]: entity for entity in turn["entities"]}
    assert set(entities) == {"tube", "body", "person anna"}
    track, stop = entities["tube"]["lines"]
    assert len(track["points"]) == len(stop["points"]) == 4 * 40
    assert len(track["indices"]) == 8 * 40
    person = entities["person anna"]["cylinders"]
    # Seen 0.1 s ago within 0.3 m: 0.3 + 0.3 * 0.1 + 3 * 0.1^2 / 2 now, drawn by its diameter.
    assert person[0]["size"]["x"] == pytest.approx(2 * 0.345, abs=1e-3)
    assert person[0]["pose"]["position"]["x"] == pytest.approx(5.0 + 0.1 * 0.1, abs=1e-3)
    assert len(person) == 1 + 4 + 4


def test_the_header_comes_back_with_every_bit() -> None:
    assert LogHeader.from_json(header().to_json(), source="x") == header()
    for text, why in [
        ("", "header of a log"), ("[]", "header of a log"), ("{}", "header of a log"),
        (header().to_json().replace('"format": 1', '"format": 2'), "format 1, got 2"),
        (header().to_json().replace('"spacing_m": 1.0', '"spacing_m": -1.0'), "spacing_m"),
        (header().to_json().replace('"mode"', '"mood"'), "mood"),
    ]:  # fmt: skip
        with pytest.raises(InputError, match=why):
            LogHeader.from_json(text, source="x")
