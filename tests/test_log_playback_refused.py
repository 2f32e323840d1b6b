"""Marks of another version, and logs that cannot be replayed, are refused with a sentence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.runtime.onboard.playback import EntriesLost, Event
from workbench.runtime.onboard.playback_logs import events_of, open_log
from workbench.runtime.onboard.recorder_can import CanForm, CanLog
from workbench.runtime.onboard.recorder_entries import LoggedFrame, Mark
from workbench.runtime.onboard.recorder_file import BlockFile, Spool


def line_with(mark: Mark, number: int) -> list[LoggedFrame]:
    return [LoggedFrame.mark(Mark.START, 1, at_us=0), LoggedFrame.mark(mark, number, at_us=1)]


def test_marks_of_another_version_are_refused() -> None:
    for mark in (Mark.REQUEST, Mark.BUS_ERROR):
        with pytest.raises(InputError, match="marks of this version"):
            list(events_of(line_with(mark, 99)))
    assert list(events_of(line_with(Mark.LOST, 99))) == [EntriesLost(99, 1)]
    unknown = LoggedFrame(1, LoggedFrame.mark(Mark.LOST, 0, at_us=0).identifier, b"\x63" * 8, True)
    assert list(events_of([unknown])) == []


def raw_log(path: Path, frames: Iterable[LoggedFrame]) -> Path:
    file = BlockFile(path)
    log = CanLog(Spool(file), CanForm(path.suffix))
    for frame in frames:
        log.frame(frame)
    log.close()
    return path


def test_what_is_no_log_of_ours_is_refused(tmp_path: Path) -> None:
    other = raw_log(tmp_path / "a.log", [LoggedFrame.mark(Mark.START, 9, at_us=0)] * 2)
    with pytest.raises(InputError, match="format 1, got 9"):
        open_log(other)
    silent = raw_log(tmp_path / "b.log", [LoggedFrame(k, 0x6F, b"", False) for k in range(9)])
    events: Iterator[Event] = open_log(silent).events
    with pytest.raises(InputError, match="expected HEARTBEAT"):
        list(events)
    with pytest.raises(InputError, match="header of a log"):
        open_log(silent, header=tmp_path / "none.json")
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(InputError, match="header of a log"):
        open_log(silent)
