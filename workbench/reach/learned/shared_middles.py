"""A loop about middles that two runs share: learning over a region from sets of one size."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import casadi as ca

from workbench.errors import InputError
from workbench.models.signals import Ranged
from workbench.models.system import Ode
from workbench.sets import Box

Range = tuple[float, float]


def about_shared_middles(ode: Ode, middles: Box, *, ranges: Mapping[str, Range]) -> Ode:
    """The loop of z = x - c for a middle c that is drawn with the parameters: z' = field(c + z).

    A pair of its runs from a box about 0, with parameters in common, is a pair of runs of `ode`
    from one box about a middle somewhere in `middles` (a range for every state, a point where it
    does not matter). Distances of the two are the same. ranges: parameters and disturbances that
    differ from pair to pair and are constant in time; all others have their nominal values.
    Raises InputError for names that are not the loop's.
    """
    own = (*ode.parameters, *ode.disturbances)
    unknown = sorted(set(ranges) - {each.name for each in own})
    if unknown or set(middles.names) != set(ode.names):
        raise InputError(
            f"expected middles for the states {ode.names} and ranges of {[q.name for q in own]}, "
            f"got {middles.names} and {sorted(ranges)}"
        )
    middle = ca.SX.sym("middle", len(ode.names))
    drawn = [
        Ranged(each.name, each.unit, 0.5 * (low + high), low, high)
        for each, (low, high) in (
            (each, ranges.get(each.name, (each.nominal, each.nominal))) for each in own
        )
    ]
    drawn += [
        Ranged(f"middle_{state.name}", state.unit, 0.5 * sum(side), *side)
        for state, side in (
            (state, middles.interval(state.name)) for state in ode.states
        )
    ]  # fmt: skip
    return dataclasses.replace(
        ode,
        name=f"{ode.name}, about shared middles",
        parameters=tuple(drawn),
        disturbances=(),
        p=ca.vertcat(ode.p, ode.w, middle),
        w=ca.SX(0, 1),
        field=ca.cse(ca.substitute(ode.field, ode.x, ode.x + middle)),
        outputs=(),
        constants=(),
    )
