"""The loop that all local bounds share: enclose a step, bound the Jacobian, advance the bound."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar, final

import numpy as np

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import System
from workbench.reach.local.mean_jacobian import mean_jacobian
from workbench.reach.local.reference import Reference
from workbench.reach.tube import Array, ReachTube, TubeStatus
from workbench.reach.validated.bounds import Range
from workbench.reach.validated.picard import NoEnclosureError, enclosure
from workbench.sets import Box

# The first pass bounds the Jacobian over the Picard box, the next over what the first has proved.
_PASSES = 2


@final
@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """What holds for e = x - x* during [0, length_s]: e' = M(t) e + d(t).

    lower <= M(t) <= upper (n, n); |d_i(t)| <= felt_i (n), what other parameters and disturbances
    than the reference's add to the rates; index counts the steps.
    """

    index: int
    length_s: float
    lower: Array
    upper: Array
    felt: Array

    @property
    def magnitude(self) -> Array:
        """Metzler majorant (n, n): diagonal sup M_ii, elsewhere sup |M_ij|."""
        bound = np.maximum(np.abs(self.lower), np.abs(self.upper))
        np.fill_diagonal(bound, np.diag(self.upper))
        return bound


State = TypeVar("State")


class Bound(Protocol[State]):
    """A set of distances e that is advanced step by step."""

    def start(self, radius: Array) -> State:
        """A set that holds every |e_i| <= radius_i."""

    def advance(self, state: State, step: Step) -> tuple[State, Array]:
        """A set that holds e at the end of the step, and half widths (n,) for all of the step."""

    def half_widths(self, state: State) -> Array:
        """Bounds (n,) on |e_i| over the set."""

    def condition(self, state: State) -> float:
        """Condition number of the metric in units of the likely spread; NaN where there is none."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class LocalRun:
    """A tube, and the condition number (K+1,) of the metric at its instants."""

    tube: ReachTube
    condition: Array


class LocalMethod(Protocol):
    """A `TubeMethod` that can work about a trajectory that is known already."""

    @property
    def step_s(self) -> float:
        """Length of a step in s."""

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """A tube from `initial_set` (axes = state names) over [0, horizon_s]."""

    def along(self, reference: Reference) -> LocalRun:
        """The tube about `reference`, on its time grid."""


def tube_along(
    method: LocalMethod, system: System, *, initial_set: Box, horizon_s: float
) -> ReachTube:
    """The tube of `method` about the enclosed trajectory from the middle of `initial_set`."""
    reference = Reference.of(
        system, initial_set=initial_set, horizon_s=horizon_s, step_s=method.step_s
    )
    return method.along(reference).tube


def require_step(step_s: float) -> None:
    """Raise InputError unless `step_s` is a time that steps can have."""
    if not (math.isfinite(step_s) and step_s > 0.0):
        raise InputError(f"expected a positive step_s in s, got {step_s!r}")


def run_along(reference: Reference, bound: Bound[State]) -> LocalRun:
    """x*(t) + {e in the bound's set}, intersected with a priori boxes.

    Every step: a box that no trajectory from the current box leaves (Picard); the mean Jacobian
    between it and the enclosed x*; the bound's own step; once more over the smaller box that this
    has proved. The tube ends with the reference, or where no enclosure is found or a number
    overflows. Rigor ENCLOSED if the bound's steps are.
    """
    rows = _Rows(reference)
    state = bound.start(reference.radius[: reference.size])
    rows.condition.append(bound.condition(state))
    message = ""
    for k in range(len(reference.tube.times) - 1):
        found = _step(reference, bound, state, k, rows.box)
        if isinstance(found, str):
            message = f"{found}, between t = {reference.tube.times[k]:.6g} and "
            message += f"{reference.tube.times[k + 1]:.6g} s"
            break
        state, swept = found
        rows.add(swept, bound.half_widths(state), bound.condition(state))
    return rows.run(message)


def _step(
    reference: Reference, bound: Bound[State], state: State, k: int, box: Range
) -> tuple[State, Range] | str:
    """The state after step k and the box that is not left during it; or what failed."""
    tube, n = reference.tube, reference.size
    length_s = float(tube.times[k + 1] - tube.times[k])
    try:
        found, _ = enclosure(reference.with_inputs(box), reference.seen.field_range, length_s)
    except NoEnclosureError as failure:
        return str(failure)
    swept = found[0][0, :n], found[1][0, :n]
    for _ in range(_PASSES):
        step = seen_step(reference, k, swept)
        if step is None:
            return "the Jacobian could not be bounded"
        with np.errstate(all="ignore"):
            after, during = bound.advance(state, step)
            if not np.isfinite([during, bound.half_widths(after)]).all():
                return "the bound left the range of numbers"
        around = _around(tube.lower[k, :n], tube.upper[k, :n], during)
        swept = np.maximum(swept[0], around[0]), np.minimum(swept[1], around[1])
    return after, swept


def seen_step(reference: Reference, k: int, swept: Range) -> Step | None:
    """What holds for e in step k while x stays in the box `swept`; None where nothing does."""
    tube, n = reference.tube, reference.size
    low, high = reference.with_inputs(swept)
    near = np.maximum(tube.lower[k], low), np.minimum(tube.upper[k], high)
    matrix = mean_jacobian(reference.seen.jacobian, near=near, box=(low, high))
    if matrix is None:
        return None
    lower, upper = (end[:n] for end in matrix)
    felt = _felt(lower[:, n:], upper[:, n:], reference.radius[n:])
    return Step(k, float(tube.times[k + 1] - tube.times[k]), lower[:, :n], upper[:, :n], felt)


def _felt(lower: Array, upper: Array, radius: Array) -> Array:
    """Bounds (n,) on |sum_j M_ij (q_j - q*_j)|, rounded up."""
    total = np.zeros(len(lower))
    for j, each in enumerate(radius):
        term = np.nextafter(np.maximum(np.abs(lower[:, j]), np.abs(upper[:, j])) * each, np.inf)
        some = (lower[:, j] != 0.0) | (upper[:, j] != 0.0)
        total = np.where(some, np.nextafter(total + term, np.inf), total)
    return total


def _around(lower: Array, upper: Array, half_widths: Array) -> Range:
    return (
        np.nextafter(lower - half_widths, -np.inf),
        np.nextafter(upper + half_widths, np.inf),
    )


@final
class _Rows:
    """The boxes found so far; `box` is the current one."""

    def __init__(self, reference: Reference) -> None:
        n = reference.size
        self._reference = reference
        self.box: Range = reference.lower[:n], reference.upper[:n]
        self._at, self._during = [self.box], list[Range]()
        self.condition: list[float] = []

    def add(self, swept: Range, half_widths: Array, condition: float) -> None:
        n, k = self._reference.size, len(self._at)
        tube = self._reference.tube
        low, high = _around(tube.lower_at[k, :n], tube.upper_at[k, :n], half_widths)
        self.box = np.maximum(low, swept[0]), np.minimum(high, swept[1])
        self._at.append(self.box)
        self._during.append(swept)
        self.condition.append(condition)

    def run(self, message: str) -> LocalRun:
        reference, done, n = self._reference, len(self._during), self._reference.size
        failed = TubeStatus.ENCLOSURE_FAILED if message else reference.tube.status
        tube = ReachTube(
            times=reference.tube.times[: done + 1],
            lower=np.array([low for low, _ in self._during]).reshape(done, n),
            upper=np.array([high for _, high in self._during]).reshape(done, n),
            lower_at=np.array([low for low, _ in self._at]),
            upper_at=np.array([high for _, high in self._at]),
            names=reference.system.ode.names,
            status=failed,
            rigor=Rigor.ENCLOSED,
            message=message or reference.tube.message,
        )
        return LocalRun(tube, np.array(self.condition))
