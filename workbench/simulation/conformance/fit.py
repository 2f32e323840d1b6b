"""The least bounds whose tubes contain measured motion: a linear program, then real tubes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, final

import cvxpy as cp
import numpy as np

from workbench.errors import InputError
from workbench.models.vehicle_sections import Uncertainty
from workbench.simulation.conformance.enclosing import Enclosed, enclose
from workbench.simulation.conformance.first_order import FirstOrder, first_order
from workbench.simulation.conformance.windows import Array, Measured, MotionModel

Advance = Callable[[int], None]
"""Told of so many stages that are done, for who waits."""

INFLATION_STEP: Final = 1.02
_MOST_STEPS: Final = 150
_NOTHING: Final = 1e-6
# A solver's tolerance must not decide which windows touch the bounds.
_TOUCHES: Final = 1e-5
# Of the largest cost: what costs next to nothing would come out anywhere.
_LEAST_COST: Final = 1e-6


@final
class NoFitError(InputError):
    """No bounds within the limits contain the windows to first order."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class LinearFit:
    """The program's answer.

    bounds (p,): in the order of the model's `fitted`; left_out: places of the windows that need not
    be contained; outliers: so many might have been left out; deciding: places of the windows whose
    constraints had a multiplier at any time.
    """

    bounds: Array
    left_out: tuple[int, ...]
    outliers: int
    deciding: tuple[int, ...]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Bounds whose real tubes contain the training windows.

    linear: the first-order answer; inflation: the least power of `INFLATION_STEP` times its bounds
    that suffices; deciding: recording whose window needed the last step (None: no step);
    contained: whether the real tubes contain every window that was not left out.
    """

    linear: LinearFit
    inflation: float
    deciding: str | None
    uncertainty: Uncertainty
    enclosed: Enclosed
    contained: bool

    @property
    def inside_after_all(self) -> tuple[int, ...]:
        """Places of the windows that were left out and that the real tubes contain."""
        return tuple(place for place in self.linear.left_out if self.enclosed.whole[place])


def linear_fit(
    model: MotionModel, measured: Measured, *, outliers: int, most: Mapping[str, float]
) -> LinearFit:
    """Minimise the mean weighted half width subject to containment to first order.

    The mean is over the windows of the first recording by name alone, so that what is minimised
    does not depend on the other recordings: they are the independent samples of the statement.

    outliers: so many windows may stay outside; one after the other the window whose constraints
    cause most of the cost, by their multipliers, is left out, and the rest fitted again. most:
    limits on bounds, by key. Raises NoFitError where no bounds below these contain the windows.
    """
    if not measured.windows:
        raise InputError("expected windows of measured motion to fit to, got none")
    if not 0 <= outliers < len(measured.windows):
        raise InputError(
            f"--outliers: expected a whole number from 0 to {len(measured.windows) - 1}, fewer "
            f"than the training windows, got {outliers}"
        )
    linear = first_order(model, measured)
    limits = np.array([most.get(name, np.inf) for name in model.fitted])
    first = [window.recording == measured.recordings[0] for window in measured.windows]
    costs = np.einsum("wkmp,m->p", linear.per_bound[first], np.array(model.weights))
    costs = costs / linear.per_bound[first, :, 0, 0].size
    left_out: list[int] = []
    deciding: set[int] = set()
    while True:
        # A window that is left out next may be what the limits do not admit.
        last = len(left_out) == outliers
        allowed = limits if last else np.full_like(limits, np.inf)
        bounds, caused = _solve(linear, costs, limits=allowed, left_out=left_out, model=model)
        deciding |= {int(place) for place in np.flatnonzero(caused)}
        if last or caused.max() <= 0.0:
            return LinearFit(bounds, tuple(left_out), outliers, tuple(sorted(deciding)))
        left_out.append(int(np.argmax(caused)))


def _solve(
    linear: FirstOrder, costs: Array, *, limits: Array, left_out: list[int], model: MotionModel
) -> tuple[Array, Array]:
    """Bounds (p,), and the cost that each window's constraints cause (W,)."""
    count, p = len(linear.deviation), len(costs)
    needed = (linear.deviation - linear.given).reshape(count, -1)
    rows = linear.per_bound.reshape(count, -1, p)
    kept = needed > 0.0
    kept[left_out] = False
    if not kept.any():
        return np.zeros(p), np.zeros(count)
    # In units of each bound's own effect the program is well scaled.
    scale = np.maximum(costs, _LEAST_COST * costs.max())
    bounds = cp.Variable(p, nonneg=True)
    enough = (rows[kept] / scale) @ bounds >= needed[kept]
    constraints: list[Any] = [enough]
    finite = np.flatnonzero(np.isfinite(limits))
    if len(finite):
        constraints.append(bounds[finite] <= limits[finite] * scale[finite])
    problem = cp.Problem(cp.Minimize(cp.sum(bounds)), constraints)
    problem.solve(solver=cp.CLARABEL)
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        raise NoFitError(_impossible(model, limits))
    # Multiplier times what is needed: by duality these sum to the cost, whatever the units.
    caused = np.zeros(count)
    np.add.at(caused, np.nonzero(kept)[0], np.asarray(enough.dual_value) * needed[kept])
    caused[caused < _TOUCHES * caused.max()] = 0.0
    return np.maximum(np.asarray(bounds.value) / scale, 0.0), caused


def _impossible(model: MotionModel, limits: Array) -> str:
    named = [
        f"{name} <= {limit:g}"
        for name, limit in zip(model.fitted, limits, strict=True)
        if np.isfinite(limit)
    ]
    return (
        "to first order no bounds contain the training windows"
        + (f" with {', '.join(named)}" if named else "")
        + "; the motion is not that of this model, the stated errors of the beginnings are "
        "too small, or a window holds a defect of the measurement or lies near standstill, where "
        "the first order is not what real tubes do (leave it out with --outliers: it is checked "
        "against the real tubes)"
    )


def fit(
    model: MotionModel, measured: Measured, *, outliers: int, most: Mapping[str, float],
    advance: Advance = lambda _: None,
) -> Fit:  # fmt: skip
    """`linear_fit`, then all bounds times the least power of `INFLATION_STEP` that suffices.

    Sufficient: real tubes contain every window that was not left out. It is one factor, so that one
    recording decides it. A window inside under smaller bounds is taken to stay inside under larger
    ones while the factor is sought; all windows are judged once more with the bounds found. Where
    no factor is found, `contained` is False and the bounds are those of the program. advance: told
    of each of the three stages, and 0 between them.
    """
    linear = linear_fit(model, measured, outliers=outliers, most=most)
    advance(1)
    kept = measured.without(linear.left_out)
    power, deciding = _least_power(model, kept, linear, advance)
    advance(1)
    uncertainty = scaled(model, linear.bounds, INFLATION_STEP**power)
    enclosed = enclose(model, uncertainty, measured)
    advance(1)
    required = np.delete(enclosed.whole, linear.left_out)
    return Fit(linear, INFLATION_STEP**power, deciding, uncertainty, enclosed, bool(required.all()))


def _least_power(
    model: MotionModel, measured: Measured, linear: LinearFit, advance: Advance
) -> tuple[int, str | None]:
    """The power, 0 where none suffices, and whose window is outside at the one before."""

    def outside(power: int, windows: Measured) -> Measured:
        enclosed = enclose(model, scaled(model, linear.bounds, INFLATION_STEP**power), windows)
        advance(0)
        return windows.without([int(place) for place in np.flatnonzero(enclosed.whole)])

    low, step = 0, 1
    open_ones = outside(0, measured)
    if not open_ones.windows:
        return 0, None
    while True:
        high = low + step
        if high > _MOST_STEPS:
            return 0, None
        still = outside(high, open_ones)
        if not still.windows:
            break
        low, open_ones, step = high, still, 2 * step
    while high - low > 1:
        middle = (low + high) // 2
        still = outside(middle, open_ones)
        if still.windows:
            low, open_ones = middle, still
        else:
            high = middle
    return high, open_ones.windows[0].recording


def scaled(model: MotionModel, bounds: Array, factor: float) -> Uncertainty:
    """The bounds (p,) times a factor as figures of a file, rounded up in the third digit."""
    figures = {
        name: rounded_up(float(bound) * factor)
        for name, bound in zip(model.fitted, bounds, strict=True)
    }
    return dataclasses.replace(Uncertainty(), **figures)  # type: ignore[arg-type]


def rounded_up(value: float) -> float:
    """To three significant digits; below a millionth, 0: no unit of these files is finer.

    >>> rounded_up(0.12341), rounded_up(0.125), rounded_up(1e-9)
    (0.124, 0.125, 0.0)
    """
    if value < _NOTHING:
        return 0.0
    digits = 2 - math.floor(math.log10(value))
    scale = 10.0**digits
    return math.ceil(round(value * scale, 6)) / scale
