"""The compiled decision of the shipped vehicle: its queries, its answers, and how it is called."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.codegen.bundle import BUDGET, MonitorSpec, operating_region
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.decision_source import DecisionSizes, decision_layout, decision_source
from workbench.codegen.native_calls import exported_size, load_function
from workbench.models.bicycle import PathFrame
from workbench.models.system import Ode
from workbench.models.vehicle import gem_e2
from workbench.reach.online.kernels import LOCAL_LINEAR, Method
from workbench.reach.tube import Array
from workbench.runtime.manifest import Field

HORIZON_S: Final = 3.0
STEP_S: Final = 0.05
ENTRY: Final = "wb_decide"
_DOUBLES = ctypes.POINTER(ctypes.c_double)
# What result and work hold before a call: a number that is left is then seen.
_UNSET = float("nan")


@final
@dataclass(frozen=True, slots=True)
class DecisionKernel:
    """One compiled `wb_decide`: its C text, the shared object, and the fields of both vectors."""

    sizes: DecisionSizes
    source: str
    shared_object: bytes
    query: tuple[Field, ...]
    result: tuple[Field, ...]

    @property
    def query_size(self) -> int:
        """Doubles of a query."""
        return self.query[-1].offset + self.query[-1].count

    @property
    def result_size(self) -> int:
        """Doubles of a result."""
        return self.result[-1].offset + self.result[-1].count

    @property
    def work_size(self) -> int:
        """Doubles of work memory."""
        return exported_size(self.shared_object, "wb_work_size")

    def numbers(self, values: Mapping[str, Sequence[float]]) -> Array:
        """A query (query_size,) with `values` by field; others have their defaults, or zeros."""
        numbers = np.zeros(self.query_size)
        for field in self.query:
            given = values.get(field.name, field.default or ())
            numbers[field.offset : field.offset + len(given)] = given
        return numbers

    def spans(self, vector: Sequence[Field]) -> dict[str, slice]:
        """Where each field of a vector lies."""
        return {field.name: slice(field.offset, field.offset + field.count) for field in vector}


def shipped_loop() -> Ode:
    """The TRACK loop of the shipped vehicle along a path."""
    vehicle = gem_e2()
    return vehicle.closed_loop(vehicle.track(), PathFrame(-0.5, 0.5)).ode


def shipped_sizes(
    *, horizon_s: float = HORIZON_S, budget: int = BUDGET, method: Method = LOCAL_LINEAR
) -> DecisionSizes:
    """Sizes of the bundle that `workbench build` makes, for this horizon, budget and method."""
    return MonitorSpec(gem_e2(), horizon_s, STEP_S, budget=budget, method=method).sizes


def decision_kernel(sizes: DecisionSizes) -> DecisionKernel:
    """Derive and compile the decision of the shipped vehicle. InputError without a C compiler."""
    vehicle, loop = gem_e2(), shipped_loop()
    brake = vehicle.brake.mode()
    source = decision_source(loop, brake, operating_region(vehicle), sizes)
    query, result = decision_layout(loop, brake, sizes)
    return DecisionKernel(sizes, source, compile_shared(source).shared_object, query, result)


def compiled_again(source: str, *, level: str) -> bytes:
    """The shared object of the same text with the bundle's flags, but for the optimisation."""
    flags = tuple(level if flag.startswith("-O") else flag for flag in FLAGS)
    return compile_shared(source, flags=flags).shared_object


@final
class DecisionCaller:
    """Calls a `wb_decide` from Python, with buffers that hold NaN before every call."""

    def __init__(self, kernel: DecisionKernel, shared_object: bytes | None = None) -> None:
        self._entry = load_function(shared_object or kernel.shared_object, ENTRY)
        self._result, self._work = np.zeros(kernel.result_size), np.zeros(kernel.work_size)
        self._spans = kernel.spans(kernel.result)

    def __call__(self, query: Array) -> Array:
        """A copy of the result (result_size,)."""
        self._result[:] = _UNSET
        self._work[:] = _UNSET
        buffers = (query, self._result, self._work)
        if self._entry(*(buffer.ctypes.data_as(_DOUBLES) for buffer in buffers)):
            raise RuntimeError(f"{ENTRY} did not run")
        return self._result.copy()

    def field(self, result: Array, name: str) -> Array:
        """The numbers of one field of a result."""
        return result[self._spans[name]]
