"""What the analysis commands compute and show in the same way: tubes, regions, distances, runs."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from workbench.cli.analysis_options import Subject
from workbench.cli.output import Progress
from workbench.errors import InputError
from workbench.models.system import Ode, System
from workbench.reach import Partitioned, ReachTube, ValidatedTube, compute_tube
from workbench.report.curves import SampledRuns, TubeCurves
from workbench.sensitivity import (
    Discrepancy,
    ProvedEnvelope,
)
from workbench.sensitivity.sampling import parameter_states, rollout, sample_initial_states
from workbench.sets import Box

Array = NDArray[np.float64]

_RUN_STEP_S = 0.02
_ERROR_RUNS = 256
_FINER = 4
# Instants of two grids that mean the same time differ by their rounding only.
_SAME_S = 1e-12


def tube_of(
    subject: Subject, *, horizon_s: float, step_s: float, parts: Mapping[str, int] | None = None
) -> ReachTube:
    """The subject's tube, with a progress bar; `parts` as `Partitioned` takes them."""
    cells = math.prod((parts or {}).values())
    rows = math.ceil(horizon_s / step_s)
    with Progress("tube" if cells == 1 else f"tube of {cells} cells", rows) as progress:
        method = ValidatedTube(step_s, each_row=progress.advance)
        return compute_tube(
            subject.system,
            initial_set=subject.initial_set,
            horizon_s=horizon_s,
            method=Partitioned(method, parts) if parts else method,
        )


def hull_of(tube: ReachTube) -> Box:
    """The smallest box that holds the whole tube. Raises InputError on a tube without a step."""
    if not len(tube.lower):
        raise InputError(
            f"expected a tube with at least one step, got none: {tube.message}; shorten the step "
            "or shrink the initial set"
        )
    rows = zip(tube.names, tube.lower.min(axis=0), tube.upper.max(axis=0), strict=True)
    return Box.from_intervals({name: (float(low), float(high)) for name, low, high in rows})


def first_exit(tube: ReachTube, region: Box) -> str:
    """The state and time at which the tube first may leave the region, in words; '' if never."""
    for k in range(len(tube.lower)):
        for name in region.names:
            low, high = region.interval(name)
            i = tube.names.index(name)
            if tube.lower[k, i] < low or tube.upper[k, i] > high:
                return f"{name} may leave [{low:g}, {high:g}] from {tube.times[k]:.3f} s on"
    return ""


def ending(tube: ReachTube) -> str:
    """How the tube ended, in one sentence."""
    end = f"{tube.times[-1]:.3f} s"
    if tube.complete:
        return f"tube: {tube.status.name}, {tube.rigor.name}, proved up to {end}"
    return f"tube: {tube.status.name}, {tube.rigor.name}, proved up to {end} only ({tube.message})"


def bounds_at(tube: ReachTube, t_s: float) -> tuple[Array, Array]:
    """Bounds (n,) at `t_s`: the instant's, else those of the step around it; NaN past the end."""
    k = int(np.searchsorted(tube.times, t_s + _SAME_S, side="right")) - 1
    if abs(tube.times[k] - t_s) <= _SAME_S:
        return tube.lower_at[k], tube.upper_at[k]
    if k >= len(tube.lower):
        nothing = np.full(len(tube.names), np.nan)
        return nothing, nothing
    return tube.lower[k], tube.upper[k]


def half_widths(tube: ReachTube, times_s: Array) -> Array:
    """Half widths (M, n) of the tube at `times_s` (M,), s."""
    pairs = [bounds_at(tube, t) for t in times_s.tolist()]
    return np.array([0.5 * (upper - lower) for lower, upper in pairs])


def distances_from(run: Array, tube: ReachTube, times_s: Array) -> Array:
    """Bounds (M, n) on the distance of the tube's trajectories from `run` (M, n) at `times_s`."""
    pairs = [bounds_at(tube, t) for t in times_s.tolist()]
    return np.array(
        [np.maximum(upper - x, x - lower) for (lower, upper), x in zip(pairs, run, strict=True)]
    )


def runs_at(
    system: System,
    states: Array,
    times_s: Array,
    *,
    inputs: tuple[Array | None, Array | None] = (None, None),
) -> Array:
    """Runs (N, M, n) from `states` (N, n) at the rising instants `times_s` >= 0.

    inputs: parameters (N, n_p) and disturbances (N, n_w), constant along each run; nominal if None.
    """
    found, last, now = [], states, 0.0
    for t in times_s.tolist():
        if t > now:
            step = (t - now) / math.ceil((t - now) / _RUN_STEP_S)
            last = rollout(
                system, last, horizon_s=t - now, step_s=step,
                parameters=inputs[0], disturbances=inputs[1],
            )[:, -1]  # fmt: skip
        found.append(last)
        now = t
    return np.stack(found, axis=1)


def integration_error(subject: Subject, *, horizon_s: float, step_s: float) -> Array:
    """Estimated error (M, n) of the distance of two Runge-Kutta runs at the step instants.

    Twice (two runs) twice (kinks make the order low) the largest change that a fourth of the step
    makes among the vertices and as many other states.
    """
    ordered = subject.initial_set.reordered(subject.system.ode.names)
    states = sample_initial_states(ordered, count=_ERROR_RUNS, seed=1)
    coarse, fine = (
        rollout(subject.system, states, horizon_s=horizon_s, step_s=step)
        for step in (step_s, step_s / _FINER)
    )
    with np.errstate(invalid="ignore"):  # runs of an unstable loop may leave the finite numbers
        change = np.abs(coarse - fine[:, ::_FINER]).max(axis=0)
    return np.where(np.isfinite(change), 4.0 * change, 0.0)


def curve_times(horizon_s: float) -> Array:
    """The instants at which curves are drawn."""
    return np.linspace(0.0, horizon_s, max(1, math.ceil(horizon_s / 0.05 - 1e-9)) + 1)


def centre_run(subject: Subject, times_s: Array) -> Array:
    """The run (M, n) from the middle of the initial set."""
    ordered = subject.initial_set.reordered(subject.system.ode.names)
    return np.asarray(runs_at(subject.system, np.array([ordered.center]), times_s)[0])


def sampled_runs(subject: Subject, *, horizon_s: float, count: int, seed: int) -> SampledRuns:
    """Runs from the initial set with constant parameters and disturbances from their ranges."""
    ode, times = subject.system.ode, curve_times(horizon_s)
    rng = np.random.default_rng(seed)
    states = rollout(
        subject.system,
        sample_initial_states(subject.initial_set.reordered(ode.names), count=count, seed=seed),
        horizon_s=horizon_s,
        step_s=horizon_s / (len(times) - 1),
        parameters=parameter_states(ode.parameters, count, rng),
        disturbances=parameter_states(ode.disturbances, count, rng),
    )
    return SampledRuns(times, states)


def tube_curves(tube: ReachTube, ode: Ode) -> TubeCurves:
    """The tube as the report takes it."""
    return TubeCurves(
        names=tube.names,
        units=tuple(state.unit for state in ode.states),
        times_s=tube.times,
        lower=tube.lower,
        upper=tube.upper,
        lower_at=tube.lower_at,
        upper_at=tube.upper_at,
        rigor=tube.rigor,
    )


def radii(bound: Discrepancy, subject: Subject, times_s: Array) -> Array:
    """The bound's half widths (M, n) from the radius of the initial set."""
    start = subject.initial_set.reordered(bound.names).radius
    return np.array([bound.radius(start, t) for t in times_s.tolist()])


def envelope_of(subject: Subject, tube: ReachTube, times_s: Array) -> ProvedEnvelope:
    """A complete tube as a bound about the run from the middle, for the instants `times_s`."""
    rows = distances_from(centre_run(subject, times_s), tube, times_s).tolist()
    by_time = dict(zip(times_s.tolist(), rows, strict=True))
    condition = "one of the two runs starts in the middle of the initial set"
    return ProvedEnvelope("validated tube", by_time.__getitem__, tube.rigor, condition)
