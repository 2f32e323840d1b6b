"""The learned tube compiled to C, for any system."""

from __future__ import annotations

import ctypes
import math
from typing import Final, final

import numpy as np

from workbench.claims import Rigor
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.learned_source import learned_source
from workbench.codegen.native_calls import load_function
from workbench.codegen.online_source import OnlineSizes
from workbench.errors import InputError
from workbench.models.system import System
from workbench.reach.learned.tube import LearnedTube
from workbench.reach.tube import Array, ReachTube, TubeStatus
from workbench.sensitivity.sampling import ordered_box, step_count
from workbench.sets import Box

_DOUBLES = ctypes.POINTER(ctypes.c_double)
_STATUS: Final = {
    0: TubeStatus.COMPLETE,
    1: TubeStatus.LEFT_REGION,
    2: TubeStatus.ENCLOSURE_FAILED,
}


@final
class CompiledLearnedTube:
    """`LearnedTube` compiled: the hull of its regions, to the same numbers but for rounding.

    horizon_s: of the longest tube. Parameters and disturbances act as in `LearnedTube`, at their
    nominal values. InputError for a beta without a table (`beta_table`) and without a C compiler.
    """

    def __init__(self, system: System, method: LearnedTube, *, horizon_s: float) -> None:
        self.ode, self._method = system.ode, method
        self._steps = step_count(horizon_s, method.step_s)
        self.source = learned_source(self.ode, method, OnlineSizes(self._steps, method.step_s))
        shared_object = compile_shared(self.source, flags=FLAGS).shared_object
        self._entry = load_function(shared_object, "wb_learned_tube")

    def tube(self, initial_set: Box, *, horizon_s: float) -> ReachTube:
        """As `LearnedTube.tube`; radii along which nothing was learned give LEFT_REGION here."""
        count, n = step_count(horizon_s, self._method.step_s), len(self.ode.states)
        if count > self._steps:
            raise InputError(
                f"expected at most {self._steps} steps of {self._method.step_s:g} s, got {count}; "
                "compile for a longer horizon"
            )
        result = np.zeros(2 + 2 * n * (2 * self._steps + 1))
        self._called(self._query(initial_set, horizon_s), result)
        status, done = _STATUS[int(result[0])], int(result[1])
        sizes = [self._steps * n, self._steps * n, (self._steps + 1) * n]
        lower, upper, lower_at, upper_at = (
            part.reshape(-1, n) for part in np.split(result[2:], np.cumsum(sizes))
        )
        times = np.linspace(0.0, horizon_s, count + 1)[: done + 1]
        return ReachTube(
            times, lower[:done], upper[:done], lower_at[: done + 1], upper_at[: done + 1],
            self.ode.names, status, Rigor.SAMPLED,
            "" if status is TubeStatus.COMPLETE else f"{status.name} at t = {times[-1]:.3f} s",
        )  # fmt: skip

    def _query(self, initial_set: Box, horizon_s: float) -> Array:
        box = ordered_box(self.ode, initial_set, "initial set")
        w = [d.nominal for d in self.ode.disturbances]
        parameters = self.ode.parameter_values()
        return np.array([
            *box.center, *box.radius, *parameters, *w, *w, horizon_s, self._method.step_s,
        ])  # fmt: skip

    def _called(self, query: Array, result: Array) -> None:
        arrays = (query, result, np.zeros(1))
        self._entry(*(each.ctypes.data_as(_DOUBLES) for each in arrays))
        if result[0] not in _STATUS or not math.isfinite(result[1]):
            raise InputError("the kernel refused its input; expected finite numbers in range")
