"""Replay: run a monitor over a recorded drive, sample by sample, and measure what it decided.

Replay is open-loop: the recorded car does not obey, so a BRAKE changes nothing of what follows, and
the driver is not the controller of the bundle.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.models.vehicle import Vehicle
from workbench.models.vehicle_sections import Geometry
from workbench.runtime.path import PathTable
from workbench.sets import Box
from workbench.simulation.measures import Drawing, Judge, Measures, Moment, Progress
from workbench.simulation.observing import Observer, StateErrors, rear_axle
from workbench.simulation.people import Body, PeopleModel, seen_people
from workbench.simulation.recorded_path import PathSmoothing, corners, recorded_path
from workbench.simulation.recording import Recording, VehicleSample
from workbench.simulation.runlog import Entry

OPEN_LOOP = (
    "Replay is open-loop: the recorded car does not obey the decisions, and its driver is not the "
    "controller that the bundle was built for."
)


@final
@dataclass(frozen=True, slots=True)
class ReplaySettings:
    """errors: around the recorded state; people, path: how they are predicted and smoothed;
    speed_limit_mps: faster samples are not judged; reference_ahead_m: recorded point ahead of the
    rear axle; drawn_horizon_s, drawn_step_s: people's discs kept for the report.
    """

    errors: StateErrors
    people: PeopleModel
    path: PathSmoothing
    speed_limit_mps: float
    reference_ahead_m: float
    drawn_horizon_s: float
    drawn_step_s: float

    def __post_init__(self) -> None:
        for name in ("speed_limit_mps", "drawn_horizon_s", "drawn_step_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{name}: expected a finite number above zero, got {value!r}")
        if not math.isfinite(self.reference_ahead_m):
            raise InputError(
                f"reference_ahead_m: expected finite metres, got {self.reference_ahead_m!r}"
            )

    @classmethod
    def instrumented_car(cls) -> ReplaySettings:
        """A GNSS/INS car whose point lies 0.3 m ahead of the rear axle, judged up to 8 m/s."""
        return cls(
            StateErrors.assumed(), PeopleModel.assumed(), PathSmoothing.usual(), 8.0, 0.3, 3.0, 0.5
        )


@final
@dataclass(frozen=True, slots=True)
class ReplayResult:
    """What the monitor decided over one recording.

    entries: the judged samples in time order; too_fast, reversing: samples that were not judged;
    notes: what a reader must know, first of all that replay is open-loop.
    """

    recording: str
    agent: str
    entries: tuple[Entry, ...]
    measures: Measures
    too_fast: int
    reversing: int
    notes: tuple[str, ...]

    def summary_line(self) -> str:
        """Queries, braked share, smallest separation and time per decision, in one line."""
        return f"{self.recording}: {self.measures.summary()}, open-loop"


def replay_path(recording: Recording, settings: ReplaySettings) -> PathTable:
    """The path that a monitor for `replay` must be given: the recorded one, smoothed."""
    path = recorded_path(recording, settings.path, reference_ahead_m=settings.reference_ahead_m)
    return settings.path.table(path)


def replay_vehicle(recording: Recording, base: Vehicle, settings: ReplaySettings) -> Vehicle:
    """`base` with the recording's own shape, measured from the rear axle, the settings' steering
    limits, and a region of speeds that reaches 2 m/s beyond the fastest judged sample.
    """
    shape, ahead_m = recording.shape, settings.reference_ahead_m
    geometry = Geometry(
        shape.wheelbase_m,
        shape.front_m + ahead_m,
        shape.rear_m - ahead_m,
        shape.half_width_m,
        f"shapes.csv of recording {recording.name}, its point {ahead_m:g} m ahead of the rear axle",
    )
    region = base.operation.region
    lowest, highest = region.interval("speed")
    wider = {name: region.interval(name) for name in region.names}
    wider["speed"] = (lowest, max(highest, settings.speed_limit_mps + 2.0))
    operation = dataclasses.replace(base.operation, region=Box.from_intervals(wider))
    named = base.with_geometry(geometry, name=f"{recording.name} {recording.agent}")
    limits = dataclasses.replace(
        base.limits,
        steering_rad=settings.errors.steering_limit_rad,
        steering_rate_radps=settings.errors.steering_rate_limit_radps,
        provenance=f"steering: assumed for replay; otherwise {base.limits.provenance}",
    )
    return dataclasses.replace(named, operation=operation, limits=limits)


def replay(
    recording: Recording,
    monitor: Judge,
    *,
    settings: ReplaySettings,
    progress: Progress | None = None,
) -> ReplayResult:
    """Ask `monitor` at every sample that counts, using only samples with time <= t.

    The monitor must have been built for `replay_path` and `replay_vehicle`; the route and nothing
    else of the future is used. `progress(done, total)` is called after each sample. Raises
    InputError when the vehicle does not move or no sample is slow enough.
    """
    drawing = Drawing(
        settings.drawn_horizon_s, settings.drawn_step_s, corners(replay_path(recording, settings))
    )
    _require_slow_samples(recording, settings)
    observer = Observer(
        settings.errors,
        wheelbase_m=recording.shape.wheelbase_m,
        reference_ahead_m=settings.reference_ahead_m,
    )
    entries = []
    for done, sample in enumerate(recording.vehicle, start=1):
        people = seen_people(recording.people, sample.t_s, settings.people)
        observation = observer.observe(sample, people)
        if _counts(sample, settings):
            decision = monitor.step(observation)
            moment = _moment(recording, sample, settings)
            entries.append(moment.entry(observation, decision, drawing))
        if progress is not None:
            progress(done, len(recording.vehicle))
    too_fast = sum(s.speed_mps > settings.speed_limit_mps for s in recording.vehicle)
    return ReplayResult(
        recording.name,
        recording.agent,
        tuple(entries),
        Measures.of(entries),
        too_fast,
        len(recording.vehicle) - len(entries) - too_fast,
        tuple(_notes(recording, settings, too_fast)),
    )


def _counts(sample: VehicleSample, settings: ReplaySettings) -> bool:
    return -settings.errors.speed_mps <= sample.speed_mps <= settings.speed_limit_mps


def _require_slow_samples(recording: Recording, settings: ReplaySettings) -> None:
    if not any(_counts(sample, settings) for sample in recording.vehicle):
        slowest = min(sample.speed_mps for sample in recording.vehicle)
        raise InputError(
            f"recording {recording.name!r}: no sample is driven forward at up to "
            f"{settings.speed_limit_mps:g} m/s (slowest {slowest:.2f} m/s); "
            "choose a slower recording"
        )


def _moment(recording: Recording, sample: VehicleSample, settings: ReplaySettings) -> Moment:
    shape, ahead_m = recording.shape, settings.reference_ahead_m
    x_m, y_m = rear_axle(sample, ahead_m)
    body = Body(
        x_m,
        y_m,
        sample.heading_rad,
        shape.front_m + ahead_m,
        shape.rear_m - ahead_m,
        shape.half_width_m,
    )
    return Moment(sample.t_s, body, sample.speed_mps, recording.people, settings.people)


def _notes(recording: Recording, settings: ReplaySettings, too_fast: int) -> Iterator[str]:
    yield OPEN_LOOP
    yield (
        "People are extrapolated at constant velocity with a growing radius "
        f"({settings.people.on_foot.provenance} figures); who is not seen for "
        f"{settings.people.on_foot.max_age_s:g} s is dropped."
    )
    if not recording.people:
        yield "This recording has no people: only the vehicle's side of decisions was exercised."
    if too_fast:
        yield f"{too_fast} samples above {settings.speed_limit_mps:g} m/s were not judged."
