"""Validated steps along a time grid, with the step and the order chosen on the way."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.reach.tube import TubeStatus
from workbench.reach.validated.algebra import Array
from workbench.reach.validated.composition import OutsideDomainError
from workbench.reach.validated.picard import NoEnclosureError
from workbench.reach.validated.sets import PolynomialSet
from workbench.reach.validated.step import Stepper, StepResult
from workbench.runtime.floats import float_mode_fault

# The last term of the series may add this share of the set's radius to a step.
_REMAINDER_SHARE = 1e-7
_REMAINDER_LEAST = 1e-14
_ORDERS = (4, 16)
# Halve the step where the motion within it makes up more than this share of an undecided driver's
# range, but not below 1/8 of the grid for this reason; a failed enclosure goes on to 2^-12 of it.
_MOTION_SHARE = 0.03
_FINEST_FOR_MOTION = 2**9
_UNITS = 2**12
# An interval whose dyadic parts are normal doubles, in s.
_SHORTEST = 2.0**-1000
# Steps in one grid interval: a proof that needs more is going wrong.
_MOST_STEPS = 2**9


@final
@dataclass(slots=True)
class Trace:
    """What a run has found: rows per grid interval, sets at the grid's instants.

    lower, upper, lower_at, upper_at: lists of (B, n). kinks: per interval the share of (step, cell)
    pairs in which each kink was decided, and whether it was linear in all of them, (2, n_kinks).
    """

    end: PolynomialSet
    kink_count: int
    lower_at: list[Array]
    upper_at: list[Array]
    lower: list[Array] = field(default_factory=list)
    upper: list[Array] = field(default_factory=list)
    kinks: list[Array] = field(default_factory=list)
    status: TubeStatus = TubeStatus.COMPLETE
    message: str = ""


def run(
    stepper: Stepper,
    start: PolynomialSet,
    times_s: Array,
    *,
    inside: Callable[[Array, Array], bool] = lambda _low, _high: True,
) -> Trace:
    """Advance over the grid `times_s` (s); ends early where a step fails or `inside` is false.

    Differences of neighbouring grid times must be doubles, as they are (Sterbenz) where none but
    the first time is more than twice the one before; steps are dyadic parts of them, normal doubles
    too, so that the sets hold at exactly these times. Raises InputError on other grids.
    """
    for before, after in itertools.pairwise(map(float, times_s)):
        exact = Fraction(after) - Fraction(before) == Fraction(after - before)
        if not (exact and after - before >= _SHORTEST):
            raise InputError(
                f"expected rising times with exact differences, got {before!r} and {after!r}"
            )
    fault = float_mode_fault()
    if fault is not None:
        raise InputError(f"expected IEEE-754 arithmetic rounded to nearest, but {fault}")
    low, high = start.hull()
    trace = Trace(start, stepper.kink_count, [low], [high])
    pace = _Pace()
    for k in range(len(times_s) - 1):
        failure = _interval(stepper, trace, float(times_s[k + 1] - times_s[k]), pace)
        if failure is not None:
            trace.status, reason = failure
            trace.message = f"{reason}, between t = {times_s[k]:.6g} and {times_s[k + 1]:.6g} s"
            break
        if not inside(trace.lower[-1], trace.upper[-1]):
            trace.status = TubeStatus.LEFT_REGION
            trace.message = f"the tube left the region before t = {times_s[k + 1]:.6g} s"
            _forget_last(trace)
            break
    return trace


@final
@dataclass(slots=True)
class _Pace:
    """Units of 2^-12 of a grid interval per step, and the order of the series."""

    units: int = _UNITS
    order: int = 8


def _interval(
    stepper: Stepper, trace: Trace, length_s: float, pace: _Pace
) -> tuple[TubeStatus, str] | None:
    results: list[StepResult] = []
    done, current = 0, trace.end
    while done < _UNITS:
        if len(results) == _MOST_STEPS:
            return TubeStatus.ENCLOSURE_FAILED, "the steps had to become too short"
        while pace.units > _UNITS - done or done % pace.units:
            pace.units //= 2
        result = _attempt(stepper, current, length_s, pace)
        if not isinstance(result, StepResult):
            return result
        done += pace.units
        current = result.end
        results.append(result)
        _adapt(pace, result)
    trace.end = current
    trace.lower.append(np.min([r.lower for r in results], axis=0))
    trace.upper.append(np.max([r.upper for r in results], axis=0))
    low, high = current.hull()
    trace.lower_at.append(low)
    trace.upper_at.append(high)
    decided = np.array([r.decided for r in results])
    trace.kinks.append(
        np.array([(decided != 0).mean(axis=(0, 1)), (decided == 2).all(axis=(0, 1))])
    )
    return None


def _attempt(
    stepper: Stepper, start: PolynomialSet, length_s: float, pace: _Pace
) -> StepResult | tuple[TubeStatus, str]:
    """One step, with shorter ones tried until it succeeds and is fine enough."""
    while True:
        h = length_s * (pace.units / _UNITS)
        try:
            result = stepper.step(start, h, pace.order)
        except (NoEnclosureError, OutsideDomainError) as failure:
            if pace.units == 1:
                return _ending(failure)
        else:
            if pace.units == 1 or _fine(result, start, pace):
                return result
        pace.units //= 2


def _fine(result: StepResult, start: PolynomialSet, pace: _Pace) -> bool:
    if pace.units > _FINEST_FOR_MOTION and np.any(result.motion > _MOTION_SHARE):
        return False
    low, high = start.hull()
    size = 0.5 * (high - low)
    allowed = _REMAINDER_SHARE * size + _REMAINDER_LEAST * (np.abs(low) + np.abs(high) + 1.0)
    excess = float(np.max(result.remainder / allowed))
    if excess > 1.0 and pace.order < _ORDERS[1]:
        pace.order = min(pace.order + 2, _ORDERS[1])
    elif excess < 1e-4 and pace.order > _ORDERS[0]:
        pace.order -= 1
    return excess <= 1e3


def _adapt(pace: _Pace, result: StepResult) -> None:
    """Try a step twice as long next where the motion allows it."""
    if pace.units < _UNITS and not np.any(result.motion > _MOTION_SHARE / 3.0):
        pace.units *= 2


def _ending(failure: Exception) -> tuple[TubeStatus, str]:
    if isinstance(failure, OutsideDomainError):
        return TubeStatus.SINGULAR, f"the set reaches the border of the domain of {failure}"
    return TubeStatus.ENCLOSURE_FAILED, str(failure)


def _forget_last(trace: Trace) -> None:
    for rows in (trace.lower, trace.upper, trace.lower_at, trace.upper_at, trace.kinks):
        rows.pop()
