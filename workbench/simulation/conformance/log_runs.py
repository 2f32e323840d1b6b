"""A log of the monitor as a closed-loop run: what its decisions were told, replayed."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from workbench.errors import InputError
from workbench.runtime import Bundle
from workbench.runtime.arc import Interval
from workbench.runtime.observation import Observation
from workbench.runtime.onboard.playback import play
from workbench.runtime.onboard.playback_logs import open_log
from workbench.runtime.onboard.playback_settings import core_again, settings_again
from workbench.runtime.onboard.recorder_header import LogHeader
from workbench.runtime.onboard.states import State
from workbench.runtime.path import PathTable
from workbench.simulation.conformance.driven_runs import DrivenRun

_SAME_MPS: Final = 1e-9
_WAYPOINT_M: Final = 2.0


def run_from_log(file: Path, bundle: Bundle) -> DrivenRun:
    """A row per decision of a log (.mcap, or with its run.json beside it) made with `bundle`.

    Nobody knows where the car truly was: the middles of what the monitor was told stand for it, so
    that their errors are in whatever is fitted to the run. TRACK is said where it was sent towards
    the reference speed itself. Raises InputError for a log without a header or without decisions,
    and for another bundle's.
    """
    log = open_log(file)
    if log.header is None:
        raise InputError(
            f"{file}: expected the run.json that workbench-monitor wrote beside the log, found "
            "none; put it there"
        )
    _require_same(bundle, log.header, file)
    reference_mps = settings_again(log.header.settings).reference_speed_mps
    rows, tracking = [], []
    for result in play(core_again(bundle, log.header), log.events):
        told = result.observation
        if told is None:
            continue
        rows.append([result.at_us / 1e6, *_middles(told)])
        risen = abs(told.reference_speed_mps - reference_mps) <= _SAME_MPS
        tracking.append(result.state is State.TRACKING and risen)
    if not rows:
        raise InputError(f"{file}: expected a drive with decisions, got none")
    table = np.array(rows)
    table[:, 3] = np.unwrap(table[:, 3])
    return DrivenRun(file.stem, table, np.array(tracking), _waypoints(log.header.path))


def _require_same(bundle: Bundle, header: LogHeader, file: Path) -> None:
    if header.manifest_sha256 != bundle.manifest_sha256:
        raise InputError(
            f"{file}: expected the bundle whose manifest has the SHA-256 "
            f"{header.manifest_sha256[:16]}..., got {bundle.manifest_sha256[:16]}...; name the one "
            "that the log was made with"
        )


def _middles(told: Observation) -> tuple[float, ...]:
    """In the order of `driven_runs.NUMBERS`, without the time."""

    def middle(ends: Interval) -> float:
        return 0.5 * (ends[0] + ends[1])

    return (
        middle(told.x), middle(told.y), middle(told.heading), middle(told.steering),
        middle(told.speed), told.speed_integral[0], told.offset_integral[0],
    )  # fmt: skip


def _waypoints(path: PathTable) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Nodes some metres apart, the last one among them."""
    every = max(1, round(_WAYPOINT_M / path.spacing_m))
    places = list(zip(path.x, path.y, strict=True))
    return np.array([*places[:-1:every], places[-1]])
