"""C text of the online tube: CasADi's functions, one model's tables, the hand-written loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from workbench.codegen.c_source import (
    FLOOR,
    PRELUDE,
    c_text,
    function_text,
    table,
    wide,
    work_macro,
)
from workbench.errors import InputError
from workbench.reach.online.budget import Budget
from workbench.reach.online.functions import OnlineFunctions
from workbench.sets import Box


@final
@dataclass(frozen=True, slots=True)
class OnlineSizes:
    """Capacities fixed at build time: most steps of a tube, and the longest step accepted in s."""

    steps: int
    step_max_s: float


# The loop covers the rounding of sums of so many columns.
_MOST_COLUMNS = 2**14


def online_source(
    functions: OnlineFunctions,
    region: Box,
    sizes: OnlineSizes,
    *,
    extra: Sequence[ca.Function] = (),
) -> str:
    """C text of `wb_tube` for one model; `extra` Functions are emitted beside its own.

    Whoever completes it defines `wb_work_size`, from the static `wb_tube_work`.
    """
    if _columns(functions, sizes) > _MOST_COLUMNS:
        raise InputError(
            f"expected at most {_MOST_COLUMNS} columns, {sizes.steps} steps of this model can make "
            f"{_columns(functions, sizes)}; build the kernel for fewer steps"
        )
    generated = [*functions.all(), *extra]
    return "\n".join([
        PRELUDE, FLOOR, wide(function_text(generated)), work_macro(generated),
        _tables(functions, region, sizes), c_text("online.c"),
    ])  # fmt: skip


def _tables(functions: OnlineFunctions, region: Box, sizes: OnlineSizes) -> str:
    model, n = functions.model, functions.model.n
    phi = functions.advance.sparsity_out("transition")
    inputs = functions.inputs.sparsity_out(0) if functions.inputs else ca.Sparsity(n, 0)
    return "\n".join([
        *_macros(functions, sizes, phi.nnz(), inputs.nnz()),
        *_structure("phi", phi), *(_structure("input", inputs) if model.n_v else []),
        *_ranges(functions, region),
        *(_roundings(functions, functions.rounding) if functions.rounding else []),
        *(_pair_tables(functions) if functions.pairs else []),
        _map_columns(phi), _map_sizes(phi), _map_pairs(phi, len(functions.pairs)),
        _sums(n, len(functions.pairs)),
    ])  # fmt: skip


def tube_source(functions: OnlineFunctions, region: Box, sizes: OnlineSizes) -> str:
    """Complete C text of `wb_tube` alone."""
    end = "\nlong long wb_work_size(void) { return wb_tube_work(); }\n"
    return online_source(functions, region, sizes) + end


def _columns(functions: OnlineFunctions, sizes: OnlineSizes) -> int:
    """Most columns that a tube can have: the linear part's and those that every step adds."""
    model = functions.model
    return len(functions.columns) + (model.n + 2 * model.n_v) * sizes.steps


def _macros(
    functions: OnlineFunctions, sizes: OnlineSizes, transition: int, inputs: int
) -> list[str]:
    model, columns = functions.model, len(functions.columns)
    macros = {
        "N": model.n, "L": _lanes(model.n), "NP": model.ode.p.numel(),
        "NC": len(model.form.constants), "NP_ALL": model.form.p.numel(), "NW": model.n_w,
        "NK": model.n_k, "NV": model.n_v, "M": columns, "PAIRS": len(functions.pairs),
        "STEPS": sizes.steps,
        "COLUMNS": _columns(functions, sizes),
        "HESSIAN": functions.second.numel_out("hessian"), "PHI_NNZ": transition,
        "ENCLOSED": int(functions.rounding is None),
        "INPUT_NNZ": inputs, "STEP_MAX": sizes.step_max_s.hex(),
        "FLUSH_SHARE": functions.flush_share.hex(),
    }  # fmt: skip
    return [f"#define WB_{name} {value}" for name, value in macros.items()]


def _structure(name: str, sparsity: ca.Sparsity) -> list[str]:
    """Row of every nonzero, and where each column starts."""
    return [
        table(f"{name}_row", sparsity.row(), "int"),
        table(f"{name}_start", sparsity.colind(), "int"),
    ]


def _ranges(functions: OnlineFunctions, region: Box) -> list[str]:
    """What the kernel accepts, and which states feed or enter others."""
    model, ranges = functions.model, functions.ranges
    n, n_p = model.n, model.ode.p.numel()
    entries = functions.advance.sparsity_out("transition").get_triplet()
    feeds = [any(r != c == i for r, c in zip(*entries, strict=True)) for i in range(n)]
    return [
        table("feeds", feeds, "int"), table("enters", _padded(functions.entering, n)),
        table("axis", functions.columns, "int"), table("constants", model.form.constants),
        table("region_lower", region.lower), table("region_upper", region.upper),
        table("p_lower", ranges.parameters[0][:n_p]), table("p_upper", ranges.parameters[1][:n_p]),
        table("w_lower", ranges.disturbances[0]), table("w_upper", ranges.disturbances[1]),
    ]  # fmt: skip


def _roundings(functions: OnlineFunctions, budget: Budget) -> list[str]:
    """The rounding budget, rounded up."""
    model = functions.model
    n, n_k = model.n, model.n_k
    tables = [
        table("round_step", _padded(_up(budget.step), n)),
        table("round_start", _padded(_up(budget.start), n)),
        table("round_hessian", _sized(_up(budget.hessian), functions.second.numel_out("hessian"))),
    ]
    if functions.pairs:
        tables += [
            table("round_source", _sized(_up(budget.source), n)),
            table("round_bent", _sized(_up(budget.bent_source), n)),
        ]
    if n_k:
        tables += [
            table("round_driver", _sized(_up(budget.driver), n_k)),
            table("gap_limit", _sized(list(budget.gap), n_k)),
            table("offset_limit", _sized(list(budget.offset), n_k)),
        ]
    return tables


def _pair_tables(functions: OnlineFunctions) -> list[str]:
    """Which pairs are squares, and how much of a pair's range is two-sided or one-sided."""
    pairs = functions.pairs
    return [
        *([table("square", [j == k for j, k in pairs], "int")] if functions.model.n_k else []),
        table("cross", [float(j != k) for j, k in pairs]),
        table("own", [0.5 * (j == k) for j, k in pairs]),
    ]


def _lanes(n: int) -> int:
    """n rounded up to whole registers of four."""
    return (n + 3) // 4 * 4


def _padded(values: Sequence[float], n: int) -> list[float]:
    return [float(v) for v in _sized(values, n)] + [0.0] * (_lanes(n) - n)


def _sized(values: Sequence[float], count: int) -> list[float]:
    """The values, which the loop reads `count` of."""
    if len(values) != count:
        raise ValueError(f"expected {count} numbers, got {len(values)}")
    return list(values)


def _up(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float]:
    return [float(value) * (1 + 1e-9) for value in values]


def _row_terms(phi: ca.Sparsity) -> list[list[tuple[int, int]]]:
    """For each row its nonzeros as (place among the nonzeros, column)."""
    terms: list[list[tuple[int, int]]] = [[] for _ in range(phi.size1())]
    for k, (row, col) in enumerate(zip(*phi.get_triplet(), strict=True)):
        terms[row].append((k, col))
    return terms


def _map_columns(phi: ca.Sparsity) -> str:
    """to = Phi from for `count` columns, unrolled over the nonzeros; columns are independent."""
    n = phi.size1()
    loads = [f"    const double v{i} = from[{i} * WB_COLUMNS + c];" for i in range(n)]
    stores = [
        f"    to[{i} * WB_COLUMNS + c] = {' + '.join(f'phi[{k}] * v{j}' for k, j in row) or '0.0'};"
        for i, row in enumerate(_row_terms(phi))
    ]
    return "\n".join([
        "WB_WIDE static void",
        "wb_map_columns(const double *restrict phi, const double *restrict from,",
        "               double *restrict to, int count) {", "  int c;",
        "  for (c = 0; c < count; ++c) {", *loads, *stores, "  }", "}",
    ])  # fmt: skip


def _map_sizes(phi: ca.Sparsity) -> str:
    """sums += |Phi| sizes, rounded up."""
    rows = []
    for i, row in enumerate(_row_terms(phi)):
        terms = " + ".join(f"fabs(phi[{k}]) * sizes[{j}]" for k, j in row)
        rows.append(f"  sums[{i}] += ({terms or '0.0'}) * (1.0 + 0x1p-40);")
    return "\n".join([
        "WB_WIDE static void",
        "wb_map_sizes(const double *phi, const double *sizes, double *sums) {",
        *rows, "}",
    ])  # fmt: skip


def _map_pairs(phi: ca.Sparsity, pairs: int) -> str:
    """Q at the end: Phi (Q + h/2 B0 + h^2/12 C0) + h/2 B1 - h^2/12 C1, pair by pair."""
    if not pairs:
        return ""
    n = phi.size1()
    loads = [
        f"    const double v{i} = q[{i * pairs} + k] + (half * b0[{i * pairs} + k] + "
        f"twelfth * c0[{i * pairs} + k]);" for i in range(n)
    ]  # fmt: skip
    stores = [
        f"    to[{i * pairs} + k] = {' + '.join(f'phi[{e}] * v{j}' for e, j in row) or '0.0'} + "
        f"(half * b1[{i * pairs} + k] - twelfth * c1[{i * pairs} + k]);"
        for i, row in enumerate(_row_terms(phi))
    ]
    return "\n".join([
        "WB_WIDE static void",
        "wb_map_pairs(const double *restrict phi, const double *restrict q,",
        "             const double *restrict b0, const double *restrict c0,",
        "             const double *restrict b1, const double *restrict c1,",
        "             double h, double *restrict to) {",
        "  const double half = h / 2, twelfth = h * h / 12;", "  int k;",
        f"  for (k = 0; k < {pairs}; ++k) {{", *loads, *stores, "  }", "}",
    ])  # fmt: skip


def _sums(n: int, pairs: int) -> str:
    """Row sums of absolute values, in a fixed order, and what they are taken of."""
    dots = " + ".join(f"row[{i}] * g[{i} * WB_COLUMNS + c]" for i in range(n))
    return "\n".join([
        _SUM_ABS,
        "WB_WIDE static void",
        "wb_sum_rows(const double *g, int from, int to, double *sums) {", "  int i;",
        f"  for (i = 0; i < {n}; ++i) sums[i] = wb_sum_abs(g + (size_t)i * WB_COLUMNS, from, to) * "
        "(1.0 + 0x1p-40);", "}",
        *(_pair_sums(n, pairs) if pairs else _NO_PAIR_SUMS),
        "#if WB_NK > 0", "WB_WIDE static void",
        "wb_dots(const double *restrict row, const double *restrict g, double *restrict to,",
        "        int count) {",
        "  int c;", f"  for (c = 0; c < count; ++c) to[c] = {dots};", "}",
        "static double wb_sum_dots(const double *row, const double *g, int count) {",
        "  double values[WB_COLUMNS];", "  wb_dots(row, g, values, count);",
        "  return wb_sum_abs(values, 0, count);", "}", "#endif",
    ])  # fmt: skip


# Four running sums: the order is fixed, so the bits are too, and the additions overlap.
_SUM_ABS = """\
static inline double wb_sum_abs(const double *v, int from, int to) {
  double lane[4] = {0.0, 0.0, 0.0, 0.0};
  int j = from, k;
  for (; j + 4 <= to; j += 4) {
    for (k = 0; k < 4; ++k) lane[k] += fabs(v[j + k]);
  }
  for (k = 0; j < to; ++j, ++k) lane[k] += fabs(v[j]);
  return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}"""
_NO_PAIR_SUMS = [
    "static void wb_sum_pairs(const double *q, double *low, double *high) {", "  (void)q;",
    "  memset(low, 0, WB_L * sizeof *low);", "  memset(high, 0, WB_L * sizeof *high);", "}",
]  # fmt: skip


def _pair_sums(n: int, pairs: int) -> list[str]:
    """Sums over the pairs: of absolute values, and of the one-sided ranges of Q[d, d]."""
    return [
        "WB_WIDE static void", "wb_sum_sizes(const double *q, double *sums) {", "  int i;",
        f"  for (i = 0; i < {n}; ++i) sums[i] = wb_sum_abs(q + i * {pairs}, 0, {pairs});", "}",
        "/* A square is at least 0: its part of the range has one side. */",
        "WB_WIDE static void", "wb_sum_pairs(const double *q, double *low, double *high) {",
        "  int i, k;", f"  for (i = 0; i < {n}; ++i) {{",
        "    double total = 0.0, below = 0.0, above = 0.0;",
        f"    for (k = 0; k < {pairs}; ++k) {{",
        f"      const double value = q[i * {pairs} + k], size = fabs(value);",
        "      total += wb_cross[k] * size;", "      below += wb_own[k] * (size - value);",
        "      above += wb_own[k] * (size + value);", "    }",
        "    low[i] = (total + below) * (1.0 + 0x1p-40);",
        "    high[i] = (total + above) * (1.0 + 0x1p-40);", "  }", "}",
    ]  # fmt: skip
