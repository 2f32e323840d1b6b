"""A file is read whole, bounded, and only if it is regular and stands still."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.runtime.reading import read_once


def test_files_are_read_whole_bounded_and_only_while_they_stand_still(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert read_once(path, most_bytes=5).content == b"12345"
    with pytest.raises(InputError, match="expected at most 4 bytes, got 5"):
        read_once(path, most_bytes=4)
    for place in (tmp_path, Path(os.devnull)):
        with pytest.raises(InputError, match="expected a regular file, got a folder, pipe or dev"):
            read_once(place, most_bytes=5)
    with pytest.raises(InputError, match="No such file"):
        read_once(tmp_path / "absent", most_bytes=5)
    real = os.fstat

    def grow(descriptor: int) -> os.stat_result:
        found = real(descriptor)
        path.write_bytes(b"123456")
        return found

    monkeypatch.setattr(os, "fstat", grow)
    with pytest.raises(InputError, match="it changes while it is read"):
        read_once(path, most_bytes=5)
    assert path.read_bytes() == b"123456"


def test_a_file_that_cannot_be_read_to_its_end_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_bytes(b"12345")

    def fails(_descriptor: int) -> os.stat_result:
        raise OSError(5, "Input/output error")

    descriptors = Path("/proc/self/fd")
    before = len(os.listdir(descriptors)) if descriptors.is_dir() else 0
    # Whoever reports the test's outcome needs the real one again.
    with monkeypatch.context() as patched:
        patched.setattr(os, "fstat", fails)
        with pytest.raises(InputError, match="can be read, got: Input/output error"):
            read_once(tmp_path / "file", most_bytes=5)
    if before:
        assert len(os.listdir(descriptors)) == before
