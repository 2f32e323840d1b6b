"""Many trajectories at once in floats: Taylor steps that end at every switch and every kink."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
import numpy.typing as npt

from workbench.bench.taylor import Expansion, TaylorField
from workbench.sensitivity.vectorised import Array, Index

# A step beyond a kink's crossing by this much (s) puts the next expansion on the other side; on the
# wrong branch for so long a state moves by less than 1e-16 of the jump in its second derivative.
_BEYOND_S = 1e-8
_LONGEST_STEP_S = 0.25
# Sides of a kink closer than this may be in either order.
_TOUCHING = 1e-11
_SHORTEST_STEP_S = 1e-6
# Where a kink may hide between two probes the step is shortened, down to this.
_SHORTEST_GRAZE_S = 2e-3
_PROBES = 8
_BISECTIONS = 40
_MOST_STEPS = 20_000
# Lanes whose dense output is computed together: their arrays stay in the processor's cache.
_CHUNK = 250


@final
@dataclass(frozen=True, slots=True, eq=False)
class Inputs:
    """What N trajectories start from and feel.

    states (N, n); parameters (N, n_p); switches (N, S): ascending times in s, inf where unused;
    values (N, S+1, n_w): the disturbance before, between and after the switches.
    """

    states: Array
    parameters: Array
    switches: Array
    values: Array

    def take(self, rows: Index | slice) -> Inputs:
        """The chosen rows."""
        return Inputs(
            self.states[rows], self.parameters[rows], self.switches[rows], self.values[rows]
        )


@final
@dataclass(frozen=True, slots=True)
class LaneAlgebra:
    """Arrays with one number per trajectory, or floats, for the Taylor recurrences."""

    def number(self, value: float) -> float:
        """The constant."""
        return value

    def sine_cosine(self, angle: Any) -> tuple[Any, Any]:
        """By numpy."""
        return np.sin(angle), np.cos(angle)

    def convolve(self, left: Sequence[Any], right: Sequence[Any]) -> Any:
        """Sum of products in floats."""
        total = left[0] * right[-1]
        for a, b in zip(left[1:], right[-2::-1], strict=True):
            total = total + a * b
        return total

    def least(self, sides: tuple[Any, Any], branch: tuple[Any, Any], order: int) -> Any:  # noqa: ARG002
        """The lower side's branch at the start of the step."""
        return np.where(sides[0] < sides[1], branch[0], branch[1])


@final
@dataclass(frozen=True, slots=True)
class Accuracy:
    """order: of the Taylor polynomials; tolerance: size of the last term that is allowed, relative
    to 1 + |x|."""

    order: int
    tolerance: float


@final
@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """states (m, n, N) at the times asked for, NaN from where a run left the numbers.

    first (kinks, N): whether the first side of each kink is the smaller one at the start (see
    `TaylorField`); crossed_s (kinks, N): time at which the sides come to cross or come closer than
    can be told apart, inf where they never do.
    """

    states: Array
    first: npt.NDArray[np.bool_]
    crossed_s: Array


def trajectories(field: TaylorField, inputs: Inputs, times: Array, accuracy: Accuracy) -> Runs:
    """Runs seen at `times` (m,), ascending, in s.

    Rigor SAMPLED: truncation is controlled by the size of the last Taylor term, rounding is not.
    """
    run = _Run(field, inputs, times, accuracy)
    with np.errstate(all="ignore"):
        for _ in range(_MOST_STEPS):
            if not run.step():
                break
    return Runs(run.result, run.first, run.crossed_s)


@final
class _Run:
    """Every lane at its own time; lanes that have reached the end are dropped."""

    def __init__(
        self, field: TaylorField, inputs: Inputs, times: Array, accuracy: Accuracy
    ) -> None:
        count, n = inputs.states.shape
        self.field, self.inputs, self.times, self.accuracy = field, inputs, times, accuracy
        self.result = np.full((len(times), n, count), np.nan)
        self.lanes = np.arange(count)
        self.now = np.zeros(count)
        self.seen = np.zeros(count, dtype=np.intp)
        self.held = np.zeros(count, dtype=np.intp)
        self.x = np.ascontiguousarray(inputs.states.T)
        self.first = np.zeros((len(field.kinks), count), dtype=np.bool_)
        self.crossed_s = np.full((len(field.kinks), count), np.inf)
        self.started = False
        self.common = [np.ptp(column) == 0.0 for column in inputs.parameters.T]

    def step(self) -> bool:
        """One step of every lane that is under way; whether there was any."""
        if not len(self.lanes):
            return False
        values = self.inputs.values[self.lanes, self.held]
        p = [
            float(column[0]) if same else column[self.lanes]
            for column, same in zip(self.inputs.parameters.T, self.common, strict=True)
        ]
        expansion = self.field.expand(
            LaneAlgebra(), (list(self.x), p, list(values.T)), self.accuracy.order
        )
        coefficients = np.array(
            [[np.broadcast_to(c, self.x.shape[1]) for c in row] for row in expansion.state]
        )
        switches = np.pad(self.inputs.switches, ((0, 0), (0, 1)), constant_values=np.inf)
        until = np.minimum(switches[self.lanes, self.held], self.times[-1])
        length = np.minimum(_accurate(coefficients, self.accuracy), until - self.now)
        length = self._to_kinks(expansion, length)
        after = np.where(length >= until - self.now, until, self.now + length)
        self._record(coefficients, after)
        self.x = _polynomial(coefficients, after - self.now)
        self.held += (after >= until) & (after < self.times[-1])
        self.now = after
        self._drop()
        return True

    def _to_kinks(self, expansion: Expansion, length: Array) -> Array:
        """Lengths cut just behind the first crossing of a kink, which is noted."""
        for kink, sides in enumerate(expansion.kinks):
            gaps = np.array(
                [np.broadcast_to(a - b, length.shape) for a, b in zip(*sides, strict=True)]
            )
            below = gaps[0] < 0.0
            if not self.started:
                self.first[kink] = below
            # A disturbance that switches may throw a run to the other side.
            thrown = np.flatnonzero(below != self.first[kink, self.lanes])
            self._meet(kink, thrown, self.now[thrown])
            reach = _polynomial(np.abs(gaps[1:]), length) * length
            near = np.flatnonzero(~(np.abs(gaps[0]) > reach + _TOUCHING))
            if not len(near):
                continue
            cut, met = _first_crossing(gaps[:, near], length[near])
            at = np.where(np.abs(gaps[0, near]) <= _TOUCHING, 0.0, met) + self.now[near]
            self._meet(kink, near, at)
            length = length.copy()
            length[near] = cut
        self.started = True
        return length

    def _meet(self, kink: int, active: Index, at_s: Array) -> None:
        lanes = self.lanes[active]
        self.crossed_s[kink, lanes] = np.fmin(self.crossed_s[kink, lanes], at_s)

    def _record(self, coefficients: Array, after: Array) -> None:
        """The states at all times up to `after` that were not seen yet."""
        reached = np.searchsorted(self.times, after, side="right")
        for first in range(0, len(self.lanes), _CHUNK):
            chunk = slice(first, first + _CHUNK)
            seen, now = self.seen[chunk], self.now[chunk]
            counts = reached[chunk] - seen
            columns = np.repeat(np.arange(len(counts)), counts)
            rows = np.arange(len(columns)) - np.repeat(np.cumsum(counts) - counts - seen, counts)
            since = self.times[rows] - now[columns]
            value = np.zeros((len(self.x), len(columns)))
            for row in coefficients[::-1, :, chunk]:
                value *= since
                value += np.repeat(row, counts, axis=1)
            self.result[rows, :, self.lanes[chunk][columns]] = value.T
        self.seen = reached

    def _drop(self) -> None:
        kept = (self.now < self.times[-1]) & np.isfinite(self.x).all(axis=0)
        if not kept.all():
            self.lanes, self.now, self.seen, self.held = (
                array[kept] for array in (self.lanes, self.now, self.seen, self.held)
            )
            self.x = self.x[:, kept]


def _polynomial(coefficients: Array, at: Array) -> Array:
    """sum_k coefficients[k] at^k, in place over the last axis."""
    value = coefficients[-1] * at
    for row in coefficients[-2:0:-1]:
        value += row
        value *= at
    value += coefficients[0]
    return np.asarray(value)


def _accurate(coefficients: Array, accuracy: Accuracy) -> Array:
    """Length at which the last two terms reach the tolerance, per lane."""
    scale = accuracy.tolerance * (1.0 + np.abs(coefficients[0]))
    order = accuracy.order
    lengths = [
        np.min((scale / np.maximum(np.abs(coefficients[k]), 1e-300)) ** (1.0 / k), axis=0)
        for k in (order - 1, order)
    ]
    return np.asarray(np.clip(np.fmin(*lengths), _SHORTEST_STEP_S, _LONGEST_STEP_S))


def _first_crossing(gaps: Array, length: Array) -> tuple[Array, Array]:
    """Lengths cut behind the first sign change of the polynomials `gaps` in (0, length], and when
    the kink is met: there, at 0 where a crossing may be hidden, else never (inf)."""
    shares = np.arange(1, _PROBES + 1)[:, None] / _PROBES
    probes = np.array([_polynomial(gaps, share * length) for share in shares])
    # The branch was chosen by left < right, so that equality belongs to the other side.
    before = gaps[0] < 0.0
    crossed = (probes < 0.0) != before
    first = np.argmax(crossed, axis=0)
    found = crossed.any(axis=0)
    low, high = first / _PROBES * length, (first + 1) / _PROBES * length
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        same = (_polynomial(gaps, middle) < 0.0) == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    # Between two probes a curve of second derivative c can dip by c (spacing)^2 / 8.
    bend = 2.0 * np.abs(gaps[2]) + 6.0 * np.abs(gaps[3]) * length
    dip = bend * (length / _PROBES) ** 2 / 8.0
    hidden = ~found & (np.minimum(np.abs(probes).min(axis=0), np.abs(gaps[0])) <= dip)
    shorter = np.where(
        hidden, np.maximum(0.5 * length, np.minimum(length, _SHORTEST_GRAZE_S)), length
    )
    cut = np.where(found, np.minimum(high + _BEYOND_S, length), shorter)
    return cut, np.where(found, low, np.where(hidden, 0.0, np.inf))
