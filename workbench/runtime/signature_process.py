"""Holds one Ed25519 signature against its key, as a program of its own.

Run by path, with `-I`: it imports nothing of workbench, and the signature library lives no longer
than the answer. Standard input: public key (32 bytes), signature (64 bytes), signed bytes. The
answer is one line, `verified` or `refused` and the SHA-256 of that request, and the exit status
that belongs to it; a crash or an exception leaves with another status and no such line.
"""

from __future__ import annotations

import hashlib
import sys

PUBLIC_KEY_BYTES = 32
SIGNATURE_BYTES = 64
VERIFIED = 0
REFUSED = 10  # not 1 or 2: an uncaught exception and a wrong option of Python leave with these
NO_LIBRARY = 11


def answer_line(status: int, request: bytes) -> bytes:
    """The line that belongs to `VERIFIED` or `REFUSED` for this request, and to no other."""
    word = b"verified" if status == VERIFIED else b"refused"
    return b"%b %b\n" % (word, hashlib.sha256(request).hexdigest().encode())


def status_of(request: bytes) -> int:
    """`VERIFIED` or `REFUSED`. ModuleNotFoundError without the library."""
    from nacl.exceptions import BadSignatureError
    from nacl.signing import VerifyKey

    key, rest = request[:PUBLIC_KEY_BYTES], request[PUBLIC_KEY_BYTES:]
    signature, signed = rest[:SIGNATURE_BYTES], rest[SIGNATURE_BYTES:]
    if len(signature) != SIGNATURE_BYTES:
        return REFUSED
    try:
        VerifyKey(key).verify(signed, signature)
    except BadSignatureError:
        return REFUSED
    return VERIFIED


def main() -> int:
    """Answer the request on standard input."""
    request = sys.stdin.buffer.read()
    try:
        status = status_of(request)
    except ModuleNotFoundError as error:
        sys.stderr.write(f"{error}\n")
        return NO_LIBRARY
    sys.stdout.buffer.write(answer_line(status, request))
    sys.stdout.buffer.flush()
    return status


if __name__ == "__main__":
    sys.exit(main())
