"""Parts of a kernel's C text: CasADi's functions, tables, and the hand-written files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from importlib.resources import files

import casadi as ca

from workbench.errors import InputError

# One instruction in place of a library call. Minimum and maximum differ from C's for NaN and signed
# zeros only, and every bound is watched for NaN before it meets one (see sensitivity.validity). The
# rounding trick equals floor below 2^51; the trigonometry that asks refuses arguments above 1e4.
_INLINE = {
    "return fmin(x, y);": "return x < y ? x : y;",
    "return fmax(x, y);": "return x > y ? x : y;",
    "floor(": "wb_floor(",
}
FLOOR = """\
static double wb_floor(double x) {
  const double shift = 6755399441055744.0, nearest = (x + shift) - shift;
  return nearest > x ? nearest - 1.0 : nearest;
}
"""
PRELUDE = """\
#include <math.h>
#include <stddef.h>
#include <string.h>

/* A second copy of one loop for wider registers, chosen when the object is loaded. Columns are
 * independent and nothing is contracted, so both copies give the same bits. Only for functions that
 * call none of this file: GCC 12 forgets to clear the wide registers behind a call between two such
 * copies, and the next narrow instruction then waits for some 150 cycles. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__)
#define WB_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WB_WIDE
#endif
"""


def function_text(functions: Sequence[ca.Function]) -> str:
    """C text of CasADi Functions; none of them may need integer work memory."""
    generator = ca.CodeGenerator("kernel_functions", {"with_header": False, "verbose": False})
    for function in functions:
        if function.sz_iw():
            raise InputError(f"{function.name()} needs integer work memory; the kernel gives none")
        generator.add(function)
    text = str(generator.dump())
    for call, replacement in _INLINE.items():
        text = text.replace(call, replacement)
    return text


def wide(text: str) -> str:
    """The same functions with a second copy each for wider registers; the bits stay the same."""
    return re.sub(r"static int (casadi_f[0-9]+)\(", r"WB_WIDE static int \1(", text)


def work_macro(functions: Sequence[ca.Function]) -> str:
    """The work memory that covers every one of `functions`."""
    return f"#define WB_SCRATCH {1 + max(function.sz_w() for function in functions)}"


def c_text(name: str) -> str:
    """One of the hand-written C files of this package."""
    return (files("workbench.codegen") / "c" / name).read_text()


def table(name: str, values: Iterable[float], kind: str = "double") -> str:
    """A constant C array wb_`name`; one 0 where there are no values."""
    texts = [str(int(v)) if kind == "int" else float(v).hex() for v in values] or ["0"]
    return f"static const {kind} wb_{name}[] = {{{', '.join(texts)}}};"
