"""Runs of TRACK followed by the vehicle's BRAKE to standstill, beside the kernel's tubes."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from decision_answers import Answer, Array, TubeAnswer
from decision_fixture import BRAKE_S, STARTS, STEP_S, SWITCH_S, DecisionKernel, Start, query
from decision_paths import ExactPath, paths
from numpy.typing import NDArray

pytest.importorskip("casadi", reason="needs the optional package casadi")

import casadi as ca

from workbench.models.bicycle import PathFrame
from workbench.models.system import Ode
from workbench.models.vehicle import gem_e2

Ways = NDArray[np.int64]
FINE_S = 0.005
AT_ONCE = (0.0, 0.0)
SPEED, SPEED_INTEGRAL, CLOCK = 3, 5, 7
_BRAKE = gem_e2().brake


@dataclass(frozen=True, slots=True)
class Orders:
    """What happens in each run: times after the stamp, and how the run chooses.

    start_s: TRACK begins, the car rests before; reset: with the speed's integral at 0;
    switch_s: BRAKE is commanded; braking: 0 weakest deceleration, 1 strongest, 2 one of both at
    every step, 3 anything between at every step; curving: the same for the curvature within its
    bins, 4 the path's own.
    """

    start_s: Array
    reset: Array
    switch_s: Array
    braking: Ways
    curving: Ways


@dataclass(frozen=True, slots=True)
class Runs:
    """Times (instants, runs) and states (instants, 7, runs), all standing in the last one."""

    times_s: Array
    states: Array


@functools.cache
def _stepped(braking: bool, runs: int) -> Callable[..., object]:
    """One step of RK4: states, parameters, disturbances and length to the next states."""
    ode = _loop(braking)
    rate, x, p, w, h = ode.function(), ode.x, ode.p, ode.w, ca.SX.sym("h")
    k1 = rate(x, p, w)
    k2 = rate(x + h / 2 * k1, p, w)
    k3 = rate(x + h / 2 * k2, p, w)
    k4 = rate(x + h * k3, p, w)
    after = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    mapped: Callable[..., object] = ca.Function("stepped", [x, p, w, h], [after]).map(runs)
    return mapped


@functools.cache
def _loop(braking: bool) -> Ode:
    vehicle = gem_e2()
    mode = vehicle.brake.mode() if braking else vehicle.track()
    return vehicle.closed_loop(mode, PathFrame(-0.5, 0.5)).ode


def _step(
    braking: bool, runs: int, reference_mps: float = 0.0
) -> Callable[[Array, Array, Array], Array]:
    stepped = _stepped(braking, runs)
    p = ca.repmat(ca.DM([
        reference_mps if p.name == "reference_speed" else p.nominal
        for p in _loop(braking).parameters
    ]), 1, runs)  # fmt: skip
    return lambda x, w, h: np.asarray(stepped(x, p, w, h[None, :]))


def _chosen(way: Ways, low: Array, high: Array, chance: np.random.Generator) -> Array:
    share = np.choose(
        way,
        [np.zeros(len(way)), np.ones(len(way)), chance.integers(0, 2, len(way)) * 1.0,
         chance.uniform(size=len(way)), np.zeros(len(way))],
    )  # fmt: skip
    return np.asarray(low + share * (high - low))


def _curvature(path: ExactPath, way: Ways, station: Array, chance: np.random.Generator) -> Array:
    low, high = path.bins(station)
    return np.where(way == 4, path.curvature(station), _chosen(way, low, high, chance))


def _braked(clock: Array) -> Array:
    """Integral of the share of braking in force."""
    acting = np.maximum(clock - _BRAKE.delay_s, 0.0)
    ramp = np.minimum(acting, _BRAKE.build_up_s)
    return np.asarray(ramp**2 / (2 * _BRAKE.build_up_s) + acting - ramp)


def _clock_of(braked: Array) -> Array:
    """The clock at which that integral has a value."""
    ramp = np.sqrt(2 * _BRAKE.build_up_s * np.maximum(braked, 0.0))
    late = braked + _BRAKE.build_up_s / 2
    return np.asarray(_BRAKE.delay_s + np.where(ramp < _BRAKE.build_up_s, ramp, late))


def drive(
    start: Start, states: Array, path: ExactPath, orders: Orders, chance: np.random.Generator
) -> Runs:
    """Rest, TRACK and BRAKE until all stand, by RK4 at 5 ms or less.

    Steps end exactly where a command comes and where a car stands; those of BRAKE end where its
    delay and its build-up do.
    """
    begun = orders.start_s
    rest = int(np.ceil(float(begun.max()) / FINE_S))
    times = [begun * (j / rest) for j in range(rest)] + [begun]
    seen = [states] * (rest + 1)
    runs = states.shape[1]
    if orders.reset.any():
        begins = states.copy()
        begins[SPEED_INTEGRAL] = np.where(orders.reset, 0.0, states[SPEED_INTEGRAL])
        seen, times = [*seen, begins], [*times, begun]
    left = np.maximum(orders.switch_s - begun, 0.0)
    steps = int(np.ceil(float(left.max()) / FINE_S))
    step = _step(False, runs, start.reference_mps)
    for _ in range(steps):
        x, h = seen[-1], left / steps
        w = _curvature(path, orders.curving, x[0], chance)[None, :]
        seen.append(step(x, w, h))
        times.append(times[-1] + h)
    braked = _brake(np.vstack([seen[-1], np.zeros(runs)]), path, orders, chance)
    times += [times[-1] + x[CLOCK] for x in braked]
    return Runs(np.array(times), np.array([*seen, *(_moving(x) for x in braked)]))


def _brake(x: Array, path: ExactPath, orders: Orders, chance: np.random.Generator) -> list[Array]:
    """States with the clock of BRAKE, from its command on."""
    step = _step(True, x.shape[1])
    x[SPEED_INTEGRAL] = 0.0
    seen = [x]
    while (x[SPEED] > 0.0).any():
        least, most = _BRAKE.deceleration_min_mps2, _BRAKE.deceleration_max_mps2
        d = _chosen(orders.braking, np.full(x.shape[1], least), np.full(x.shape[1], most), chance)
        moving = x[SPEED] > 0.0
        stands = _clock_of(_braked(x[CLOCK]) + np.maximum(x[SPEED], 0.0) / d) - x[CLOCK]
        h = np.where(moving, np.minimum(stands, FINE_S), 0.0)
        w = np.vstack([_curvature(path, orders.curving, x[0], chance), d])
        x = step(x, w, h)
        x[SPEED] = np.where(moving & (stands <= FINE_S), 0.0, x[SPEED])
        seen.append(x)
    return seen


def _moving(x: Array) -> Array:
    state = x[:CLOCK].copy()
    state[SPEED] = np.maximum(state[SPEED], 0.0)
    return state


def sampled_orders(
    states: Array,
    switch_s: tuple[float, float],
    chance: np.random.Generator,
    *,
    start_s: tuple[float, float] = (0.0, 0.0),
    corners: int = 0,
) -> tuple[Array, Orders]:
    """Every state with chosen orders; the first `corners` ones with all ends of the orders too."""
    ends = [(a, b, d) for a in start_s for b in switch_s for d in (0, 1)]
    if start_s[0] == start_s[1]:
        ends = ends[: len(ends) // 2]
    first = np.repeat(states[:, :corners], len(ends), axis=1)
    every = np.concatenate([first, states], axis=1)
    runs, tiled = every.shape[1], np.tile(np.array(ends).T, corners)
    start, switch, braking = (
        np.concatenate([fixed, free])
        for fixed, free in zip(
            tiled,
            (
                chance.uniform(*start_s, states.shape[1]),
                chance.uniform(*switch_s, states.shape[1]),
                chance.integers(0, 4, states.shape[1]),
            ),
            strict=True,
        )
    )
    reset = (chance.integers(0, 2, runs) == 1) & (start_s[1] > 0.0)
    curving: Ways = chance.integers(0, 5, (runs,))
    return every, Orders(start, reset, switch, braking.astype(int), curving)


def excess(tube: TubeAnswer, runs: Runs, *, step_s: float = STEP_S) -> Array:
    """Largest distance of the runs outside the tube in rows of step_s, per state: to the last row,
    and beyond it where that is a standstill."""
    lower, upper = tube.rows("lower", 7), tube.rows("upper", 7)
    stands = upper[-1, SPEED] <= 0.0
    worst = np.full(7, -np.inf)
    # An instant between two rows is in both.
    for side in (-1e-12, 1e-12):
        place = np.floor(runs.times_s / step_s + side).astype(int)
        row = np.clip(place, 0, tube.steps - 1)
        outside = np.maximum(
            lower[row].swapaxes(1, 2) - runs.states, runs.states - upper[row].swapaxes(1, 2)
        )
        known = np.broadcast_to(((place < tube.steps) | stands)[:, None, :], outside.shape)
        worst = np.maximum(worst, outside.max(axis=(0, 2), where=known, initial=-np.inf))
    # A car that stands stays where it is.
    row, last = place[-1], runs.states[-1]
    for k in range(tube.steps):
        standing = last[:, row <= k]
        if standing.size:
            outside = np.maximum(lower[k][:, None] - standing, standing - upper[k][:, None])
            worst = np.maximum(worst, outside.max(axis=1))
    return worst


_FURTHER = {
    # It steers as fast as it can when it comes to a standstill.
    "slow": Start((0.0, 1.0, 0.0, 0.7, 0.0, 0.0, 0.0), (0.0,) * 7, 0.7),
    # The integral of a motion before, which the next one does not begin with.
    "charged": Start((0.0, -0.3, 0.2, 0.3, 0.05, 0.6, 0.0), (0.1, 0.1, 0.02, 0.1, 0.05, 0.1, 0.0)),
}


@dataclass(frozen=True, slots=True)
class Scene:
    """A start on a path, its radii times `share`, and when what is commanded."""

    where: str
    start: str
    share: float = 1.0
    switch_s: tuple[float, float] = SWITCH_S
    start_s: tuple[float, float] = AT_ONCE
    brake_s: tuple[float, float] = BRAKE_S

    @property
    def box(self) -> Start:
        return (STARTS | _FURTHER)[self.start].scaled(self.share)

    def answer(self, kernel: DecisionKernel, **changed: Sequence[float]) -> Answer:
        orders = {"switch_s": self.switch_s, "start_s": self.start_s, "brake_s": self.brake_s}
        return kernel(query(paths()[self.where].table, self.box, **orders, **changed))


@functools.cache
def runs_of(scene: Scene, tube: str, corners: int = 32, vertices: int = 128) -> Runs:
    chance = np.random.default_rng(17)
    states = scene.box.states(30, chance)
    ends = states.shape[1] - 30
    states[:, :ends] = chance.permutation(states[:, :ends], axis=1)
    states = states[:, max(ends - vertices, 0) :]
    corners = min(corners, ends)
    window = scene.brake_s if tube == "brake" else scene.switch_s
    held = AT_ONCE if tube == "brake" else scene.start_s
    every, orders = sampled_orders(states, window, chance, start_s=held, corners=corners)
    return drive(scene.box, every, paths()[scene.where], orders, chance)
