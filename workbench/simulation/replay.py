"""Replay: run a monitor over a recorded drive, sample by sample, and measure what it decided.

Replay is open-loop: the recorded car does not obey, so a BRAKE changes nothing of what follows, and
the driver is not the controller of the bundle. `FailSafe` can therefore decide nothing here: what
its induction rests on, that the car does what was sent, does not hold. It is asked beside
`LookAhead`, and logged.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.estimation.people_estimator import PeopleNow
from workbench.models.vehicle import Vehicle
from workbench.models.vehicle_sections import Geometry
from workbench.runtime import MotionLimits, PathTable, Timing
from workbench.runtime.policies import Turn
from workbench.sets import Box
from workbench.simulation.clock import SetClock
from workbench.simulation.measures import Drawing, Judge, Measures, Moment, Progress
from workbench.simulation.observing import Observer, StateErrors, rear_axle
from workbench.simulation.people import Body, PeopleModel
from workbench.simulation.people_sources import PeopleSource, StraightPeople
from workbench.simulation.recorded_path import PathSmoothing, corners, recorded_path
from workbench.simulation.recording import Recording, VehicleSample
from workbench.simulation.runlog import Entry

OPEN_LOOP = (
    "Replay is open-loop: the recorded car does not obey the decisions, and its driver is not the "
    "controller that the bundle was built for."
)
CHECK_S = 0.02
"""How long after its sample a check is taken to end, so that the log does not depend on the
machine; the time per decision is measured beside."""
TURN_S = 1.0 / 30.0
"""Time between two turns of the sender."""
# Of a turn; a clock that counts from long ago shows instants no finer.
_SAME_TURN = 1e-3
_TIMING = Timing(period_s=0.1, latency_s=0.05, send_gap_s=TURN_S)


@final
@dataclass(frozen=True, slots=True)
class ReplaySettings:
    """errors: around the recorded state; people, path: how they are predicted and smoothed; limits:
    what no person exceeds; watched_m: radius about the car within which everybody is taken to be
    recorded; speed_limit_mps: faster samples are not judged; reference_ahead_m: recorded point
    ahead of the rear axle; drawn_horizon_s, drawn_step_s: people's discs kept for the report.
    """

    errors: StateErrors
    people: PeopleModel
    limits: MotionLimits
    path: PathSmoothing
    watched_m: float
    speed_limit_mps: float
    reference_ahead_m: float
    drawn_horizon_s: float
    drawn_step_s: float

    def __post_init__(self) -> None:
        for name in ("watched_m", "speed_limit_mps", "drawn_horizon_s", "drawn_step_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{name}: expected a finite number above zero, got {value!r}")
        if not math.isfinite(self.reference_ahead_m):
            raise InputError(
                f"reference_ahead_m: expected finite metres, got {self.reference_ahead_m!r}"
            )

    @classmethod
    def instrumented_car(cls, limits: MotionLimits) -> ReplaySettings:
        """A GNSS/INS car whose point lies 0.3 m ahead of the rear axle, judged up to 8 m/s, that
        records everybody within 30 m."""
        return cls(
            StateErrors.assumed(), PeopleModel.assumed(), limits, PathSmoothing.usual(), 30.0, 8.0,
            0.3, 3.0, 0.5,
        )  # fmt: skip


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


def replay_timing(recording: Recording) -> Timing:
    """What the monitor of `replay` must be told of times: 0.1 s between samples, or the recording's
    median where its samples are rarer; 0.05 s for a check; a sender that turns 30 times a second.
    """
    times = [sample.t_s for sample in recording.vehicle]
    gaps = [after - before for before, after in itertools.pairwise(times)]
    usual_s = statistics.median(gaps) if gaps else 0.0
    return dataclasses.replace(_TIMING, period_s=max(_TIMING.period_s, usual_s))


def replay(
    recording: Recording,
    monitor: Judge,
    *,
    clock: SetClock,
    settings: ReplaySettings,
    people: PeopleSource | None = None,
    progress: Progress | None = None,
) -> ReplayResult:
    """Ask `monitor` at every sample that counts, using only samples with time <= t.

    The monitor must have been built for `replay_path`, `replay_vehicle` and `replay_timing`, read
    `clock`, and have LookAhead decide; the route and nothing else of the future is used. The clock
    counts from the recording's first sample; each check ends CHECK_S after its sample. `turn` is
    asked every TURN_S after a judged sample, and at the next one, just before its check.
    people: what the monitor is told of them, None for straight on as the settings say.
    `progress(done, total)` is called after each sample. Raises InputError when the vehicle does not
    move or no sample is slow enough.
    """
    _require_slow_samples(recording, settings)
    source = people or StraightPeople(recording.people, settings.people, settings.limits)
    entries = []
    for done, entry in enumerate(_entries(recording, (monitor, clock), settings, source), start=1):
        if entry is not None:
            entries.append(entry)
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
        tuple(_notes(recording, settings, source, too_fast)),
    )


def _entries(
    recording: Recording,
    judge: tuple[Judge, SetClock],
    settings: ReplaySettings,
    source: PeopleSource,
) -> Iterator[Entry | None]:
    """For every sample the decision on record, None where it is not judged."""
    monitor, clock = judge
    drawing = Drawing(
        settings.drawn_horizon_s, settings.drawn_step_s, corners(replay_path(recording, settings))
    )
    observer = Observer(
        settings.errors,
        wheelbase_m=recording.shape.wheelbase_m,
        reference_ahead_m=settings.reference_ahead_m,
        watched_m=settings.watched_m,
    )
    judged_s = 0.0
    told: PeopleNow | None = None
    for sample in recording.vehicle:
        stamp_s = sample.t_s - recording.vehicle[0].t_s
        told = _together(told, source.observe(sample.t_s))
        observation = observer.observe(sample, told.people, stamp_s=stamp_s)
        if not _counts(sample, settings):
            yield None
            continue
        turns = _turns(monitor, clock, (judged_s, stamp_s))
        judged_s = stamp_s
        clock.now_s = stamp_s + CHECK_S
        decision = monitor.step(observation)
        moment = _moment(recording, sample, (turns, told), settings)
        told = None
        yield moment.entry(observation, decision, drawing)


def _together(before: PeopleNow | None, now: PeopleNow) -> PeopleNow:
    """`now`, with what was broken at samples before that were not judged."""
    if before is None:
        return now
    return dataclasses.replace(now, violations=before.violations + now.violations)


def _turns(monitor: Judge, clock: SetClock, between_s: tuple[float, float]) -> Sequence[Turn]:
    """The turns of the sender from one judged sample to the next, the last one at the latter."""
    last_s, stamp_s = between_s
    turns = []
    for turn in range(1, math.ceil((stamp_s - last_s) / TURN_S - _SAME_TURN)):
        clock.now_s = last_s + turn * TURN_S
        turns.append(monitor.turn(clock.now_s))
    clock.now_s = stamp_s
    return [*turns, monitor.turn(stamp_s)]


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


def _moment(
    recording: Recording,
    sample: VehicleSample,
    known: tuple[Sequence[Turn], PeopleNow],
    settings: ReplaySettings,
) -> Moment:
    turns, told = known
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
    return Moment(
        sample.t_s, turns, body, sample.speed_mps, recording.people, settings.people, told
    )


def _notes(
    recording: Recording, settings: ReplaySettings, source: PeopleSource, too_fast: int
) -> Iterator[str]:
    yield OPEN_LOOP
    yield source.intent_note
    yield (
        "LookAhead decides; FailSafe is followed in the log only, as the recorded car does not do "
        "what it says. It takes everybody within "
        f"{settings.watched_m:g} m to be recorded, and {source.guard_note}; "
        "whoever comes from farther away and is faster than the bundle's guard allows is named "
        "(NOBODY_NEW)."
    )
    if not recording.people:
        yield "This recording has no people: only the vehicle's side of decisions was exercised."
    if too_fast:
        yield f"{too_fast} samples above {settings.speed_limit_mps:g} m/s were not judged."
