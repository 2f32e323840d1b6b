"""Independent runs of switched and sampled loops: Runge-Kutta with every run's own durations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from workbench.models import System
from workbench.sensitivity.vectorised import Vectorised

Array = npt.NDArray[np.float64]
Field = Callable[[Array], Array]


def advanced(field: Field, x: Array, durations: Array, steps: int) -> Array:
    """States (n, N) after each run's own duration (N,)."""
    h = durations / steps
    for _ in range(steps):
        k1 = field(x)
        k2 = field(x + h / 2 * k1)
        k3 = field(x + h / 2 * k2)
        k4 = field(x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


@dataclass(frozen=True)
class Phase:
    """A system with one disturbance sample per run and interval, (n_w, N) from `draw`."""

    system: System
    draw: Callable[[int], Array]

    def field(self) -> Field:
        ode = self.system.ode
        rates, p = Vectorised(ode.function()), np.array([ode.parameter_values()]).T
        w = self.draw(len(ode.disturbances))
        return lambda x: rates(x, p, w)[0]


def switched_runs(
    first: Phase,
    then: Phase,
    *,
    states: Array,
    switch_s: Array,
    times: Array,
    reset: dict[str, float],
) -> Array:
    """Runs (N, m, n) over the states of `first`; `switch_s` (N,) is when each run switches."""
    before, after = first.system.ode.names, then.system.ode.names
    x = {name: states[:, i].copy() for i, name in enumerate(before)}
    y = {name: np.full(len(states), reset.get(name, 0.0)) for name in after}
    rows = []
    for k, time in enumerate(times):
        switched = switch_s < time
        rows.append([np.where(switched, y.get(name, x[name]), x[name]) for name in before])
        if k + 1 == len(times):
            break
        until = np.clip(switch_s - time, 0.0, times[k + 1] - time)
        moved = advanced(first.field(), np.stack(list(x.values())), until, 3)
        x = dict(zip(before, moved, strict=True))
        now = (switch_s >= time) & (switch_s < times[k + 1])
        for name in after:
            start = np.full(len(states), reset[name]) if name in reset else x[name]
            y[name] = np.where(now, start, y[name])
        rest = np.where(switch_s < times[k + 1], times[k + 1] - time - until, 0.0)
        moved = advanced(then.field(), np.stack(list(y.values())), rest, 3)
        y = dict(zip(after, moved, strict=True))
    return np.array(rows).transpose(2, 0, 1)
