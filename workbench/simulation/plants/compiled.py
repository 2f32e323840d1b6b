"""A plant's field, written by CasADi, and the C file that steps it: compiled once per process."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files

import casadi as ca

from workbench.codegen.c_source import function_text, work_macro
from workbench.codegen.compiler import compile_shared
from workbench.codegen.native_calls import load_function

Doubles = ctypes.Array[ctypes.c_double]


def doubles(values: Sequence[float]) -> Doubles:
    """Memory that a compiled function reads or writes."""
    return (ctypes.c_double * len(values))(*values)


def stepping(
    functions: Sequence[ca.Function], file: str, numbers: Mapping[str, float]
) -> Callable[..., int]:
    """`wb_advance` of c/`file`, which calls these functions; numbers: its macros.

    Raises InputError without a C compiler. Equal text is compiled once in a process.
    """
    macros = [f"#define {name} {value!r}" for name, value in numbers.items()]
    own = (files("workbench.simulation.plants") / "c" / file).read_text()
    return _compiled("\n".join([function_text(functions), work_macro(functions), *macros, own]))


@functools.cache
def _compiled(source: str) -> Callable[..., int]:
    return load_function(compile_shared(source).shared_object, "wb_advance")
