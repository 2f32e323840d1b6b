"""C text of a kernel: CasADi's functions, the tables of one model, and the hand-written loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import final

import casadi as ca

from workbench.errors import InputError
from workbench.reach.step_functions import PICARD_TRIALS, StepFunctions
from workbench.sets import Box

# One instruction in place of a library call. Minimum and maximum differ from C's for NaN and signed
# zeros only, and every bound is watched for NaN before it meets one (see sensitivity.validity). The
# rounding trick equals floor below 2^51; the trigonometry that asks refuses arguments above 1e4.
_INLINE = {
    "return fmin(x, y);": "return x < y ? x : y;",
    "return fmax(x, y);": "return x > y ? x : y;",
    "floor(": "wb_floor(",
}
_FLOOR = """\
static double wb_floor(double x) {
  const double shift = 6755399441055744.0, nearest = (x + shift) - shift;
  return nearest > x ? nearest - 1.0 : nearest;
}
"""
_PRELUDE = """\
#include <math.h>
#include <stddef.h>
#include <string.h>

/* A second copy of one loop for wider registers, chosen when the object is loaded. Columns are
 * independent and nothing is contracted, so both copies give the same bits. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__)
#define WB_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WB_WIDE
#endif
"""


@final
@dataclass(frozen=True, slots=True)
class KernelSizes:
    """Capacities fixed at build time.

    steps: most steps of a tube; step_max_s: longest step accepted, s;
    merge_steps: steps after which a remainder box becomes columns of its own.
    """

    steps: int
    step_max_s: float
    merge_steps: int


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


def tube_source(
    steps: StepFunctions, region: Box, sizes: KernelSizes, *, extra: Sequence[ca.Function] = ()
) -> str:
    """Complete C text of `wb_tube` for one model; `extra` Functions are emitted beside its own."""
    functions = [
        *steps.driver_rows,
        *steps.relaxations,
        steps.bounds,
        steps.advance,
        steps.remainder,
    ]
    if steps.relaxations:
        functions.append(steps.enclose)
    functions += extra
    _require_dense(functions)
    tables = _tables(steps, region, sizes)
    return "\n".join(
        [
            _FLOOR,
            function_text(functions),
            _PRELUDE,
            work_macro(functions),
            tables,
            c_text("tube.c"),
        ]
    )


def _require_dense(functions: Sequence[ca.Function]) -> None:
    """The C loop reads whole rows; only the two matrices are passed by their nonzeros."""
    for function in functions:
        for name in function.name_out():
            sparsity = function.sparsity_out(name)
            if name not in ("transition", "by_exogenous") and not sparsity.is_dense():
                raise InputError(f"{function.name()} packs its output {name!r}; make it dense")


def work_macro(functions: Sequence[ca.Function]) -> str:
    """The work memory that covers every one of `functions`."""
    return f"#define WB_SCRATCH {1 + max(function.sz_w() for function in functions)}"


def c_text(name: str) -> str:
    """One of the hand-written C files of this package."""
    return (files("workbench.codegen") / "c" / name).read_text()


def _tables(steps: StepFunctions, region: Box, sizes: KernelSizes) -> str:
    ode, form = steps.form.ode, steps.form
    n, n_w, n_k = ode.x.numel(), ode.w.numel(), form.kappa.numel()
    phi, by_v = steps.advance.sparsity_out("transition"), steps.advance.sparsity_out("by_exogenous")
    columns = n * (sizes.steps // sizes.merge_steps + 2) + (n_w + n_k) * sizes.steps
    macros = {
        "N": n, "NP": ode.p.numel(), "NC": len(form.constants), "NP_ALL": form.p.numel(), "NW": n_w,
        "NK": n_k, "NV": n_w + n_k, "STEPS": sizes.steps, "MERGE": sizes.merge_steps,
        "COLUMNS": columns, "PHI_NNZ": phi.nnz(), "BY_V_NNZ": by_v.nnz(),
        "PICARD_TRIALS": PICARD_TRIALS, "SIZES": 1 + steps.bounds.numel_out("sizes"),
    }  # fmt: skip
    lines = [f"#define WB_{name} {value}" for name, value in macros.items()]
    lines.append(f"#define WB_STEP_MAX {sizes.step_max_s.hex()}")
    for name, sparsity in (("phi", phi), ("by_v", by_v)):
        rows, cols = sparsity.get_triplet()
        lines += [_table(f"{name}_row", rows, "int"), _table(f"{name}_col", cols, "int")]
    lines.append(_map_columns(phi))
    feeds = [any(r != c == i for r, c in zip(*phi.get_triplet(), strict=True)) for i in range(n)]
    lines += [
        _table("feeds", feeds, "int"),
        _table("constants", form.constants),
        _table("region_lower", region.lower),
        _table("region_upper", region.upper),
        "typedef int (*wb_function)(const double **, double **, casadi_int *, double *, int);",
    ]
    for table, functions in (
        ("driver_rows", steps.driver_rows),
        ("relaxations", steps.relaxations),
    ):
        if functions:
            names = ", ".join(function.name() for function in functions)
            lines.append(f"static const wb_function wb_{table}[] = {{{names}}};")
    return "\n".join(lines)


def _map_columns(phi: ca.Sparsity) -> str:
    """to = Phi from for `count` columns, unrolled over the nonzeros; columns are independent."""
    n = phi.size1()
    terms: list[list[str]] = [[] for _ in range(n)]
    rows, cols = phi.get_triplet()
    for k, (row, col) in enumerate(zip(rows, cols, strict=True)):
        terms[row].append(f"phi[{k}] * v{col}")
    loads = [f"    const double v{i} = from[{i} * WB_COLUMNS + c];" for i in range(n)]
    stores = [f"    to[{i} * WB_COLUMNS + c] = {' + '.join(terms[i]) or '0.0'};" for i in range(n)]
    return "\n".join([
        "WB_WIDE static void",
        "wb_map_columns(const double *restrict phi, const double *restrict from,",
        "                           double *restrict to, int count) {", "  int c;",
        "  for (c = 0; c < count; ++c) {", *loads, *stores, "  }", "}",
    ])  # fmt: skip


def _table(name: str, values: Sequence[float], kind: str = "double") -> str:
    texts = [str(int(v)) if kind == "int" else float(v).hex() for v in values] or ["0"]
    return f"static const {kind} wb_{name}[] = {{{', '.join(texts)}}};"
