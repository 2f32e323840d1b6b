"""A generated scene: a car follows a bend, one person walks beside it, another crosses its path."""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.models.spline_path import SplinePath
from workbench.models.vehicle import Vehicle
from workbench.runtime import Action, Observation, PathTable
from workbench.simulation.driving import CarState, Driver
from workbench.simulation.frames import Point
from workbench.simulation.measures import Drawing, Judge, Measures, Moment, Progress
from workbench.simulation.people import Body, PeopleModel, seen_people
from workbench.simulation.recorded_path import corners
from workbench.simulation.recording import PersonSample, Track
from workbench.simulation.runlog import Entry

PERIOD_S = 0.1


@final
@dataclass(frozen=True, slots=True)
class Walker:
    """A person who stands at (x_m, y_m) until start_s and then walks at (vx_mps, vy_mps)."""

    name: str
    kind: str
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    start_s: float

    def track(self, duration_s: float) -> Track:
        """The person's samples, one per decision; they have been in view for 0.5 s at time 0."""
        times = (k * PERIOD_S for k in range(-5, round(duration_s / PERIOD_S) + 1))
        return Track(self.name, self.kind, tuple(self._sample(t_s) for t_s in times))

    def _sample(self, t_s: float) -> PersonSample:
        walked_s = max(0.0, t_s - self.start_s)
        return PersonSample(
            t_s, self.x_m + self.vx_mps * walked_s, self.y_m + self.vy_mps * walked_s
        )


@final
@dataclass(frozen=True, slots=True)
class Localisation:
    """Half widths of the intervals that the monitor is given; each contains the truth.

    With a `random.Random` the interval's centre is off by up to its half width, without one it is
    the truth. The controller reads the true state: only the monitor's input is blurred.
    """

    position_m: float
    heading_rad: float
    steering_rad: float
    speed_mps: float

    @classmethod
    def assumed(cls) -> Localisation:
        """Assumed for corrected satellite positioning with an inertial unit: 0.05 m, 0.01 rad,
        steering 0.005 rad, speed 0.05 m/s.
        """
        return cls(0.05, 0.01, 0.005, 0.05)


@final
@dataclass(frozen=True, slots=True)
class Crossing:
    """What happens, apart from the monitor.

    waypoints: (x, y) of the path, m; walkers; duration_s; seed: of the localisation error, None for
    none; models: how the monitor's side predicts people. The same values give the same run.
    """

    vehicle: Vehicle
    waypoints: tuple[Point, ...]
    walkers: tuple[Walker, ...]
    localisation: Localisation
    models: PeopleModel
    duration_s: float
    seed: int | None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.duration_s) and self.duration_s >= PERIOD_S):
            raise InputError(f"duration_s: expected at least {PERIOD_S} s, got {self.duration_s!r}")

    @classmethod
    def standard(cls, vehicle: Vehicle, *, seed: int | None) -> Crossing:
        """An S of 60 m by 6 m; a person walks along 3 m to its right and is overtaken, another
        crosses from the left and would be on the path just when an undisturbed car gets there.
        """
        waypoints = tuple(
            (float(x), 3.0 * (1.0 - math.cos(math.pi * x / 60.0))) for x in range(0, 61, 4)
        )
        path = SplinePath.through(waypoints)
        speed_mps, walk_mps, lead_m = vehicle.operation.reference_speed_mps, 1.3, 11.0
        meeting_m, overtaken_m = 24.0, 14.0
        start_s = max(0.0, meeting_m / speed_mps - lead_m / walk_mps)
        crossing = _walker("crossing", path, (meeting_m, lead_m), (0.0, -walk_mps), start_s)
        alongside = _walker("alongside", path, (overtaken_m, -3.0), (walk_mps, 0.0), 0.0)
        alongside = dataclasses.replace(
            alongside,
            x_m=alongside.x_m - alongside.vx_mps * overtaken_m / speed_mps,
            y_m=alongside.y_m - alongside.vy_mps * overtaken_m / speed_mps,
        )
        return cls(
            vehicle,
            waypoints,
            (alongside, crossing),
            Localisation.assumed(),
            PeopleModel.assumed(),
            22.0,
            seed,
        )

    @property
    def path(self) -> SplinePath:
        """The path through the waypoints."""
        return SplinePath.through(self.waypoints)

    def path_table(self) -> PathTable:
        """The path as the monitor must be given it, with straight ends."""
        return self.path.table(0.25, before_m=10.0, after_m=40.0)


@final
@dataclass(frozen=True, slots=True)
class CrossingResult:
    """What happened, closed-loop: the car obeyed.

    entries: one per decision; slowest_mps: lowest speed; braked_s: first BRAKE, None without one;
    resumed_s: TRACK after the last BRAKE, None without one.
    """

    entries: tuple[Entry, ...]
    measures: Measures
    slowest_mps: float
    braked_s: float | None
    resumed_s: float | None

    def summary_line(self) -> str:
        """The run in one line."""
        story = "did not brake"
        if self.braked_s is not None:
            end = "to the end" if self.resumed_s is None else f"to {self.resumed_s:.1f} s"
            story = f"braked from {self.braked_s:.1f} s {end}, slowest {self.slowest_mps:.2f} m/s"
        return f"crossing: {self.measures.summary()}, closed-loop: the car {story}"


def simulate(
    crossing: Crossing, monitor: Judge, *, progress: Progress | None = None
) -> CrossingResult:
    """Drive the scene: a decision every 0.1 s, obeyed until the next one.

    The plant is the vehicle's own closed loop, RK4 at 0.01 s: TRACK, or the vehicle's BRAKE at its
    nominal deceleration. The monitor must have been built for `crossing.path_table()` and
    `crossing.vehicle`. `progress(done, total)` is called after each decision.
    """
    driver = Driver(crossing.vehicle, crossing.path)
    people = tuple(walker.track(crossing.duration_s) for walker in crossing.walkers)
    chance = None if crossing.seed is None else random.Random(crossing.seed)
    drawing = Drawing(3.0, 0.5, corners(crossing.path_table()))
    state = driver.start(crossing.vehicle.operation.reference_speed_mps)
    count = round(crossing.duration_s / PERIOD_S)
    entries = []
    for k in range(count):
        t_s = k * PERIOD_S
        observation = _observation(crossing, state, (t_s, people), chance)
        decision = monitor.step(observation)
        body = _body(crossing.vehicle, state)
        moment = Moment(t_s, body, state.speed_mps, people, crossing.models)
        entries.append(moment.entry(observation, decision, drawing))
        state = driver.drive(state, decision.action, PERIOD_S)
        if progress is not None:
            progress(k + 1, count)
    return _result(tuple(entries))


def _walker(name: str, path: SplinePath, place: Point, velocity: Point, start_s: float) -> Walker:
    """A pedestrian placed by station and offset, moving along and to the left of the path."""
    station_m, offset_m = place
    (x_m, y_m), tangent = path.position(station_m).tolist(), float(path.heading(station_m))
    cos, sin = math.cos(tangent), math.sin(tangent)
    return Walker(
        name,
        "ped",
        x_m - offset_m * sin,
        y_m + offset_m * cos,
        velocity[0] * cos - velocity[1] * sin,
        velocity[0] * sin + velocity[1] * cos,
        start_s,
    )


def _observation(
    crossing: Crossing,
    state: CarState,
    seen: tuple[float, Sequence[Track]],
    chance: random.Random | None,
) -> Observation:
    error = crossing.localisation

    def around(value: float, radius: float) -> tuple[float, float]:
        centre = value if chance is None else value + chance.uniform(-radius, radius)
        return centre - radius, centre + radius

    low, high = around(state.speed_mps, error.speed_mps)
    return Observation(
        x=around(state.x_m, error.position_m),
        y=around(state.y_m, error.position_m),
        heading=around(state.heading, error.heading_rad),
        steering=around(state.steering, error.steering_rad),
        speed=(max(low, 0.0), max(high, 0.0)),
        speed_integral=(state.speed_integral_m, state.speed_integral_m),
        offset_integral=(state.offset_integral_ms, state.offset_integral_ms),
        reference_speed_mps=crossing.vehicle.operation.reference_speed_mps,
        people=seen_people(seen[1], seen[0], crossing.models),
    )


def _body(vehicle: Vehicle, state: CarState) -> Body:
    shape = vehicle.geometry
    return Body(
        state.x_m, state.y_m, state.heading, shape.front_m, shape.rear_m, shape.half_width_m
    )


def _result(entries: tuple[Entry, ...]) -> CrossingResult:
    frames = [entry.frame for entry in entries]
    braking = [frame.t_s for frame in frames if frame.action == Action.BRAKE.name]
    after = [frame.t_s for frame in frames if braking and frame.t_s > braking[-1]]
    return CrossingResult(
        entries,
        Measures.of(entries),
        min(frame.speed_mps for frame in frames),
        braking[0] if braking else None,
        after[0] if after else None,
    )
