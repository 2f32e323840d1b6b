"""A model as a black box again, its Runge-Kutta steps compiled: `ModelSimulator` in C."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Self, final

import casadi as ca
import numpy as np

from workbench.codegen.c_source import function_text, work_macro
from workbench.codegen.compiler import compile_shared
from workbench.codegen.native_calls import load_function
from workbench.codegen.trajectory import rk4_step
from workbench.models.signals import Ranged
from workbench.models.system import System
from workbench.sensitivity.learning.draws import Words
from workbench.sensitivity.learning.model_simulator import drawn_parameters, inputs_said
from workbench.sensitivity.sampling import instants
from workbench.sensitivity.vectorised import Array

_LOOP: Final = """\
int wb_runs(const double *p, const double *w, const double *h, const long long *sizes,
            double *out) {
  double scratch[WB_SCRATCH];
  long long i, k;
  for (i = 0; i < sizes[0]; ++i, p += WB_P)
    for (k = 0; k < sizes[1]; ++k, out += WB_N) {
      const double *arg[] = {out, p, w, h};
      double *res[] = {out + WB_N};
      if (k + 1 < sizes[1] && wb_step(arg, res, 0, scratch, 0)) return 1;
    }
  return 0;
}
"""
_DOUBLES: Final = ctypes.POINTER(ctypes.c_double)


@final
@dataclass(frozen=True, slots=True, eq=False)
class CompiledSimulator:
    """Runs of x' = field(x, p, w) as `ModelSimulator` makes them, up to the last bits.

    Can be sent to other processes, which load the object and need no compiler.
    """

    shared_object: bytes
    names: tuple[str, ...]
    parameters: tuple[Ranged, ...]
    disturbances: tuple[Ranged, ...]
    times: Array

    @classmethod
    def of(cls, system: System, *, horizon_s: float, step_s: float) -> Self:
        """Of a system. Raises InputError without a C compiler, and unless the horizon is a whole
        number of steps."""
        ode, times = system.ode, instants(horizon_s, step_s)
        h = ca.SX.sym("h")
        end = ca.cse(rk4_step(ode.function(), ode.x, h, [ode.p, ode.w]))
        step = ca.Function("wb_step", [ode.x, ode.p, ode.w, h], [end])
        source = "\n".join([
            function_text([step]), work_macro([step]),
            f"#define WB_N {len(ode.states)}", f"#define WB_P {len(ode.parameters)}", _LOOP,
        ])  # fmt: skip
        compiled = compile_shared(source)
        return cls(compiled.shared_object, ode.names, ode.parameters, ode.disturbances, times)

    @property
    def what(self) -> str:
        """How its runs come about."""
        steps = f"runs of the model by compiled Runge-Kutta steps of {self.times[1]:g} s"
        return steps + inputs_said(self.parameters, self.disturbances)

    def runs(self, initial_states: Array, seeds: Words) -> Array:
        """As `Simulator` says; a run that leaves the finite numbers holds inf or NaN from there."""
        count, instants_ = len(initial_states), len(self.times)
        out = np.empty((count, instants_, len(self.names)))
        out[:, 0] = initial_states
        p = np.ascontiguousarray(drawn_parameters(self.parameters, seeds))
        w = np.array([each.nominal for each in self.disturbances])
        h = np.array([self.times[-1] / (instants_ - 1)])
        sizes = (ctypes.c_longlong * 2)(count, instants_)
        arrays = [array.ctypes.data_as(_DOUBLES) for array in (p, w, h)]
        if _loaded(self.shared_object)(*arrays, sizes, out.ctypes.data_as(_DOUBLES)):
            raise RuntimeError("the compiled integrator refused its arguments")
        return out


@functools.lru_cache(maxsize=8)
def _loaded(shared_object: bytes) -> Callable[..., int]:
    return load_function(shared_object, "wb_runs")
