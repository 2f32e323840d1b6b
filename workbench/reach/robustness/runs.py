"""Runs of cars whose steering command comes late, by Runge and Kutta's fourth order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from workbench.models.gains.ranged_loop import Car, Ranges
from workbench.models.gains.ranged_plant import IN_FLIGHT, ranged_plant

if TYPE_CHECKING:
    import casadi as ca

    from workbench.models.system import Ode
    from workbench.models.vehicle import Vehicle

Array = NDArray[np.float64]
_STEP_S: Final = 0.02


def delayed_runs(vehicle: Vehicle, cars: Sequence[Car], starts: Array, times_s: Array) -> Array:
    """States (cars x starts x instants x n) at the rising instants >= 0 from `starts` (k x n).

    Steering is that of the wheels: what was commanded `delay_s` ago, at first the start's. Rigor
    SAMPLED.
    """
    return np.stack([_of_car(vehicle, car, starts, times_s) for car in cars])


def _of_car(vehicle: Vehicle, car: Car, starts: Array, times_s: Array) -> Array:
    ends = (car.wheelbase_m,) * 2, (car.speed_scale,) * 2, (car.delay_s,) * 2
    ode = ranged_plant(vehicle, Ranges(*ends))
    steering = ode.names.index("steering")
    back = math.ceil(car.delay_s / _STEP_S)
    step = car.delay_s / back if back else _STEP_S
    count = max(1, math.ceil(times_s[-1] / step))
    field, inputs = ode.function().map(len(starts)), _inputs(ode, len(starts))
    # Commanded steering and its rate at the steps so far; columns are runs.
    states, slopes = [starts.T], list[Array]()
    commanded, rates = [starts.T[steering]], list[Array]()

    def slope(x: Array, wheel: Array | None) -> Array:
        return _slope(field, ode, inputs, x, wheel)

    # One step more, so that the slope at the end of the last one that counts is known.
    for k in range(count + 1):
        x = states[-1]
        late = [_late(commanded, rates, k - back, share, step) for share in (0.0, 0.5, 1.0)]
        if not back:
            late = [None, None, None]
        k1 = slope(x, late[0])
        k2 = slope(x + step / 2 * k1, late[1])
        k3 = slope(x + step / 2 * k2, late[1])
        k4 = slope(x + step * k3, late[2])
        slopes.append(k1)
        rates.append(k1[steering])
        states.append(x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
        commanded.append(states[-1][steering])
    whole, moving = np.array(states[:-1]), np.array(slopes)
    if back:
        whole[:, steering] = [commanded[max(0, k - back)] for k in range(count + 1)]
        moving[:, steering] = [
            rates[k - back] if k >= back else 0.0 * rates[0] for k in range(count + 1)
        ]
    return _at(whole, moving, step, times_s)


def _inputs(ode: Ode, count: int) -> tuple[Array, Array]:
    p = np.tile(np.array(ode.parameter_values())[:, None], (1, count))
    w = np.tile(np.array([each.nominal for each in ode.disturbances])[:, None], (1, count))
    return p, w


def _slope(
    field: ca.Function, ode: Ode, inputs: tuple[Array, Array], x: Array, wheel: Array | None
) -> Array:
    p, w = inputs
    if wheel is not None:
        flight = [each.name for each in ode.disturbances].index(IN_FLIGHT)
        w = w.copy()
        w[flight] = wheel - x[ode.names.index("steering")]
    return np.asarray(field(x, p, w).full())


def _late(
    commanded: Sequence[Array], rates: Sequence[Array], k: int, share: float, step: float
) -> Array | None:
    """What was commanded at the time (k + share) step; nothing was in flight at 0."""
    if k < 0:
        return commanded[0]
    if share == 0.0 or k + 1 >= len(commanded):
        return commanded[k]
    if share == 1.0:
        return commanded[k + 1]
    # Hermite's cubic at the middle; the rate at k + 1 is known once its step was made.
    if k + 1 < len(rates):
        return (commanded[k] + commanded[k + 1]) / 2 + step / 8 * (rates[k] - rates[k + 1])
    return (commanded[k] + commanded[k + 1]) / 2


def _at(states: Array, slopes: Array, step: float, times_s: Array) -> Array:
    """States (runs x instants x n) from (steps x n x runs), by Hermite's cubics between steps."""
    k = np.clip(np.floor(times_s / step).astype(int), 0, len(states) - 2)
    t = (times_s / step - k)[:, None, None]
    low = (1.0 + 2.0 * t) * (1.0 - t) ** 2 * states[k] + t * t * (3.0 - 2.0 * t) * states[k + 1]
    bent = t * (1.0 - t) ** 2 * slopes[k] - t * t * (1.0 - t) * slopes[k + 1]
    return np.transpose(low + step * bent, (2, 0, 1))
