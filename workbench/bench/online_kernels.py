"""The online kernels, forms, steps and partitions that are measured, and their compiled tubes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.codegen.online_source import OnlineSizes
from workbench.codegen.online_tube import OnlineTube
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark
from workbench.reach.compute import hull
from workbench.reach.online.budget import Ranges
from workbench.reach.online.functions import OnlineFunctions
from workbench.reach.online.kernels import KERNELS, Form, Method
from workbench.reach.online.model import OnlineModel
from workbench.reach.tube import ReachTube
from workbench.sets import Box

STEPS_S: Final = (0.1, 0.05, 0.025)
CELLS: Final = (1, 8, 27)
# The initial set is split along y, speed and heading, or what stands for them along a path: they
# drive the others.
SPLIT_AXES: Final = (1, 3, 4)
# What the car can meet on a road: (lower, upper) in each state's unit.
_REGION: Final = {
    "x": (-100.0, 100.0), "station": (-100.0, 100.0), "y": (-5.0, 5.0), "offset": (-5.0, 5.0),
    "steering": (-1.2, 1.2), "speed": (-2.0, 6.0), "heading": (-1.5, 1.5),
    "heading_error": (-1.5, 1.5), "speed_integral": (-20.0, 20.0), "offset_integral": (-40.0, 40.0),
    "brake_clock": (-1.0, 20.0),
}  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Setting:
    """One row of the board: kernel by name, form, step in s, cells of the initial set: a cube, as
    many parts along each of the three split axes."""

    kernel: str
    form: Form
    step_s: float
    cells: int

    def __post_init__(self) -> None:
        if self.cells < 1 or self.parts ** len(SPLIT_AXES) != self.cells:
            raise InputError(
                f"expected a cube of cells such as 1, 8 or 27, got {self.cells}; the set is split "
                "equally along three axes"
            )

    @property
    def parts(self) -> int:
        """Parts along each split axis."""
        edge: float = self.cells ** (1.0 / len(SPLIT_AXES))
        return round(edge)


def all_settings(
    *, steps_s: Sequence[float] = STEPS_S, cells: Sequence[int] = CELLS
) -> tuple[Setting, ...]:
    """Every kernel in every form with every step and partition; `enclosed`, whose sets are those of
    `local`, as one set only."""
    rows = itertools.product(KERNELS, Form, sorted(steps_s)[::-1], cells)
    return tuple(Setting(*row) for row in rows if row[0] == "local" or row[3] == 1)


def operating_region(benchmark: Benchmark) -> Box:
    """The states for which a kernel's rounding budget is made: a road of 10 m, 200 m of it, up to
    6 m/s, steering up to 1.2 rad, heading up to 1.5 rad off the road."""
    unknown = [name for name in benchmark.system.ode.names if name not in _REGION]
    if unknown:
        raise InputError(
            f"expected states among {', '.join(_REGION)}, got {unknown[0]!r}; give its range here"
        )
    return Box.from_intervals({name: _REGION[name] for name in benchmark.system.ode.names})


def kernel_functions(benchmark: Benchmark, kernel: str, form: Form) -> OnlineFunctions:
    """The Functions of one kernel in one form, for steps of up to 0.1 s."""
    ode = benchmark.system.ode
    values = np.array(OnlineModel.of(ode).form.parameter_values())
    lower, upper = (
        np.array([getattr(w, end) for w in ode.disturbances]) for end in ("lower", "upper")
    )
    ranges = Ranges(operating_region(benchmark), (values, values), (lower, upper), max(STEPS_S))
    return Method(kernel, form).functions(ode, ranges)


def steps_in(horizon_s: float, step_s: float) -> int:
    """Steps that cover the horizon, the last one shorter where they do not divide it."""
    return max(1, math.ceil(horizon_s / step_s - 1e-9))


def compiled(functions: OnlineFunctions, *, horizon_s: float, step_s: float) -> OnlineTube:
    """The compiled tube with room for just this horizon in steps of this length."""
    return OnlineTube(functions, OnlineSizes(steps_in(horizon_s, step_s), max(STEPS_S)))


def cells_of(benchmark: Benchmark, parts: int) -> tuple[Box, ...]:
    """The initial set cut into `parts` along each split axis."""
    box = benchmark.initial_set.reordered(benchmark.system.ode.names)
    return tuple(box.split({box.names[i]: parts for i in SPLIT_AXES}))


def tube_of_cells(
    kernel: OnlineTube, benchmark: Benchmark, setting: Setting, *, horizon_s: float
) -> ReachTube:
    """The hull of the cells' tubes; it ends where the first cell's proof ends."""
    return hull(tuple(
        kernel.tube(cell, horizon_s=horizon_s, step_s=setting.step_s)
        for cell in cells_of(benchmark, setting.parts)
    ))  # fmt: skip
