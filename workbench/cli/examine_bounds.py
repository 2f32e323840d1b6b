"""What `workbench examine` puts beside a learned bound: proofs from above and from below."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.cli.analysis_options import Subject
from workbench.cli.analysis_results import Array, bounds_at, ending, hull_of, tube_of
from workbench.cli.methods import LOCAL, REGION, TUBES
from workbench.cli.output import Progress, warn
from workbench.errors import InputError
from workbench.reach import ReachTube
from workbench.reach.inner.distance import point_runs
from workbench.reach.inner.extremes import SearchEffort
from workbench.reach.inner.hull import inner_hull
from workbench.reach.local import Reference
from workbench.reach.tube import TubeStatus
from workbench.reach.validated.tube import time_grid
from workbench.sensitivity import Discrepancy, Inputs, ProvedEnvelope, derive_discrepancy
from workbench.sensitivity.kinks import smooth_form
from workbench.sensitivity.sampling import instants, step_count

TUBE: Final = "validated tube"
_CELLS: Final = 256
_TUBE_STEP_S: Final = 0.02
# Instants, starts and rounds of the proof from below.
_INNER_INSTANTS: Final = 60
_INNER: Final = SearchEffort(starts=64, rounds=3, every=2, seed=1)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Beside:
    """tube: of all runs from the set; bounds: method -> bound; refusals: method -> why there is
    none; inner: instants (M,) and the distances (M, n) that runs reach for certain, if proved."""

    tube: ReachTube
    bounds: dict[str, Discrepancy | ProvedEnvelope]
    refusals: dict[str, str]
    inner: tuple[Array, Array] | None


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Middle:
    """Enclosure lower, upper (K+1, n) of the run from the middle at `times` (K+1,), s."""

    subject: Subject
    times: Array
    lower: Array
    upper: Array

    def envelope(self, name: str, tube: ReachTube) -> ProvedEnvelope:
        """A complete tube as a bound on the distance from the middle run.

        Where parameters have ranges, the run with the same ones as another is not the middle run
        but somewhere in the tube.
        """
        ends = [bounds_at(tube, t) for t in self.times.tolist()]
        low, high = (np.array(side) for side in zip(*ends, strict=True))
        if _ranged(self.subject):
            rows = high - low
        else:
            rows = np.maximum(high - self.lower, self.upper - low)
        # A difference of equal numbers is exact; other ones are rounded up.
        rows = np.where(rows > 0.0, np.nextafter(rows, np.inf), rows)
        rows = np.where(np.isnan(rows), np.inf, rows)
        by_time = dict(zip(self.times.tolist(), rows.tolist(), strict=True))
        condition = "one of the two runs starts in the middle of the initial set"
        return ProvedEnvelope(name, by_time.__getitem__, tube.rigor, condition)


def proved_beside(
    subject: Subject, *, horizon_s: float, step_s: float, methods: Sequence[str]
) -> Beside:
    """The validated tube, the chosen methods of `workbench derive`, and the proof from below."""
    # A whole number of tube steps between examined instants, so that each is a tube instant.
    fine_s = step_s / math.ceil(step_s / _TUBE_STEP_S)
    tube = tube_of(subject, horizon_s=horizon_s, step_s=fine_s)
    if not tube.complete:
        warn(f"{ending(tube)}; the proved bounds are left out")
        return Beside(tube, {}, {}, None)
    middle = _middle(subject, horizon_s=horizon_s, step_s=step_s)
    bounds: dict[str, Discrepancy | ProvedEnvelope] = {}
    refusals: dict[str, str] = {}
    reference: Reference | None = None
    with Progress("bounds", len(methods) + 1) as progress:
        for name in methods:
            try:
                if name in REGION:
                    bounds[name] = _over_region(subject, tube, name, horizon_s)
                elif name in LOCAL:
                    reference = reference or Reference.of(
                        subject.system, initial_set=subject.initial_set,
                        horizon_s=horizon_s, step_s=fine_s,
                    )  # fmt: skip
                    along = LOCAL[name](fine_s).along(reference).tube
                    bounds[name] = middle.envelope(name, along)
                else:
                    other = TUBES[name](fine_s).tube(
                        subject.system, initial_set=subject.initial_set, horizon_s=horizon_s
                    )
                    bounds[name] = middle.envelope(name, other)
            except InputError as error:
                refusals[name] = str(error)
            progress.advance()
        inner = _inner(subject, middle)
        progress.advance()
    bounds[TUBE] = middle.envelope(TUBE, tube)
    return Beside(tube, bounds, refusals, inner)


def _over_region(subject: Subject, tube: ReachTube, name: str, horizon_s: float) -> Discrepancy:
    kinked = smooth_form(subject.system.ode).kappa.numel() > 0
    return derive_discrepancy(
        subject.system,
        region=hull_of(tube),
        horizon_s=horizon_s,
        method=REGION[name](_CELLS, Inputs.SHARED, kinked),
    )


def _middle(subject: Subject, *, horizon_s: float, step_s: float) -> _Middle:
    ode = subject.system.ode
    centre = np.array([subject.initial_set.reordered(ode.names).center])
    grid = time_grid(horizon_s, horizon_s / step_count(horizon_s, step_s))
    nominal = [parameter.nominal for parameter in ode.parameters]
    runs = point_runs(subject.system, centre, nominal, grid)
    if runs.status is not TubeStatus.COMPLETE:
        raise InputError(
            f"the run from the middle cannot be enclosed: {runs.message}; shorten the horizon"
        )
    times = instants(horizon_s, step_s)
    return _Middle(subject, times, runs.lower[:, 0], runs.upper[:, 0])


def _ranged(subject: Subject) -> bool:
    return any(p.lower < p.upper for p in subject.system.ode.parameters)


def _inner(subject: Subject, middle: _Middle) -> tuple[Array, Array] | None:
    """Distances from the middle run that are reached for certain; None where this is not proved.

    The reached hull varies parameters and disturbances, which a pair of runs shares: with them it
    would prove nothing about pairs.
    """
    if _ranged(subject) or subject.system.ode.disturbances:
        return None
    steps = len(middle.times) - 1
    stride = next(
        each
        for each in range(1, steps + 1)
        if steps % each == 0 and steps // each <= _INNER_INSTANTS
    )
    horizon_s = float(middle.times[-1])
    hull = inner_hull(
        subject.system,
        initial_set=subject.initial_set,
        horizon_s=horizon_s,
        step_s=horizon_s / (steps // stride),
        effort=_INNER,
    )
    if not hull.complete:
        return None
    lower, upper = middle.lower[::stride], middle.upper[::stride]
    reached = np.maximum(hull.upper_at - upper, lower - hull.lower_at)
    return middle.times[::stride], np.maximum(np.nextafter(reached, -np.inf), 0.0)
