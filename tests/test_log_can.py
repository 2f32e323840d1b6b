"""Raw logs in every form give back each frame's identifier, bytes and whole microsecond."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.runtime.onboard.bus import EXTENDED, FLEXIBLE, REMOTE
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.recorder_can import CanForm, CanLog, frame_of, message_of, read_can
from workbench.runtime.onboard.recorder_entries import LoggedFrame, Mark
from workbench.runtime.onboard.recorder_file import BlockFile, Spool

LATEST_US = 10**13
"""116 days."""
TIMES = st.integers(0, LATEST_US)
SHORT = st.binary(max_size=8)
LONG = st.sampled_from([1, 2, 8, 12, 16, 20, 24, 32, 48, 64]).flatmap(
    lambda size: st.binary(min_size=size, max_size=size)
)
FRAMES = st.one_of(
    st.builds(LoggedFrame, TIMES, st.integers(0, 0x7FF), SHORT, st.booleans(), st.booleans()),
    st.builds(
        LoggedFrame, TIMES, st.integers(0x800, 0x1FFFFFFD).map(lambda i: i | EXTENDED),
        st.binary(min_size=1, max_size=8), st.booleans(),
    ),
    st.builds(
        LoggedFrame, TIMES, st.integers(0, 0x7FF).map(lambda i: i | REMOTE), st.just(b""),
        st.booleans(),
    ),
    st.builds(
        LoggedFrame, TIMES, st.integers(0, 0x7FF).map(lambda i: i | FLEXIBLE), LONG, st.booleans()
    ),
    st.builds(
        lambda mark, number, at_us: LoggedFrame.mark(mark, number, at_us=at_us),
        st.sampled_from(Mark), st.integers(0, 2**56 - 1), TIMES,
    ),
)  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _no_waiting_for_the_disk() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fdatasync", lambda _file: None)
        yield


def again(frames: list[LoggedFrame], form: CanForm, *, flushed: int = 0) -> list[LoggedFrame]:
    """Written, with a commit after `flushed` of them, and read."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"x{form.value}"
        file = BlockFile(path)
        log = CanLog(Spool(file), form)
        for k, frame in enumerate(frames):
            log.frame(frame)
            if k + 1 == flushed or log.full:
                log.commit()
        log.close()
        file.close()
        read = list(read_can(path))
    assert all(isinstance(entry, LoggedFrame) and entry.at_us == at for at, entry in read)
    return [entry for _, entry in read if isinstance(entry, LoggedFrame)]


@pytest.mark.parametrize("form", CanForm)
@given(st.lists(FRAMES, max_size=20), st.integers(0, 20))
@settings(max_examples=60)
def test_every_frame_comes_back(form: CanForm, frames: list[LoggedFrame], flushed: int) -> None:
    frames.sort(key=lambda frame: frame.at_us)
    assert again(frames, form, flushed=flushed) == frames


@pytest.mark.parametrize("form", CanForm)
def test_every_kind_of_microsecond_comes_back(form: CanForm) -> None:
    times = [*range(2000), *(10**k + d for k in range(3, 14) for d in (-1, 0, 1, 333_333, 999_999))]
    frames = [LoggedFrame(at_us, 0x6B, b"\x01", False) for at_us in sorted(times)]
    assert again(frames, form) == frames


@given(FRAMES)
def test_python_can_knows_the_frame_as_we_do(frame: LoggedFrame) -> None:
    assert frame_of(message_of(frame)) == frame


@given(st.one_of(FRAMES, st.builds(
    LoggedFrame, TIMES, st.integers(0, 0xFFFFFFFF), st.binary(min_size=8, max_size=8), st.booleans()
)))  # fmt: skip
def test_only_our_own_marks_mean_anything(frame: LoggedFrame) -> None:
    received = LoggedFrame(frame.at_us, frame.identifier, frame.data, False)
    assert received.meant is None
    if frame.meant is not None:
        mark, number = frame.meant
        assert LoggedFrame.mark(mark, number, at_us=frame.at_us) == frame


@pytest.mark.parametrize("form", CanForm)
def test_a_block_that_was_lost_takes_only_its_own_frames_along(
    form: CanForm, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / f"x{form.value}"
    file = BlockFile(path)
    log = CanLog(Spool(file), form)

    def send(numbers: range) -> None:
        for k in numbers:
            log.frame(LoggedFrame(k, 0x100, k.to_bytes(8, "big"), False))

    send(range(100))
    log.commit()
    write = BlockFile._write

    def half(file: BlockFile, block: bytes, begin: int) -> None:
        write(file, bytes(block[: len(block) // 2]), begin)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(BlockFile, "_write", half)
    send(range(100, 300))
    with pytest.raises(OSError, match="No space"):
        log.commit()
    monkeypatch.setattr(BlockFile, "_write", write)
    send(range(300, 400))
    log.close()
    times = [at_us for at_us, _ in read_can(path)]
    assert times == [*range(100), *range(300, 400)]


def test_a_log_cut_anywhere_gives_back_a_beginning(tmp_path: Path) -> None:
    for form in CanForm:
        path = tmp_path / f"x{form.value}"
        file = BlockFile(path)
        log = CanLog(Spool(file), form)
        for k in range(40):
            log.frame(LoggedFrame(k * 1001, 0x100 + k, bytes([k] * 8), k % 2 == 0))
            if k % 10 == 9:
                log.commit()
        log.close()
        whole = list(read_can(path))
        content = path.read_bytes()
        cut = tmp_path / f"cut{form.value}"
        for size in range(200, len(content), 13):
            cut.write_bytes(content[:size])
            read = list(read_can(cut))
            # Text breaks off within a frame's bytes; that frame is the last one.
            assert read[:-1] == whole[: len(read)][:-1], (form, size)


def test_error_frames_of_others_are_errors(tmp_path: Path) -> None:
    path = tmp_path / "x.asc"
    with can.ASCWriter(path) as writer:
        writer.log_event("begins", 0.0)
        writer(can.Message(timestamp=0.5, is_error_frame=True))
    assert list(read_can(path)) == [(500_000, BusError.ERROR_FRAME)]


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("x.txt", b"", "one of these endings"), ("x.blf", b"no", "cannot be read"),
        ("x.log", b"what is this", "cannot be read"), ("x.log", b"\xff\xfe", "cannot be read"),
    ],
)  # fmt: skip
def test_other_files_are_refused(name: str, content: bytes, why: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=why):
        list(read_can(path))
    with pytest.raises(InputError):
        list(read_can(tmp_path / f"none{path.suffix}"))
