"""The filter's steps from a shared object: CasADi's C functions with buffers of their own."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, Final

from workbench.errors import InputError
from workbench.runtime.localiser.states import HYPOTHESES
from workbench.runtime.localiser.steps import FOUND, GIVEN, NAMES, Numbers, Step, Steps, doubles
from workbench.runtime.native import load_library

SYMBOLS: Final = (
    "wb_loc_predict", "wb_loc_report_speed", "wb_loc_report_steering", "wb_loc_range",
    "wb_loc_locate", "wb_loc_collapse",
)  # fmt: skip
"""The functions of `NAMES` as the shared object exports them."""
REBUILD: Final = "build it again here with `workbench build-localiser`"
"""How what does not fit this machine is mended."""
# What one function may want of pointers and of work memory; more is not believed.
_MOST_WORK: Final = 1 << 20
_EACH: Final = NAMES[:4]
_Pointers = Any


def native_steps(library: bytes) -> Steps:
    """The steps in a shared object, given as the bytes that were verified.

    Raises InputError where it cannot be loaded, lacks a function, or where a function does not take
    and give as many numbers as `GIVEN` and `FOUND` say.
    """
    handle = load_library(library, name="localiser.so", mend=REBUILD)
    made = {}
    for name, symbol, given, found in zip(NAMES, SYMBOLS, GIVEN, FOUND, strict=True):
        _check_sizes(handle, symbol, given, found)
        made[name] = _step(handle, symbol, (given, found), 1)
        if name in _EACH:
            made[f"each_{name}"] = _step(handle, symbol, (given, found), HYPOTHESES)
    return Steps(**made)


def _step(
    handle: ctypes.CDLL, symbol: str, sizes: tuple[tuple[int, ...], tuple[int, ...]], many: int
) -> Step:
    """A function over `many` cases, one after the other, whose numbers lie side by side."""
    pointers, work = _work_of(handle, symbol)
    given, found = (tuple(doubles(many * size) for size in part) for part in sizes)
    tables = [
        tuple(
            _table(buffers, part, k, room)
            for buffers, part, room in zip((given, found), sizes, pointers, strict=True)
        )
        for k in range(many)
    ]
    return Step(given, found, _runner(_symbol(handle, symbol), tables, work))


def _runner(
    function: Any, tables: list[tuple[_Pointers, ...]], work: tuple[Any, Any]
) -> Callable[[], None]:
    function.restype = ctypes.c_int
    function.argtypes = (ctypes.c_void_p,) * 4 + (ctypes.c_int,)
    whole, real = (ctypes.addressof(part) for part in work)
    calls = [(*map(ctypes.addressof, table), whole, real, 0) for table in tables]
    alone = calls[0]

    def run_one(_keep: object = (tables, work)) -> None:
        function(*alone)

    def run_all(_keep: object = (tables, work)) -> None:
        for call in calls:
            function(*call)

    return run_one if len(calls) == 1 else run_all


def _table(buffers: tuple[Numbers, ...], sizes: tuple[int, ...], k: int, room: int) -> _Pointers:
    """Addresses of the k-th case's numbers, in an array with room for what the function adds."""
    table = (ctypes.c_void_p * room)()
    for i, (buffer, size) in enumerate(zip(buffers, sizes, strict=True)):
        table[i] = ctypes.addressof(ctypes.c_double.from_buffer(buffer, 8 * k * size))
    return table


def _work_of(handle: ctypes.CDLL, symbol: str) -> tuple[tuple[int, int], tuple[Any, Any]]:
    """Room for pointers to arguments and results, and memory to work in."""
    sizes = [ctypes.c_longlong() for _ in range(4)]
    function = _symbol(handle, f"{symbol}_work")
    function.restype = ctypes.c_int
    failed = function(*(ctypes.byref(size) for size in sizes))
    n = [size.value for size in sizes]
    if failed or not all(0 <= size <= _MOST_WORK for size in n):
        raise InputError(f"{symbol} of localiser.so asks for {n} of work memory; {REBUILD}")
    work = (ctypes.c_longlong * max(n[2], 1))(), (ctypes.c_double * max(n[3], 1))()
    return (n[0], n[1]), work


def _check_sizes(
    handle: ctypes.CDLL, symbol: str, given: tuple[int, ...], found: tuple[int, ...]
) -> None:
    for side, sizes in (("in", given), ("out", found)):
        count = _symbol(handle, f"{symbol}_n_{side}")
        sparsity = _symbol(handle, f"{symbol}_sparsity_{side}")
        count.restype = ctypes.c_longlong
        sparsity.restype = ctypes.POINTER(ctypes.c_longlong)
        sparsity.argtypes = (ctypes.c_longlong,)
        # Of a dense matrix: rows, columns, and 1 in the place where a sparse one's columns begin.
        shapes = [sparsity(k)[:3] for k in range(min(count(), len(sizes) + 1))]
        if tuple(rows * columns for rows, columns, _ in shapes) != sizes or any(
            dense != 1 for _, _, dense in shapes
        ):
            raise InputError(
                f"{symbol} of localiser.so: expected {sizes} numbers {side}, got the shapes "
                f"{shapes}; {REBUILD}"
            )


def _symbol(handle: ctypes.CDLL, name: str) -> Any:
    try:
        return handle[name]
    except AttributeError:
        raise InputError(f"localiser.so does not export {name}; {REBUILD}") from None
