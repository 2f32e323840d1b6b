"""A compiler front end that compiles each C text once in a run of the tests, on all workers.

`python compile_once.py COMPILER FOLDER ARGUMENT...` does what `COMPILER ARGUMENT...` does. The file
it makes is kept in FOLDER under a digest of everything it can depend on: the compiler's version,
the arguments (a name in the object is one of them) and the C text. Whatever is not one
self-contained C file made into one file by known options goes to the compiler as it is, and so
does what it warned about or refused.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
import shutil
import subprocess
import sys

# None of these reads or writes another file, or puts a place or a time into the object.
_KNOWN = re.compile(
    r"-shared|-fPIC|-lm|-ldl|-std=\w+|-O\w|-W[a-z-]+|-f(no-)?(tree-vectorize|fast-math|math-errno|"
    r"semantic-interposition|builtin)|-ffp-contract=\w+|-fvect-cost-model=\w+"
)
_DEPENDS_ON_MORE = re.compile(rb"#\s*include\s*[^<\s]|__(FILE|DATE|TIME|TIMESTAMP|BASE_FILE)__")


def parts(arguments: list[str]) -> tuple[str, str, list[str]] | None:
    """(C file, object, the arguments without the object's name), or None for anything unusual."""
    if arguments.count("-o") != 1 or arguments[-1] == "-o":
        return None
    at = arguments.index("-o")
    rest = arguments[:at] + arguments[at + 2 :]
    texts = [each for each in rest if not _KNOWN.fullmatch(each)]
    if len(texts) != 1 or not texts[0].endswith(".c"):
        return None
    return texts[0], arguments[at + 1], rest


def key(compiler: str, text: bytes, rest: list[str]) -> str:
    """Digest of all that the object depends on."""
    about = os.stat(os.path.realpath(compiler))
    told = [os.path.realpath(compiler), about.st_mtime_ns, about.st_size, rest]
    return hashlib.sha256(repr(told).encode() + b"\0" + text).hexdigest()


def main(compiler: str, folder: str, arguments: list[str]) -> int:
    found = parts(arguments)
    text = b"__FILE__"
    if found is not None and os.path.isfile(found[0]):
        with open(found[0], "rb") as file:
            text = file.read()
    if found is None or _DEPENDS_ON_MORE.search(text):
        return subprocess.run([compiler, *arguments], check=False).returncode
    _, made, rest = found
    kept = os.path.join(folder, key(compiler, text, rest))
    # Who comes second waits for the first instead of compiling as well.
    with open(f"{kept}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if os.path.exists(kept):
            shutil.copy(kept, made)
            return 0
        ran = subprocess.run([compiler, *arguments], capture_output=True, check=False)
        sys.stdout.buffer.write(ran.stdout)
        sys.stderr.buffer.write(ran.stderr)
        if ran.returncode == 0 and not ran.stdout and not ran.stderr:
            shutil.copy(made, f"{kept}.part")
            os.replace(f"{kept}.part", kept)
        return ran.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], sys.argv[3:]))
