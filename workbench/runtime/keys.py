"""Key files for signed bundles: Ed25519 in the PEM form that other tools read and write too."""

from __future__ import annotations

import base64
import binascii
import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench.errors import InputError
from workbench.runtime.reading import read_once

KEY_BYTES = 32
_MOST_BYTES = 4096
_WRITABLE_BY_OTHERS = 0o022


@final
@dataclass(frozen=True, slots=True)
class KeyForm:
    """How a file holds one half of a pair: its PEM title, and the DER before the key (RFC 8410)."""

    title: str
    prefix: bytes

    def text(self, key: bytes) -> bytes:
        """What a file with this key holds; key: 32 bytes."""
        body = base64.b64encode(self.prefix + key)
        title = self.title.encode()
        return b"-----BEGIN %b-----\n%b\n-----END %b-----\n" % (title, body, title)

    def key(self, text: bytes) -> bytes | None:
        """The 32 bytes in such a file, or None: one text per key, so that no byte is free."""
        lines = text.split(b"\n")
        try:
            der = base64.b64decode(lines[1], validate=True)
        except (IndexError, binascii.Error):
            return None
        key = der[len(self.prefix) :]
        return key if len(key) == KEY_BYTES and self.text(key) == text else None


PUBLIC = KeyForm("PUBLIC KEY", bytes.fromhex("302a300506032b6570032100"))
PRIVATE = KeyForm("PRIVATE KEY", bytes.fromhex("302e020100300506032b657004220420"))


@final
@dataclass(frozen=True, slots=True)
class PublicKey:
    """The key that signatures are held against; raw: its 32 bytes (RFC 8032)."""

    raw: bytes

    def __post_init__(self) -> None:
        if len(self.raw) != KEY_BYTES:
            raise InputError(
                f"expected a public key of {KEY_BYTES} bytes, got {len(self.raw)}; "
                "read it from the file that `workbench keygen` wrote"
            )

    @property
    def key_id(self) -> str:
        """Its name for people: the first 128 bits of its SHA-256, in hex."""
        return hashlib.sha256(self.raw).hexdigest()[:32]


def key_folder() -> Path:
    """The user's folder for keys: workbench in $XDG_CONFIG_HOME, or in ~/.config."""
    configured = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    return (configured if configured.is_absolute() else Path.home() / ".config") / "workbench"


def default_private_key() -> Path:
    """Where `workbench keygen` and `sign` look for the private key unless told otherwise."""
    return key_folder() / "bundle.key"


def default_public_key() -> Path:
    """Where a vehicle looks for the public key unless told otherwise."""
    return public_key_beside(default_private_key())


def public_key_beside(private_key: Path) -> Path:
    """The public half's file: the private one's name with .pub at its end."""
    return private_key.with_name(f"{private_key.name}.pub")


def read_public_key(path: Path) -> PublicKey:
    """The key in a file that `workbench keygen` wrote.

    Raises InputError where it is no such file, or where others than its owner may write to it:
    whoever can exchange the key decides what drives.
    """
    reading = read_once(path, most_bytes=_MOST_BYTES)
    if reading.mode & _WRITABLE_BY_OTHERS:
        raise InputError(
            f"{path}: expected a public key that only its owner may write, got mode "
            f"{reading.mode:04o}; make sure that it is the right key, then chmod 644 {path}"
        )
    key = PUBLIC.key(reading.content)
    if key is None:
        raise InputError(
            f"{path}: expected an Ed25519 public key as `workbench keygen` writes it, got "
            f"{described(reading.content)}; copy the .pub file again"
        )
    return PublicKey(key)


def described(text: bytes) -> str:
    """What a key file seems to hold, without a byte of it: it may be a secret."""
    for form in (PUBLIC, PRIVATE):
        if form.key(text) is not None:
            return f"a {form.title.lower()}"
    return f"{len(text)} bytes of another form"
