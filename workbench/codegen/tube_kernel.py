"""A compiled tube that can be called on this machine, and the compiled trajectory beside it."""

from __future__ import annotations

import ctypes
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import final

import casadi as ca
import numpy as np

from workbench.claims import Rigor
from workbench.codegen.c_source import KernelSizes, function_text, tube_source, work_macro
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.errors import InputError
from workbench.models.system import Ode, System
from workbench.reach.step_functions import step_functions
from workbench.reach.step_symbols import rk4
from workbench.reach.tube import Array, ReachTube, TubeStatus
from workbench.sets import Box

_STATUS = {
    0: TubeStatus.COMPLETE,
    1: TubeStatus.LEFT_REGION,
    2: TubeStatus.ENCLOSURE_FAILED,
}
_DOUBLES = ctypes.POINTER(ctypes.c_double)


def load_function(shared_object: bytes, name: str) -> ctypes._NamedFuncPointer:
    """`name` from a shared object given as bytes (loaded through a private temporary file)."""
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        path = Path(folder) / "kernel.so"
        path.write_bytes(shared_object)
        return ctypes.CDLL(str(path))[name]


def exported_size(shared_object: bytes, name: str) -> int:
    """What an exported size function without arguments returns."""
    function = load_function(shared_object, name)
    function.restype = ctypes.c_longlong
    return int(function())


@final
class CompiledTube:
    """`SensitivityTube` compiled to C for one system, over one operating region.

    A tube that leaves the region ends with LEFT_REGION. Parameters must be known constants (make
    ranged ones states first). Rigor NUMERICAL: as `SensitivityTube`, except that the truncation of
    the Runge-Kutta step is estimated (generously) and not bounded.
    """

    def __init__(
        self, system: System, *, region: Box, sizes: KernelSizes, flags: tuple[str, ...] = FLAGS
    ) -> None:
        steps = step_functions(system.ode)
        self.source = tube_source(steps, region.reordered(system.ode.names), sizes)
        self.ode: Ode = system.ode
        self.sizes = sizes
        self.shared_object = compile_shared(self.source, flags=flags).shared_object
        self._entry = load_function(self.shared_object, "wb_tube")
        n = len(self.ode.states)
        self._result = np.zeros(2 + 2 * (2 * sizes.steps + 1) * n)
        self._work = np.zeros(exported_size(self.shared_object, "wb_work_size"))

    def query(self, initial_set: Box, horizon_s: float, step_s: float) -> Array:
        """The input vector of `wb_tube`."""
        box = initial_set.reordered(self.ode.names)
        w = self.ode.disturbances
        return np.concatenate([
            box.center, box.radius, self.ode.parameter_values(),
            [d.lower for d in w], [d.upper for d in w], [horizon_s, step_s],
        ])  # fmt: skip

    def bound(self, query: Array) -> Callable[[], int]:
        """A call without arguments that runs the kernel on `query` (for timing)."""
        arguments = [a.ctypes.data_as(_DOUBLES) for a in (query, self._result, self._work)]
        return lambda: int(self._entry(*arguments))

    def tube(self, initial_set: Box, *, horizon_s: float, step_s: float) -> ReachTube:
        """Run over [0, horizon_s]."""
        count = math.ceil(horizon_s / step_s - 1e-9)
        if count > self.sizes.steps or step_s > self.sizes.step_max_s:
            raise InputError(
                f"expected at most {self.sizes.steps} steps of at most {self.sizes.step_max_s} s, "
                "got "
                f"{count} of {step_s} s; build the kernel with larger sizes"
            )
        query = self.query(initial_set, horizon_s, step_s)
        if self.bound(query)() != 0 or self._result[0] not in _STATUS:
            raise InputError("the kernel refused its input; expected finite numbers in range")
        status, done = _STATUS[int(self._result[0])], int(self._result[1])
        n, capacity = len(self.ode.states), self.sizes.steps
        sizes = [capacity * n, capacity * n, (capacity + 1) * n, (capacity + 1) * n]
        parts = np.split(self._result[2:].copy(), np.cumsum(sizes)[:-1])
        lower, upper, lower_at, upper_at = (part.reshape(-1, n) for part in parts)
        times = np.append(step_s * np.arange(count), horizon_s)[: done + 1]
        return ReachTube(
            times, lower[:done], upper[:done], lower_at[: done + 1], upper_at[: done + 1],
            self.ode.names, status, Rigor.NUMERICAL,
            "" if status is TubeStatus.COMPLETE else f"{status.name} at t = {times[-1]:.3f} s",
        )  # fmt: skip


@final
class CompiledTrajectory:
    """The nominal alone: `steps` classical Runge-Kutta steps in C, the yardstick of every time."""

    def __init__(self, system: System, *, steps: int, flags: tuple[str, ...] = FLAGS) -> None:
        ode = system.ode
        h = ca.SX.sym("h")
        end = rk4(ode.function(), ode.x, h, [ode.p, ode.w])
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
