"""C text of the learned tube: a beta as a table, one step of simulation, the loop over regions."""

from __future__ import annotations

import math
from typing import Final

import casadi as ca

from workbench.codegen.c_source import PRELUDE, c_text, function_text, table, work_macro
from workbench.codegen.online_source import OnlineSizes
from workbench.codegen.trajectory import rk4_step
from workbench.models.system import Ode
from workbench.reach.learned.table import Shares, beta_table
from workbench.reach.learned.tube import LearnedTube
from workbench.sensitivity.discrepancy import Discrepancy

_ANYWHERE: Final = 1e300


def simulation_step(ode: Ode) -> ca.Function:
    """One step of classical Runge-Kutta: x, p, w, h (s) to the next x."""
    h = ca.SX.sym("h")
    following = rk4_step(ode.function(), ode.x, h, [ode.p, ode.w])
    return ca.Function("wb_simulate", [ode.x, ode.p, ode.w, h], ca.cse([ca.densify(following)]))


def learned_tables(method: LearnedTube, *, horizon_s: float) -> str:
    """Macros and tables of a beta up to horizon_s, and `learned.c`; `wb_simulate` comes in front.

    InputError as `beta_table` raises it.
    """
    learned = method.learned
    beta = beta_table(learned, horizon_s=horizon_s, step_s=method.step_s)
    sides = [_learned_on(learned, name) for name in learned.names]
    parts = [method.regions.get(name, 1) for name in learned.names]
    # C's tables hold no infinity: what lies below 0 stands for it.
    entries = [value if math.isfinite(value) else -1.0 for value in beta.entries.ravel().tolist()]
    macros = {
        "REGIONS": method.count, "BETA_ROWS": len(beta.entries),
        "BETA_STEP": method.step_s.hex(), "BETA_SUMS": int(beta.shares is Shares.SUM),
    }  # fmt: skip
    return "\n".join([
        *(f"#define WB_{name} {value}" for name, value in macros.items()),
        table("beta", entries), table("parts", parts, "int"),
        table("learned_lower", [low for low, _ in sides]),
        table("learned_upper", [high for _, high in sides]),
        c_text("learned.c"),
    ])  # fmt: skip


def _learned_on(learned: Discrepancy, name: str) -> tuple[float, float]:
    """Where a set may lie along a state; anywhere where the bound does not say."""
    region = learned.region
    if region is None or name not in region.names:
        return -_ANYWHERE, _ANYWHERE
    return region.interval(name)


def learned_source(ode: Ode, method: LearnedTube, sizes: OnlineSizes) -> str:
    """Complete C text of `wb_learned_tube` alone."""
    step = simulation_step(ode)
    macros = {
        "N": len(ode.states), "NP": ode.p.numel(), "NW": ode.w.numel(), "STEPS": sizes.steps,
        "STEP_MAX": sizes.step_max_s.hex(),
    }  # fmt: skip
    return "\n".join([
        PRELUDE, function_text([step]), work_macro([step]),
        *(f"#define WB_{name} {value}" for name, value in macros.items()),
        learned_tables(method, horizon_s=sizes.steps * sizes.step_max_s),
    ])  # fmt: skip
