"""Unknown constants, and held disturbances, as states with zero derivative, which keeps their
correlation with the state."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import casadi as ca

from workbench.errors import InputError
from workbench.models.signals import Signal
from workbench.models.system import Ode
from workbench.sets import Box


def with_ranged_parameters_as_states(ode: Ode) -> Ode:
    """Append every parameter with lower < upper to the states (x' = 0); the others stay
    parameters."""
    ranged = [i for i, q in enumerate(ode.parameters) if q.lower < q.upper]
    if not ranged:
        return ode
    fixed = [i for i in range(len(ode.parameters)) if i not in ranged]
    symbols = ca.vertsplit(ode.p)
    return Ode(
        name=ode.name,
        states=(
            *ode.states,
            *(Signal(ode.parameters[i].name, ode.parameters[i].unit) for i in ranged),
        ),
        parameters=tuple(ode.parameters[i] for i in fixed),
        disturbances=ode.disturbances,
        x=ca.vertcat(ode.x, *(symbols[i] for i in ranged)),
        p=ca.vertcat(*(symbols[i] for i in fixed)) if fixed else ca.SX(0, 1),
        w=ode.w,
        field=ca.vertcat(ode.field, ca.SX.zeros(len(ranged))),
        outputs=ode.outputs,
        constants=(*ode.constants, *(ode.parameters[i] for i in ranged)),
    )


def with_ranged_parameters_as_disturbances(ode: Ode) -> Ode:
    """Append every parameter with lower < upper to the disturbances.

    A disturbance may change at any time, which a parameter cannot: every solution of `ode` for any
    of its parameter values is one of the result.
    """
    ranged = [i for i, q in enumerate(ode.parameters) if q.lower < q.upper]
    if not ranged:
        return ode
    fixed = [i for i in range(len(ode.parameters)) if i not in ranged]
    symbols = ca.vertsplit(ode.p)
    return dataclasses.replace(
        ode,
        parameters=tuple(ode.parameters[i] for i in fixed),
        disturbances=(*ode.disturbances, *(ode.parameters[i] for i in ranged)),
        p=ca.vertcat(*(symbols[i] for i in fixed)) if fixed else ca.SX(0, 1),
        w=ca.vertcat(ode.w, *(symbols[i] for i in ranged)),
    )


def with_inputs_as_states(ode: Ode) -> Ode:
    """Append every parameter with lower < upper and every disturbance to the states (x' = 0).

    With the appended states held at numbers this is the equation of one choice of them.
    """
    held = with_ranged_parameters_as_states(ode)
    if not held.disturbances:
        return held
    return Ode(
        name=held.name,
        states=(*held.states, *(Signal(w.name, w.unit) for w in held.disturbances)),
        parameters=held.parameters,
        disturbances=(),
        x=ca.vertcat(held.x, held.w),
        p=held.p,
        w=ca.SX(0, 1),
        field=ca.vertcat(held.field, ca.SX.zeros(len(held.disturbances))),
        outputs=held.outputs,
        constants=(*held.constants, *held.disturbances),
    )


def initial_box(original: Ode, ode: Ode, initial_set: Box) -> Box:
    """The initial set with an axis for every parameter that became a state.

    initial_set: axes = state names of `original`; it may name ranged parameters too, with a part of
    their range. Raises InputError on other axes or values outside a parameter's range.
    """
    ranges = {q.name: (q.lower, q.upper) for q in original.parameters if q.name in ode.names}
    given = set(initial_set.names)
    if not set(original.names) <= given <= {*original.names, *ranges}:
        raise InputError(
            f"expected an initial set over the states {original.names} (ranged parameters may be "
            f"added: {sorted(ranges)}), got {initial_set.names}"
        )
    intervals = {name: initial_set.interval(name) for name in original.names}
    for name, (lower, upper) in ranges.items():
        low, high = initial_set.interval(name) if name in given else (lower, upper)
        if not lower <= low <= high <= upper:
            raise InputError(
                f"expected {name!r} within its range [{lower!r}, {upper!r}], got [{low!r}, "
                f"{high!r}]"
            )
        intervals[name] = (low, high)
    return Box.from_intervals(intervals)


def with_ranged_axes(ode: Ode, initial_set: Box, names: Iterable[str]) -> Box:
    """`initial_set` with the whole range of those of `names` that are ranged parameters."""
    intervals = {name: initial_set.interval(name) for name in initial_set.names}
    for parameter in ode.parameters:
        if parameter.name in names and parameter.lower < parameter.upper:
            intervals.setdefault(parameter.name, (parameter.lower, parameter.upper))
    return Box.from_intervals(intervals)
