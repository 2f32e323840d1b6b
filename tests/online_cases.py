"""Small loops, compiled online tubes of them, and accurate runs, that tests of the kernel share."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from tube_cases import Array, box, disturbed, system_of

from workbench.bench.lanes import Accuracy, trajectories
from workbench.bench.pressing import pressing_inputs
from workbench.bench.random_loops import RandomLoop
from workbench.bench.taylor import taylor_field
from workbench.codegen import online_tube
from workbench.codegen.online_source import OnlineSizes, tube_source
from workbench.codegen.online_tube import OnlineTube
from workbench.models import Ode, Ranged, System
from workbench.reach import ReachTube
from workbench.reach.online.budget import Ranges
from workbench.reach.online.functions import OnlineFunctions, online_functions
from workbench.reach.online.model import OnlineModel
from workbench.reach.ranged_parameters import initial_box, with_ranged_parameters_as_states
from workbench.sets import Box

QUICK = (
    "-std=c99", "-O0", "-ffp-contract=off", "-fno-fast-math", "-fno-math-errno", "-fPIC", "-shared",
)  # fmt: skip
"""As the kernel's flags, but compiled faster; the bits are the same."""
Edit = Callable[[str], str]
Change = Callable[[OnlineFunctions], OnlineFunctions]

_REGION: Mapping[str, tuple[float, float]] = {
    "x": (-1e3, 1e3), "station": (-1e3, 1e3), "y": (-50.0, 50.0), "offset": (-9.0, 9.0),
    "steering": (-1.2, 1.2), "speed": (-6.0, 8.0), "heading": (-20.0, 20.0),
    "heading_error": (-1.5, 1.5), "speed_integral": (-40.0, 40.0), "offset_integral": (-80.0, 80.0),
}  # fmt: skip


def clip(value: ca.SX, low: float, high: float) -> ca.SX:
    return ca.fmin(ca.fmax(value, low), high)


def pushes(*radii: float) -> tuple[Ranged, ...]:
    return tuple(Ranged.symmetric(f"w{i}", "1", radius) for i, radius in enumerate(radii))


@dataclass(frozen=True)
class Case:
    """A loop with its initial set, horizon, step and form; region: radius of all states' ranges."""

    system: Ode
    initial_set: Box
    horizon_s: float
    step_s: float = 0.1
    quadratic: bool = False
    region: float = 6.0

    @property
    def loop(self) -> RandomLoop:
        return RandomLoop("case", self.system, self.initial_set, self.horizon_s)  # type: ignore[arg-type]


def _pushed(field: Callable[[ca.SX, ca.SX], list[ca.SX]], names: str, *radii: float) -> Ode:
    return disturbed(lambda x, _p, w: field(x, w), tuple(names), disturbances=pushes(*radii))


CASES = {
    "riccati": Case(system_of(lambda x: [x * x - 1], "x"), box(x=(-0.4, 0.9)), 1.0, 0.04),
    "pendulum": Case(
        _pushed(lambda x, w: [x[1], -ca.sin(x[0]) - 0.2 * x[1] + w[0]], "ab", 0.1),
        box(a=(0.5, 1.0), b=(-0.3, 0.3)), 1.5,
    ),
    "saturated": Case(
        _pushed(lambda x, w: [x[1], -clip(3 * x[0] + x[1], -1, 1) + w[0]], "ab", 0.2),
        box(a=(-0.3, 0.9), b=(-0.4, 0.4)), 2.0, 0.07,
    ),
    "pushed limit": Case(
        _pushed(lambda x, w: [x[1], -clip(3 * x[0] + x[1] + w[0], -0.5, 1)], "ab", 0.3),
        box(a=(-0.3, 0.5), b=(-0.4, 0.4)), 1.5,
    ),
    "fabs": Case(
        system_of(lambda x, y: [y, -ca.fabs(x) - 0.3 * y], "x", "y"),
        box(x=(-0.2, 0.3), y=(-0.3, 0.3)), 1.5,
    ),
    "nested": Case(
        _pushed(
            lambda x, w: [
                clip(clip(2 * x[1], -0.5, 0.5) - x[0] + w[0], -0.3, 0.3), -clip(x[0], -0.2, 0.2),
            ],
            "ab", 0.1,
        ),
        box(a=(-0.3, 0.5), b=(-0.4, 0.4)), 1.5,
    ),
    "bilinear": Case(
        _pushed(lambda x, w: [x[0] * w[0], x[0] * x[1] * w[1] - x[1]], "ab", 1.0, 0.5),
        box(a=(0.9, 1.1), b=(0.5, 1.0)), 0.8, 0.04,
    ),
    "quotient": Case(
        _pushed(lambda x, w: [-x[0] / (1 + x[1] * x[1]) + w[0] * x[1], 0.5 * x[0]], "ab", 0.1),
        box(a=(0.4, 0.6), b=(-0.2, 0.2)), 0.6, 0.03,
    ),
    "forgetting": Case(
        _pushed(lambda x, w: [-3 * x[0] + x[1] * x[1], -2 * x[1] + w[0]], "ab", 1.0),
        box(a=(-0.1, 0.1), b=(-0.5, 0.5)), 1.5,
    ),
    "triangular": Case(
        _pushed(lambda x, w: [x[1] * x[1] + w[0], x[2], 0 * x[2]], "abc", 0.01),
        box(a=(0.0, 0.0), b=(-0.01, 0.01), c=(-1.0, 1.0)), 1.0, 0.05,
    ),
    # One point that turns back in the middle of the first step.
    "turning": Case(
        system_of(lambda x, y: [y, -x], "x", "y"),
        box(x=(math.cos(0.05),) * 2, y=(math.sin(0.05),) * 2), 1.0,
    ),
    # Its sixth derivative grows from nothing.
    "growing": Case(
        system_of(lambda x, y, z: [z * y**6, 1 + 0 * y, 0 * z], "x", "y", "z"),
        box(x=(0.0, 0.0), y=(0.0, 0.0), z=(0.9, 1.1)), 1.5, region=60.0,
    ),
    "hard limit": Case(
        _pushed(lambda x, w: [x[1], -clip(9 * x[0] + 3 * x[1], -1, 1) + w[0]], "ab", 0.1),
        box(a=(0.3, 0.5), b=(-0.1, 0.1)), 2.0, 0.05,
    ),
    "swinging": Case(
        system_of(lambda x, y, t: [ca.cos(20 * t) * y * y, 0 * y, 1 + 0 * t], "x", "y", "t"),
        box(x=(0.0, 0.0), y=(-3.0, 3.0), t=(0.0, 0.0)), 0.3, 0.01,
    ),
}  # fmt: skip


def in_form(case: Case, *, quadratic: bool) -> Case:
    return dataclasses.replace(case, quadratic=quadratic)


@functools.cache
def functions_of(name: str, *, quadratic: bool) -> OnlineFunctions:
    """The kernel's Functions of one of CASES; slow, hence kept."""
    case = in_form(CASES[name], quadratic=quadratic)
    return derived(case.system, case.initial_set, case.step_s, quadratic, case.region)


def derived(
    ode: Ode, initial: Box, step_s: float, quadratic: bool, region: float
) -> OnlineFunctions:
    values = np.array(OnlineModel.of(ode).form.parameter_values())
    low, high = (
        np.array([getattr(w, end) for w in ode.disturbances]) for end in ("lower", "upper")
    )
    sides = {}
    ordered = initial.reordered(ode.names)
    for name, *ends in zip(ode.names, ordered.lower, ordered.upper, strict=True):
        # Parameters that became states hardly leave their range.
        room = 0.2 * (ends[1] - ends[0]) + 0.01 * max(map(abs, ends)) + 1e-3
        known = _REGION.get(name) if len(name) > 1 else (-region, region)
        sides[name] = known or (ends[0] - room, ends[1] + room)
    followed = [
        name
        for name, low_end, high_end in zip(ode.names, ordered.lower, ordered.upper, strict=True)
        if high_end > low_end and not name.endswith("integral")
    ]
    ranges = Ranges(Box.from_intervals(sides), (values, values), (low, high), max(0.1, step_s))
    return online_functions(ode, ranges, quadratic=tuple(followed) if quadratic else ())


def compiled(functions: OnlineFunctions, *, steps: int, edit: Edit | None = None) -> OnlineTube:
    """The kernel of `functions`, its C text changed by `edit`."""
    sizes = OnlineSizes(steps, functions.ranges.step_max_s)
    if edit is None:
        return OnlineTube(functions, sizes, flags=QUICK)
    whole = tube_source
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(online_tube, "tube_source", lambda *a, **k: edit(whole(*a, **k)))
        return OnlineTube(functions, sizes, flags=QUICK)


def steps_of(horizon_s: float, step_s: float) -> int:
    return max(1, math.ceil(horizon_s / step_s - 1e-9))


@dataclass(frozen=True)
class Online:
    """The online kernel as a method for the campaign: ranged parameters become states."""

    step_s: float
    quadratic: bool

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        ode = with_ranged_parameters_as_states(system.ode)
        start = initial_box(system.ode, ode, initial_set).reordered(ode.names)
        functions = derived(ode, start, self.step_s, self.quadratic, 6.0)
        kernel = compiled(functions, steps=steps_of(horizon_s, self.step_s))
        tube = kernel.tube(start, horizon_s=horizon_s, step_s=self.step_s)
        order = [tube.names.index(name) for name in system.ode.names]
        return dataclasses.replace(
            tube, lower=tube.lower[:, order], upper=tube.upper[:, order],
            lower_at=tube.lower_at[:, order], upper_at=tube.upper_at[:, order],
            names=tuple(system.ode.names),
        )  # fmt: skip


@dataclass(frozen=True)
class Seen:
    """Ranges of many accurate runs of a case: low, high (m, n) at `times` (m,)."""

    times: Array
    low: Array
    high: Array


@functools.cache
def seen(name: str) -> Seen:
    """Runs that press on the tube of one of CASES, at its instants and between them."""
    case = CASES[name]
    count = steps_of(case.horizon_s, case.step_s)
    instants = np.append(case.step_s * np.arange(count), case.horizon_s)
    inner = instants[:-1, None] + np.diff(instants)[:, None] * np.array([0.13, 0.37, 0.5, 0.71])
    times = np.union1d(instants, inner)
    inputs = pressing_inputs(case.loop, count=400, horizon_s=case.horizon_s, seed=5)
    field = taylor_field(case.system.function())
    runs = trajectories(field, inputs, times, Accuracy(18, 1e-16)).states
    return Seen(times, runs.min(axis=2), runs.max(axis=2))
