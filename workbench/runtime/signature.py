"""The signature of a bundle's SHA256SUMS: its file, and whether the installed key made it."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench.errors import InputError
from workbench.runtime import signature_process
from workbench.runtime.contents import CHECKSUM_FILE
from workbench.runtime.keys import PublicKey
from workbench.runtime.signature_process import REFUSED, VERIFIED, answer_line

SIGNATURE_FILE = "SHA256SUMS.sig"
_FORM = re.compile(rb"workbench bundle signature 1 Ed25519\nkey ([0-9a-f]{32})\n([0-9a-f]{128})\n")
_PROGRAM = Path(signature_process.__file__)
_PATIENCE_S = 20.0


@final
@dataclass(frozen=True, slots=True)
class Signature:
    """A signature and the name of the key that made it; raw: 64 bytes (RFC 8032)."""

    key_id: str
    raw: bytes

    def text(self) -> bytes:
        """What its file holds."""
        return b"workbench bundle signature 1 Ed25519\nkey %b\n%b\n" % (
            self.key_id.encode(),
            self.raw.hex().encode(),
        )


@final
@dataclass(frozen=True, slots=True)
class Answer:
    """How the checking process ended: exit status, standard output and standard error."""

    status: int
    out: bytes
    err: bytes

    def says(self, status: int, request: bytes) -> bool:
        """Whether exit status and output together are the answer `status` to this request."""
        return self.status == status and self.out == answer_line(status, request)

    def ending(self) -> str:
        """How the process ended, for people."""
        lines = self.err.decode("utf-8", "replace").splitlines()
        return f"exit status {self.status}" + (f", {lines[-1]}" if lines else "")


def signature_from(text: bytes, path: Path) -> Signature:
    """Read a signature file's content; path: for the message. Raises InputError on any other."""
    found = _FORM.fullmatch(text)
    if found is None:
        raise InputError(
            f"{path}: expected three lines as `workbench sign` writes them, got {len(text)} bytes "
            f"of another form; {_mend(path)}"
        )
    return Signature(found[1].decode(), bytes.fromhex(found[2].decode()))


def check_signature(signed: bytes, signature: Signature, *, key: PublicKey, path: Path) -> None:
    """Raise InputError unless `key` made `signature` of `signed`.

    signed: the bytes of SHA256SUMS; path: the signature's file, for messages. The check runs in a
    process of its own and counts only if that process left with the right exit status and the one
    line that belongs to exactly these bytes, this signature and this key.
    """
    if signature.key_id != key.key_id:
        raise InputError(
            f"{path}: expected a signature by the installed key {key.key_id}, got one by "
            f"{signature.key_id}; sign the bundle with the key that belongs to this vehicle, or, "
            "if you trust the one that signed, install its public key"
        )
    request = key.raw + signature.raw + signed
    answer = ask(request)
    if answer.says(VERIFIED, request):
        return
    if answer.says(REFUSED, request):
        raise InputError(
            f"{path}: expected the signature of this {CHECKSUM_FILE} by key {key.key_id}, got one "
            f"that does not fit; one of the two was changed after signing: {_mend(path)}"
        )
    raise InputError(
        f"{path}: expected an answer about this signature, got none ({answer.ending()}); "
        "install the package again, with its dependency PyNaCl"
    )


def ask(request: bytes) -> Answer:
    """Run the checking process on one request. InputError where it cannot start or end."""
    if not sys.executable:
        raise InputError(
            "expected to know the Python that runs this, to check a signature in a process of its "
            "own, got no sys.executable; start `python` itself"
        )
    try:
        done = subprocess.run(
            [sys.executable, "-I", str(_PROGRAM)],
            input=request,
            capture_output=True,
            timeout=_PATIENCE_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise InputError(
            f"expected an answer about a signature within {_PATIENCE_S:g} s, got none; "
            "try again on a machine that is less busy"
        ) from None
    except OSError as error:
        raise InputError(
            f"expected to start {sys.executable} to check a signature, got: {error.strerror}; "
            "repair this installation of Python"
        ) from None
    return Answer(done.returncode, done.stdout, done.stderr)


def _mend(path: Path) -> str:
    return (
        "copy the bundle again, or see that it is the right one and sign it with "
        f"`workbench sign --bundle {path.parent}`"
    )
