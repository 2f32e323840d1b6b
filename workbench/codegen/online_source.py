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
from workbench.codegen.online_loops import (
    box_columns,
    lanes,
    map_columns,
    map_pairs,
    map_sizes,
    sum_dots,
    sums,
    transition,
)
from workbench.reach.online.budget import Budget
from workbench.reach.online.functions import OnlineFunctions
from workbench.sets import Box


@final
@dataclass(frozen=True, slots=True)
class OnlineSizes:
    """Capacities fixed at build time: most steps of a tube, and the longest step accepted in s."""

    steps: int
    step_max_s: float


# More columns than these are merged into the box, those first that it holds best.
_MOST_COLUMNS, _KEPT_COLUMNS = 192, 128


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
    generated = [*functions.all(), *extra]
    return "\n".join([
        PRELUDE, FLOOR, wide(function_text(generated)), work_macro(generated),
        _tables(functions, region, sizes), c_text("online.c"),
    ])  # fmt: skip


def _tables(functions: OnlineFunctions, region: Box, sizes: OnlineSizes) -> str:
    model, n = functions.model, functions.model.n
    phi = functions.transition
    inputs = functions.inputs.sparsity_out(0) if functions.inputs else ca.Sparsity(n, 0)
    return "\n".join([
        *_macros(functions, sizes, phi.nnz(), inputs.nnz()),
        *(_structure("phi", phi) + _structure("input", inputs) if model.n_v else []),
        *_ranges(functions, region),
        *(_roundings(functions, functions.rounding) if functions.rounding else []),
        *(_pair_tables(functions) if functions.pairs else []),
        *([transition(functions.jacobians, phi)] if functions.jacobians else []),
        map_columns(phi), map_sizes(phi), box_columns(phi, _feeds(functions)),
        map_pairs(phi, len(functions.pairs)),
        sums(n, len(functions.pairs)), sum_dots(n, model.n_k),
    ])  # fmt: skip


def tube_source(functions: OnlineFunctions, region: Box, sizes: OnlineSizes) -> str:
    """Complete C text of `wb_tube` alone."""
    end = "\nlong long wb_work_size(void) { return wb_tube_work(); }\n"
    return online_source(functions, region, sizes) + end


def _columns(functions: OnlineFunctions, sizes: OnlineSizes) -> int:
    """Room for the linear part's columns, the others and what one step adds."""
    model = functions.model
    step = sum(_feeds(functions)) + 2 * model.n_v
    return lanes(len(functions.columns)) + lanes(min(_MOST_COLUMNS + step, step * sizes.steps))


def _reduced(functions: OnlineFunctions, sizes: OnlineSizes) -> bool:
    """Whether a tube can have so many columns that some must be merged."""
    return _columns(functions, sizes) > lanes(len(functions.columns)) + lanes(_MOST_COLUMNS)


def _macros(
    functions: OnlineFunctions, sizes: OnlineSizes, transition: int, inputs: int
) -> list[str]:
    model, columns = functions.model, len(functions.columns)
    macros = {
        "N": model.n, "L": lanes(model.n), "NP": model.ode.p.numel(),
        "NC": len(model.form.constants), "NP_ALL": model.form.p.numel(), "NW": model.n_w,
        "NK": model.n_k, "NV": model.n_v, "M": columns, "MS": lanes(columns),
        "PAIRS": len(functions.pairs), "STEPS": sizes.steps,
        "COLUMNS": _columns(functions, sizes), "REDUCED": int(_reduced(functions, sizes)),
        "MOST": _MOST_COLUMNS, "KEPT": _KEPT_COLUMNS,
        "HESSIAN": functions.second.numel_out("hessian"), "PHI_NNZ": transition,
        "ENCLOSED": int(functions.rounding is None),
        "RATES": functions.advance.numel_out(1), "INPUT_NNZ": inputs,
        "STEP_MAX": sizes.step_max_s.hex(),
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
    return [
        table("feeds", _padded(_feeds(functions), n)),
        table("enters", _padded(functions.entering, n)),
        table("axis", functions.columns, "int"), table("constants", model.form.constants),
        table("region_lower", region.lower), table("region_upper", region.upper),
        table("p_lower", ranges.parameters[0][:n_p]), table("p_upper", ranges.parameters[1][:n_p]),
        table("w_lower", ranges.disturbances[0]), table("w_upper", ranges.disturbances[1]),
    ]  # fmt: skip


def _feeds(functions: OnlineFunctions) -> list[bool]:
    """Which states enter others within a step."""
    entries = functions.transition.get_triplet()
    return [
        any(r != c == i for r, c in zip(*entries, strict=True)) for i in range(functions.model.n)
    ]


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


def _padded(values: Sequence[float], n: int) -> list[float]:
    return [float(v) for v in _sized(values, n)] + [0.0] * (lanes(n) - n)


def _sized(values: Sequence[float], count: int) -> list[float]:
    """The values, which the loop reads `count` of."""
    if len(values) != count:
        raise ValueError(f"expected {count} numbers, got {len(values)}")
    return list(values)


def _up(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float]:
    return [float(value) * (1 + 1e-9) for value in values]
