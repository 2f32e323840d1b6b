"""The private half of a pair of keys: made, kept from others' eyes, used."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.errors import InputError
from workbench.runtime.keys import (
    KEY_BYTES,
    PRIVATE,
    PUBLIC,
    PublicKey,
    described,
    public_key_beside,
)
from workbench.runtime.reading import read_once
from workbench.runtime.signature import Signature, check_signature

if TYPE_CHECKING:
    from nacl.signing import SigningKey

_MOST_BYTES = 4096
_OPEN_TO_OTHERS = 0o077


def write_pair(private: Path) -> tuple[Path, PublicKey]:
    """Write a new private key (mode 0600) and, beside it, its public key (mode 0644).

    Returns the public key's file and the key. Neither file may exist: a key that is replaced takes
    every signature made with it along. Raises InputError, and then leaves neither.
    """
    public = public_key_beside(private)
    for path in (private, public):
        if os.path.lexists(path):
            raise _exists(path)
    seed = secrets.token_bytes(KEY_BYTES)
    key = PublicKey(bytes(_signing_key(seed).verify_key))
    try:
        private.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise _no_place(private, error) from None
    try:
        with (
            _new_file(private, PRIVATE.text(seed), 0o600),
            _new_file(public, PUBLIC.text(key.raw), 0o644),
        ):
            pass
    except FileExistsError as error:
        raise _exists(Path(error.filename)) from None
    except OSError as error:
        raise _no_place(private, error) from None
    return public, key


@contextlib.contextmanager
def _new_file(path: Path, content: bytes, mode: int) -> Iterator[None]:
    """Write a file that did not exist, on the disk before the block begins; gone if that fails."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
    try:
        with os.fdopen(descriptor, "wb") as file:
            os.fchmod(descriptor, mode)  # whatever the umask took away
            file.write(content)
            file.flush()
            os.fsync(descriptor)
        yield
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def _no_place(path: Path, error: OSError) -> InputError:
    return InputError(
        f"expected a place where keys can be written, got {path} ({error.strerror}); "
        "choose another with --key FILE"
    )


def _exists(path: Path) -> InputError:
    return InputError(
        f"expected no file {path}, and there is one: a key that is replaced is lost, with all "
        "that it signed; choose another name with --key FILE"
    )


def read_private_key(path: Path) -> bytes:
    """The 32 secret bytes in a file of `write_pair`.

    Raises InputError where it is no such file, or where others than its owner may open it; no
    message holds a byte of it.
    """
    reading = read_once(path, most_bytes=_MOST_BYTES)
    if reading.mode & _OPEN_TO_OTHERS:
        raise InputError(
            f"{path}: expected a private key that only its owner may open, got mode "
            f"{reading.mode:04o}; if nobody can have copied it, chmod 600 {path}, else make a new "
            "one with `workbench keygen`"
        )
    seed = PRIVATE.key(reading.content)
    if seed is None:
        raise InputError(
            f"{path}: expected an Ed25519 private key as `workbench keygen` writes it, got "
            f"{described(reading.content)}; name the file without .pub"
        )
    return seed


def signed(message: bytes, seed: bytes) -> tuple[Signature, PublicKey]:
    """The signature of `message` (Ed25519, RFC 8032), and the public key that fits it."""
    private = _signing_key(seed)
    key = PublicKey(bytes(private.verify_key))
    return Signature(key.key_id, private.sign(message).signature), key


def signature_file(sums: bytes, seed: bytes, path: Path) -> tuple[bytes, PublicKey]:
    """The content of the file `path` that signs `sums`, verified as a vehicle would, and the public
    key that fits it."""
    signature, key = signed(sums, seed)
    check_signature(sums, signature, key=key, path=path)
    return signature.text(), key


def _signing_key(seed: bytes) -> SigningKey:
    try:
        from nacl.signing import SigningKey
    except ModuleNotFoundError as error:
        raise InputError(
            f"expected PyNaCl, which signs, and this installation lacks it ({error}); "
            "install the package again"
        ) from None
    return SigningKey(seed)
