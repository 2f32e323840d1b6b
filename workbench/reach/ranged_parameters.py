"""Unknown constants as states with zero derivative, which keeps their correlation with the
state."""

from __future__ import annotations

import casadi as ca

from workbench.models.signals import Signal
from workbench.models.system import Ode


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
    )
