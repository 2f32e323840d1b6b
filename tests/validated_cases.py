"""Systems whose solutions are known in closed form, as balls of 200 bits."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import flint
import numpy as np
import numpy.typing as npt
from tube_cases import box, system_of
from validated_balls import coefficients, precise

from workbench.models import Ode
from workbench.models.graph import graph_of
from workbench.reach import ReachTube, compute_tube
from workbench.reach.validated.tube import ValidatedTube
from workbench.sets import Box

Ball = Any
Array = npt.NDArray[np.float64]
# From the initial state and a time to the state.
Solution = Callable[[Sequence[Ball], Ball], Sequence[Ball]]


@dataclass(frozen=True)
class ClosedForm:
    """x' = f(x) from a set, its solution, and a horizon in s."""

    name: str
    system: Ode
    start: Box
    solution: Solution
    horizon_s: float

    def tube(self, *, step_s: float = 0.05, degree: int = 2) -> ReachTube:
        method = ValidatedTube(step_s, degree)
        return compute_tube(
            self.system, initial_set=self.start, horizon_s=self.horizon_s, method=method
        )

    def at(self, point: Array) -> ClosedForm:
        """The same from a point."""
        values = tuple(map(float, point))
        single = Box(self.start.names, values, values)
        return ClosedForm(self.name, self.system, single, self.solution, self.horizon_s)


def scalar(
    name: str,
    field: Callable[[ca.SX], ca.SX],
    solution: Callable[[Ball, Ball], Ball],
    start: tuple[float, float],
    horizon_s: float,
) -> ClosedForm:
    system = system_of(lambda x: [field(x)], "x")
    return ClosedForm(name, system, box(x=start), lambda x, t: [solution(x[0], t)], horizon_s)


def _e(x: Ball) -> Ball:
    return x.exp()


def _power_solution(x: Ball, t: Ball) -> Ball:
    c = flint.arb(1.7) - 1
    return (x ** (-c) - c * t) ** (-1 / c)


def _turned(x: Ball, t: Ball) -> Ball:
    return (x.asin() + t).sin()


def _rooted(x: Ball, t: Ball) -> Ball:
    return (x * x + 2 * t).sqrt()


def clipped(x: Ball, t: Ball) -> Ball:
    """x' = clip(-x, -1, 1): at unit speed until |x| = 1."""
    if abs(x) <= 1:
        return x * _e(-t)
    meets = abs(x) - 1
    size = abs(x) - t if t <= meets else _e(meets - t)
    return size if x > 0 else -size


SMOOTH = [
    scalar("decay", lambda x: -x, lambda x, t: x * _e(-t), (0.9, 1.1), 2.0),
    scalar("square", lambda x: x * x, lambda x, t: x / (1 - x * t), (0.2, 0.9), 0.8),
    scalar(
        "logistic",
        lambda x: x * (1 - x),
        lambda x, t: x * _e(t) / (1 + x * (_e(t) - 1)),
        (0.1, 0.4),
        2.0,
    ),
    scalar("inverse", lambda x: 1 / x, _rooted, (0.6, 1.0), 2.0),
    scalar("root", ca.sqrt, lambda x, t: (x.sqrt() + t / 2) ** 2, (0.3, 0.9), 2.0),
    scalar("exponential", lambda x: ca.exp(-x), lambda x, t: (_e(x) + t).log(), (-0.3, 0.3), 2.0),
    scalar("logarithm", lambda x: x * ca.log(x), lambda x, t: x ** _e(t), (0.6, 0.75), 0.7),
    scalar("tangent", ca.tan, lambda x, t: (x.sin() * _e(t)).asin(), (0.1, 0.3), 1.0),
    scalar("cosine", lambda x: ca.cos(x) ** 2, lambda x, t: (x.tan() + t).atan(), (-0.3, 0.3), 2.0),
    scalar("sine", ca.sin, lambda x, t: 2 * ((x / 2).tan() * _e(t)).atan(), (0.3, 0.6), 2.0),
    scalar("tanh", ca.tanh, lambda x, t: (x.sinh() * _e(t)).asinh(), (-0.1, 0.2), 0.8),
    scalar(
        "cosh", lambda x: 1 / ca.cosh(x), lambda x, t: (x.sinh() + t).asinh(), (-0.1, 0.15), 1.0
    ),
    scalar("sinh", ca.sinh, lambda x, t: 2 * ((x / 2).tanh() * _e(t)).atanh(), (0.1, 0.3), 1.0),
    scalar("arc sine", lambda x: ca.cos(ca.asin(x)), _turned, (-0.3, 0.1), 0.8),
    scalar("arc cosine", lambda x: ca.sin(ca.acos(x)), _turned, (-0.3, 0.1), 0.8),
    scalar("arc tangent", lambda x: 1 / ca.tan(ca.atan(x)), _rooted, (0.6, 1.0), 1.0),
    scalar("real power", lambda x: x**1.7, _power_solution, (0.4, 0.5), 0.7),
]


def _angle(x: Sequence[Ball], t: Ball) -> list[Ball]:
    start = flint.arb.atan2(x[1], x[0])
    turned = [x[0] * t.cos() - x[1] * t.sin(), x[0] * t.sin() + x[1] * t.cos()]
    return [*turned, x[2] + start * t + t * t / 2]


PLANAR = [
    ClosedForm(
        "oscillator",
        system_of(lambda x, y: [y, -x], "x", "y"),
        box(x=(0.9, 1.1), y=(-0.1, 0.1)),
        lambda x, t: [x[0] * t.cos() + x[1] * t.sin(), x[1] * t.cos() - x[0] * t.sin()],
        2.0,
    ),
    ClosedForm(
        "angle",
        system_of(lambda x, y, a: [-y, x, ca.atan2(y, x)], "x", "y", "a"),
        box(x=(0.5, 0.8), y=(-0.9, -0.6), a=(-0.1, 0.1)),
        _angle,
        2.0,
    ),
    ClosedForm(
        "many turns per step",
        system_of(lambda x, y: [1.0, 130 * ca.cos(130 * x)], "x", "y"),
        box(x=(0.0, 0.0), y=(-0.01, 0.01)),
        lambda x, t: [x[0] + t, x[1] + (130 * (x[0] + t)).sin() - (130 * x[0]).sin()],
        0.2,
    ),
    ClosedForm(
        "a cubic in the set",
        system_of(lambda x, y: [y**3 - y * y, 0.0], "x", "y"),
        box(x=(-0.1, 0.1), y=(-0.9, 1.0)),
        lambda x, t: [x[0] + t * (x[1] ** 3 - x[1] ** 2), x[1]],
        1.0,
    ),
]
KINKED = [
    scalar("clip", lambda x: ca.fmin(ca.fmax(-x, -1), 1), clipped, (0.8, 1.6), 2.0),
    scalar(
        "absolute value",
        lambda x: -ca.fabs(x),
        lambda x, t: x * _e(-t) if x > 0 else x * _e(t),
        (-0.3, 0.5),
        1.5,
    ),
    scalar(
        "two rates",
        lambda x: ca.fmin(-x, -2 * x),
        lambda x, t: x * _e(-2 * t) if x > 0 else x * _e(-t),
        (-0.4, 0.5),
        1.0,
    ),
    scalar(
        "limits in the wrong order",
        lambda x: ca.fmin(ca.fmax(x, 1.0), 0.5),
        lambda x, t: x + t / 2,
        (-0.3, -0.2),
        1.0,
    ),
]


def points(start: Box, count: int = 12, seed: int = 3) -> Array:
    """Vertices of the set and `count` states inside, as doubles."""
    lower, upper = np.array(start.lower), np.array(start.upper)
    ends = np.stack([lower, upper])
    grid = np.indices((2,) * len(lower)).reshape(len(lower), -1).T
    vertices = np.take_along_axis(ends, grid, axis=0)
    shares = np.random.default_rng(seed).uniform(0, 1, (count, len(lower)))
    return np.concatenate([vertices, np.clip(lower + shares * (upper - lower), lower, upper)])


def instants(tube: ReachTube, per_row: int) -> list[tuple[int, float]]:
    """(row, time) of `per_row` times inside every row."""
    shares = (np.arange(per_row) + 0.5) / per_row
    return [
        (k, float(start + share * (end - start)))
        for k, (start, end) in enumerate(zip(tube.times[:-1], tube.times[1:], strict=True))
        for share in shares
    ]


def escapes(tube: ReachTube, form: ClosedForm, states: Array, *, per_row: int = 3) -> list[str]:
    """What lies certainly outside: at the instants outside the sets there, else outside the row."""
    found: list[str] = []
    with precise():
        for state in states:
            start = [flint.arb(float(v)) for v in state]
            for k, time in enumerate(tube.times):
                there = form.solution(start, flint.arb(float(time)))
                found += _outside(there, tube.lower_at[k], tube.upper_at[k], f"t = {time}")
            for row, time in instants(tube, per_row):
                there = form.solution(start, flint.arb(time))
                found += _outside(there, tube.lower[row], tube.upper[row], f"row {row}, {time}")
    return found


def _outside(state: Sequence[Ball], lower: Array, upper: Array, where: str) -> list[str]:
    found = []
    for i, (ball, low, high) in enumerate(zip(state, lower, upper, strict=True)):
        assert ball.is_finite(), f"the closed form has no value at {where}"
        inside = np.isfinite([low, high]).all()
        if not inside or ball < flint.arb(float(low)) or ball > flint.arb(float(high)):
            found.append(f"{where}: state {i} = {ball.str(25)} outside [{low!r}, {high!r}]")
    return found


def precise_run(system: Ode, state: Array, times: Array, *, orders: int = 30) -> list[list[Ball]]:
    """States at `times` (s) from Taylor steps with 30 terms in 200-bit balls, about 1e-30 exact.

    The balls do not hold what the series leaves out; it is far below any rounding of doubles.
    """
    graph = graph_of(ca.Function("field", [system.x, system.p], [ca.densify(system.field)]))
    parameters = [[flint.arb(v)] for v in system.parameter_values()]
    with precise(orders):
        now = [flint.arb(float(v)) for v in state]
        result = [now]
        for before, after in itertools.pairwise(times):
            h = flint.arb(float(after)) - flint.arb(float(before))
            series = [[ball] for ball in now]
            for k in range(orders - 1):
                rates = coefficients(graph, [series, parameters])
                for row, rate in zip(series, rates, strict=True):
                    row.append(rate[k] / (k + 1))
            now = [sum((c * h**k for k, c in enumerate(row)), flint.arb(0)) for row in series]
            result.append(now)
    return result
