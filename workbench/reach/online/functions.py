"""All Functions of the online kernel of one model, with the budget of what they round."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.errors import InputError
from workbench.models.graph import graph_of
from workbench.models.system import Ode
from workbench.reach.online.budget import Budget, Ranges, budget_of
from workbench.reach.online.majorants import majorant_function
from workbench.reach.online.model import OnlineModel, emitted
from workbench.reach.online.point_trig import PRINCIPAL_RAD
from workbench.reach.online.step import (
    advance_function,
    driver_function,
    input_function,
    pairs_of,
    rates_function,
    second_function,
    source_function,
)

# Measured on B1: below these shares of a state's radius a remainder's own column costs more than it
# tightens.
_FLUSH_SHARE = {False: 7e-4, True: 3e-4}
ORDER = 5
"""Of the Taylor steps: the loop's remainder is of order 6."""


@final
@dataclass(frozen=True, slots=True)
class OnlineFunctions:
    """What the C loop calls.

    rounding: the `local` kernel's budget; None in the `enclosed` kernel, whose Functions return
    bounds of their own errors. columns: the axes whose initial deviations the quadratic form
    follows (none: the linear form); pairs: of these, as they are stored; transition: structure of
    a step's transition, which `advance` returns, or in the `local` kernel the Jacobian's
    coefficients, of the structures `jacobians`, for the loop to compute it.
    """

    model: OnlineModel
    ranges: Ranges
    rounding: Budget | None
    columns: tuple[int, ...]
    pairs: tuple[tuple[int, int], ...]
    jacobians: tuple[ca.Sparsity, ...]
    transition: ca.Sparsity
    advance: ca.Function
    inputs: ca.Function | None
    second: ca.Function
    source: ca.Function
    majorant: ca.Function
    drivers: ca.Function | None
    limits: ca.Function | None

    @property
    def flush_share(self) -> float:
        """Share of a state's radius below which a remainder stays in the box."""
        return _FLUSH_SHARE[bool(self.columns)]

    @property
    def entering(self) -> list[bool]:
        """Which states the field or a driver depends on at all."""
        relaxed = self.model.relaxed
        both = ca.vertcat(relaxed.field, relaxed.drivers)
        return [bool(ca.depends_on(both, x)) for x in ca.vertsplit(self.model.ode.x)]

    def all(self) -> list[ca.Function]:
        """Every Function, in the order of emission."""
        found = [
            self.advance,
            self.inputs,
            self.second,
            self.source,
            self.majorant,
            self.drivers,
            self.limits,
        ]
        return [function for function in found if function is not None]


def online_functions(ode: Ode, ranges: Ranges, *, quadratic: tuple[str, ...]) -> OnlineFunctions:
    """Build the `local` kernel's Functions of `ode` for states and inputs in `ranges`.

    quadratic: states whose initial deviations enter to second order; none: the linear form.
    InputError where an operation has no rule or the region is too large for the budget.
    """
    model = OnlineModel.of(ode)
    unknown = [name for name in quadratic if name not in ode.names]
    if unknown:
        raise InputError(f"expected states of {ode.names}, got {unknown}")
    columns = tuple(ode.names.index(name) for name in quadratic)
    budget = budget_of(model, ranges, columns, ORDER)
    principal = budget.angle < PRINCIPAL_RAD
    rates, jacobians = rates_function(model, ORDER)
    return OnlineFunctions(
        model=model,
        ranges=ranges,
        rounding=budget,
        columns=columns,
        pairs=tuple(pairs_of(model, columns)) if columns else (),
        jacobians=jacobians,
        transition=advance_function(model, ORDER).sparsity_out("transition"),
        advance=emitted(rates, principal=principal),
        inputs=emitted(input_function(model), principal=principal) if model.n_v else None,
        second=emitted(second_function(model, columns), principal=principal),
        source=source_function(model, quadratic=bool(columns)),
        majorant=majorant_function(model, order=ORDER, upward=False, quadratic=bool(columns)),
        drivers=emitted(driver_function(model, columns), principal=principal)
        if model.n_k
        else None,
        limits=exact_limits(model) if model.n_k else None,
    )


def exact_limits(model: OnlineModel) -> ca.Function:
    """`wb_limits`: p -> low, high of every kink, which must be parameters, negated or not."""
    form = model.form
    function = ca.Function(
        "wb_limits", [form.p], [form.floor, form.ceiling], ["p"], ["low", "high"]
    )
    rounded = {node.name for node in graph_of(function).nodes} - {"input", "const", "neg"}
    if rounded:
        raise InputError(
            f"a limit of a command is computed with {sorted(rounded)}; the online kernel takes "
            "parameters and constants as limits: add one for the result"
        )
    return function
