"""The compiled online tube as it can be called on this machine."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from typing import final

import numpy as np

from workbench.claims import Rigor
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.native_calls import exported_size, load_function
from workbench.codegen.online_source import OnlineSizes, tube_source
from workbench.errors import InputError
from workbench.models.system import Ode, System
from workbench.reach.online.budget import Ranges
from workbench.reach.online.functions import OnlineFunctions, online_functions
from workbench.reach.online.model import OnlineModel
from workbench.reach.ranged_parameters import initial_box, with_ranged_parameters_as_states
from workbench.reach.tube import Array, ReachTube, TubeStatus
from workbench.sets import Box

_STATUS = {
    0: TubeStatus.COMPLETE,
    1: TubeStatus.LEFT_REGION,
    2: TubeStatus.ENCLOSURE_FAILED,
}
_DOUBLES = ctypes.POINTER(ctypes.c_double)
# Of a ranged parameter, far above what some hundred steps round.
_ROOM = 1e-6


@final
class OnlineTube:
    """One model's online tube, compiled: microseconds for a tube, ENCLOSED.

    functions: what `reach.online` derived; sizes: capacities; original: the equation whose ranged
    parameters are states of the functions' (none: they are its own states). A tube that leaves the
    functions' region ends with LEFT_REGION, one whose bounds do not verify with ENCLOSURE_FAILED.
    Raises InputError where a parameter has a range and is no state: a tube for one of its values
    would be none for the others.
    """

    def __init__(
        self,
        functions: OnlineFunctions,
        sizes: OnlineSizes,
        *,
        original: Ode | None = None,
        flags: tuple[str, ...] = FLAGS,
    ) -> None:
        self.ode: Ode = functions.model.ode
        self.original = self.ode if original is None else original
        ranged = [p.name for p in self.ode.parameters if p.lower < p.upper]
        if ranged:
            raise InputError(
                f"expected parameters with one value, got ranges of {ranged}; `online_tube` makes "
                "states of them"
            )
        self.region = functions.ranges.states.reordered(self.ode.names)
        self.source = tube_source(functions, self.region, sizes)
        self.sizes = sizes
        self.shared_object = compile_shared(self.source, flags=flags).shared_object
        self._entry = load_function(self.shared_object, "wb_tube")
        n = len(self.ode.states)
        self._result = np.zeros(2 + 2 * (2 * sizes.steps + 1) * n)
        self._work = np.zeros(exported_size(self.shared_object, "wb_work_size"))

    def query(self, initial_set: Box, horizon_s: float, step_s: float) -> Array:
        """The input vector of `wb_tube`."""
        box = initial_box(self.original, self.ode, initial_set).reordered(self.ode.names)
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
        """Run over [0, horizon_s] from a set over the states, of ranged parameters too if wanted.

        Raises InputError on other axes, and on times for which the kernel was not built.
        """
        count = self._steps(horizon_s, step_s)
        query = self.query(initial_set, horizon_s, step_s)
        if self.bound(query)() != 0 or self._result[0] not in _STATUS:
            raise InputError("the kernel refused its input; expected finite numbers in range")
        status, done = _STATUS[int(self._result[0])], int(self._result[1])
        n, capacity = len(self.ode.states), self.sizes.steps
        sizes = [capacity * n, capacity * n, (capacity + 1) * n, (capacity + 1) * n]
        parts = np.split(self._result[2:].copy(), np.cumsum(sizes)[:-1])
        shown = len(self.original.states)
        lower, upper, lower_at, upper_at = (part.reshape(-1, n)[:, :shown] for part in parts)
        times = np.append(step_s * np.arange(count), horizon_s)[: done + 1]
        return ReachTube(
            times, lower[:done], upper[:done], lower_at[: done + 1], upper_at[: done + 1],
            self.original.names, status, Rigor.ENCLOSED, self._message(status, times[-1], query),
        )  # fmt: skip

    def _steps(self, horizon_s: float, step_s: float) -> int:
        for name, value in (("horizon_s", horizon_s), ("step_s", step_s)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"expected a positive {name} in s, got {value!r}")
        count = max(1, math.ceil(horizon_s / step_s - 1e-9))
        if count > self.sizes.steps or step_s > self.sizes.step_max_s:
            raise InputError(
                f"expected at most {self.sizes.steps} steps of at most {self.sizes.step_max_s} s, "
                f"got {count} of {step_s} s; build the kernel with larger sizes"
            )
        return count

    def _message(self, status: TubeStatus, end_s: float, query: Array) -> str:
        if status is TubeStatus.COMPLETE:
            return ""
        n = len(self.ode.states)
        low, high = query[:n] - query[n : 2 * n], query[:n] + query[n : 2 * n]
        outside = [
            name
            for i, name in enumerate(self.ode.names)
            if not (self.region.lower[i] <= low[i] and high[i] <= self.region.upper[i])
        ]
        if outside:
            return f"the initial set is not inside the operating region along {outside}"
        return f"{status.name} at t = {end_s:.3f} s"


def online_tube(
    system: System,
    *,
    region: Box,
    steps: int,
    step_max_s: float,
    quadratic: Sequence[str] = (),
    flags: tuple[str, ...] = FLAGS,
) -> OnlineTube:
    """The compiled online tube of `system` for sets in `region`, parameters and W at their ranges.

    region: the operating region, a range for every state; steps, step_max_s: most steps of a tube,
    longest step in s; quadratic: states whose initial deviations are followed to second order
    (none: the linear form). Ranged parameters become states, so that one value acts in a whole
    trajectory. InputError where the field is not defined or not bounded over the region.

    >>> from workbench.models import system_from_casadi
    >>> import casadi as ca
    >>> x = ca.SX.sym("x")
    >>> decay = system_from_casadi(x, -x, ("x",))
    >>> region = Box.from_intervals({"x": (-2.0, 2.0)})
    >>> kernel = online_tube(decay, region=region, steps=10, step_max_s=0.1)
    >>> kernel.tube(Box(("x",), (0.9,), (1.1,)), horizon_s=1.0, step_s=0.1).status.name
    'COMPLETE'
    """
    original = system.ode
    ode = with_ranged_parameters_as_states(original)
    if set(region.names) != set(original.names):
        raise InputError(f"expected a region over the states {original.names}, got {region.names}")
    sides = {name: region.interval(name) for name in region.names}
    for constant in ode.constants[len(original.constants) :]:
        sides[constant.name] = _with_room(constant.lower, constant.upper)
    values = np.array(OnlineModel.of(ode).form.parameter_values())
    w = ode.disturbances
    inputs = np.array([d.lower for d in w]), np.array([d.upper for d in w])
    ranges = Ranges(Box.from_intervals(sides), (values, values), inputs, step_max_s)
    functions = online_functions(ode, ranges, quadratic=tuple(quadratic))
    sizes = OnlineSizes(steps, step_max_s)
    return OnlineTube(functions, sizes, original=original, flags=flags)


def _with_room(lower: float, upper: float) -> tuple[float, float]:
    """A constant's range and what the tube's rounding adds to it."""
    room = _ROOM * (max(abs(lower), abs(upper)) + (upper - lower))
    return lower - room, upper + room
