"""The rounding budget of the `local` kernel: constants proved offline over an operating region."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.reach.online.model import OnlineModel
from workbench.reach.online.rounding import Ends, largest_angle, rounding_bounds
from workbench.reach.online.step import (
    advance_function,
    driver_function,
    input_function,
    pairs_of,
    second_function,
)
from workbench.sensitivity.inclusion import inclusion
from workbench.sets import Box

_OFFSET = 4
# The last step of a horizon may be longer than the others by rounding.
_LAST = 1 + 1e-6


@final
@dataclass(frozen=True, slots=True)
class Budget:
    """Absolute rounding errors over the region, for every step up to the longest.

    step (n): of the state, the transition applied to any set in the region, and inputs at the end;
    start (n): of inputs at the start; hessian: of each nonzero; source, bent_source (n): summed
    over the pairs; driver (n_k): of a driver and of all that it varies by over any set in the
    region; angle: largest argument of sin, cos or tan in rad; gap, offset (n_k): largest half gap
    and offset of a line that all this holds for.
    """

    step: NDArray[np.float64]
    start: NDArray[np.float64]
    hessian: NDArray[np.float64]
    source: NDArray[np.float64]
    bent_source: NDArray[np.float64]
    driver: NDArray[np.float64]
    angle: float
    gap: NDArray[np.float64]
    offset: NDArray[np.float64]


@final
@dataclass(frozen=True, slots=True)
class Ranges:
    """What the kernel accepts: states, parameters (constants included), disturbances, step in s."""

    states: Box
    parameters: Ends
    disturbances: Ends
    step_max_s: float


def budget_of(model: OnlineModel, ranges: Ranges, columns: tuple[int, ...], order: int) -> Budget:
    """Analyse every point Function over `ranges`. InputError where one is not defined there."""
    n = model.n
    low = np.array(ranges.states.reordered(model.ode.names).lower)
    high = np.array(ranges.states.reordered(model.ode.names).upper)
    radius = (high - low) / 2
    lines = _lines(model, ranges, (low, high))
    slopes = np.zeros(model.n_k), np.ones(model.n_k)
    point = [
        (low, high), ranges.parameters, ranges.disturbances, slopes, (-lines.offset, lines.offset)
    ]  # fmt: skip
    known = {(_OFFSET, k): (lines.low[k], lines.high[k]) for k in range(model.n_k)}
    advance = advance_function(model, order)
    moved = [*point, (np.zeros(1), np.array([ranges.step_max_s * _LAST]))]
    errors = rounding_bounds(advance, moved, sums=known)
    spread = (ranges.disturbances[1] - ranges.disturbances[0]) / 2
    v = np.concatenate([spread, lines.gap])
    step = errors[0] + _applied(advance, 1, errors[1], radius)
    start = np.zeros(n)
    if model.n_v:
        inputs = input_function(model)
        by_input = rounding_bounds(inputs, point, sums=known)[0]
        # Once at the start, where the transition maps it, and once at the end.
        step = step + ranges.step_max_s * _applied(inputs, 0, by_input, v)
        start = start + ranges.step_max_s * _applied(inputs, 0, by_input, v)
    second = second_function(model, columns)
    extra = [(-np.repeat(radius, len(columns)), np.repeat(radius, len(columns)))]
    derived = rounding_bounds(second, [*point, *(extra if columns else [])], sums=known)
    angle = largest_angle(advance, moved, sums=known)
    pairs = len(pairs_of(model, columns)) if columns else 0
    zero = np.zeros(n)
    sums = [
        f.reshape(n, pairs).sum(axis=1) if columns else zero for f in (derived[1:] or [zero] * 2)
    ]
    driver = np.zeros(0)
    if model.n_k:
        sets = [(0 * radius, radius), (0 * radius, radius), *(extra if columns else [])]
        found = rounding_bounds(driver_function(model, columns), [*point, *sets], sums=known)
        driver = found[0] + found[1].reshape(model.n_k, n) @ radius + found[2]
        driver = driver + (found[3].reshape(model.n_k, pairs).sum(axis=1) if columns else 0.0)
    return Budget(step, start, derived[0], sums[0], sums[1], driver, angle, lines.gap, lines.offset)


def _applied(
    function: ca.Function, output: int, errors: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Error matrix (by the output's sparsity) times sizes."""
    sparsity = function.sparsity_out(output)
    total = np.zeros(sparsity.size1())
    for row, column, error in zip(*sparsity.get_triplet(), errors, strict=True):
        total[row] += error * sizes[column]
    return total


@final
@dataclass(frozen=True, slots=True)
class _Lines:
    """What a verified line of each kink can be: its offset's size, its values at the nominal, the
    errors it can have."""

    offset: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    gap: NDArray[np.float64]


def _lines(model: OnlineModel, ranges: Ranges, box: Ends) -> _Lines:
    """From the ranges of the drivers over the region.

    A line deviates from the clip by its gap, at most half the clip's range, wherever the driver is
    in the range that the line was made for; the kernel verifies that the nominal driver is.
    """
    form, n_k = model.form, model.n_k
    size, low, high = np.zeros(n_k), np.zeros(n_k), np.zeros(n_k)
    if n_k:
        inputs = [form.ode.x, form.p, form.ode.w, form.kappa]
        natural = inclusion(
            ca.Function("drivers", inputs, [form.drivers, form.floor, form.ceiling])
        )
        for _ in range(n_k):
            found = natural(*box, *ranges.parameters, *ranges.disturbances, low, high)
            ends = [np.array(v).ravel() for v in found[:-1]]
            size = np.maximum(abs(ends[0]), abs(ends[1]))
            low, high = np.clip(ends[0], ends[2], ends[5]), np.clip(ends[1], ends[2], ends[5])
    gap = (high - low) / 2 * (1 + 1e-9)
    bad = ~np.isfinite(size + gap)
    if np.any(bad):
        raise InputError(
            f"the command behind limit {int(np.argmax(bad))} is not bounded over the operating "
            "region; narrow it"
        )
    offset = np.maximum(abs(low), abs(high)) + gap + size
    return _Lines(offset, low - gap, high + gap, gap)
