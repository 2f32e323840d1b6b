"""`workbench keygen`: make a pair of keys for signing bundles."""

from __future__ import annotations

import argparse
from pathlib import Path

from workbench.cli.output import emit
from workbench.cli.private_key import write_pair
from workbench.runtime.keys import default_private_key

HELP = (
    "Makes a pair of Ed25519 keys: a private one that signs bundles and stays at the desk, and a "
    "public one that is installed on the vehicle, apart from every bundle. Nothing is overwritten."
)
EXAMPLE = """\
workbench keygen
workbench keygen --key keys/shuttle.key
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--key",
        type=Path,
        metavar="FILE",
        help="private key to write, mode 0600; the public one gets .pub at its end "
        "(default: bundle.key in workbench in the user's configuration folder)",
    )


def run(args: argparse.Namespace) -> int:
    """Write both files and name the key."""
    private = args.key or default_private_key()
    public, key = write_pair(private)
    text = (
        f"key {key.key_id}\nprivate {private}: keep it here, it signs\n"
        f"public  {public}: install it on the vehicle, apart from the bundle"
    )
    emit(args, text, {"key_id": key.key_id, "private_key": private, "public_key": public})
    return 0
