"""The online kernels as tube methods, compiled for whatever loop they are asked about."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import final

from workbench.bench.online_kernels import operating_region, steps_in
from workbench.codegen.online_tube import OnlineTube, online_tube
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark
from workbench.models.system import Ode, System
from workbench.reach.online.kernels import Form
from workbench.reach.tube import ReachTube
from workbench.sets import Box


@final
@dataclass(frozen=True, slots=True)
class OnlineMethod:
    """The online tube of a car's loop within `operating_region`, in steps of step_s.

    The quadratic form follows every state in which the initial set has width. Rigor ENCLOSED; a
    tube that leaves the region ends with LEFT_REGION. The kernel is compiled at the first set of a
    loop, which takes seconds. InputError on a step that is not positive and on states without a
    known range.
    """

    step_s: float
    form: Form

    def __post_init__(self) -> None:
        if not 0 < self.step_s < float("inf"):
            raise InputError(f"expected a positive step_s in s, got {self.step_s!r}")

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """Run over [0, horizon_s] from `initial_set` (axes = state names)."""
        ode = system.ode
        followed: tuple[str, ...] = ()
        if self.form is Form.QUADRATIC:
            sides = [(name, *initial_set.interval(name)) for name in initial_set.names]
            followed = tuple(name for name, low, high in sides if low < high and name in ode.names)
        region = operating_region(Benchmark(ode.name, ode, initial_set))
        kernel = _kernel(ode, region, followed, self.step_s, steps_in(horizon_s, self.step_s))
        return kernel.tube(initial_set, horizon_s=horizon_s, step_s=self.step_s)


@functools.lru_cache(maxsize=8)
def _kernel(
    ode: Ode, region: Box, followed: tuple[str, ...], step_s: float, steps: int
) -> OnlineTube:
    return online_tube(ode, region=region, steps=steps, step_max_s=step_s, quadratic=followed)
