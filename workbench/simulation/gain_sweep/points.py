"""The points of a study that are known beforehand: the vehicle's own gains, then a grid or a Sobol
sequence."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from scipy.stats import qmc

from workbench.models.vehicle import Vehicle
from workbench.simulation.gain_sweep.gains import Gains, own_gains
from workbench.simulation.gain_sweep.plan import Plan


def points(plan: Plan, vehicle: Vehicle, indices: Iterable[int]) -> list[Gains]:
    """Gains by index: 0 the vehicle's, 1 to `plan.count` those of the study; always the same.

    Sobol: Owen-scrambled by the seed, each index the same whatever the count.
    """
    own, held, wanted = own_gains(vehicle), held_gains(plan, vehicle), list(indices)
    return [own if k == 0 else held | _drawn(plan, share)
            for k, share in zip(wanted, _shares(plan, wanted), strict=True)]  # fmt: skip


def held_gains(plan: Plan, vehicle: Vehicle) -> Gains:
    """What every point has but for the gains that vary."""
    return own_gains(vehicle) | {name: low for name, (low, _) in plan.ranges.items()}


def _shares(plan: Plan, indices: list[int]) -> list[list[float]]:
    """Where each index lies in the unit cube of the gains that vary; 0 where it is not used."""
    size = len(plan.varied)
    if plan.method == "grid":
        shape = (plan.per_axis,) * size
        return [
            [float(i) / (plan.per_axis - 1) for i in np.unravel_index(max(k - 1, 0), shape)]
            for k in indices
        ]
    # As many as a power of two holds, whose first ones are the same for every power.
    power = math.ceil(math.log2(max(max(indices, default=1), 2)))
    drawn = qmc.Sobol(size, scramble=True, rng=plan.seed).random_base2(power)
    return [[float(x) for x in drawn[max(k - 1, 0)]] for k in indices]


def _drawn(plan: Plan, share: list[float]) -> Gains:
    found = {}
    for name, x in zip(plan.varied, share, strict=True):
        low, high = plan.ranges[name]
        found[name] = low + (high - low) * x
    return found
