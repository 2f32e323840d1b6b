"""Ways of people through the potential field to their goals, others moving on as they do."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.estimation.motion_filter import Estimate
from workbench.estimation.potential_field import NEAR_M, Field, Repulsion, field_step

Values = NDArray[np.float64]
STEP_S = 0.1
DISC_NUMBERS = 5
"""Numbers of a disc: x, y (m), velocity x, y (m/s), radius (m)."""
VEHICLE_NUMBERS = 7
"""Numbers of a vehicle: those of `vehicle_repulsion`, and its speed along the heading (m/s)."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Others:
    """What repels a person: discs (k, 5) and vehicles (j, 7) at the time of the person's estimate.

    They go on at constant velocity, vehicles along their heading. For n people: (n, k, 5) and
    (n, j, 7).
    """

    discs: Values
    vehicles: Values

    @classmethod
    def none(cls) -> Others:
        """Nobody and nothing."""
        return cls(np.empty((0, DISC_NUMBERS)), np.empty((0, VEHICLE_NUMBERS)))


@final
@dataclass(frozen=True, slots=True)
class TowardGoal:
    """Ours, the goal known: the person's own speed, through the potential field, to the goal.

    Starts at the estimate with the estimated velocity, keeps the size of the preferred one, and
    goes in steps of 0.1 s, linear between them. Near the goal the field is a damped spring: the
    person runs past it by less than the softening, returns and settles. Who stands does not set
    out.
    """

    field: Field

    def places_m(
        self, known: Estimate, at_s: float, horizons_s: Sequence[float] | Values, *,
        goal_m: Sequence[float] | Values, others: Others,
    ) -> Values:  # fmt: skip
        """(n, 2) places in m, at at_s + horizons_s (n,), which is not before the estimate."""
        goal = np.asarray(goal_m, dtype=np.float64)
        if goal.shape != (2,) or not np.isfinite(goal).all():
            raise InputError(f"expected a goal (2,) of finite metres, got {goal_m}")
        lead = at_s - known.t_s + np.asarray(horizons_s, dtype=np.float64)
        if not (lead >= -1e-9).all():
            raise InputError(
                f"expected times from {known.t_s:g} s on, the last measurement, got "
                f"{at_s + np.min(horizons_s):g} s"
            )
        steps = max(1, math.ceil(float(lead.max(initial=0.0)) / STEP_S - 1e-9))
        begin = starts([known])[0]
        step = _step(self.field, len(others.discs), len(others.vehicles))
        state: Values = begin[:4]
        ways = [state[:2]]
        for k in range(steps):
            discs, cars = _columns(others, k * STEP_S)
            state = np.ravel(step(state, goal, begin[4], discs, cars).full())
            ways.append(state[:2])
        places: Values = _along(np.array(ways)[:, None], lead[None])[0]
        return places


def starts(known: Sequence[Estimate]) -> Values:
    """(n, 5): place, velocity and preferred speed of each estimate."""
    rows = [(*each.mean[0], *each.velocity_mps, float(np.hypot(*each.mean[1]))) for each in known]
    begin: Values = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return begin


def paths(
    field: Field, begin: Values, goals_m: Values, leads_s: Values, *, others: Others
) -> Values:
    """(n, h, 2): `TowardGoal` for n people at once, after leads_s (n, h), all starting at time 0.

    begin: (n, 5) as `starts` gives it; goals_m: (n, 2). The formulas of `field_step` once more,
    over arrays: fits ask about ten thousands of ways.
    """
    steps = max(1, math.ceil(float(leads_s.max(initial=0.0)) / STEP_S - 1e-9))
    place, velocity, speed = begin[:, :2].copy(), begin[:, 2:4].copy(), begin[:, 4:]
    ways = [place]
    for k in range(steps):
        way = goals_m - place
        wanted = speed * way / np.sqrt(_squares(way) + field.softening_m**2)
        u = (wanted - velocity) / field.relaxation_s + _pushes(field, place, others, k * STEP_S)
        place = place + STEP_S * velocity + 0.5 * STEP_S**2 * u
        velocity = velocity + STEP_S * u
        ways.append(place)
    return _along(np.array(ways), leads_s)


def _pushes(field: Field, place: Values, others: Others, later_s: float) -> Values:
    """(n, 2), all repulsions together."""
    discs, cars = others.discs, others.vehicles
    centres = discs[..., :2] + later_s * discs[..., 2:4]
    pushes = _push(field.obstacle, place[:, None] - centres, discs[..., 4:])
    forward = np.stack([np.cos(cars[..., 2]), np.sin(cars[..., 2])], axis=-1)
    away = place[:, None] - cars[..., :2] - later_s * cars[..., 6:] * forward
    half = cars[..., 5:6]
    along = np.sum(away * forward, axis=-1, keepdims=True)
    nearest = np.minimum(np.maximum(along, half - cars[..., 4:5]), cars[..., 3:4] - half)
    return pushes + _push(field.vehicle, away - nearest * forward, half)


def _push(law: Repulsion, away: Values, radius: Values) -> Values:
    distance = np.sqrt(_squares(away) + NEAR_M**2)
    push = law.strength_mps2 * np.exp((radius - distance) / law.reach_m) * away / distance
    total: Values = push.sum(axis=1)
    return total


def _squares(rows: Values) -> Values:
    squares: Values = np.sum(rows**2, axis=-1, keepdims=True)
    return squares


def _along(ways: Values, leads_s: Values) -> Values:
    """Linear between the steps: ways (steps + 1, n, 2) at leads_s (n, h)."""
    last = len(ways) - 1
    at = np.clip(leads_s / STEP_S, 0.0, last)
    low = np.minimum(at.astype(int), last - 1)
    share = (at - low)[..., None]
    who = np.arange(len(leads_s))[:, None]
    found: Values = (1.0 - share) * ways[low, who] + share * ways[low + 1, who]
    return found


@functools.lru_cache(maxsize=16)
def _step(field: Field, discs: int, vehicles: int) -> ca.Function:
    return field_step(field, STEP_S, obstacles=discs, vehicles=vehicles)


def _columns(others: Others, later_s: float) -> tuple[Values, Values]:
    """Obstacles (3, k) and vehicles (6, j) as `field_step` reads them, later_s on."""
    discs, cars = others.discs, others.vehicles
    obstacles = np.column_stack([discs[:, :2] + later_s * discs[:, 2:4], discs[:, 4]])
    ahead = np.column_stack([np.cos(cars[:, 2]), np.sin(cars[:, 2])])
    moved = cars[:, :2] + later_s * cars[:, 6:] * ahead
    return obstacles.T, np.column_stack([moved, cars[:, 2:6]]).T
