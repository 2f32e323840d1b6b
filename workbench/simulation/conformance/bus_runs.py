"""Drives over the bus as closed-loop runs: the truth at decisions, and the law's integrals."""

from __future__ import annotations

from typing import Final

import numpy as np

from workbench.errors import InputError
from workbench.simulation.bus_drive import BusDrive
from workbench.simulation.conformance.driven_runs import DrivenRun
from workbench.simulation.scenarios.scenario import Scenario

_SAME_MPS: Final = 1e-9
_END_M: Final = 0.5


def driven_run(
    name: str, driven: BusDrive, scenario: Scenario, *, reference_speed_mps: float
) -> DrivenRun:
    """A row per decision. TRACK is said where TRACK was sent towards the reference speed itself: on
    the way up to it the loop changes from decision to decision. Only what lies on the path itself.
    Raises InputError for a drive without a decision there."""
    rows, tracking, length_m = [], [], scenario.path.length_m
    for instant in driven.instants:
        told, motion = instant.observation, instant.motion
        if told is None or not _END_M <= instant.station_m <= length_m - _END_M:
            continue
        rows.append([
            instant.t_s, motion.x_m, motion.y_m, motion.heading, motion.road_wheel_rad,
            motion.speed_mps, told.speed_integral[0], told.offset_integral[0],
        ])  # fmt: skip
        risen = abs(told.reference_speed_mps - reference_speed_mps) <= _SAME_MPS
        tracking.append(instant.tracks and risen)
    if not rows:
        raise InputError(f"{name}: expected a drive with decisions on its path, got none")
    return DrivenRun(name, np.array(rows), np.array(tracking), np.array(scenario.waypoints))
