"""A folder of files that is written whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from workbench.errors import InputError


def write_folder(files: Mapping[str, bytes], target: Path, *, what: str) -> Path:
    """Write the files (name -> content) into `target`, in place of what stands there, return it.

    what: names the thing in messages, as "bundle". Raises InputError where nothing can be written.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=f".{what}-", dir=target.parent))
    except OSError as error:
        raise InputError(
            f"cannot write a {what} to {target} ({error.strerror}); choose a folder you may write"
        ) from None
    try:
        for name, content in files.items():
            (fresh / name).write_bytes(content)
        fresh.chmod(0o755)
        old = fresh.with_name(f"{fresh.name}-old")
        # A crash in between leaves the old one beside its place, never half of one in it.
        if target.exists():
            target.rename(old)
        fresh.rename(target)
        shutil.rmtree(old, ignore_errors=True)
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise
    return target
