"""The tubes that are held against drives: of the vehicle's own kernel, from what was measured."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol, final

import numpy as np

from workbench.codegen.bundle import LEVELS, MonitorSpec, bundle_files
from workbench.codegen.decision_source import PATH_NODES
from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.signals import Ranged
from workbench.models.stopping import REFERENCE_CHANGE
from workbench.models.vehicle import Vehicle
from workbench.reach.ranged_parameters import with_ranged_parameters_as_disturbances
from workbench.runtime import Bundle, Timing
from workbench.runtime.bundle import bundle_of
from workbench.runtime.layout import KernelStatus
from workbench.runtime.measuring import STATES, initial_sets
from workbench.runtime.onboard.times import DECIDE_EVERY, TURN_US, seconds
from workbench.runtime.path import PathTable
from workbench.runtime.query import PathWindows, crowd_values, parameter_values
from workbench.runtime.settings import fixed_values
from workbench.sets import Box
from workbench.simulation.frames import Rectangle
from workbench.simulation.paper.replayed import Array, Asked

STEP_S: Final = 0.05
BUDGET: Final = 6_000
"""Steps of integration per decision: twice the vehicle's, for tubes of 5 s in place of 3 s."""
_TIMING: Final = Timing(period_s=0.12, latency_s=0.1, send_gap_s=0.055)
_PLACE: Final = [STATES.index("station"), STATES.index("offset")]
_INTEGRALS: Final = ("speed_integral", "offset_integral")
_ROOM: Final = 10.0
_CURVATURE: Final = "curvature"
_ENDS: Final = ("disturbance_lower", "disturbance_upper")


@final
@dataclass(frozen=True, slots=True, eq=False)
class PathRows:
    """A tube's position. lower, upper (K, 2): station and offset (m) on all of [k step_s, (k + 1)
    step_s] after the decision; K ends where the proof does. ground: rectangles that contain the
    body, row by row."""

    lower: Array
    upper: Array
    step_s: float
    ground: tuple[Rectangle, ...] = ()


class PathTubes(Protocol):
    """A way to say where a car that tracks a path may be."""

    @property
    def title(self) -> str:
        """For a row of a table."""

    def rows(self, path: PathTable, asked: Asked, level: int) -> PathRows:
        """From one of the nested sets that a decision was about."""


def loaded(files: Mapping[str, bytes]) -> Bundle:
    """A bundle of which no file stays."""
    return bundle_of(files, Path("bundle"))


def paper_bundle(spec: MonitorSpec) -> Bundle:
    """The kernel of a `paper_spec`; some seconds."""
    return loaded(bundle_files(spec))


def paper_spec(vehicle: Vehicle, horizon_s: float, *, ramps: bool = False) -> MonitorSpec:
    """Three nested sets, as on the vehicle, and more room for the controller's integrals: over the
    paper's 5 s they reach farther than over the 3 s that the vehicle's own region is for.

    ramps: the reference speed may change, by as much as it is wanted to be at most; otherwise it
    holds for the whole tube, as in the vehicle's bundle."""
    region = vehicle.operation.region
    sides = {
        name: tuple(_ROOM * end if name in _INTEGRALS else end for end in region.interval(name))
        for name in region.names
    }
    most_mps = vehicle.operation.reference_speed_mps if ramps else 0.0
    wider = dataclasses.replace(
        vehicle.operation,
        region=Box.from_intervals({name: (low, high) for name, (low, high) in sides.items()}),
        reference_change_mps=(-most_mps, most_mps),
    )
    return MonitorSpec(
        dataclasses.replace(vehicle, operation=wider), horizon_s, STEP_S, levels=LEVELS,
        budget=BUDGET,
    )  # fmt: skip


@final
class KernelTubes:
    """TRACK's tubes of a bundle's kernel over its whole horizon, along any path.

    vehicle: the one the bundle is built for; unsure: with N, W and parameter ranges of its file;
    otherwise none of them acts, and the tube is that of the bicycle under its controller alone. Of
    a bundle that `ramps` the reference speed is on its way from that of the decision to the one
    that is wanted (see `ramp_of`); of others it holds. Rigor ENCLOSED along the path's curvature
    bounds.
    """

    def __init__(self, bundle: Bundle, vehicle: Vehicle, *, unsure: bool, title: str) -> None:
        self._bundle, self._title = bundle, title
        self._fixed = {
            **fixed_values(bundle.manifest.vehicle, 0.0, _TIMING), **crowd_values(()),
            "skew_s": (0.0, 0.0), "start_s": (0.0, 0.0),
        }  # fmt: skip
        self._disturbances = own_ranges(bundle) if unsure else certain(bundle, vehicle)
        operation = vehicle.operation
        self._wanted_mps = operation.reference_speed_mps
        self._ramps_at = None
        if any(operation.reference_change_mps):
            self._ramps_at = [each.name for each in _own(vehicle)].index(REFERENCE_CHANGE)
            self._fixed["reference_ramp"] = ramp_of(vehicle)
        self._windows: tuple[PathTable, PathWindows] | None = None

    @property
    def title(self) -> str:
        """For a row of a table."""
        return self._title

    def query(self, path: PathTable, asked: Asked, level: int) -> dict[str, Sequence[float]]:
        """What the kernel is asked: all its levels are the one set, and nobody is there, so that
        the first tube of each order is the whole answer."""
        if self._windows is None or self._windows[0] is not path:
            self._windows = path, PathWindows(path, nodes=PATH_NODES)
        box = asked.sets[level]
        manifest = self._bundle.manifest
        return {
            **self._fixed,
            **self._ranges(asked.reference_speed_mps),
            **self._windows[1].around(box.interval("station")[0]),
            **initial_sets([box] * len(manifest.levels)),
            "parameters": parameter_values(manifest, asked.reference_speed_mps),
        }

    def _ranges(self, reference_mps: float) -> Mapping[str, Sequence[float]]:
        """Of all disturbances; the reference may be ramped to the speed that is wanted."""
        found = {name: list(each) for name, each in self._disturbances.items()}
        if self._ramps_at is not None:
            change_mps = self._wanted_mps - reference_mps
            for name, end in zip(_ENDS, sorted((0.0, change_mps)), strict=True):
                found[name][self._ramps_at] = end
        return found

    def rows(self, path: PathTable, asked: Asked, level: int) -> PathRows:
        """As far as the proof goes; nothing where the set has left what the kernel covers."""
        result = self._bundle.call(self.query(path, asked, level))
        count, step_s = int(result.scalar("track_rows")), self._bundle.manifest.step_s
        if result.scalar("status") != KernelStatus.COMPLETE:
            count = 0
        lower, upper = (
            np.array(result.rows(f"track_{end}", width=len(STATES), count=count).numbers)
            .reshape(count, len(STATES))[:, _PLACE]
            for end in ("lower", "upper")
        )  # fmt: skip
        ground = result.rows("track_occupancy", width=5, count=count)
        return PathRows(lower, upper, step_s, tuple((x, y, h, a, b) for x, y, h, a, b in ground))


def ramp_of(vehicle: Vehicle) -> tuple[float, float, float]:
    """How the vehicle brings its reference speed up, or down, while every decision is TRACK: least
    and most pace (m/s^2), and by how much (s) it may be early or late.

    It changes at each decision, by what one turn's slew allows (`ramped_reference_mps`): in steps,
    so that it may be a period late; and another one where a decision could not be made. That is of
    turns on time, as those of a drive in virtual time are: late ones change the pace.
    Raises InputError for a vehicle without [drive_by_wire]."""
    if vehicle.drive_by_wire is None:
        raise InputError(
            f"{vehicle.name}: expected a vehicle with [drive_by_wire], which says how fast "
            "commands may change"
        )
    pedals = vehicle.drive_by_wire.value.pedals
    pace_mps2 = pedals.slew_mps3 / vehicle.speed_pid.proportional_per_s / DECIDE_EVERY
    return pace_mps2, pace_mps2, 2 * DECIDE_EVERY * seconds(TURN_US)


def certain(bundle: Bundle, vehicle: Vehicle) -> Mapping[str, Sequence[float]]:
    """The fields of a query's disturbances with none of N, W and the parameters' ranges."""
    own, found = _own(vehicle), {}
    for name, default in own_ranges(bundle).items():
        values = [
            d.nominal if d.name != _CURVATURE else v for d, v in zip(own, default, strict=False)
        ]
        found[name] = (*values, *default[len(own) :])
    return found


def own_ranges(bundle: Bundle) -> dict[str, Sequence[float]]:
    """The same fields as the bundle was built with."""
    found = {field.name: field.default for field in bundle.manifest.query if field.name in _ENDS}
    return {name: default for name, default in found.items() if default is not None}


def _own(vehicle: Vehicle) -> tuple[Ranged, ...]:
    """The disturbances of TRACK, which come first among a kernel's."""
    most = vehicle.operation.curvature_per_m
    ode = vehicle.uncertain_loop(vehicle.track(), PathFrame(-most, most)).ode
    return with_ranged_parameters_as_disturbances(ode).disturbances


def nested(tubes: PathTubes, path: PathTable, asked: Asked) -> tuple[tuple[Rectangle, ...], ...]:
    """The ground that the body covers from each nested set, the largest first."""
    return tuple(tubes.rows(path, asked, level).ground for level in range(len(asked.sets)))
