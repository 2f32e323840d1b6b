"""How far apart two given runs are for certain: both enclosed by validated integration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.errors import InputError
from workbench.models.system import Ode, System
from workbench.reach.inner.choices import Choices
from workbench.reach.inner.point_runs import PointRuns, validated_runs
from workbench.reach.tube import Array, TubeStatus
from workbench.reach.validated.tube import time_grid

# Longest step in s that is offered to the validated integration.
_LONGEST_STEP_S = 0.05


def point_runs(
    system: System, states: Array, parameters: Sequence[float], times_s: Array
) -> PointRuns:
    """Enclosures of the runs from the exact `states` (N, n) with these parameters.

    Disturbances stay at their nominal values. InputError where a known constant differs.
    """
    ode, count = system.ode, len(states)
    constants = _ranged(ode, parameters)
    nominal = [w.nominal for w in ode.disturbances]
    signals = np.tile(np.array(nominal, dtype=float), (count, len(times_s) - 1, 1))
    return validated_runs(ode, Choices(states, np.tile(constants, (count, 1)), signals), times_s)


def proved_distance(
    system: System,
    pair: tuple[Sequence[float], Sequence[float]],
    *,
    parameters: Sequence[float],
    time_s: float,
    state: str,
) -> tuple[float, float] | None:
    """Bounds on |second - first| of `state` at `time_s`; None where no enclosure was found.

    The system is taken as exactly its numbers, and so are the two initial states and the shared
    parameters. Rigor ENCLOSED.
    """
    points = np.array(pair, dtype=float)
    i = system.ode.names.index(state)
    if time_s == 0.0:
        low = high = points[:, i]
    else:
        times = time_grid(time_s, min(time_s, _LONGEST_STEP_S))
        runs = point_runs(system, points, parameters, times)
        if runs.status is not TubeStatus.COMPLETE:
            return None
        low, high = runs.lower[-1, :, i], runs.upper[-1, :, i]
    apart = max(float(low[1] - high[0]), float(low[0] - high[1]), 0.0)
    most = max(float(high[1] - low[0]), float(high[0] - low[1]))
    return float(np.nextafter(apart, 0.0)), float(np.nextafter(most, np.inf))


def _ranged(ode: Ode, parameters: Sequence[float]) -> Array:
    """The values of the parameters with a range, in order."""
    known = [
        (each, value)
        for each, value in zip(ode.parameters, parameters, strict=True)
        if not each.lower <= value <= each.upper
    ]
    if known:
        raise InputError(
            f"expected parameters in their ranges, got {known[0][1]!r} for {known[0][0].name!r}"
        )
    return np.array(
        [v for each, v in zip(ode.parameters, parameters, strict=True) if each.lower < each.upper]
    )
