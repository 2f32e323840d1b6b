"""How far B1's runs really part, by means that share nothing with the workbench's own.

The equations are written out again, SciPy's DOP853 integrates them, and a compass search without
gradients maximises. What it finds is reached, so it is never above the truth; many starts bring it
close from below.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.integrate import solve_ivp

from workbench.sensitivity.vectorised import Array, Index

CENTRE = (0.0, 0.3, 0.0, 2.5, 0.0, 0.0, 0.0)
RADIUS = (0.2, 0.2, 0.02, 0.2, 0.05, 0.0, 0.0)
NAMES = ("x", "y", "steering", "speed", "heading", "speed_integral", "offset_integral")
# Far below a thousandth of any distance looked for.
_TOLERANCE = 1e-10
_FIRST_STRIDE, _LEAST_STRIDE = 0.5, 1e-4
_RANDOM_STARTS = 200


def field(state: Array) -> Array:
    """B1's right-hand side at states (7, N), typed from its description."""
    _, y, steering, speed, heading, speed_integral, offset_integral = state
    turn = speed * np.tan(steering) / 1.75
    offset = y + 2.0 * np.sin(heading)
    offset_rate = speed * np.sin(heading) + 2.0 * np.cos(heading) * turn
    short = 2.8 - speed
    return np.stack(
        [
            speed * np.cos(heading),
            speed * np.sin(heading),
            -(0.6 * offset + 0.05 * offset_integral + 1.0 * offset_rate),
            1.0 * short + 0.1 * speed_integral,
            turn,
            short,
            offset,
        ]
    )


def runs(initial: Array, times_s: Array) -> Array:
    """B1's runs (N, M, 7) from `initial` (N, 7) at the rising instants `times_s`, from 0 on."""
    count = len(initial)

    def flat(_t: float, state: Array) -> Array:
        return field(state.reshape(7, count)).ravel()

    solved = solve_ivp(
        flat, (0.0, float(times_s[-1])), initial.T.ravel(), "DOP853", times_s,
        rtol=_TOLERANCE, atol=_TOLERANCE,
    )  # fmt: skip
    if not solved.success:
        raise RuntimeError(f"DOP853 gave up: {solved.message}")
    return np.asarray(solved.y.reshape(7, count, -1).transpose(1, 2, 0))


@final
@dataclass(frozen=True, slots=True, eq=False)
class TightEnvelope:
    """times_s (M,); distance (M, 7): the largest |e_i| found; state (M, 7, 7): where, per i."""

    times_s: Array
    distance: Array
    state: Array


def tight_envelope(times_s: Array, *, starts: int, seed: int) -> TightEnvelope:
    """The largest distance from the middle run of every state at every instant.

    starts: best of all vertices and some random states from which each search begins, in both
    directions.
    """
    centre, radius = np.array(CENTRE), np.array(RADIUS)
    free = np.flatnonzero(radius)
    rng = np.random.default_rng(seed)
    corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * len(free)), axis=-1).reshape(-1, len(free))
    pool = np.concatenate([corners, rng.uniform(-1.0, 1.0, (_RANDOM_STARTS, len(free)))])
    middle = runs(centre[None], times_s)[0]

    def differences(shares: Array) -> Array:
        states = np.tile(centre, (len(shares), 1))
        states[:, free] += shares * radius[free]
        return np.asarray(runs(states, times_s) - middle)

    signed = differences(pool).reshape(len(pool), -1)
    order = np.concatenate(
        [np.argsort(-signed, axis=0)[:starts], np.argsort(signed, axis=0)[:starts]]
    )
    goals = signed.shape[1]
    goal = np.tile(np.arange(goals), 2 * starts)
    sign = np.repeat([1.0, -1.0], starts * goals)
    shares, value = _searched(
        lambda s, rows: (
            sign[rows] * differences(s).reshape(len(s), -1)[np.arange(len(s)), goal[rows]]
        ),
        pool[order.ravel()],
    )
    best = value.reshape(2 * starts, goals).argmax(axis=0)
    rows = best * goals + np.arange(goals)
    states = np.tile(centre, (goals, 1))
    states[:, free] += shares[rows] * radius[free]
    shape = (len(times_s), 7)
    return TightEnvelope(times_s, value[rows].reshape(shape), states.reshape(*shape, 7))


def _searched(goal: Callable[[Array, Index], Array], start: Array) -> tuple[Array, Array]:
    """Compass search of all rows at once: along each axis and back, half as far on failure."""
    shares, rows = start.copy(), np.arange(len(start))
    value, stride = goal(shares, rows), np.full(len(start), _FIRST_STRIDE)
    axes = start.shape[1]
    compass = np.concatenate([np.eye(axes), -np.eye(axes)])
    while len(rows):
        tried = shares[rows, None] + stride[rows, None, None] * compass
        tried = np.clip(tried, -1.0, 1.0).reshape(-1, axes)
        found = goal(tried, np.repeat(rows, 2 * axes)).reshape(len(rows), -1)
        pick = found.argmax(axis=1)
        reached = found[np.arange(len(rows)), pick]
        better = reached > value[rows]
        moved = rows[better]
        shares[moved] = tried.reshape(len(rows), 2 * axes, axes)[better, pick[better]]
        value[moved] = reached[better]
        stride[rows[~better]] *= 0.5
        rows = rows[stride[rows] > _LEAST_STRIDE]
    return shares, value
