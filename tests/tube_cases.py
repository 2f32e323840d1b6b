"""Systems, dense reference trajectories and the containment check that tube tests share."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
import numpy.typing as npt
from hypothesis import strategies as st

from workbench.bench import escaping
from workbench.controllers import PathFollowing, SpeedPid, SteeringPid, Track
from workbench.models import ClosedLoop, Ode, PlaneBicycle, Ranged, System, system_from_casadi
from workbench.models.benchmarks import PLANE_STATES
from workbench.reach import ReachTube, ValidatedTube, compute_tube
from workbench.sensitivity.ascent import gradient_states
from workbench.sensitivity.sampling import sample_initial_states
from workbench.sensitivity.vectorised import Vectorised
from workbench.sets import Box

Array = npt.NDArray[np.float64]
REFERENCE_ERROR = 1e-9


def box(**intervals: tuple[float, float]) -> Box:
    return Box.from_intervals(intervals)


def system_of(field: Callable[..., Sequence[ca.SX]], *names: str) -> Ode:
    """The system whose field is `field(*states)`."""
    x = ca.SX.sym("x", len(names))
    return system_from_casadi(x, ca.vertcat(*field(*ca.vertsplit(x))), names)


def disturbed(
    field: Callable[[ca.SX, ca.SX, ca.SX], Sequence[ca.SX]],
    names: tuple[str, ...],
    *,
    disturbances: tuple[Ranged, ...] = (),
    parameters: tuple[Ranged, ...] = (),
) -> Ode:
    """The system whose field is `field(x, p, w)`."""
    x, p, w = (
        ca.SX.sym(name, count)
        for name, count in (("x", len(names)), ("p", len(parameters)), ("w", len(disturbances)))
    )
    plain = system_from_casadi(x, ca.SX.zeros(len(names)), names)
    rows = ca.vertcat(*field(x, p, w))
    return Ode("disturbed", plain.states, parameters, disturbances, x, p, w, rows)


def tube_of(system: Ode, initial_set: Box, horizon_s: float, step_s: float = 0.05) -> ReachTube:
    method = ValidatedTube(step_s)
    return compute_tube(system, initial_set=initial_set, horizon_s=horizon_s, method=method)


def starts(initial_set: Box, count: int = 9) -> Array:
    """A grid over the set, end points included."""
    ends = zip(initial_set.lower, initial_set.upper, strict=True)
    axes = [np.linspace(low, high, count) for low, high in ends]
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes)], axis=1)


def dense_times(tube: ReachTube, per_step: int = 10) -> Array:
    """All instants of the tube and `per_step` - 1 times between each two."""
    segments = itertools.pairwise(tube.times)
    parts = [np.linspace(start, end, per_step + 1)[1:] for start, end in segments]
    return np.concatenate([tube.times[:1], *parts])


def march(
    system: System,
    states: Array,
    times: Array,
    *,
    parameters: Array | None = None,
    disturbances: Array | None = None,
) -> Array:
    """Runge-Kutta runs (N, m, n) from `states` (N, n), one step between any two of `times` (m,).

    parameters (N, n_p); disturbances (N, m - 1, n_w), held from each time to the next.
    """
    ode = system.ode
    field = Vectorised(ode.function())
    p = np.array([ode.parameter_values()]) if parameters is None else parameters
    w = (
        np.array([[[d.nominal for d in ode.disturbances]]])
        if disturbances is None
        else disturbances
    )
    x, rows = np.array(states, dtype=float).T, [np.array(states, dtype=float)]
    with np.errstate(all="ignore"):
        for k, h in enumerate(np.diff(times)):
            held = w[:, min(k, w.shape[1] - 1)].T

            def rate(y: Array, held: Array = held) -> Array:
                return field(y, p.T, held)[0]

            k1 = rate(x)
            k2 = rate(x + h / 2 * k1)
            k3 = rate(x + h / 2 * k2)
            k4 = rate(x + h * k3)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            rows.append(x.T)
    return np.stack(rows, axis=1)


def pressing_states(system: System, initial_set: Box, tube: ReachTube, *, count: int) -> Array:
    """Vertices, faces, interior, and states that gradient ascent chose."""
    ordered = initial_set.reordered(system.ode.names)
    sampled = sample_initial_states(ordered, count=count, seed=7)
    horizon_s = float(tube.times[-1])
    chosen = gradient_states(
        system, ordered, horizon_s=horizon_s, step_s=horizon_s / 10, every=3, seed=7
    )
    return np.concatenate([sampled, chosen])


def assert_contains(
    tube: ReachTube, times: Array, runs: Array, allowance: float = REFERENCE_ERROR
) -> None:
    """Every run lies in the tube at all `times` up to where its proof ends."""
    kept = times <= tube.times[-1] + 1e-12
    assert np.isfinite(runs[:, kept]).all()
    outside = escaping(tube, times[kept], runs[:, kept], allowance=allowance)
    if outside.any():
        run, k = np.argwhere(outside)[0]
        raise AssertionError(f"run {run} is outside at t = {times[k]}: {runs[run, k]}")


def escapes(tube: ReachTube, times: Array, runs: Array) -> int:
    """Number of runs that leave the tube."""
    return int(escaping(tube, times, runs, allowance=REFERENCE_ERROR).any(axis=1).sum())


def _between(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False).map(lambda value: round(value, 6))


@st.composite
def closed_loops(draw: st.DrawFn, *, limited: bool) -> ClosedLoop:
    """The plane bicycle under random gains, with or without limits that saturate."""
    steering = SteeringPid(
        proportional=draw(_between(0.2, 1.0)),
        integral=draw(_between(0.0, 0.1)),
        derivative=draw(_between(0.4, 1.5)),
        look_ahead_m=draw(_between(0.0, 3.0)),
        rate_limit_radps=draw(_between(0.05, 0.3)) if limited else None,
    )
    speed = SpeedPid(
        proportional=draw(_between(0.4, 1.5)),
        integral=draw(_between(0.0, 0.2)),
        accel_min_mps2=-draw(_between(0.1, 2.0)) if limited else None,
        accel_max_mps2=draw(_between(0.1, 1.0)) if limited else None,
    )
    wheelbase_m = draw(_between(1.2, 3.0))
    limit = draw(_between(0.1, 0.6)) if limited else None
    reference = draw(_between(1.0, 5.0))
    return ClosedLoop(
        PlaneBicycle(wheelbase_m, limit), PathFollowing(steering, speed), Track(reference)
    )


@st.composite
def vehicle_sets(draw: st.DrawFn, *, points: bool) -> Box:
    """Initial sets of the plane loop up to 0.25 m; `points` allows axes without width."""
    center = [0.0, *(draw(_between(-r, r)) for r in (0.6, 0.1, 0.0, 0.3, 0.2, 0.2))]
    center[3] = draw(_between(1.0, 4.0))
    largest = (0.25, 0.25, 0.03, 0.25, 0.06, 0.05, 0.05)
    widths = [_between(r / 50, r) for r in largest]
    radius = [draw(st.just(0.0) | width if points else width) for width in widths]
    return Box.around(
        dict(zip(PLANE_STATES, center, strict=True)),
        radius=dict(zip(PLANE_STATES, radius, strict=True)),
    )
