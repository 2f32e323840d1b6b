"""Many runs at once: initial states drawn from a box, and their Runge-Kutta trajectories."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from workbench.errors import InputError
from workbench.models.signals import Ranged
from workbench.models.system import Ode, System
from workbench.sensitivity.vectorised import Array, Index, Vectorised, columns
from workbench.sets.box import Box

# Points marched together: their arrays stay in the processor's cache.
_BLOCK = 4096
# With their slopes at every instant they are 8 n times as large.
_SLOPED = 1024
_MOST_VERTICES = 4096


def step_count(horizon_s: float, step_s: float) -> int:
    """Number of steps of `step_s` in `horizon_s`; InputError unless it is a whole number >= 1."""
    if not (0.0 < step_s <= horizon_s):
        raise InputError(
            f"expected 0 < step_s <= horizon_s, got step_s={step_s!r}, horizon_s={horizon_s!r}"
        )
    steps = round(horizon_s / step_s)
    if abs(steps * step_s - horizon_s) > 1e-9 * horizon_s:
        raise InputError(
            f"expected a horizon of whole steps, got {horizon_s!r} s in steps of {step_s!r} s; "
            f"choose step_s = {horizon_s / steps!r}"
        )
    return steps


def instants(horizon_s: float, step_s: float) -> Array:
    """The K+1 step instants 0, h, ..., horizon_s."""
    return np.linspace(0.0, horizon_s, step_count(horizon_s, step_s) + 1)


def rollout(
    system: System,
    initial_states: Array,
    *,
    horizon_s: float,
    step_s: float,
    parameters: Sequence[float] | Array | None = None,
    disturbances: Sequence[float] | Array | None = None,
) -> Array:
    """Trajectories by classical Runge-Kutta of order 4: array (N, K+1, n) for `initial_states` (N,
    n).

    parameters, disturbances: one value each, or one row per run (N, m); nominal when left out.
    Disturbances stay constant along a run. Results are floats with the method's truncation error
    (about 2e-8 on the benchmark loops at 0.05 s): Rigor SAMPLED. A run that leaves the finite
    numbers holds inf or NaN from there on.
    """
    ode = system.ode
    points = _checked_points(ode, initial_states)
    count = points.shape[1]
    p = columns(_nominal(ode.parameters) if parameters is None else parameters, count)
    w = columns(_nominal(ode.disturbances) if disturbances is None else disturbances, count)
    return march(Vectorised(ode.function()), points, (p, w), instants(horizon_s, step_s))


def march(field: Vectorised, points: Array, inputs: tuple[Array, Array], times: Array) -> Array:
    """Runge-Kutta steps between the evenly spaced `times` (K+1,) from `points` (n, N): (N, K+1, n).

    inputs: parameters and disturbances, (m, 1) or (m, N) each.
    """
    size, count = points.shape
    steps, h = len(times) - 1, float(times[-1]) / (len(times) - 1)
    result = np.empty((steps + 1, size, count))
    for block in _blocks(count):
        p, w = (a if a.shape[1] == 1 else np.ascontiguousarray(a[:, block]) for a in inputs)
        result[0, :, block] = points[:, block]
        state = points[:, block]
        for k in range(steps):
            state = _rk4(field, state, p, w, h)
            result[k + 1, :, block] = state
    return result.transpose(2, 0, 1)


def _rk4(field: Vectorised, x: Array, p: Array, w: Array, h: float) -> Array:
    with np.errstate(all="ignore"):
        k1 = field(x, p, w)[0]
        k2 = field(x + (0.5 * h) * k1, p, w)[0]
        k3 = field(x + (0.5 * h) * k2, p, w)[0]
        k4 = field(x + h * k3, p, w)[0]
        return x + (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """Runs of a system with their sensitivities to the initial state."""

    system: System
    horizon_s: float
    step_s: float

    def runs(self, initial_states: Array, parameters: Array) -> Array:
        """States (N, K+1, n) of the runs from `initial_states` (N, n), a row of parameters each."""
        return rollout(
            self.system,
            initial_states,
            horizon_s=self.horizon_s,
            step_s=self.step_s,
            parameters=parameters,
        )

    def slopes(
        self, initial_states: Array, parameters: Array, coordinate: Index, instant: Index
    ) -> Array:
        """d state[coordinate] at the step `instant` / d initial state (N, n), row by row."""
        found = np.empty(np.shape(initial_states))
        for block in _blocks(len(found), _SLOPED):
            _, slopes = self.with_sensitivity(initial_states[block], parameters[block])
            rows = np.arange(len(slopes))
            found[block] = slopes[rows, instant[block], coordinate[block]]
        return found

    def with_sensitivity(self, initial_states: Array, parameters: Array) -> tuple[Array, Array]:
        """States (N, K+1, n) and d state / d initial state (N, K+1, n, n) of the Runge-Kutta map.

        Differentiates each Runge-Kutta stage with CasADi's Jacobian of the field. At a kink that
        Jacobian is undecided and counts as zero: good for a search direction, never for a proof.
        """
        ode = self.system.ode
        size = len(ode.states)
        both = Vectorised(
            ca.Function(
                "both",
                [ode.x, ode.p, ode.w],
                [ode.field, ca.vec(ca.densify(ca.jacobian(ode.field, ode.x)))],
            )
        )
        x = _checked_points(ode, initial_states)
        count = x.shape[1]
        p, w = columns(parameters, count), columns(_nominal(ode.disturbances), count)
        steps = step_count(self.horizon_s, self.step_s)
        h = self.horizon_s / steps
        states = np.empty((count, steps + 1, size))
        slopes = np.empty((count, steps + 1, size, size))
        s = np.broadcast_to(np.eye(size), (count, size, size))
        states[:, 0], slopes[:, 0] = x.T, s
        for k in range(steps):
            x, s = _rk4_with_slope(both, x, s, (p, w), h)
            states[:, k + 1], slopes[:, k + 1] = x.T, s
        return states, slopes


def _rk4_with_slope(
    both: Vectorised, x: Array, s: Array, inputs: tuple[Array, Array], h: float
) -> tuple[Array, Array]:
    size = x.shape[0]

    def rate(x: Array, s: Array) -> tuple[Array, Array]:
        field, slope = both(x, *inputs)
        matrix = np.nan_to_num(slope).reshape(size, size, -1).transpose(2, 1, 0)
        return field, matrix @ s

    with np.errstate(all="ignore"):
        k1, l1 = rate(x, s)
        k2, l2 = rate(x + 0.5 * h * k1, s + 0.5 * h * l1)
        k3, l3 = rate(x + 0.5 * h * k2, s + 0.5 * h * l2)
        k4, l4 = rate(x + h * k3, s + h * l3)
        return x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4), s + h / 6.0 * (l1 + 2.0 * (l2 + l3) + l4)


def sample_initial_states(box: Box, *, count: int, seed: int) -> Array:
    """Initial states (N, n) that press on the box: all vertices, points on faces, points inside.

    Vertices come first (at most half of `count`; a random choice if there are more), then half of
    the rest on faces of every dimension, the others uniform in the box. N = count. Same seed, same
    states.
    """
    if count < 2:
        raise InputError(f"expected at least 2 initial states, got {count}")
    rng = np.random.default_rng(seed)
    vertices = vertex_states(box, most=count // 2, rng=rng)
    faces = (count - len(vertices)) // 2
    inside = count - len(vertices) - faces
    return np.concatenate(
        [vertices, face_states(box, faces, rng), uniform_states(box, inside, rng)]
    )


def uniform_states(box: Box, count: int, rng: np.random.Generator) -> Array:
    """`count` independent states, uniform on the box."""
    share = rng.random((count, len(box.names)))
    lower, upper = np.array(box.lower), np.array(box.upper)
    return np.asarray(np.clip(lower + share * (upper - lower), lower, upper))


def face_states(box: Box, count: int, rng: np.random.Generator) -> Array:
    """States uniform on random faces: a random non-empty set of axes sits at its end points."""
    states = uniform_states(box, count, rng)
    spread = np.flatnonzero(np.array(box.upper) > np.array(box.lower))
    if not len(spread) or not count:
        return states
    pinned = rng.random((count, len(spread))) < rng.random((count, 1))
    pinned[np.arange(count), rng.integers(len(spread), size=count)] = True
    ends = np.where(
        rng.random((count, len(spread))) < 0.5,
        np.array(box.lower)[spread],
        np.array(box.upper)[spread],
    )
    states[:, spread] = np.where(pinned, ends, states[:, spread])
    return states


def vertex_states(box: Box, *, most: int, rng: np.random.Generator) -> Array:
    """All vertices of the box, or `most` random ones where there are more."""
    lower, upper = np.array(box.lower), np.array(box.upper)
    limit = min(most, _MOST_VERTICES)
    if 2 ** int(np.sum(upper > lower)) <= limit:
        return np.array(list(itertools.islice(box.vertices(), limit)))
    return np.where(rng.random((limit, len(lower))) < 0.5, lower, upper)


def parameter_states(ranges: Sequence[Ranged], count: int, rng: np.random.Generator) -> Array:
    """`count` independent rows, uniform on the ranges (known constants stay exact)."""
    lower, upper = (np.array([getattr(r, end) for r in ranges]) for end in ("lower", "upper"))
    share = rng.random((count, len(ranges)))
    return np.asarray(np.clip(lower + share * (upper - lower), lower, upper))


def ordered_box(ode: Ode, box: Box, what: str) -> Box:
    """`box` with its axes in the order of the states; InputError when the names differ."""
    if set(box.names) != set(ode.names):
        raise InputError(
            f"expected the {what} to name the states {ode.names}, got {box.names}; "
            "give every state an interval (a point interval where it is known)"
        )
    return box.reordered(ode.names)


def _nominal(ranges: Sequence[Ranged]) -> list[float]:
    return [ranged.nominal for ranged in ranges]


def _checked_points(ode: Ode, states: Array) -> Array:
    points = np.asarray(states, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != len(ode.states) or not len(points):
        raise InputError(
            f"expected initial states of shape (N, {len(ode.states)}) for {ode.names}, "
            f"got {points.shape}"
        )
    return np.ascontiguousarray(points.T)


def _blocks(count: int, most: int = _BLOCK) -> Iterator[slice]:
    return (slice(start, min(start + most, count)) for start in range(0, count, most))
