"""Functions of a compiled shared object, as they can be called on this machine."""

from __future__ import annotations

import ctypes
import tempfile
from pathlib import Path


def load_function(shared_object: bytes, name: str) -> ctypes._NamedFuncPointer:
    """`name` from a shared object given as bytes (loaded through a private temporary file)."""
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        path = Path(folder) / "kernel.so"
        path.write_bytes(shared_object)
        return ctypes.CDLL(str(path))[name]


def exported_size(shared_object: bytes, name: str) -> int:
    """What an exported size function without arguments returns."""
    function = load_function(shared_object, name)
    function.restype = ctypes.c_longlong
    return int(function())
