"""Validated trajectories of chosen points: one thin tube per choice, many at once."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import numpy as np
import numpy.typing as npt

from workbench.errors import InputError
from workbench.models.system import Ode
from workbench.reach.inner.choices import Choices
from workbench.reach.ranged_parameters import with_inputs_as_states
from workbench.reach.tube import Array, TubeStatus
from workbench.reach.validated.algebra import upward
from workbench.reach.validated.composition import OutsideDomainError
from workbench.reach.validated.picard import NoEnclosureError
from workbench.reach.validated.sets import PolynomialSet
from workbench.reach.validated.step import Stepper, StepResult
from workbench.runtime.floats import float_mode_fault
from workbench.sensitivity.vectorised import Index

# Orders of the series for whole grid intervals, and for a quarter and less.
_ORDERS = (6, 4)
# A step is halved where it adds more than this to a state, times 1 + |state|; a step through a kink
# adds the gap of its relaxation, which falls with the square of the step.
# Below 2^-4 of a grid interval steps are halved only to succeed, down to 2^-12.
_TOLERANCE = 1e-8
_UNITS = 2**12
_LEAST_UNITS = 2**8
# Generators per state beyond which the smallest are joined; they are all tiny here.
_MOST_GENERATORS = 12
# Batches are filled up to a power of two, because the inclusion functions are built per size.
_LEAST_BATCH = 16


@final
@dataclass(frozen=True, slots=True, eq=False)
class PointRuns:
    """times (K+1); lower, upper (K+1, N, n): boxes that contain each trajectory at the instants.

    status, message: as of a `ReachTube`; on failure `times` ends where the first proof ends.
    """

    times: Array
    lower: Array
    upper: Array
    status: TubeStatus
    message: str


def validated_runs(ode: Ode, choices: Choices, times_s: Array) -> PointRuns:
    """Enclose the trajectory of every choice at the grid `times_s` (K+1,), s.

    Rigor ENCLOSED: each choice is taken as exactly its numbers; steps are those of the validated
    tube, halved per trajectory where a kink is met. A proof that ends early is a value. InputError
    on a grid whose differences are not doubles.
    """
    n = len(ode.states)
    stepper = Stepper(with_inputs_as_states(ode))
    _require_exact(times_s)
    points = np.concatenate(
        [choices.states, choices.constants, np.zeros_like(choices.signals[:, 0])], axis=1
    )
    current = PolynomialSet.of_boxes(points, points, degree=1)
    ends = [(choices.states, choices.states)]
    status, message = TubeStatus.COMPLETE, ""
    for k in range(len(times_s) - 1):
        current = _holding(_with_few_generators(current), choices.signals[:, k])
        try:
            current = _advanced(stepper, current, float(times_s[k + 1] - times_s[k]))
        except (NoEnclosureError, OutsideDomainError) as failure:
            status = TubeStatus.ENCLOSURE_FAILED
            if isinstance(failure, OutsideDomainError):
                status = TubeStatus.SINGULAR
            message = f"{failure}, between t = {times_s[k]:.6g} and {times_s[k + 1]:.6g} s"
            break
        low, high = current.hull()
        ends.append((low[:, :n], high[:, :n]))
    return PointRuns(
        times_s[: len(ends)], np.array([low for low, _ in ends]),
        np.array([high for _, high in ends]), status, message,
    )  # fmt: skip


def _require_exact(times_s: Array) -> None:
    """Steps are dyadic parts of differences of grid times, which must therefore be doubles."""
    fault = float_mode_fault()
    if fault is not None:
        raise InputError(f"expected IEEE-754 arithmetic rounded to nearest, but {fault}")
    for before, after in itertools.pairwise(times_s.tolist()):
        if Fraction(after) - Fraction(before) != Fraction(after - before) or not before < after:
            raise InputError(
                f"expected rising times with exact differences, got {before!r} and {after!r}; "
                "take multiples of one step"
            )


def _holding(current: PolynomialSet, signals: Array) -> PolynomialSet:
    """The same sets with the last states at exactly `signals` (N, n_w)."""
    first = current.coef.shape[1] - signals.shape[1]
    coef, generators = current.coef.copy(), current.generators.copy()
    coef[:, first:], generators[:, first:] = 0.0, 0.0
    coef[:, first:, 0] = signals
    return PolynomialSet(current.algebra, coef, generators)


def _advanced(stepper: Stepper, sets: PolynomialSet, length_s: float) -> PolynomialSet:
    """The sets after a grid interval; each goes on by its own step, a dyadic part of the interval.

    Trajectories that want the same step go together, wherever they are in the interval: with the
    inputs held, the equation does not depend on time.
    """
    done = np.zeros(sets.batch, dtype=int)
    units = np.full(sets.batch, _UNITS)
    while np.any(done < _UNITS):
        going = units[done < _UNITS]
        chosen = int(np.argmax(np.bincount(going)))
        rows = np.flatnonzero((done < _UNITS) & (units == chosen))
        try:
            h = length_s * (chosen / _UNITS)
            order = _ORDERS[chosen <= _UNITS // 4]
            result = stepper.step(_filled(_rows(sets, rows)), h, order)
        except (NoEnclosureError, OutsideDomainError):
            if chosen == 1:
                raise
            units[rows] //= 2
            continue
        end = _rows(result.end, np.arange(len(rows)))
        coarse = _coarse(result, _rows(sets, rows), end) & (chosen > _LEAST_UNITS)
        units[rows[coarse]] //= 2
        passed = np.flatnonzero(~coarse)
        sets = _merged(sets, rows[passed], _rows(end, passed))
        done[rows[passed]] += chosen
        # The longest dyadic step that starts where this one has ended.
        units[rows[passed]] = done[rows[passed]] & -done[rows[passed]]
    return sets


def _coarse(result: StepResult, start: PolynomialSet, end: PolynomialSet) -> npt.NDArray[np.bool_]:
    """Which steps should be halved."""
    count = start.batch
    size = 1.0 + np.abs(start.coef[:, :, 0])
    undecided = (result.decided[:count] == 0).any(axis=1)
    grown = np.any(end.spread() - start.spread() > _TOLERANCE * size, axis=1)
    rough = np.any(result.remainder[:count] > _TOLERANCE * size, axis=1)
    return np.asarray((undecided & grown) | rough)


def _filled(sets: PolynomialSet) -> PolynomialSet:
    """The batch with its first set repeated up to a power of two."""
    size = max(_LEAST_BATCH, 1 << (sets.batch - 1).bit_length())
    return _rows(sets, np.arange(size) * (np.arange(size) < sets.batch))


def _rows(sets: PolynomialSet, rows: Index) -> PolynomialSet:
    return PolynomialSet(sets.algebra, sets.coef[rows], sets.generators[rows])


def _merged(sets: PolynomialSet, rows: Index, others: PolynomialSet) -> PolynomialSet:
    """`sets` with `rows` replaced by `others`."""
    batch, n, mine = sets.generators.shape
    generators = np.zeros((batch, n, max(mine, others.generators.shape[2])))
    generators[:, :, :mine] = sets.generators
    generators[rows] = 0.0
    generators[rows, :, : others.generators.shape[2]] = others.generators
    coef = sets.coef.copy()
    coef[rows] = others.coef
    return PolynomialSet(sets.algebra, coef, generators)


def _with_few_generators(sets: PolynomialSet) -> PolynomialSet:
    """The same or larger sets with the smallest generators of each joined into a box."""
    batch, n, count = sets.generators.shape
    if count <= _MOST_GENERATORS * n:
        return sets
    size = np.abs(sets.generators)
    scale = np.maximum(size.sum(axis=2, keepdims=True), 1e-300)
    order = np.argsort((size / scale).max(axis=1), axis=1)[:, None, :]
    ordered = np.take_along_axis(sets.generators, order, axis=2)
    kept = _MOST_GENERATORS * n // 2
    box = np.zeros((batch, n, n))
    joined = upward(np.abs(ordered[:, :, : count - kept]).sum(axis=2))
    box[:, np.arange(n), np.arange(n)] = joined
    generators = np.concatenate([ordered[:, :, count - kept :], box], axis=2)
    return PolynomialSet(sets.algebra, sets.coef, generators)
