"""A plant's field, written by CasADi, and the C file that steps it: compiled once per process."""

from __future__ import annotations

import ctypes
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from typing import final

import casadi as ca

from workbench.codegen.c_source import function_text, work_macro
from workbench.codegen.compiler import compile_shared
from workbench.codegen.native_calls import load_function

Doubles = ctypes.Array[ctypes.c_double]


def doubles(values: Sequence[float]) -> Doubles:
    """Memory that a compiled function reads or writes."""
    return (ctypes.c_double * len(values))(*values)


@final
class Stepped:
    """A car's state x that `wb_advance` moves on; x[3] is its speed along the body."""

    __slots__ = ("_advance", "_input", "_p", "acceleration_mps2", "x")

    def __init__(self, advance: Callable[..., int], x: Sequence[float], p: Sequence[float]) -> None:
        """p: what `wb_advance` needs of the car."""
        self._advance, self._p = advance, doubles(p)
        self.x, self._input = doubles(x), doubles([0.0, 0.0])
        self.acceleration_mps2 = 0.0

    def advance(self, asked: tuple[float, float], duration_s: float, *more: object) -> bool:
        """Go on for a time > 0 with these inputs; more: further arguments of `wb_advance`.

        acceleration_mps2 is then the mean over it. Whether the state is still finite.
        """
        before = self.x[3]
        self._input[0], self._input[1] = asked
        self._advance(self.x, self._input, self._p, ctypes.c_double(duration_s), *more)
        self.acceleration_mps2 = (self.x[3] - before) / duration_s
        return math.isfinite(sum(self.x))


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
