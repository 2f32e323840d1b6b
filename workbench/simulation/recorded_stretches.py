"""Runs to learn from, cut from a folder of drives or of recordings."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.tables import Table
from workbench.models.spline_path import SplinePath
from workbench.sensitivity.learning.recorded_pairs import RecordedPairs, Stretch
from workbench.sensitivity.vectorised import Array
from workbench.simulation.conformance.driven_runs import DrivenRun, holds_runs, load_runs
from workbench.simulation.conformance.track_loop import path_states
from workbench.simulation.recording import VEHICLE_COLUMNS, Recording, load_recording

LOOP: Final = {
    "station": 0.5, "offset": 0.2, "steering": 0.05, "speed": 0.2, "heading_error": 0.05,
    "speed_integral": 0.5, "offset_integral": 0.5,
}  # fmt: skip
"""States of drives, along their path, and the radius within which two starts are near."""
CAR: Final = {"x": 0.0, "y": 0.0, "heading": 0.0, "speed": 0.5, "yaw_rate": 0.1}
"""States of recordings: where the car is from where it was at the beginning, ahead and to the left;
its direction from then; speed and yaw rate."""
_UNITS: Final = {
    "station": "m", "offset": "m", "steering": "rad", "speed": "m/s", "heading_error": "rad",
    "speed_integral": "m", "offset_integral": "m s", "x": "m", "y": "m", "heading": "rad",
    "yaw_rate": "rad/s",
}  # fmt: skip
_EVERY_S: Final = 0.5
_STANDS_MPS: Final = 0.1
_GAP_S: Final = 0.5
_SAME_S: Final = 1e-9


def unit_of(state: str) -> str:
    """Of a state of `LOOP` or `CAR`."""
    return _UNITS[state]


def recorded_pairs(
    folder: Path, times: Array, radius: dict[str, float], seed: int
) -> RecordedPairs:
    """Pairs of a folder that `workbench drives` wrote, or of one with vehicles.csv.

    times (K+1,), s; radius: by state, in place of those of `LOOP` or `CAR`. Drives: stretches under
    TRACK on one path, in its coordinates. Recordings: moving stretches, seen from where they begin.
    Raises InputError for a folder that is neither, for states that it has not, and where there are
    no pairs.
    """
    if holds_runs(folder):
        usual, what = LOOP, f"stretches under TRACK of the drives of {folder.name} along one path"
        stretches = list(_of_drives(load_runs(folder), times))
    elif Table.exists(folder, "vehicles"):
        usual, what = CAR, f"moving stretches of the recordings of {folder.name}"
        stretches = list(_of_recordings(folder, times))
    else:
        raise InputError(
            f"{folder}: expected runs.csv (`workbench drives` writes it) or vehicles.csv "
            "(recordings), plain or .gz, found neither"
        )
    unknown = sorted(set(radius) - set(usual))
    if unknown:
        raise InputError(
            f"--radius: expected states of these runs ({', '.join(usual)}), got "
            f"{', '.join(unknown)}"
        )
    merged = usual | radius
    return RecordedPairs.matched(
        stretches, names=tuple(merged), times=times, radius=tuple(merged.values()), seed=seed,
        what=what,
    )  # fmt: skip


def _of_drives(runs: tuple[DrivenRun, ...], times: Array) -> Iterator[Stretch]:
    for run in runs:
        path = SplinePath.through(run.waypoints)
        place = repr(run.waypoints.tolist())
        states = path_states(run, path)
        for at, inside in _grids(run.column("t"), times):
            if run.tracking[inside].all():
                yield Stretch(run.name, place, _interpolated(at, run.column("t"), states))


def _of_recordings(folder: Path, times: Array) -> Iterator[Stretch]:
    rows = Table.read(folder, "vehicles", VEHICLE_COLUMNS).rows
    agents = sorted({(row.text("recording"), row.text("agent")) for row in rows})
    for name, agent in agents:
        recording = load_recording(folder, name, agent=agent)
        clock, states = _car_states(recording)
        for at, inside in _grids(clock, times):
            moves = (states[inside, 3] > _STANDS_MPS).all()
            if moves and (np.diff(clock[inside]) <= _GAP_S).all():
                found = _interpolated(at, clock, states)
                yield Stretch(name, recording.kind, _from_start(found))


def _car_states(recording: Recording) -> tuple[Array, Array]:
    """Clock (M,) and x, y, heading, speed, yaw rate (M, 5); the yaw rate as recorded, else the
    slope of the heading."""
    samples = recording.vehicle
    clock = np.array([each.t_s for each in samples])
    heading = np.unwrap([each.heading_rad for each in samples])
    rates = [each.yaw_rate_radps for each in samples]
    turning = np.gradient(heading, clock) if None in rates else np.array(rates, dtype=np.float64)
    place = [(each.x_m, each.y_m) for each in samples]
    speed = [each.speed_mps for each in samples]
    return clock, np.column_stack([place, heading, speed, turning])


def _from_start(states: Array) -> Array:
    """Place and direction as seen from the first row."""
    x, y, heading = (states[:, i] - states[0, i] for i in range(3))
    cosine, sine = np.cos(states[0, 2]), np.sin(states[0, 2])
    ahead, left = cosine * x + sine * y, cosine * y - sine * x
    return np.column_stack([ahead, left, heading, states[:, 3:]])


def _grids(clock: Array, times: Array) -> Iterator[tuple[Array, slice]]:
    """Instants (K+1,) from a start every half second on, and the rows that cover them."""
    start, last = float(clock[0]), float(clock[-1]) - float(times[-1])
    for k in range(int((last - start + _SAME_S) / _EVERY_S) + 1 if last >= start else 0):
        at = start + k * _EVERY_S + times
        first = int(np.searchsorted(clock, at[0] + _SAME_S, side="right")) - 1
        end = int(np.searchsorted(clock, at[-1] - _SAME_S, side="left")) + 1
        yield at, slice(first, min(end, len(clock)))


def _interpolated(at: Array, clock: Array, states: Array) -> Array:
    return np.column_stack([np.interp(at, clock, column) for column in states.T])
