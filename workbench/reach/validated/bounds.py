"""Outward-rounded ranges that a validated step needs, as Functions over a batch of boxes."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from workbench.models.system import Ode
from workbench.reach.validated.algebra import Array
from workbench.sensitivity.derivatives import derivatives
from workbench.sensitivity.inclusion import inclusion
from workbench.sensitivity.kinks import RelaxedForm, SmoothForm, relax, smooth_form

# A range (lower, upper) of arrays (B, k), one row per member of the batch.
Range = tuple[Array, Array]


@final
@dataclass(frozen=True, slots=True, eq=False)
class BatchInclusion:
    """The inclusion function of an SX Function, over B boxes at once."""

    bounds: ca.Function

    @classmethod
    def of(cls, inputs: list[ca.SX], outputs: list[ca.SX]) -> BatchInclusion:
        """Inputs and outputs are columns."""
        return cls(inclusion(ca.Function("ranged", inputs, list(map(ca.densify, outputs)))))

    def __call__(self, inputs: list[Range]) -> tuple[list[Range], Array]:
        """Ranges (B, k) of every output, and which of the B are valid."""
        batch = len(inputs[0][0])
        arguments = [np.ascontiguousarray(end.T) for pair in inputs for end in pair]
        function = self.bounds if batch == 1 else _mapped(self.bounds, batch)
        found = [
            np.asarray(value.full()).T for value in function.call([ca.DM(a) for a in arguments])
        ]
        pairs = [(found[2 * i], found[2 * i + 1]) for i in range(len(found) // 2)]
        return pairs, np.asarray(found[-1][:, 0] == 1.0)


@functools.lru_cache(maxsize=64)
def _mapped(function: ca.Function, batch: int) -> ca.Function:
    return function.map(batch)


@final
@dataclass(frozen=True, slots=True, eq=False)
class StepBounds:
    """All that is ranged in one step.

    field: (x, p, w) -> f, kinks included. relaxed: (x, p, w, slope, offset, error) -> relaxed
    field, its Jacobian by x (n n entries by columns) and by v = (w, error) (n n_v entries).
    drivers: for every kink (x, p, w, slope, offset, error, f) -> driver, its derivative along f,
    and its derivative by v. limits: p -> floor and ceiling of every kink.
    """

    form: SmoothForm
    lines: RelaxedForm
    field: BatchInclusion
    relaxed: BatchInclusion
    drivers: tuple[BatchInclusion, ...]
    limits: BatchInclusion


@functools.lru_cache(maxsize=32)
def step_bounds(ode: Ode) -> StepBounds:
    """Build the functions for `ode`, whose parameters are numbers."""
    form = smooth_form(ode)
    lines = relax(form)
    inputs = [ode.x, form.p, ode.w, lines.slope, lines.offset, lines.error]
    first = derivatives(form, lines)
    exogenous = ca.vertcat(ode.w, lines.error)
    rate = ca.SX.sym("rate", ode.x.numel())
    drivers = []
    for i in range(form.kappa.numel()):
        driver = lines.drivers[i]
        along = ca.jtimes(driver, ode.x, rate)
        by_v = ca.densify(ca.jacobian(driver, exogenous)).T
        drivers.append(BatchInclusion.of([*inputs, rate], [driver, along, by_v]))
    return StepBounds(
        form,
        lines,
        BatchInclusion.of([ode.x, ode.p, ode.w], [ode.field]),
        BatchInclusion.of(
            inputs,
            [
                lines.field,
                ca.vec(ca.densify(first.jacobian)),
                ca.vec(ca.densify(first.by_exogenous)),
            ],
        ),
        tuple(drivers),
        BatchInclusion.of([form.p], [form.floor, form.ceiling]),
    )
