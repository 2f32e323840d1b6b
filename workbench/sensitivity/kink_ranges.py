"""Where the kinks of a field and their derivatives range over boxes of states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from typing import final

import casadi as ca
import numpy as np

from workbench.sensitivity.inclusion import inclusion
from workbench.sensitivity.interval_arrays import Interval
from workbench.sensitivity.kinks import SmoothForm
from workbench.sensitivity.vectorised import Array, Vectorised

# Kinks without a floor have one at -1e300 (`kinks`); drivers must stay away from it.
_LEAST_DRIVER = -1e299


@final
@dataclass(frozen=True, slots=True, eq=False)
class KinkValues:
    """Ranges (n_kinks, C) of kappa = clip(d, floor, ceiling) and of its derivatives.

    d kappa = driver d d + floor d floor + ceiling d ceiling with shares in these ranges, within
    [0, 1]; of Clarke's generalised derivative an outer bound.
    """

    kappa: Interval
    driver: Interval
    floor: Interval
    ceiling: Interval


@final
class KinkRanges:
    """Encloses the kinks of a `SmoothForm` over boxes of states, many at once.

    `constant`: the intervals of `form.p` and of the disturbances, as (entries, 1) arrays.
    """

    __slots__ = ("_drivers", "_form", "constant")

    def __init__(self, form: SmoothForm) -> None:
        ode = form.ode
        drivers = ca.densify(ca.vertcat(form.drivers, form.floor, form.ceiling))
        self._form = form
        self._drivers = lifted(
            ca.Function(
                "drivers",
                [ode.x, form.p, ode.w, form.kappa],
                [drivers],
                ["x", "p", "w", "kappa"],
                ["value"],
            )
        )
        self.constant = _parameter_ranges(form)

    def on(self, x: Interval) -> KinkValues:
        """The ranges on the boxes x, two (n, C) arrays."""
        size, count = self._form.kappa.numel(), x[0].shape[1]
        kappa = (np.zeros((size, count)), np.zeros((size, count)))
        driver_share, floor_share, ceiling_share = (
            (np.zeros((size, count)), np.ones((size, count))) for _ in range(3)
        )
        # Driver i depends on earlier kappa only: after pass i the first i + 1 are final.
        for i in range(size):
            low, high, valid = self._drivers([x, *self.constant, kappa])
            driver, floor, ceiling = ((low[row], high[row]) for row in (i, size + i, 2 * size + i))
            known = (valid == 1.0) & (driver[0] > _LEAST_DRIVER)
            for end, infinite in ((0, -np.inf), (1, np.inf)):
                clipped = np.minimum(np.maximum(driver[end], floor[end]), ceiling[end])
                kappa[end][i] = np.where(known, clipped, infinite)
            above, below = driver[0] > floor[1], driver[1] < ceiling[0]
            outside = (driver[1] < floor[0]) | (driver[0] > ceiling[1])
            driver_share[0][i] = np.where(known & above & below, 1.0, 0.0)
            driver_share[1][i] = np.where(known & outside, 0.0, 1.0)
            floor_share[1][i] = np.where(known & above, 0.0, 1.0)
            ceiling_share[1][i] = np.where(known & below & (floor[1] < ceiling[0]), 0.0, 1.0)
        return KinkValues(kappa, driver_share, floor_share, ceiling_share)


def lifted(function: ca.Function) -> Callable[[list[Interval]], tuple[Array, Array, Array]]:
    """Inclusion function of `function` (one output "value"): (lower, upper) pairs by position."""
    inclusive = inclusion(function)
    evaluate = Vectorised(inclusive)
    position = {name: k for k, name in enumerate(function.name_in())}
    slots = [
        (position[name.rsplit("_", 1)[0]], 0 if name.endswith("_lower") else 1)
        for name in inclusive.name_in()
    ]
    outputs = inclusive.name_out()
    order = [outputs.index(name) for name in ("value_lower", "value_upper", "valid")]

    def run(arguments: list[Interval]) -> tuple[Array, Array, Array]:
        with np.errstate(all="ignore"):
            results = evaluate(*[arguments[k][end] for k, end in slots])
        low, high, valid = (results[k] for k in order)
        return low, high, valid[0]

    return run


def decimal_hull(value: float) -> tuple[float, float]:
    """Interval with both the double and the decimal number it prints as (0.1 is no double)."""
    value = float(value)
    if Decimal(value) == Decimal(repr(value)):
        return value, value
    return float(np.nextafter(value, -np.inf)), float(np.nextafter(value, np.inf))


def _parameter_ranges(form: SmoothForm) -> list[Interval]:
    """Intervals of the parameters with the graph's constants, and of the disturbances."""
    known = [decimal_hull(value) for value in form.constants]
    ranges = [(decimal_hull(r.lower)[0], decimal_hull(r.upper)[1]) for r in form.ode.parameters]
    felt = [(r.lower, r.upper) for r in form.ode.disturbances]
    return [
        (
            np.array([[low] for low, _ in ends]).reshape(-1, 1),
            np.array([[high] for _, high in ends]).reshape(-1, 1),
        )
        for ends in ([*ranges, *known], felt)
    ]
