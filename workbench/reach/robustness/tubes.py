"""Tubes of all cars of the ranges: proved widths, and widths that runs have shown."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.models.gains.ranged_loop import Car, Ranges
from workbench.models.gains.ranged_plant import in_flight_bound_rad, ranged_plant
from workbench.reach.compute import compute_tube
from workbench.reach.robustness.runs import delayed_runs
from workbench.reach.tube import ReachTube
from workbench.reach.validated.tube import ValidatedTube

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle

Array = NDArray[np.float64]
_RANDOM_STARTS: Final = 16
_RANDOM_CARS: Final = 8
_SAME_S: Final = 1e-9


@final
@dataclass(frozen=True, slots=True, eq=False)
class RangedTube:
    """A tube that holds every car of the ranges, and the half widths of what runs have reached.

    tube: rigor ENCLOSED; its column `steering` is that of the wheels. instants_s (m); proved (m x
    n): half widths there, NaN past the end of the proof; found (m x n): of runs, a lower bound that
    proves nothing; runs: how many.
    """

    tube: ReachTube
    units: tuple[str, ...]
    instants_s: Array
    proved: Array
    found: Array
    runs: int

    def rows(self) -> list[dict[str, object]]:
        """One row per instant and state."""
        return [
            {"time_s": float(t), "state": name, "unit": unit,
             "proved_half_width": None if np.isnan(self.proved[k, i]) else float(self.proved[k, i]),
             "found_by_search_half_width": float(self.found[k, i])}
            for k, t in enumerate(self.instants_s)
            for i, (name, unit) in enumerate(zip(self.tube.names, self.units, strict=True))
        ]  # fmt: skip


def ranged_tube(
    vehicle: Vehicle,
    ranges: Ranges,
    instants_s: Sequence[float],
    *,
    step_s: float,
    seed: int,
    each_row: Callable[[], object] = lambda: None,
) -> RangedTube:
    """The tube up to the last of the instants (s, rising, > 0), from the vehicle's initial set.

    Wheelbase and speed scale are unknown constants, what a delay holds back is a disturbance within
    its bound; see `ranged_plant`. Runs start in corners and inside of the initial set, with cars at
    corners and inside of the ranges.
    """
    ode = ranged_plant(vehicle, ranges)
    commanded = compute_tube(
        ode, initial_set=vehicle.initial_set, horizon_s=instants_s[-1],
        method=ValidatedTube(step_s, each_row=each_row),
    )  # fmt: skip
    tube = _of_wheels(commanded, in_flight_bound_rad(vehicle, ranges))
    times = np.array(instants_s)
    reached = sampled_runs(vehicle, ranges, times, seed=seed)
    flat = reached.reshape(-1, len(times), len(ode.names))
    return RangedTube(
        tube,
        tuple(state.unit for state in ode.states),
        times,
        np.array([_half_width(tube, t) for t in times.tolist()]),
        0.5 * np.ptp(flat, axis=0),
        len(flat),
    )


def sampled_runs(vehicle: Vehicle, ranges: Ranges, times_s: Array, *, seed: int) -> Array:
    """Runs (cars x starts x instants x n) of corners and random insides of both sets."""
    rng = np.random.default_rng(seed)
    start = vehicle.initial_set.reordered(ranged_plant(vehicle, ranges).names)
    ends = [sorted({low, high}) for low, high in zip(start.lower, start.upper, strict=True)]
    inside = rng.uniform(start.lower, start.upper, (_RANDOM_STARTS, len(start.lower)))
    starts = np.concatenate([np.array(list(itertools.product(*ends))), inside])
    cars = [*ranges.corners(), ranges.middle]
    cars += [Car(*(float(rng.uniform(*end)) for end in ranges.ends)) for _ in range(_RANDOM_CARS)]
    return delayed_runs(vehicle, list(dict.fromkeys(cars)), starts, times_s)


def _of_wheels(tube: ReachTube, bound_rad: float) -> ReachTube:
    """The tube with the steering of the wheels instead of the commanded one."""
    if not bound_rad:
        return tube
    column = tube.names.index("steering")
    wider = {}
    for name, way in (("lower", -1), ("upper", 1), ("lower_at", -1), ("upper_at", 1)):
        values = getattr(tube, name).copy()
        first = 1 if name.endswith("at") else 0  # at the start nothing is in flight
        moved = values[first:, column] + way * bound_rad
        values[first:, column] = np.nextafter(moved, way * np.inf)
        wider[name] = values
    return dataclasses.replace(tube, **wider)


def _half_width(tube: ReachTube, t_s: float) -> Array:
    k = int(np.argmin(np.abs(tube.times - t_s)))
    if abs(tube.times[k] - t_s) <= _SAME_S:
        return np.asarray(0.5 * (tube.upper_at[k] - tube.lower_at[k]))
    k = int(np.searchsorted(tube.times, t_s)) - 1
    if k >= len(tube.lower):
        return np.full(len(tube.names), np.nan)
    return np.asarray(0.5 * (tube.upper[k] - tube.lower[k]))
