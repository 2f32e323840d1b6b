"""C text of `wb_decide`: the tube along a path, the ground it covers, its clearance from people."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.codegen.c_source import c_text
from workbench.codegen.online_source import OnlineSizes, online_source
from workbench.models.system import Ode
from workbench.reach.occupancy import clearance_function, occupancy_function
from workbench.reach.online.budget import Ranges
from workbench.reach.online.functions import OnlineFunctions, online_functions
from workbench.reach.online.model import OnlineModel
from workbench.runtime.layout import (
    NO_CLEARANCE_M,
    PERSON_NUMBERS,
    query_counts,
    result_counts,
    tile,
)
from workbench.runtime.manifest import Field
from workbench.sets import Box

PATH_NODES = 128
PEOPLE = 32
MOST_TUBES = 9
"""Tubes of one decision: of the whole initial set and of the cells it is cut into."""
SUBSTEPS = 3
"""Steps of integration for one row of the result."""
# Stations that a step may reach: this many times the fastest speed times the step, and some slack
# for the path's curvature; the kernel verifies after the step that the tube stayed within them.
_REACH = 1.5
_SLACK_M = 0.05


def decision_layout(ode: Ode, steps: int) -> tuple[tuple[Field, ...], tuple[Field, ...]]:
    """Query and result fields of the decision kernel of `ode`."""
    n = len(ode.states)
    counts = query_counts(
        states=n, parameters=len(ode.parameters), path_nodes=PATH_NODES, people=PEOPLE
    )
    n_w = len(ode.disturbances)
    counts |= {"disturbance_lower": n_w, "disturbance_upper": n_w}
    defaults: dict[str, Sequence[float]] = {
        "parameters": ode.parameter_values(),
        "disturbance_lower": [d.lower for d in ode.disturbances],
        "disturbance_upper": [d.upper for d in ode.disturbances],
    }
    return tile(counts, defaults=defaults), tile(result_counts(states=n, steps=steps), defaults={})


def kernel_functions(ode: Ode, region: Box, *, substep_s: float) -> OnlineFunctions:
    """The online tube's Functions for a loop in path coordinates within `region`.

    Parameters are those of `ode` (a query may hold no others), except that the reference speed may
    be anything from 0 to the region's fastest speed.
    """
    values = np.array(OnlineModel.of(ode).form.parameter_values())
    low, high = values.copy(), values.copy()
    names = [parameter.name for parameter in ode.parameters]
    reference = names.index("reference_speed")
    low[reference], high[reference] = 0.0, region.interval("speed")[1]
    w = ode.disturbances
    disturbances = np.array([d.lower for d in w]), np.array([d.upper for d in w])
    ranges = Ranges(region, (low, high), disturbances, substep_s)
    return online_functions(ode, ranges, quadratic=())


def decision_source(ode: Ode, region: Box, *, steps: int, step_s: float) -> str:
    """Complete C text of `wb_decide` (and `wb_tube`) for a loop in path coordinates."""
    query, result = decision_layout(ode, steps)
    names, w_names = ode.names, [d.name for d in ode.disturbances]
    macros: dict[str, object] = {
        "STATION": names.index("station"),
        "SPEED": names.index("speed"), "HEADING_ERROR": names.index("heading_error"),
        "CURVATURE": w_names.index("curvature"), "STEP": step_s.hex(), "ROWS": steps,
        "SUBSTEPS": SUBSTEPS, "TUBES": MOST_TUBES, "OFFSET_STATE": names.index("offset"),
        "REACH": _REACH, "SLACK": _SLACK_M, "NODES": PATH_NODES,
        "PEOPLE": PEOPLE, "NO_CLEARANCE": NO_CLEARANCE_M,
        "QUERY_SIZE": query[-1].offset + query[-1].count,
        "RESULT_SIZE": result[-1].offset + result[-1].count,
    }  # fmt: skip
    macros |= {f"Q_{field.name.upper()}": field.offset for field in query}
    macros |= {f"R_{field.name.upper()}": field.offset for field in result}
    assert clearance_function().numel_in("person") == PERSON_NUMBERS
    substep_s = step_s / SUBSTEPS
    functions = kernel_functions(ode, region, substep_s=substep_s)
    sizes = OnlineSizes(steps * SUBSTEPS, substep_s)
    ground = [occupancy_function(), clearance_function()]
    return "\n".join([
        online_source(functions, region.reordered(ode.names), sizes, extra=ground),
        *[f"#define WB_{name} {value}" for name, value in macros.items()],
        c_text("decide.c"),
    ])  # fmt: skip
