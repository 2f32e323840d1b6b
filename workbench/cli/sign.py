"""`workbench sign`: sign a bundle."""

from __future__ import annotations

import argparse
from pathlib import Path

from workbench.cli.common import replacing
from workbench.cli.output import emit
from workbench.cli.private_key import read_private_key, signature_file
from workbench.errors import InputError
from workbench.runtime.bundle import checked_manifest
from workbench.runtime.contents import CHECKED_FILES, CHECKSUM_FILE
from workbench.runtime.keys import PublicKey, default_private_key
from workbench.runtime.reading import read_once
from workbench.runtime.signature import SIGNATURE_FILE
from workbench.runtime.signed_bundle import MOST_BYTES

HELP = (
    "Signs a bundle: checks every file against SHA256SUMS, then writes SHA256SUMS.sig, an Ed25519 "
    "signature of SHA256SUMS. A vehicle that holds the public key loads nothing else."
)
EXAMPLE = """\
workbench sign --bundle out/bundle
workbench sign --bundle out/bundle --key keys/shuttle.key
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--bundle", type=Path, required=True, metavar="DIR", help="bundle to sign"
    )  # fmt: skip
    parser.add_argument(
        "--key",
        type=Path,
        metavar="FILE",
        help="private key, as `workbench keygen` wrote it "
        "(default: bundle.key in workbench in the user's configuration folder)",
    )


def run(args: argparse.Namespace) -> int:
    """Sign and say whose signature it is."""
    name, key = sign_bundle(args.bundle, args.key or default_private_key())
    path = args.bundle / SIGNATURE_FILE
    emit(
        args,
        f"signed the bundle of {name} by key {key.key_id}\n{path}",
        {"key_id": key.key_id, "name": name, "signature": path},
    )
    return 0


def sign_bundle(folder: Path, private_key: Path) -> tuple[str, PublicKey]:
    """Write the signature of a whole bundle, replacing an older one; its name and the key.

    What is signed are the bytes that were held against the files, and the signature is verified
    as a vehicle would before it is written. Raises InputError; then nothing was written.
    """
    seed = read_private_key(private_key)
    if not folder.is_dir():
        raise InputError(f"{folder}: expected a bundle folder, found none; see `workbench build`")
    names = (CHECKSUM_FILE, *CHECKED_FILES)
    files = {name: read_once(folder / name, most_bytes=MOST_BYTES).content for name in names}
    manifest = checked_manifest(files, folder)
    path = folder / SIGNATURE_FILE
    signature, key = signature_file(files[CHECKSUM_FILE], seed, path)
    with replacing(path) as temporary:
        temporary.write_bytes(signature)
    return manifest.name, key
