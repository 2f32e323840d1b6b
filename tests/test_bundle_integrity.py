"""A bundle with a changed, missing or foreign part is refused before any of its code is loaded."""

from __future__ import annotations

import ctypes
import shutil
import struct
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from runtime_fixture import compiled, fake_manifest, fake_source, write_bundle

from workbench.errors import InputError
from workbench.runtime import load_bundle
from workbench.runtime.manifest import (
    CHECKED_FILES,
    CHECKSUM_FILE,
    HEADER_FILE,
    LIBRARY_FILE,
    MANIFEST_FILE,
    SOURCE_FILE,
    checksums_text,
    manifest_to_json,
)


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_bundle(tmp_path / "bundle")


@pytest.fixture
def no_loading(monkeypatch: pytest.MonkeyPatch) -> None:
    def stand_in(*_arguments: Any, **_named: Any) -> None:
        pytest.fail("the library was loaded")

    fake_manifest()
    monkeypatch.setattr(ctypes, "CDLL", stand_in)


def test_the_untouched_bundle_loads_and_sha256sum_agrees(bundle: Path) -> None:
    loaded = load_bundle(bundle).manifest
    assert manifest_to_json(loaded) == manifest_to_json(fake_manifest())
    if shutil.which("sha256sum"):
        subprocess.run(["sha256sum", "--check", "--strict", CHECKSUM_FILE], cwd=bundle, check=True)


@pytest.mark.parametrize("name", CHECKED_FILES)
def test_a_flipped_byte_names_the_file_before_loading(
    bundle: Path, name: str, no_loading: None
) -> None:
    content = (bundle / name).read_bytes()
    last = len(content) - 1
    places = {*range(min(64, last)), last, *(last * k // 400 for k in range(400))}
    for place in sorted(places):
        flipped = bytearray(content)
        flipped[place] ^= 1 << place % 8
        (bundle / name).write_bytes(flipped)
        with pytest.raises(InputError, match=f"{name} and its line .*expected SHA-256 .*, got "):
            load_bundle(bundle)


def test_every_flipped_bit_of_the_checksums_is_refused(bundle: Path, no_loading: None) -> None:
    content = (bundle / CHECKSUM_FILE).read_bytes()
    for place in range(len(content)):
        for bit in range(8):
            flipped = bytearray(content)
            flipped[place] ^= 1 << bit
            (bundle / CHECKSUM_FILE).write_bytes(flipped)
            with pytest.raises(InputError, match=CHECKSUM_FILE):
                load_bundle(bundle)


@pytest.mark.parametrize(
    "name", [MANIFEST_FILE, LIBRARY_FILE, SOURCE_FILE, HEADER_FILE, CHECKSUM_FILE]
)
def test_a_missing_or_cut_file_is_named(bundle: Path, name: str, no_loading: None) -> None:
    content = (bundle / name).read_bytes()
    (bundle / name).write_bytes(content[:-1])
    with pytest.raises(InputError, match=name):
        load_bundle(bundle)
    (bundle / name).write_bytes(b"")
    with pytest.raises(InputError, match=name):
        load_bundle(bundle)
    (bundle / name).unlink()
    with pytest.raises(InputError, match=rf"not a complete bundle, it lacks \['{name}'\]"):
        load_bundle(bundle)


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (f"{'0' * 64}  other.so\n", "found 'other.so'"),
        (f"{'0' * 64}  kernel.so\n", "once each, found 'kernel.so'"),
        ("\n", "got b''"),
        ("# comment\n", "got b'# comment'"),
    ],
)
def test_extra_lines_in_the_checksums_are_refused(
    bundle: Path, extra: str, message: str, no_loading: None
) -> None:
    path = bundle / CHECKSUM_FILE
    path.write_text(path.read_text() + extra)
    with pytest.raises(InputError, match=message):
        load_bundle(bundle)


def test_a_checksum_line_left_out_is_refused(bundle: Path, no_loading: None) -> None:
    path = bundle / CHECKSUM_FILE
    kept = [line for line in path.read_text().splitlines(keepends=True) if SOURCE_FILE not in line]
    path.write_text("".join(kept))
    with pytest.raises(InputError, match=r"incomplete, it lacks \['kernel.c'\]"):
        load_bundle(bundle)


def test_what_is_no_folder_is_no_bundle(tmp_path: Path, no_loading: None) -> None:
    with pytest.raises(InputError, match="expected a bundle folder, found none"):
        load_bundle(tmp_path / "absent")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="expected a bundle folder"):
        load_bundle(tmp_path / "file")
    with pytest.raises(InputError, match=r"lacks \['SHA256SUMS', 'kernel.so'"):
        load_bundle(str(tmp_path))


def test_another_machines_bundle_says_so(tmp_path: Path, no_loading: None) -> None:
    folder = write_bundle(tmp_path, change=lambda m: replace(m, machine="sparc64"))
    with pytest.raises(InputError, match=r"built for sparc64, this machine is .*workbench build"):
        load_bundle(folder)


def test_the_elf_header_must_agree_with_the_manifest(tmp_path: Path, no_loading: None) -> None:
    library = compiled(fake_source())

    def patched(place: int, code: bytes) -> bytes:
        return library[:place] + code + library[place + len(code) :]

    cases = [
        (patched(18, struct.pack("<H", 40)), "ELF header of kernel.so says machine 40, class"),
        (patched(4, b"\x01"), "ELF header"),
        (patched(16, struct.pack("<H", 2)), "type 2, a shared object is 3"),
        (patched(5, b"\x02"), "not a little-endian ELF library"),
        (patched(0, b"MZ"), "not a little-endian ELF library"),
        (library[:19], "not a little-endian ELF library"),
    ]
    for index, (content, message) in enumerate(cases):
        folder = write_bundle(tmp_path / str(index), library=content)
        with pytest.raises(InputError, match=message):
            load_bundle(folder)


def test_a_machine_without_bundles_is_told_which_ones_have_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_loading: None
) -> None:
    folder = write_bundle(tmp_path, change=lambda m: replace(m, machine="s390x"))
    monkeypatch.setattr("platform.machine", lambda: "s390x")
    with pytest.raises(InputError, match=r"this machine is s390x; bundles run on one of .*aarch64"):
        load_bundle(folder)


def test_a_manifest_that_is_not_utf8_is_refused(bundle: Path, no_loading: None) -> None:
    (bundle / MANIFEST_FILE).write_bytes(b"\xff{}")
    files = {n: (bundle / n).read_bytes() for n in CHECKED_FILES}
    (bundle / CHECKSUM_FILE).write_text(checksums_text(files))
    with pytest.raises(InputError, match="expected UTF-8"):
        load_bundle(bundle)
