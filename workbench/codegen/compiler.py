"""The C compiler and the flags under which generated code keeps its bits."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench.errors import InputError

# No fused multiply-add, no reassociation, no tuning to this machine: the operations that the proof
# is about are the operations that run. Vectorising independent columns does not change their bits.
FLAGS = (
    "-std=c99", "-O2", "-ftree-vectorize", "-fvect-cost-model=dynamic", "-ffp-contract=off",
    "-fno-fast-math", "-fno-math-errno", "-fPIC", "-fno-semantic-interposition", "-shared",
)  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Compiled:
    """A shared object as bytes, with the compiler (its version line) and flags that made it."""

    shared_object: bytes
    compiler: str
    flags: tuple[str, ...]


def find_compiler() -> str:
    """Path of a C compiler: $CC, else cc, gcc or clang. Raises InputError when there is none."""
    wanted = os.environ.get("CC")
    for name in (wanted,) if wanted else ("cc", "gcc", "clang"):
        path = shutil.which(name)
        if path:
            return path
    raise InputError(
        f"expected a C compiler ({wanted or 'cc, gcc or clang'}) on the PATH, found none; install "
        "one "
        "(Debian: apt-get install gcc) or set CC to its path"
    )


def compile_shared(source: str, *, flags: tuple[str, ...] = FLAGS) -> Compiled:
    """Compile one C99 file into a shared object; InputError holds the compiler's first error."""
    compiler = find_compiler()
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        (Path(folder) / "kernel.c").write_text(source)
        # A relative file name keeps the build folder out of the object: same source, same bytes.
        run = subprocess.run(
            [compiler, *flags, "-o", "kernel.so", "kernel.c", "-lm"],
            cwd=folder, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if run.returncode:
            errors = [line for line in run.stderr.splitlines() if "error" in line] or [run.stderr]
            raise InputError(f"{compiler} could not compile the kernel: {errors[0].strip()}")
        shared = (Path(folder) / "kernel.so").read_bytes()
    version = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False)
    return Compiled(shared, version.stdout.splitlines()[0] if version.stdout else compiler, flags)
