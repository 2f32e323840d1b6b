"""C text of `wb_decide`: three tubes along a path, the ground they cover, distances from people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.codegen.c_source import c_text
from workbench.codegen.decision_header import decision_header
from workbench.codegen.learned_source import learned_tables, simulation_step
from workbench.codegen.online_source import OnlineSizes, online_source
from workbench.codegen.separation_source import separation_text
from workbench.controllers import VehicleBrake
from workbench.models.stopping import (
    ACCELERATION_DISTURBANCE,
    BRAKE_SPEED,
    BRAKING,
    FREE_STEERING,
    INTEGRAL_SHARE,
    INTEGRATING,
    REFERENCE_CHANGE,
    SPEED_ERROR,
    STEERING_DISTURBANCE,
    STEERING_SHARE,
    TRACKING,
    stopping_loop,
)
from workbench.models.system import Ode
from workbench.reach.learned.tube import LearnedTube
from workbench.reach.occupancy import occupancy_function
from workbench.reach.online.budget import Ranges
from workbench.reach.online.functions import OnlineFunctions
from workbench.reach.online.kernels import LOCAL_LINEAR, Method
from workbench.reach.online.model import OnlineModel
from workbench.reach.person_gap import separation_functions
from workbench.runtime.layout import MOST_PIECES_IN_ALL, query_counts, result_counts, tile
from workbench.runtime.manifest import Field
from workbench.runtime.person_tubes import KIND_NUMBERS, TubeKind
from workbench.sets import Box

PATH_NODES = 128
MOST_TUBES = 9
"""Tubes for one deciding set: of the whole of it and of the cells it is cut into."""
SUBSTEPS = 3
"""Steps of integration for one row of the result, where one step is too coarse."""
# Stations that a step may reach: this many times the fastest speed times the step, and some slack
# for the path's curvature; the kernel verifies after the step that the tube stayed within them.
_REACH = 1.5
_SLACK_M = 0.05
# Rounding of the instants that a plan is asked about.
_GRAIN_S = 1e-9
# While BRAKE may be in force the speed lies within the region's, or as far outside of it as the
# fastest change of a switch interval takes it.
_SPEED_ROOM_MPS = 1.0
# Least and most pace (m/s^2) and slack (s) with which the reference changes anyhow.
_ANY_RAMP = (0.0, 1e6, 1.0)


@final
@dataclass(frozen=True, slots=True)
class DecisionSizes:
    """What is fixed when a decision's kernel is built.

    steps rows of step_s (s) each, or no more and no longer ones where a query asks for them;
    levels: how many nested sets; deciding: index of the one that is cut into cells and reported;
    budget: most steps of integration tried in one decision; method: kernel and form of the tubes.
    """

    steps: int
    step_s: float
    levels: int
    deciding: int
    budget: int
    method: Method = LOCAL_LINEAR


def decision_loop(track: Ode, region: Box) -> Ode:
    """The loop of all three tubes: `stopping_loop` over the region's speeds and some more."""
    slowest, fastest = region.interval("speed")
    room = _SPEED_ROOM_MPS
    return stopping_loop(track, speeds_mps=(min(slowest, 0.0) - room, fastest + room))


def decision_layout(
    track: Ode, brake: VehicleBrake, sizes: DecisionSizes
) -> tuple[tuple[Field, ...], tuple[Field, ...]]:
    """Query and result fields of the decision kernel of the TRACK loop `track`."""
    n = len(track.states)
    counts = query_counts(
        states=n, parameters=len(track.parameters), path_nodes=PATH_NODES, levels=sizes.levels
    )
    w = (*track.disturbances, *stopping_loop(track, speeds_mps=(0.0, 0.0)).disturbances[-4:])
    counts |= {"disturbance_lower": len(w), "disturbance_upper": len(w), "brake": 5}
    ramps = REFERENCE_CHANGE in (d.name for d in w)
    counts |= {"horizon_s": 1, "step_s": 1, "reference_ramp": ramps * len(_ANY_RAMP)}
    defaults: dict[str, Sequence[float]] = {
        "disturbance_lower": [d.lower for d in w],
        "disturbance_upper": [d.upper for d in w],
        "brake": [
            brake.deceleration_min_mps2, brake.deceleration_max_mps2, brake.delay_s,
            brake.build_up_s, brake.stop_speed_mps,
        ],
        "horizon_s": [sizes.steps * sizes.step_s],
        "step_s": [sizes.step_s],
        "reference_ramp": _ANY_RAMP,
    }  # fmt: skip
    results = result_counts(states=n, steps=sizes.steps, levels=sizes.levels)
    return tile(counts, defaults=defaults), tile(results, defaults={})


def kernel_functions(
    loop: Ode, region: Box, *, step_s: float, method: Method = LOCAL_LINEAR
) -> OnlineFunctions:
    """The online tube's Functions for a `decision_loop` in path coordinates within `region`.

    Parameters are those of `loop` (a query may hold no others), except that the reference speed may
    be anything from 0 to the region's fastest speed, and that the modes switch.
    """
    values = np.array(OnlineModel.of(loop).form.parameter_values())
    low, high = values.copy(), values.copy()
    names = [parameter.name for parameter in loop.parameters]
    for name in ("reference_speed", TRACKING, BRAKING, INTEGRATING):
        low[names.index(name)] = 0.0
    high[names.index("reference_speed")] = region.interval("speed")[1]
    w = loop.disturbances
    disturbances = np.array([d.lower for d in w]), np.array([d.upper for d in w])
    ranges = Ranges(region, (low, high), disturbances, step_s)
    return method.functions(loop, ranges)


def decision_source(
    track: Ode, brake: VehicleBrake, region: Box, sizes: DecisionSizes, *,
    learned: LearnedTube | None = None,
) -> str:  # fmt: skip
    """Complete C text of `wb_decide` (and `wb_tube`) for a TRACK loop in path coordinates.

    learned: computes TRACK's tube in place of `sizes.method`; `wb_learned_tube` is it alone.
    """
    loop = decision_loop(track, region)
    macros = _macros(loop, sizes)
    query, result = decision_layout(track, brake, sizes)
    functions = kernel_functions(loop, region, step_s=sizes.step_s, method=sizes.method)
    online = OnlineSizes(sizes.steps * SUBSTEPS, sizes.step_s)
    extra = [occupancy_function(), *separation_functions()]
    texts = ["path.c", "drive.c", "decide.c"]
    tables = ""
    if learned is not None:
        extra.append(simulation_step(track))
        tables = learned_tables(learned, horizon_s=sizes.steps * sizes.step_s)
        macros["TUBES"] = max(MOST_TUBES, learned.count)
        texts.append("learned_decide.c")
    return "\n".join([
        online_source(functions, region.reordered(loop.names), online, extra=extra),
        *[f"#define WB_{name} {value}" for name, value in macros.items()],
        decision_header(query, result), separation_text(), tables, *map(c_text, texts),
    ])  # fmt: skip


def _index(names: Sequence[str], name: str) -> int:
    return names.index(name) if name in names else -1


def _macros(loop: Ode, sizes: DecisionSizes) -> dict[str, object]:
    names = loop.names
    p_names, w_names = (
        [s.name for s in signals] for signals in (loop.parameters, loop.disturbances)
    )
    return {
        "STATION": names.index("station"), "OFFSET_STATE": names.index("offset"),
        "SPEED": names.index("speed"), "HEADING_ERROR": names.index("heading_error"),
        "SPEED_INTEGRAL": names.index("speed_integral"),
        "CURVATURE": w_names.index("curvature"), "BRAKE_SPEED": w_names.index(BRAKE_SPEED),
        "STEERING_SHARE": w_names.index(STEERING_SHARE), "STEERING": names.index("steering"),
        "INTEGRAL_SHARE": w_names.index(INTEGRAL_SHARE),
        "FREE_STEERING": w_names.index(FREE_STEERING),
        "PUSH": _index(w_names, ACCELERATION_DISTURBANCE),
        "MISREAD": _index(w_names, SPEED_ERROR), "TURN": _index(w_names, STEERING_DISTURBANCE),
        "REFERENCE_CHANGE": _index(w_names, REFERENCE_CHANGE),
        "RATE_MIN": p_names.index("steering_rate_min"),
        "RATE_MAX": p_names.index("steering_rate_max"),
        "TRACKING": p_names.index(TRACKING), "BRAKING": p_names.index(BRAKING),
        "INTEGRATING": p_names.index(INTEGRATING),
        "ACCEL_MIN": p_names.index("acceleration_min"),
        "ACCEL_MAX": p_names.index("acceleration_max"), "OWN_PARAMETERS": len(p_names) - 3,
        "INTENT": KIND_NUMBERS.index(TubeKind.INTENT), "GUARD": KIND_NUMBERS.index(TubeKind.GUARD),
        "ROWS": sizes.steps, "SUBSTEPS": SUBSTEPS,
        "TUBES": MOST_TUBES, "LEVELS": sizes.levels, "DECIDING": sizes.deciding,
        "BUDGET": f"{sizes.budget}L", "REACH": _REACH, "SLACK": _SLACK_M, "GRAIN": _GRAIN_S,
        "NODES": PATH_NODES, "POOL": MOST_PIECES_IN_ALL,
    }  # fmt: skip
