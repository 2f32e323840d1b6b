"""Signed bundles in memory, their keys, and the signature check without a process."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Iterator
from pathlib import Path

from runtime_fixture import write_bundle

from workbench.cli.private_key import signed
from workbench.runtime import signature_process
from workbench.runtime.contents import CHECKED_FILES, CHECKSUM_FILE
from workbench.runtime.keys import PUBLIC, PublicKey
from workbench.runtime.signature import SIGNATURE_FILE, Answer

SEED = bytes(range(32))
KEY: PublicKey = signed(b"", SEED)[1]
OTHER_SEED = bytes(range(1, 33))
OTHER_KEY: PublicKey = signed(b"", OTHER_SEED)[1]
NAMES = (SIGNATURE_FILE, CHECKSUM_FILE, *CHECKED_FILES)


def signed_again(files: dict[str, bytes], seed: bytes = SEED) -> dict[str, bytes]:
    """The same files with a signature by `seed` of the SHA256SUMS among them."""
    return files | {SIGNATURE_FILE: signed(files[CHECKSUM_FILE], seed)[0].text()}


@functools.cache
def fake_files() -> dict[str, bytes]:
    """The fake bundle, signed by `SEED`."""
    with tempfile.TemporaryDirectory() as folder:
        bundle = write_bundle(Path(folder))
        return signed_again({path.name: path.read_bytes() for path in bundle.iterdir()})


def write_files(folder: Path, files: dict[str, bytes]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder


def write_public_key(path: Path, key: PublicKey = KEY) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(PUBLIC.text(key.raw))
    path.chmod(0o644)
    return path


@functools.lru_cache(maxsize=8)
def ask_here(request: bytes) -> Answer:
    """What the checking process answers, from the same function in this process."""
    status = signature_process.status_of(request)
    return Answer(status, signature_process.answer_line(status, request), b"")


def flipped(content: bytes, place: int, bit: int) -> bytes:
    changed = bytearray(content)
    changed[place] ^= 1 << bit
    return bytes(changed)


def all_bits(content: bytes) -> Iterator[bytes]:
    """The content with each single bit of it flipped."""
    for place in range(len(content)):
        for bit in range(8):
            yield flipped(content, place, bit)


def one_bit_per_byte(content: bytes) -> Iterator[bytes]:
    """The content with one bit of each byte flipped, of each byte another."""
    for place in range(len(content)):
        yield flipped(content, place, place % 8)
