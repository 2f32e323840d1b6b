"""One validated step of a batch of sets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np
import numpy.typing as npt

from workbench.models.system import Ode
from workbench.reach.validated.algebra import UNIT, Algebra, Array, upward
from workbench.reach.validated.bounds import Range, StepBounds, step_bounds
from workbench.reach.validated.composition import BORDERED, OutsideDomainError
from workbench.reach.validated.forcing import Forced, forced
from workbench.reach.validated.lines import Lines
from workbench.reach.validated.picard import (
    NoEnclosureError,
    UndefinedFieldError,
    enclosure,
)
from workbench.reach.validated.series import Series
from workbench.reach.validated.sets import PolynomialSet
from workbench.reach.validated.tape import Tape
from workbench.sensitivity.inclusion import FirstInvalid

# A kink without a floor has one at -1e300 (`kinks`); drivers must stay away from it.
_LARGEST_DRIVER = 1e299


@final
@dataclass(frozen=True, slots=True, eq=False)
class StepResult:
    """The sets after the step, and boxes (B, n) that hold every state during it.

    remainder (B, n): the part of the radius that the order of the series controls. decided,
    motion (B, n_kinks) as in `Lines`.
    """

    end: PolynomialSet
    lower: Array
    upper: Array
    remainder: Array
    decided: npt.NDArray[np.int8]
    motion: Array


@final
class Stepper:
    """x' = f(x, p, w) ready for validated steps; kinks, disturbances and constants included."""

    def __init__(self, ode: Ode) -> None:
        self.bounds: StepBounds = step_bounds(ode)
        form, lines = self.bounds.form, self.bounds.lines
        inputs = [ode.x, form.p, ode.w, lines.slope, lines.offset, lines.error]
        self._field = Tape.of(ca.Function("field", inputs, [ca.densify(lines.field)]))
        self._drivers = [
            Tape.of(ca.Function("driver", inputs, [lines.drivers[i]]))
            for i in range(form.kappa.numel())
        ]
        self._p = np.array(form.parameter_values())
        lower = np.array([d.lower for d in ode.disturbances])
        upper = np.array([d.upper for d in ode.disturbances])
        self._w = np.clip(0.5 * lower + 0.5 * upper, lower, upper)
        self._w_radius = upward(np.maximum(upper - self._w, self._w - lower))
        self._w_ends = lower, upper
        self.ode = ode
        self._first_invalid: FirstInvalid | None = None

    @property
    def kink_count(self) -> int:
        """Number of kinks of the field."""
        return len(self._drivers)

    def step(self, start: PolynomialSet, h: float, order: int) -> StepResult:
        """Advance by h (s) with a series of the given order.

        Raises NoEnclosureError or OutsideDomainError; a shorter step may then succeed.
        """
        with np.errstate(all="ignore"):
            try:
                return self._step(start, h, order)
            except UndefinedFieldError as failure:
                name = self._unbounded(failure.box)
                reason = str(failure) if name is None else f"{name!r} could not be bounded"
            except OutsideDomainError as failure:
                name, reason = str(failure), f"{str(failure)!r} could not be bounded"
            if name in BORDERED:
                raise OutsideDomainError(name)
            raise NoEnclosureError(reason)

    def _step(self, start: PolynomialSet, h: float, order: int) -> StepResult:
        batch = start.batch
        hull = start.hull()
        lines = self._relaxed(start, hull, h)
        box, rates = enclosure(hull, lambda c: self._relaxed_field(c, lines), h)
        x = self._series(start, rates, h, order)
        flow = self._field.start([x, *self._numbers(lines, 2 * batch, start.algebra)])
        for k in range(order + 1):
            flow.extend(k)
            for state, rate in zip(x, flow.outputs[0], strict=True):
                coef, radius = _order(rate, k)
                value = coef / (k + 1)
                state.fill(k + 1, value, radius / (k + 1) + UNIT * np.abs(value).sum(axis=-1))
        coef, radius, remainder = _summed(x, h, order, batch)
        effect = self._forced(box, lines, h)
        end = start.mapped(coef, radius + effect.box, effect.generators)
        after = end.hull()
        # |y''| over the step bounds how far a state leaves the chord between the two instants.
        bend = np.stack([_magnitude(s, 2, batch) for s in x], axis=1)
        chord = upward(0.25 * h * (h * bend) + effect.chord)
        lower = np.maximum(np.minimum(hull[0], after[0]) - chord, box[0])
        upper = np.minimum(np.maximum(hull[1], after[1]) + chord, box[1])
        # NaN goes through every operation above, so finite ends mean finite parts.
        if not np.all(np.isfinite(lower + upper + after[0] + after[1])):
            raise NoEnclosureError("the set left the range of numbers")
        return StepResult(end, lower, upper, remainder, lines.decided, lines.motion)

    def _relaxed(self, start: PolynomialSet, hull: Range, h: float) -> Lines:
        """The line of every kink, from the range of its driver over the step."""
        batch = start.batch
        lines = Lines.none(batch, self.bounds.form.limited)
        if not self._drivers:
            return lines
        box, rates = enclosure(hull, self._true_field, h)
        limits, bounded = self.bounds.limits([_repeated(self._p, self._p, batch)])
        if not np.all(bounded):
            raise NoEnclosureError("the limits of a limited command could not be bounded")
        x = [_steady(start.algebra, c) for c in _by_state(start.with_spread_as_variables())]
        for i, tape in enumerate(self._drivers):
            running = tape.start([x, *self._numbers(lines, batch, start.algebra)])
            running.extend(0)
            driver = running.outputs[0][0]
            now = start.image_range(driver.coef[0][:, None], driver.radius[0][:, None])
            arguments = [*self._ranges(box, lines), rates]
            (natural, along, by_v), valid = self.bounds.drivers[i](arguments)
            if not np.all(valid):
                raise NoEnclosureError("the range of a limited command could not be bounded")
            size = np.maximum(np.abs(by_v[0]), np.abs(by_v[1]))
            wide = upward((size * self._input_radius(lines)).sum(axis=1))
            down = h * np.minimum(along[0][:, 0], 0.0)
            up = h * np.maximum(along[1][:, 0], 0.0)
            low, high = now[0][:, 0] - wide + down, now[1][:, 0] + wide + up
            margin = upward(8.0 * UNIT * (np.abs(low) + np.abs(high)))
            low = np.maximum(low - margin, natural[0][:, 0])
            high = np.minimum(high + margin, natural[1][:, 0])
            if not (np.all(low > -_LARGEST_DRIVER) and np.all(high < _LARGEST_DRIVER)):
                raise NoEnclosureError("a limited quantity left the range of numbers")
            floor, ceiling = ((end[0][:, i], end[1][:, i]) for end in limits)
            lines.set(i, (low, high), up - down, floor=floor, ceiling=ceiling)
        return lines

    def _true_field(self, box: Range) -> tuple[Range, Array]:
        batch = len(box[0])
        p = self._p[: self.ode.p.numel()]
        found, valid = self.bounds.field(
            [box, _repeated(p, p, batch), _repeated(*self._w_ends, batch)]
        )
        return found[0], valid

    def _unbounded(self, box: Range) -> str | None:
        """The operation of the field that has no bounds over the boxes."""
        if self._first_invalid is None:
            self._first_invalid = FirstInvalid(self.ode.function())
        p = self._p[: self.ode.p.numel()]
        for low, high in zip(*box, strict=True):
            name = self._first_invalid(low, high, p, p, *self._w_ends)
            if name is not None:
                return name
        return None

    def _relaxed_field(self, box: Range, lines: Lines) -> tuple[Range, Array]:
        found, valid = self.bounds.relaxed(self._ranges(box, lines))
        return found[0], valid

    def _forced(self, box: Range, lines: Lines, h: float) -> Forced:
        batch, n = box[0].shape
        radius = self._input_radius(lines)
        if not np.any(radius):
            return Forced.none(batch, n)
        (_, jacobian, by_input), valid = self.bounds.relaxed(self._ranges(box, lines))
        if not np.all(valid):
            raise NoEnclosureError("the derivatives of the field could not be bounded")
        return forced(_matrices(jacobian, n), _matrices(by_input, n), radius, h)

    def _ranges(self, box: Range, lines: Lines) -> list[Range]:
        """Inputs of the relaxed inclusion functions over `box`."""
        batch = len(box[0])
        fixed = _repeated(self._p, self._p, batch), _repeated(*self._w_ends, batch)
        return [
            box, *fixed, (lines.slope, lines.slope), (lines.offset, lines.offset),
            (-lines.gap, lines.gap),
        ]  # fmt: skip

    def _input_radius(self, lines: Lines) -> Array:
        felt = np.broadcast_to(self._w_radius, (len(lines.gap), len(self._w_radius)))
        return np.concatenate([felt, lines.gap], axis=1)

    def _series(self, start: PolynomialSet, rates: Range, h: float, order: int) -> list[Series]:
        """The state at the start, and over the whole step as the second half of the batch."""
        coef = start.with_spread_as_variables()
        low, high = np.minimum(h * rates[0], 0.0), np.maximum(h * rates[1], 0.0)
        shift = 0.5 * (low + high)
        moving = upward(0.5 * (high - low) * (1.0 + 8.0 * UNIT) + 4.0 * UNIT * np.abs(shift))
        series = []
        for i, column in enumerate(_by_state(coef)):
            made = Series(start.algebra, order + 2, 2 * start.batch)
            ahead = column.copy()
            ahead[:, 0] += shift[:, i]
            slack = upward(moving[:, i] + UNIT * np.abs(ahead[:, 0]))
            radius = np.concatenate([np.zeros(start.batch), slack])
            made.give(0, np.concatenate([column, ahead]), radius)
            series.append(made)
        return series

    def _numbers(self, lines: Lines, batch: int, algebra: Algebra) -> list[list[Series]]:
        """p, w, slope, offset and error as numbers."""
        repeats = batch // max(len(lines.slope), 1)
        columns = [
            np.broadcast_to(self._p, (batch, len(self._p))),
            np.broadcast_to(self._w, (batch, len(self._w))),
            np.tile(lines.slope, (repeats, 1)),
            np.tile(lines.offset, (repeats, 1)),
            np.zeros((batch, lines.slope.shape[1])),
        ]
        exact = np.zeros(batch)
        return [
            [Series.constant(algebra, block[:, i], exact) for i in range(block.shape[1])]
            for block in columns
        ]


def _order(series: Series, k: int) -> tuple[Array, Array]:
    if series.has(k):
        return series.coef[k], series.radius[k]
    return np.zeros_like(series.coef[0]), np.zeros_like(series.radius[0])


def _steady(algebra: Algebra, coef: Array) -> Series:
    made = Series(algebra, 1, len(coef), steady=True)
    made.give(0, coef, np.zeros(len(coef)))
    return made


def _by_state(coef: Array) -> list[Array]:
    return [coef[:, i] for i in range(coef.shape[1])]


def _repeated(lower: Array, upper: Array, batch: int) -> Range:
    return tuple(np.broadcast_to(end, (batch, len(end))) for end in (lower, upper))  # type: ignore[return-value]


def _matrices(columns: Range, n: int) -> Range:
    """(B, n k) entries by columns as (B, n, k)."""
    batch = len(columns[0])
    lower, upper = (end.reshape(batch, -1, n).transpose(0, 2, 1) for end in columns)
    return lower, upper


def _magnitude(series: Series, k: int, batch: int) -> Array:
    """max |order k| over the step (the second half of the batch)."""
    low, high = series.algebra.bounds(series.coef[k, batch:], series.radius[k, batch:])
    return np.maximum(np.abs(low), np.abs(high))


def _summed(x: list[Series], h: float, order: int, batch: int) -> tuple[Array, Array, Array]:
    """sum_{k <= order} x_k h^k at the start + h^(order+1) x_{order+1} over the step.

    coef (B, n, C), radius (B, n), and the radius that the last term alone contributes.
    """
    coefs, radii, rests = [], [], []
    for series in x:
        coef = h * series.coef[order + 1, batch:]
        radius = h * series.radius[order + 1, batch:]
        last = _magnitude(series, order + 1, batch) * h ** (order + 1)
        for k in range(order, -1, -1):
            if k < order:
                coef, radius = h * coef, h * radius
            size = np.abs(coef).sum(axis=-1)
            coef = coef + series.coef[k, :batch]
            after = np.abs(coef).sum(axis=-1)
            radius = upward(radius + series.radius[k, :batch] + UNIT * (2.0 * size + after))
        coefs.append(coef)
        radii.append(radius)
        rests.append(last)
    return np.stack(coefs, axis=1), np.stack(radii, axis=1), np.stack(rests, axis=1)
