"""Two compiled kernels that score any gains: a proved tube and plain runs, gains as inputs.

Gains, speed, curvature and the sets N and W are arguments of each call, so that one compilation
serves a whole sweep. The `enclosed` kernel bounds its own rounding, hence the ranges that a study
gives its gains make no tube wider.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Self, final

import numpy as np
from numpy.typing import NDArray

from workbench.codegen.bundle import operating_region
from workbench.codegen.compiled_simulator import CompiledSimulator
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.native_calls import exported_size, load_function
from workbench.codegen.online_source import OnlineSizes, tube_source
from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.system import Ode
from workbench.models.vehicle import Vehicle
from workbench.reach.online.budget import Ranges
from workbench.reach.online.kernels import Form, Method
from workbench.reach.online.model import OnlineModel
from workbench.reach.ranged_parameters import with_ranged_parameters_as_disturbances
from workbench.sets import Box

Array = NDArray[np.float64]
Interval = tuple[float, float]

STEP_S: Final = 0.05
HORIZON_S: Final = 3.0
STEPS: Final = 60
RUN_S: Final = 20.0
RUN_STEP_S: Final = 0.05
_QUICK: Final = tuple("-O1" if flag.startswith("-O") else flag for flag in FLAGS)
_DOUBLES: Final = ctypes.POINTER(ctypes.c_double)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sources:
    """Both kernels as machine code, which processes can share."""

    tube: bytes
    runs: bytes


def build_kernels(vehicle: Vehicle, ranges: Mapping[str, Interval]) -> Sources:
    """Compile both; ranges: of the loop's parameters and disturbances, by name, where they vary."""
    ode = tube_loop(vehicle)
    values = np.array(OnlineModel.of(ode).form.parameter_values())
    low, high = values.copy(), values.copy()
    for k, parameter in enumerate(ode.parameters):
        low[k], high[k] = ranges.get(parameter.name, (low[k], high[k]))
    w = [ranges.get(d.name, (d.lower, d.upper)) for d in ode.disturbances]
    inputs = np.array([a for a, _ in w]), np.array([b for _, b in w])
    region = operating_region(vehicle)
    functions = Method("enclosed", Form.LINEAR).functions(
        ode, Ranges(region, (low, high), inputs, STEP_S)
    )
    source = tube_source(functions, region.reordered(ode.names), OnlineSizes(STEPS, STEP_S))
    plain = CompiledSimulator.of(run_loop(vehicle), horizon_s=RUN_S, step_s=RUN_STEP_S)
    return Sources(compile_shared(source, flags=_QUICK).shared_object, plain.shared_object)


def tube_loop(vehicle: Vehicle) -> Ode:
    """TRACK with all that the vehicle file is unsure of as disturbances."""
    most = vehicle.operation.curvature_per_m
    loop = vehicle.uncertain_loop(vehicle.track(), PathFrame(-most, most))
    return with_ranged_parameters_as_disturbances(loop.ode)


def run_loop(vehicle: Vehicle) -> Ode:
    """TRACK without errors, on a curvature that is an input."""
    most = vehicle.operation.curvature_per_m
    return vehicle.closed_loop(vehicle.track(), PathFrame(-most, most)).ode


@final
@dataclass(frozen=True, slots=True, eq=False)
class Tube:
    """Bounds over each step (k x n), at the instants (k + 1 x n); whole: k reaches the horizon."""

    whole: bool
    lower: Array
    upper: Array
    lower_at: Array
    upper_at: Array

    @property
    def until_s(self) -> float:
        """How far the proof reaches."""
        return STEP_S * len(self.lower)


@final
class TubeKernel:
    """The tube of a vehicle's TRACK loop for any gains; rigor ENCLOSED."""

    def __init__(self, vehicle: Vehicle, shared_object: bytes) -> None:
        self.ode = tube_loop(vehicle)
        self._entry = load_function(shared_object, "wb_tube")
        n = len(self.ode.names)
        self._result = np.zeros(2 + 2 * (2 * STEPS + 1) * n)
        self._work = np.zeros(exported_size(shared_object, "wb_work_size"))

    def tube(
        self, start: Box, parameters: Mapping[str, float], inputs: Mapping[str, Interval]
    ) -> Tube:
        """Over the horizon; parameters, inputs: by name where they differ from the vehicle's."""
        ode, box = self.ode, start.reordered(self.ode.names)
        known = {d.name for d in ode.disturbances}
        lost = [name for name, ends in inputs.items() if any(ends) and name not in known]
        if lost:
            raise InputError(
                f"expected a vehicle file that is unsure of {lost} with its own gains too, since "
                "it is with others; give [uncertainty] a figure above 0"
            )
        p = [parameters.get(q.name, q.nominal) for q in ode.parameters]
        w = [inputs.get(d.name, (d.lower, d.upper)) for d in ode.disturbances]
        query = np.concatenate([
            box.center, box.radius, p, [a for a, _ in w], [b for _, b in w], [HORIZON_S, STEP_S],
        ])  # fmt: skip
        arrays = (query, self._result, self._work)
        refused = self._entry(*(each.ctypes.data_as(_DOUBLES) for each in arrays))
        if refused:
            raise RuntimeError("the tube's kernel refused its input")
        done, n = int(self._result[1]), len(ode.names)
        sizes = [STEPS * n, STEPS * n, (STEPS + 1) * n, (STEPS + 1) * n]
        parts = np.split(self._result[2:].copy(), np.cumsum(sizes)[:-1])
        lower, upper, lower_at, upper_at = (part.reshape(-1, n) for part in parts)
        return Tube(
            int(self._result[0]) == 0, lower[:done], upper[:done],
            lower_at[: done + 1], upper_at[: done + 1],
        )  # fmt: skip


@final
class RunKernel:
    """Runs of a vehicle's TRACK loop for any gains, by Runge and Kutta's fourth order."""

    def __init__(self, vehicle: Vehicle, shared_object: bytes) -> None:
        self.ode = run_loop(vehicle)
        self._entry = load_function(shared_object, "wb_runs")

    def runs(self, starts: Array, parameters: Mapping[str, float], curvature_per_m: float) -> Array:
        """States (runs x instants x n) every RUN_STEP_S up to RUN_S, from `starts` (runs x n)."""
        count = round(RUN_S / RUN_STEP_S) + 1
        out = np.empty((len(starts), count, len(self.ode.names)))
        out[:, 0] = starts
        p = np.tile(
            [parameters.get(q.name, q.nominal) for q in self.ode.parameters], (len(starts), 1)
        )
        w = np.array([
            curvature_per_m if d.name == "curvature" else d.nominal for d in self.ode.disturbances
        ])  # fmt: skip
        arrays = [each.ctypes.data_as(_DOUBLES) for each in (p, w, np.array([RUN_STEP_S]))]
        sizes = (ctypes.c_longlong * 2)(len(starts), count)
        if self._entry(*arrays, sizes, out.ctypes.data_as(_DOUBLES)):
            raise RuntimeError("the compiled integrator refused its arguments")
        return out


@final
@dataclass(frozen=True, slots=True, eq=False)
class Kernels:
    """Both, loaded, with the vehicle that they are of."""

    vehicle: Vehicle
    tube: TubeKernel
    runs: RunKernel

    @classmethod
    def of(cls, vehicle: Vehicle, sources: Sources) -> Self:
        """Load what was built for this vehicle."""
        return cls(vehicle, TubeKernel(vehicle, sources.tube), RunKernel(vehicle, sources.runs))
