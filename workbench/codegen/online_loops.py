"""C text of the online tube's innermost loops, unrolled over the structure of one model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import casadi as ca

from workbench.reach.online.transition import transition_rows


def lanes(n: int) -> int:
    """n rounded up to whole registers of four."""
    return (n + 3) // 4 * 4


def _row_terms(phi: ca.Sparsity) -> list[list[tuple[int, int]]]:
    """For each row its nonzeros as (place among the nonzeros, column)."""
    terms: list[list[tuple[int, int]]] = [[] for _ in range(phi.size1())]
    for k, (row, col) in enumerate(zip(*phi.get_triplet(), strict=True)):
        terms[row].append((k, col))
    return terms


@final
class _Text:
    """C text of rows of the transition: four columns at once, in lane k."""

    def __init__(self, jacobians: Sequence[ca.Sparsity]) -> None:
        sizes = [a.nnz() for a in jacobians]
        self._starts = [len(sizes) + sum(sizes[:j]) for j in range(len(sizes))]
        self.lines: list[str] = []

    def _kept(self, value: str) -> str:
        name = f"v{len(self.lines)}"
        self.lines.append(f"      const double {name} = {value};")
        return name

    def times(self, order: int, place: int, row: str) -> str:
        return self._kept(f"rates[{self._starts[order] + place}] * {row}")

    def add(self, left: str, right: str) -> str:
        return self._kept(f"{left} + {right}")

    def shared(self, divisor: int, row: str) -> str:
        return self._kept(f"rates[{divisor - 1}] * {row}")


def _unit(column: int, place: int) -> str:
    entries = ", ".join("1.0" if k == place else "0.0" for k in range(4))
    return f"    static const double e{column}[4] = {{{entries}}};"


def transition(jacobians: Sequence[ca.Sparsity], phi: ca.Sparsity) -> str:
    """phi from the Jacobian's coefficients, four columns at a time."""
    n = phi.size1()
    places = {(r, c): k for k, (r, c) in enumerate(zip(*phi.get_triplet(), strict=True))}
    reached = [[(r, c) in places for r in range(n)] for c in range(n)]
    moving = [c for c in range(n) if any(c in a.get_triplet()[1] for a in jacobians)]
    columns = sorted(moving, key=lambda c: reached[c])
    lines = [f"  phi[{places[c, c]}] = 1.0;" for c in range(n) if c not in moving]
    for first in range(0, len(columns), 4):
        group, text = columns[first : first + 4], _Text(jacobians)
        units = [f"e{row}[k]" if row in group else None for row in range(n)]
        rows = transition_rows(jacobians, units, text)
        lines += [
            "  {", *[_unit(c, k) for k, c in enumerate(group)], f"    double rows[{n}][4];",
            "    for (k = 0; k < 4; ++k) {",
            *text.lines,
            *[f"      rows[{r}][k] = {value};" for r, value in enumerate(rows) if value],
            "    }",
            *[f"    phi[{places[r, c]}] = rows[{r}][{k}];" for k, c in enumerate(group)
              for r in range(n) if (r, c) in places],
            "  }",
        ]  # fmt: skip
    return "\n".join([
        "WB_WIDE static void",
        "wb_transition(const double *restrict rates, double *restrict phi) {",
        "  int k = 0;", *lines, "  (void)rates;", "  (void)k;", "}",
    ])  # fmt: skip


def map_columns(phi: ca.Sparsity) -> str:
    """to = Phi from for whole groups of four columns, and the row sums of |to|.

    Unrolled over the nonzeros; columns are independent. Each row is summed in four running sums:
    the order is fixed, so the bits are too.
    """
    n = phi.size1()
    loads = [f"      const double v{i} = from[{i} * WB_COLUMNS + c + k];" for i in range(n)]
    values = [
        f"      const double t{i} = {' + '.join(f'phi[{k}] * v{j}' for k, j in row) or '0.0'};"
        for i, row in enumerate(_row_terms(phi))
    ]
    stores = [
        f"      to[{i} * WB_COLUMNS + c + k] = t{i}; lane{i}[k] += fabs(t{i});" for i in range(n)
    ]
    return "\n".join([
        "WB_WIDE static void",
        "wb_map_columns(const double *restrict phi, const double *restrict from,",
        "               double *restrict to, int first, int end, double *restrict sums) {",
        *_running(n), "  int c, k;",
        "  for (c = first; c < end; c += 4) {", "    for (k = 0; k < 4; ++k) {",
        *loads, *values, *stores, "    }", "  }", *_lane_sums(n), "}",
    ])  # fmt: skip


def map_sizes(sparsity: ca.Sparsity) -> str:
    """sizes = |matrix|, dense by columns of WB_L rows, and sums += sizes v, rounded up."""
    n = sparsity.size1()
    places = {(r, c): k for k, (r, c) in enumerate(zip(*sparsity.get_triplet(), strict=True))}
    entries = [
        f"  sizes[{c} * WB_L + {r}] = "
        + (f"fabs(matrix[{places[r, c]}]);" if (r, c) in places else "0.0;")
        for c in range(n) for r in range(lanes(n))
    ]  # fmt: skip
    used = sorted({c for _, c in places})
    terms = " + ".join(f"sizes[{c} * WB_L + i] * v[{c}]" for c in used) or "0.0"
    return "\n".join([
        "static void wb_size(const double *restrict matrix, double *restrict sizes) {",
        *entries, "}",
        "WB_WIDE static void",
        "wb_map_sizes(const double *restrict sizes, const double *restrict v,",
        "             double *restrict sums) {", "  int i;",
        f"  for (i = 0; i < WB_L; ++i) sums[i] += ({terms}) * (1.0 + 0x1p-40);", "}",
    ])  # fmt: skip


def box_columns(phi: ca.Sparsity, feeds: Sequence[bool]) -> str:
    """Appends Phi e_i box_i as a column of `g` for every i with box_i > 0."""
    lines = []
    starts, rows = phi.colind(), phi.row()
    for i, feeding in enumerate(feeds):
        if not feeding:
            continue
        places = {rows[k]: k for k in range(starts[i], starts[i + 1])}
        lines.append(f"  if (box[{i}] > 0.0) {{")
        for row in range(phi.size1()):
            value = f"phi[{places[row]}] * box[{i}]" if row in places else "0.0"
            lines.append(f"    g[{row} * WB_COLUMNS + columns] = {value};")
        lines += [f"    source[columns++] = {i};", "  }"]
    return "\n".join([
        "static int wb_box_columns(const double *restrict phi, const double *restrict box,",
        "                          double *restrict g, int *restrict source, int columns) {",
        *lines, "  return columns;", "}",
    ])  # fmt: skip


def map_pairs(phi: ca.Sparsity, pairs: int) -> str:
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


def sum_dots(n: int, n_k: int) -> str:
    """sums = row sums of |gradient g| over whole groups of four columns, gradient by rows of n."""
    if not n_k:
        return ""
    loads = [f"      const double v{i} = g[{i} * WB_COLUMNS + c + k];" for i in range(n)]
    dots = [" + ".join(f"gradient[{j * n + i}] * v{i}" for i in range(n)) for j in range(n_k)]
    values = [f"      lane{j}[k] += fabs({dot});" for j, dot in enumerate(dots)]
    return "\n".join([
        "WB_WIDE static void",
        "wb_sum_dots(const double *restrict gradient, const double *restrict g, int end,",
        "            double *restrict sums) {",
        *_running(n_k), "  int c, k;",
        "  for (c = 0; c < end; c += 4) {", "    for (k = 0; k < 4; ++k) {",
        *loads, *values, "    }", "  }", *_lane_sums(n_k), "}",
    ])  # fmt: skip


def _running(rows: int) -> list[str]:
    """Four running sums for each row."""
    return [f"  double lane{i}[4] = {{0.0, 0.0, 0.0, 0.0}};" for i in range(rows)]


def _lane_sums(rows: int) -> list[str]:
    """sums from the running sums, in a fixed order, rounded up."""
    return [
        f"  sums[{i}] = ((lane{i}[0] + lane{i}[1]) + (lane{i}[2] + lane{i}[3])) * "
        "(1.0 + 0x1p-40);" for i in range(rows)
    ]  # fmt: skip


def sums(n: int, pairs: int) -> str:
    """Sums over the pairs, in a fixed order."""
    return "\n".join(_pair_sums(n, pairs) if pairs else _NO_PAIR_SUMS)


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
        _SUM_ABS,
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
