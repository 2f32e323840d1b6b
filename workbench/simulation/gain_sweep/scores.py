"""The score of one choice of gains in one case: stability, margins, proved tube, runs."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from workbench.models.gains.lateral import LateralLoop
from workbench.models.vehicle import Vehicle
from workbench.runtime.policies.horizon import Timing
from workbench.sets import Box
from workbench.simulation.gain_sweep.figures import INSTANTS_S
from workbench.simulation.gain_sweep.gains import as_parameters, own_gains, with_gains
from workbench.simulation.gain_sweep.kernels import (
    HORIZON_S,
    RUN_S,
    RUN_STEP_S,
    STEP_S,
    Array,
    Kernels,
    Tube,
)
from workbench.simulation.gain_sweep.margins import LoopScore, loop_score, speed_margins
from workbench.simulation.gain_sweep.plan import Case, as_data
from workbench.simulation.simulated import MONITOR

Score = dict[str, str | float | bool]
SETTLED_M: Final = 0.05
SPEED_SETTLED_MPS: Final = 0.05
_CORNERS: Final = ("offset", "heading_error", "speed")
# Of a run whose offset leaves this band nothing more is said.
_LOST_M: Final = 1e3


def score(kernels: Kernels, gains: Mapping[str, float], case: Case) -> Score:
    """One row: gains, case and every figure; NaN for what the proof or the runs do not reach."""
    vehicle = with_gains(kernels.vehicle, gains, case.speed_mps)
    loop = loop_score_of(LateralLoop.of(vehicle))
    speed = speed_margins(vehicle.speed_pid.proportional_per_s, vehicle.speed_pid.integral_per_s2)
    parameters = as_parameters(gains) | {"reference_speed": case.speed_mps}
    start = start_of(vehicle, case)
    tube = kernels.tube.tube(start, parameters, inputs_of(vehicle, case))
    middle = sum(case.curvature_per_m) / 2.0
    runs = kernels.runs.runs(corners(start, kernels.runs.ode.names), parameters, middle)
    found: Score = {
        **own_gains(vehicle), **as_data(case),
        "stable": loop.stable and speed.stable,
        "reason": loop.reason.short if speed.stable or not loop.stable else "speed loop",
        "decay_per_s": loop.decay_per_s, "phase_deg": loop.phase_deg,
        "delay_margin_s": loop.delay_margin_s, "disk": loop.disk, "tube_whole": tube.whole,
        "speed_phase_deg": speed.phase_deg, "speed_delay_margin_s": speed.delay_margin_s,
    }  # fmt: skip
    names = kernels.tube.ode.names
    found |= _tube_figures(vehicle, tube, names) | run_figures(vehicle, runs, names)
    return found | speed_figures(runs[:, :, names.index("speed")], case.speed_mps)


@functools.lru_cache(maxsize=64)
def loop_score_of(loop: LateralLoop) -> LoopScore:
    """As `loop_score`; cases that differ in curvature or initial set share it."""
    return loop_score(loop)


def start_of(vehicle: Vehicle, case: Case) -> Box:
    """The case's initial set; its steering is about what the middle of the curvature asks for."""
    held = vehicle.initial_set
    radius = dict(zip(held.names, held.radius, strict=True))
    center = dict.fromkeys(held.names, 0.0)
    bend = sum(case.curvature_per_m) / 2.0
    steering = math.atan(vehicle.geometry.wheelbase_m * bend)
    center |= {"offset": case.start.offset_m, "speed": case.speed_mps, "steering": steering}
    return Box.around(
        center, radius={name: case.start.radius_factor * r for name, r in radius.items()}
    )


def inputs_of(vehicle: Vehicle, case: Case) -> dict[str, tuple[float, float]]:
    """Curvature, and N and W as the vehicle has them with its gains, by the loop's names."""
    unsure = vehicle.unsure()
    error, push = unsure.estimation_error(), unsure.disturbance()
    bounds = {
        "position_error_lateral": error.lateral_m, "heading_estimate_error": error.heading_rad,
        "speed_estimate_error": error.speed_mps, "acceleration_disturbance": push.acceleration_mps2,
        "steering_rate_disturbance": push.steering_rate_radps,
    }  # fmt: skip
    found = {name: (-bound, bound) for name, bound in bounds.items()}
    return found | {"curvature": case.curvature_per_m}


def corners(start: Box, names: tuple[str, ...]) -> Array:
    """Corners of the set along offset, heading error and speed, middles elsewhere (8 x n)."""
    box = start.reordered(names)
    rows = []
    for signs in itertools.product((-1.0, 1.0), repeat=len(_CORNERS)):
        row = np.array(box.center)
        for name, sign in zip(_CORNERS, signs, strict=True):
            row[names.index(name)] += sign * box.radius[names.index(name)]
        rows.append(row)
    return np.array(rows)


def _tube_figures(vehicle: Vehicle, tube: Tube, names: tuple[str, ...]) -> dict[str, float]:
    half = (tube.upper_at - tube.lower_at) / 2.0
    along, lateral = half[:, names.index("station")], half[:, names.index("offset")]
    found = {"proved_until_s": HORIZON_S if tube.whole else tube.until_s}
    for name, values in (("along", along), ("lateral", lateral)):
        for t in INSTANTS_S:
            k = round(t / STEP_S)
            found[f"{name}_{t:g}s_m"] = float(values[k]) if k < len(values) else math.nan
    found["area_3s_m2"] = 4.0 * found["along_3s_m"] * found["lateral_3s_m"]
    found["growth"] = float(lateral.max() / lateral[0]) if tube.whole else math.nan
    return found | {"stopping_m": stopping_m(vehicle, tube, names, MONITOR.timing)}


def stopping_m(vehicle: Vehicle, tube: Tube, names: tuple[str, ...], timing: Timing) -> float:
    """Farthest (m) from the middle of the initial set to standstill, along the path, proved.

    TRACK's tube up to the last switch b of a plan, then v1 t + v1^2 / (2 (d - a)), v1 = v + a t the
    fastest until braking has built up, t = delay + build-up, d the least deceleration, a what the
    acceleration may be off by. NaN where the proof ends before b.
    """
    steps = math.ceil(timing.switch_s[1] / STEP_S)
    if len(tube.upper) < steps:
        return math.nan
    station, speed = names.index("station"), names.index("speed")
    brake, off = vehicle.brake, vehicle.unsure().acceleration_mps2
    wait_s = brake.delay_s + brake.build_up_s
    middle = (tube.lower_at[0, station] + tube.upper_at[0, station]) / 2.0
    fastest = max(float(tube.upper[:steps, speed].max()), 0.0) + off * wait_s
    reached = float(tube.upper[:steps, station].max() - middle)
    return reached + fastest * wait_s + fastest**2 / (2.0 * (brake.deceleration_min_mps2 - off))


def run_figures(vehicle: Vehicle, runs: Array, names: tuple[str, ...]) -> dict[str, float]:
    """Settling: the last time at which a run is more than SETTLED_M from where it ends, NaN where
    that is in the last tenth of the time; saturated: share of the time before, whole steps alone.
    """
    offset, steering = runs[:, :, names.index("offset")], runs[:, :, names.index("steering")]
    if not np.all(np.abs(offset) < _LOST_M):
        return dict.fromkeys(("settling_s", "rest_m", "saturated"), math.nan)
    away = np.abs(offset - offset[:, -1:]) > SETTLED_M
    last = np.flatnonzero(away.any(axis=0))
    steps = int(last[-1]) + 1 if len(last) else 1
    settled = RUN_STEP_S * (steps - 1)
    rate = np.abs(np.diff(steering, axis=1)) / RUN_STEP_S
    at_limit = rate >= (1.0 - 1e-6) * vehicle.limits.steering_rate_radps
    return {
        "settling_s": settled if settled <= 0.9 * RUN_S else math.nan,
        "rest_m": float(np.abs(offset[:, -1]).max()),
        "saturated": float(at_limit[:, :steps].mean()),
    }


def speed_figures(speeds: Array, reference_mps: float) -> dict[str, float]:
    """Of runs' speeds (runs x instants, m/s): the last time that one is more than SPEED_SETTLED_MPS
    from the reference, NaN where that is in the last tenth; and the farthest beyond it, seen from
    where the run begins."""
    error = speeds - reference_mps
    away = np.flatnonzero((np.abs(error) > SPEED_SETTLED_MPS).any(axis=0))
    settled = RUN_STEP_S * (int(away[-1]) if len(away) else 0)
    beyond = -np.sign(error[:, :1]) * error
    return {
        "speed_settling_s": settled if settled <= 0.9 * RUN_S else math.nan,
        "speed_overshoot_mps": float(beyond.max(initial=0.0)),
    }
