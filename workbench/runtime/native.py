"""A kernel loaded from verified bytes: what is executed is what was hashed, never a path."""

from __future__ import annotations

import ctypes
import os
import struct
from pathlib import Path
from typing import Any, final

from workbench.errors import InputError
from workbench.runtime.contents import Kernel
from workbench.runtime.floats import float_mode_fault

_NAN = float("nan")
_REBUILD = "rebuild it with `workbench build` here"
_ELF_SHARED_OBJECT = 3
# Machine name as `uname -m` prints it -> (e_machine, class: 1 is 32 bit, 2 is 64 bit) of the ELF
# header.
_ELF_MACHINES = {
    "x86_64": (62, 2),
    "i686": (3, 1),
    "aarch64": (183, 2),
    "armv7l": (40, 1),
    "ppc64le": (21, 2),
    "riscv64": (243, 2),
}


def check_machine(
    library: bytes, *, built_for: str, here: str, name: str = "kernel.so", mend: str = _REBUILD
) -> None:
    """Refuse a library that is not a little-endian ELF shared object of the machine `here`.

    built_for: the machine the manifest names; name, mend: the library's file and how it is made
    anew. Raises InputError that names both machines.
    """
    if built_for != here:
        raise InputError(f"the bundle was built for {built_for}, this machine is {here}: {mend}")
    if here not in _ELF_MACHINES:
        raise InputError(f"this machine is {here}; bundles run on one of {sorted(_ELF_MACHINES)}")
    if len(library) < 20 or library[:4] != b"\x7fELF" or library[5] != 1:
        raise InputError(f"{name} is not a little-endian ELF library: {mend}")
    kind, machine = struct.unpack_from("<HH", library, 16)
    if kind != _ELF_SHARED_OBJECT or (machine, library[4]) != _ELF_MACHINES[here]:
        found = {code: name for name, code in _ELF_MACHINES.items()}.get(
            (machine, library[4]), f"machine {machine}, class {library[4]}"
        )
        raise InputError(
            f"the manifest says {built_for}, but the ELF header of {name} says {found} "
            f"(type {kind}, a shared object is {_ELF_SHARED_OBJECT}): {mend}"
        )


@final
class NativeKernel:
    """A loaded library with its three buffers, allocated once.

    library: the bytes of the shared object, verified by the caller; kernel: entry point and sizes.
    Raises InputError when the library cannot be loaded, lacks a symbol, reports other sizes, or
    changes the floating-point mode while loading. Not for use by two threads at once.
    """

    def __init__(self, library: bytes, kernel: Kernel) -> None:
        _require_float_mode("before kernel.so was loaded")
        handle = load_library(library, name="kernel.so", mend=_REBUILD)
        _require_float_mode("after kernel.so was loaded; its flags or its start-up code are wrong")
        for name in ("query_size", "result_size", "work_size"):
            _check_size(handle, f"wb_{name}", getattr(kernel, name))
        self._entry = _symbol(handle, kernel.entry)
        self._entry.restype = ctypes.c_int
        self._entry.argtypes = (ctypes.c_void_p,) * 3
        self._buffers = tuple(
            (ctypes.c_double * max(size, 1))()
            for size in (kernel.query_size, kernel.result_size, kernel.work_size)
        )
        self._addresses = tuple(ctypes.addressof(buffer) for buffer in self._buffers)
        self.query = memoryview(self._buffers[0]).cast("B").cast("d")
        self.result = memoryview(self._buffers[1]).cast("B").cast("d")
        self._unwritten = (ctypes.c_double * kernel.result_size)(*[_NAN] * kernel.result_size)

    def run(self) -> int:
        """Call the entry point on `query`; `result` is NaN where the kernel wrote nothing."""
        result = self._buffers[1]
        ctypes.memmove(result, self._unwritten, ctypes.sizeof(result))
        code: int = self._entry(*self._addresses)
        return code


def _require_float_mode(when: str) -> None:
    fault = float_mode_fault()
    if fault is not None:
        raise InputError(
            f"expected IEEE arithmetic, rounded to nearest, with subnormals, but {fault} {when}; "
            "build with the flags of `workbench build`, not -ffast-math, and start a new process"
        )


def _symbol(handle: ctypes.CDLL, name: str) -> Any:
    try:
        return handle[name]
    except AttributeError:
        raise InputError(f"kernel.so does not export {name}: {_REBUILD}") from None


def _check_size(handle: ctypes.CDLL, name: str, expected: int) -> None:
    function = _symbol(handle, name)
    function.restype = ctypes.c_longlong
    function.argtypes = ()
    size = function()
    if size != expected:
        raise InputError(
            f"{name}() of kernel.so says {size}, the manifest says {expected}: {_REBUILD}"
        )


def load_library(library: bytes, *, name: str, mend: str) -> ctypes.CDLL:
    """A shared object from its bytes; name, mend: for the InputError where it cannot be loaded."""
    try:
        return _load_memfd(library) if hasattr(os, "memfd_create") else _load_file(library)
    except OSError as error:
        raise InputError(f"{name} cannot be loaded ({error}): {mend}") from error


def _load_memfd(library: bytes) -> ctypes.CDLL:
    import fcntl

    descriptor = os.memfd_create("workbench-kernel", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    with os.fdopen(descriptor, "wb", closefd=False) as file:
        file.write(library)
    seals = fcntl.F_SEAL_WRITE | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL
    fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, seals)
    # The descriptor stays open as long as the library, that is, the process: the loader knows
    # libraries by path, so a second bundle under a reused number would silently get the first one's
    # code.
    return ctypes.CDLL(f"/proc/self/fd/{descriptor}", mode=os.RTLD_NOW | os.RTLD_LOCAL)


def _load_file(library: bytes) -> ctypes.CDLL:
    import tempfile

    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        path = Path(folder) / "kernel.so"
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o500)
        with os.fdopen(descriptor, "wb") as file:
            file.write(library)
        return ctypes.CDLL(str(path), mode=os.RTLD_NOW | os.RTLD_LOCAL)
