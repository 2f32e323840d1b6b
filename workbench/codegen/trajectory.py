"""One trajectory as compiled code: what the time of every tube is measured against."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import final

import casadi as ca
import numpy as np

from workbench.codegen.c_source import function_text, work_macro
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.native_calls import load_function
from workbench.models.system import System
from workbench.reach.tube import Array

_DOUBLES = ctypes.POINTER(ctypes.c_double)


@final
class CompiledTrajectory:
    """The nominal alone: `steps` classical Runge-Kutta steps in C, the yardstick of every time."""

    def __init__(self, system: System, *, steps: int, flags: tuple[str, ...] = FLAGS) -> None:
        ode = system.ode
        h = ca.SX.sym("h")
        end = rk4_step(ode.function(), ode.x, h, [ode.p, ode.w])
        step = ca.Function("rk4_step", [ode.x, ode.p, ode.w, h], ca.cse([end]))
        self.source = "\n".join([
            function_text([step]), work_macro([step]), "#include <string.h>",
            f"#define N {ode.x.numel()}\n#define STEPS {steps}",
            "int wb_trajectory(const double *x0, const double *p, const double *w, const double "
            "*h,",
            "                  double *out) {",
            "  double scratch[WB_SCRATCH];\n  int k;\n  memcpy(out, x0, N * sizeof(double));",
            "  for (k = 0; k < STEPS; ++k) {",
            "    const double *arg[] = {out + k * N, p, w, h};",
            "    double *res[] = {out + (k + 1) * N};",
            "    if (rk4_step(arg, res, 0, scratch, 0)) return 1;\n  }\n  return 0;\n}",
        ])  # fmt: skip
        self.shared_object = compile_shared(self.source, flags=flags).shared_object
        self._entry = load_function(self.shared_object, "wb_trajectory")
        self._out = np.zeros((steps + 1) * ode.x.numel())
        self._p = np.array(ode.parameter_values())
        self._w = np.array([d.nominal for d in ode.disturbances])

    def bound(self, x0: Array, step_s: float) -> Callable[[], int]:
        """A call without arguments that runs the rollout (for timing)."""
        arrays = [x0, self._p, self._w, np.array([step_s]), self._out]
        pointers = [a.ctypes.data_as(_DOUBLES) for a in arrays]

        def call(_keep: list[Array] = arrays) -> int:
            return int(self._entry(*pointers))

        return call


def rk4_step(field: ca.Function, x: ca.SX, h: ca.SX, others: list[ca.SX]) -> ca.SX:
    """One classical Runge-Kutta step of length h (s) of x' = field(x, *others)."""
    k1 = field(x, *others)
    k2 = field(x + h / 2 * k1, *others)
    k3 = field(x + h / 2 * k2, *others)
    k4 = field(x + h * k3, *others)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
