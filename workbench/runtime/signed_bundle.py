"""Load a bundle only if the key installed on this machine signed it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from workbench.errors import InputError
from workbench.runtime.bundle import Bundle, bundle_of
from workbench.runtime.contents import CHECKED_FILES, CHECKSUM_FILE
from workbench.runtime.keys import PublicKey, read_public_key
from workbench.runtime.reading import read_once
from workbench.runtime.signature import SIGNATURE_FILE, check_signature, signature_from

MOST_BYTES = 64 * 2**20


def load_signed_bundle(folder: Path, public_key: Path) -> Bundle:
    """Verify signature and hashes of a bundle folder, then load its kernel.

    public_key: a file that `workbench keygen` wrote, installed apart from the bundle. In order:
    every file is read once; the signature over the bytes of SHA256SUMS; the hashes in these same
    bytes against the files; then as `load_bundle`. What is executed is what was signed, whatever
    happens to the folder meanwhile. The key itself is believed: whoever can replace it, or hand
    another `public_key`, decides what loads.
    Raises InputError that names the file at fault, what was expected and what came.
    """
    require_apart(public_key, folder)
    key = read_public_key(public_key)
    if not os.path.isdir(folder):
        raise InputError(f"{folder}: expected a bundle folder, found none; see `workbench build`")
    if not os.path.lexists(folder / SIGNATURE_FILE):
        raise InputError(
            f"{folder}: expected a signed bundle, got one without {SIGNATURE_FILE}; see that it is "
            f"the right one and sign it with `workbench sign --bundle {folder}`"
        )
    names = (SIGNATURE_FILE, CHECKSUM_FILE, *CHECKED_FILES)
    files = {name: read_once(folder / name, most_bytes=MOST_BYTES).content for name in names}
    return signed_bundle_of(files, key=key, folder=folder)


def signed_bundle_of(files: Mapping[str, bytes], *, key: PublicKey, folder: Path) -> Bundle:
    """Verify and load what was read of a signed bundle, without reading anything again.

    files: name -> content, of SHA256SUMS.sig, SHA256SUMS and all it lists; folder: where they came
    from, for messages. What is checked, and how it fails: as `load_signed_bundle` says.
    """
    path = folder / SIGNATURE_FILE
    signature = signature_from(files[SIGNATURE_FILE], path)
    check_signature(files[CHECKSUM_FILE], signature, key=key, path=path)
    return bundle_of(files, folder)


def require_apart(public_key: Path, folder: Path) -> None:
    """Raise InputError where the key lies in the folder that it is to be held against."""
    inside = Path(os.path.realpath(folder))
    if Path(os.path.realpath(public_key)).is_relative_to(inside):
        raise InputError(
            f"{public_key}: expected a public key apart from the bundle, got one inside {folder}, "
            "where whoever changes the bundle can change it too; install the key in a place of "
            "its own"
        )
