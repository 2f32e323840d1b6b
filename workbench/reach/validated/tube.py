"""The validated tube: every number of it is proved."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import Ode, System
from workbench.reach.ranged_parameters import initial_box, with_ranged_parameters_as_states
from workbench.reach.tube import Array, KinkRecord, ReachTube
from workbench.reach.validated.run import Trace, run
from workbench.reach.validated.sets import PolynomialSet
from workbench.reach.validated.step import Stepper
from workbench.sets import Box

_MOST_ROWS = 10**6


@final
@dataclass(frozen=True, slots=True)
class ValidatedTube:
    """x(t) in P_t(d0) + zonotope, |d0| <= 1: Taylor series in time, polynomials in the initial set.

    step_s: grid of the tube's rows and longest step in s; the last interval is shorter where it
    does not divide the horizon. Steps and order of the series are chosen on the way. degree: of P
    in the initial deviation and in ranged parameters (2: sensitivity, its derivative, and a
    third-order remainder). region: the tube must stay in this box over some of the states, else it
    ends with LEFT_REGION; None for no such demand. each_row: called when a row is done.

    Each step solves the field's Taylor coefficients for all deviations at once, bounds the rest of
    the series over an a priori enclosure (Picard), and moves what was bounded before as generators
    by the flow's derivative, so that it does not wrap. Kinks enter by their best affine relaxation,
    disturbances that vary arbitrarily in time by their mean and first moment over the step.
    Rigor ENCLOSED: coefficients, remainders, enclosures, generators and the motion between instants
    are bounded with outward rounding, under IEEE-754 round to nearest. A proof that ends early is a
    value (`ReachTube.status`). Sources: Berz and Makino, Reliable Computing 4, 1998 (polynomials
    with remainder); Lohner 1987; Althoff, Stursberg, Buss, CDC 2008 (conservative linearisation).
    """

    step_s: float = 0.05
    degree: int = 2
    region: Box | None = None
    each_row: Callable[[], object] = field(default=lambda: None, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.step_s) and self.step_s > 0.0):
            raise InputError(f"expected a positive step_s in s, got {self.step_s!r}")
        if self.degree not in (1, 2, 3, 4):
            raise InputError(f"expected a degree from 1 to 4, got {self.degree!r}")

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """Run over [0, horizon_s] from `initial_set` (axes = state names)."""
        return self.tubes(system, initial_sets=(initial_set,), horizon_s=horizon_s)[0]

    def tubes(
        self, system: System, *, initial_sets: Sequence[Box], horizon_s: float
    ) -> tuple[ReachTube, ...]:
        """One tube for each initial set, run together; all end where the first proof ends."""
        if not initial_sets:
            raise InputError("expected at least one initial set, got none")
        original = system.ode
        unknown = set(self.region.names if self.region else ()) - set(original.names)
        if unknown:
            raise InputError(
                f"expected a region over states ({', '.join(original.names)}), got "
                f"{', '.join(sorted(unknown))}"
            )
        stepper = _stepper(original)
        ode = stepper.ode
        boxes = [initial_box(original, ode, box) for box in initial_sets]
        lower = np.array([box.lower for box in boxes])
        upper = np.array([box.upper for box in boxes])
        start = PolynomialSet.of_boxes(lower, upper, degree=self.degree)
        times = time_grid(horizon_s, self.step_s)
        inside = _Inside(self.region, original, self.each_row)
        trace = run(stepper, start, times, inside=inside)
        trace.lower_at[0], trace.upper_at[0] = lower, upper
        return tuple(_tube(trace, times, original, cell) for cell in range(len(boxes)))


@functools.lru_cache(maxsize=32)
def _stepper(original: Ode) -> Stepper:
    """What depends on the system alone; building it takes longer than a short tube."""
    return Stepper(with_ranged_parameters_as_states(original))


def time_grid(horizon_s: float, step_s: float) -> Array:
    """0, step, 2 step, ... and the horizon, in s."""
    if not (math.isfinite(horizon_s) and horizon_s > 0.0):
        raise InputError(f"expected a positive horizon_s in s, got {horizon_s!r}")
    if not horizon_s / step_s <= _MOST_ROWS:
        raise InputError(
            f"expected at most {_MOST_ROWS} steps, got a horizon_s of {horizon_s!r} in steps of "
            f"{step_s!r} s; use a longer step_s"
        )
    count = max(1, math.ceil(horizon_s / step_s - 1e-9))
    # A last step longer than the first would not be an exact difference.
    if count == 2 and horizon_s > 2.0 * step_s:
        count = 3
    return np.append(step_s * np.arange(count), horizon_s)


@final
@dataclass(frozen=True, slots=True)
class _Inside:
    """Whether rows (B, n) lie in the region, told to `each_row`."""

    region: Box | None
    ode: Ode
    each_row: Callable[[], object]

    def __call__(self, lower: Array, upper: Array) -> bool:
        self.each_row()
        if self.region is None:
            return True
        columns = [self.ode.names.index(name) for name in self.region.names]
        return bool(
            np.all(lower[:, columns] >= np.array(self.region.lower))
            and np.all(upper[:, columns] <= np.array(self.region.upper))
        )


def _tube(trace: Trace, times: Array, ode: Ode, cell: int) -> ReachTube:
    done, n = len(trace.lower), len(ode.states)

    def rows(values: list[Array]) -> Array:
        return np.array([value[cell, :n] for value in values]).reshape(len(values), n)

    kinks = np.array(trace.kinks).reshape(done, 2, trace.kink_count)
    return ReachTube(
        times=times[: done + 1],
        lower=rows(trace.lower),
        upper=rows(trace.upper),
        lower_at=rows(trace.lower_at),
        upper_at=rows(trace.upper_at),
        names=ode.names,
        status=trace.status,
        rigor=Rigor.ENCLOSED,
        message=trace.message,
        kinks=KinkRecord(kinks[:, 0], kinks[:, 1] == 1.0),
    )
