"""A generated scene: a car on a bend, one person walks along it, one crosses, one stands by."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Protocol, final

from workbench.errors import InputError
from workbench.models.spline_path import SplinePath
from workbench.models.vehicle import Vehicle
from workbench.runtime import Action, MotionLimits, PathTable
from workbench.simulation.driving import Driver
from workbench.simulation.frames import Point
from workbench.simulation.people import PeopleModel
from workbench.simulation.recording import PersonSample, Track

PERIOD_S = 0.1
_WALK_OFF_MPS2 = 1.0
# A car that takes longer meets nobody, the scene is over before.
_LONGEST_WAY_S = 60.0


class Walking(Protocol):
    """Somebody of a scene."""

    def track(self, duration_s: float) -> Track:
        """Where they are, one sample per decision; in view for a while before time 0."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Walker:
    """A person who stands at (x_m, y_m) until start_s and then comes to walk at (vx_mps, vy_mps),
    accelerating by acceleration_mps2: nobody walks off at once."""

    name: str
    kind: str
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    start_s: float
    acceleration_mps2: float

    def track(self, duration_s: float) -> Track:
        """The person's samples, one per decision; they have been in view for 0.5 s at time 0."""
        times = (k * PERIOD_S for k in range(-5, round(duration_s / PERIOD_S) + 1))
        return Track(self.name, self.kind, tuple(self._sample(t_s) for t_s in times))

    def _sample(self, t_s: float) -> PersonSample:
        rise_s = math.hypot(self.vx_mps, self.vy_mps) / self.acceleration_mps2
        gone_s = max(0.0, t_s - self.start_s)
        # The time at full speed that leads as far.
        walked_s = gone_s - 0.5 * rise_s
        if gone_s < rise_s:
            walked_s = 0.5 * gone_s * gone_s / rise_s
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

    waypoints: (x, y) of the path, m; walkers; start_speed_mps: of the car, on its path, 0 at
    standstill under BRAKE; duration_s; seed: of the localisation error, of how long checks take and
    how hard the brake is, None for none, the middle and the middle; models: how the monitor's side
    predicts people; watched_m: radius about the car within which everybody is reported. The same
    values give the same run.
    """

    vehicle: Vehicle
    waypoints: tuple[Point, ...]
    walkers: tuple[Walking, ...]
    localisation: Localisation
    models: PeopleModel
    watched_m: float
    start_speed_mps: float
    duration_s: float
    seed: int | None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.duration_s) and self.duration_s >= PERIOD_S):
            raise InputError(f"duration_s: expected at least {PERIOD_S} s, got {self.duration_s!r}")

    @classmethod
    def standard(cls, vehicle: Vehicle, *, start_speed_mps: float, seed: int | None) -> Crossing:
        """An S of 60 m by 6 m. A person walks along 6 m to its right and is overtaken, another
        crosses from the left and would be on the path just when an undisturbed car gets there, a
        third stands 4.5 m to the right.

        From 6 m nobody stops `FailSafe` at 2.8 m/s, as studies/alongside.py shows; from 4.5 m they
        do, standing or walking, but not `LookAhead`, which expects them to go on as they do.
        """
        waypoints = tuple(
            (float(x), 3.0 * (1.0 - math.cos(math.pi * x / 60.0))) for x in range(0, 61, 4)
        )
        path = SplinePath.through(waypoints)
        walk_mps, lead_m, meeting_m, overtaken_m = 1.3, 11.0, 30.0, 14.0
        met_s, overtaken_s = _arrivals(vehicle, path, start_speed_mps, (meeting_m, overtaken_m))
        # They are half a rise late: 0.5 walk_mps / _WALK_OFF_MPS2.
        start_s = max(0.0, met_s - lead_m / walk_mps - 0.5 * walk_mps / _WALK_OFF_MPS2)
        crossing = _walker("crossing", path, (meeting_m, lead_m), (0.0, -walk_mps), start_s)
        alongside = _walker("alongside", path, (overtaken_m, -6.0), (walk_mps, 0.0), -10.0)
        away_s = overtaken_s + 10.0 - 0.5 * walk_mps / _WALK_OFF_MPS2
        waiting = _walker("waiting", path, (48.0, -4.5), (0.0, 0.0), 0.0)
        alongside = dataclasses.replace(
            alongside,
            x_m=alongside.x_m - alongside.vx_mps * away_s,
            y_m=alongside.y_m - alongside.vy_mps * away_s,
        )
        return cls(
            vehicle, waypoints, (alongside, crossing, waiting), Localisation.assumed(),
            PeopleModel.assumed(), 80.0, start_speed_mps, 30.0, seed,
        )  # fmt: skip

    @property
    def limits(self) -> MotionLimits:
        """What no person exceeds, from the vehicle file."""
        guard = self.vehicle.guard
        return MotionLimits(guard.speed_max_mps, guard.accel_max_mps2)

    @property
    def path(self) -> SplinePath:
        """The path through the waypoints."""
        return SplinePath.through(self.waypoints)

    def path_table(self) -> PathTable:
        """The path as the monitor must be given it, with straight ends."""
        return self.path.table(0.25, before_m=10.0, after_m=40.0)


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
        _WALK_OFF_MPS2,
    )


def _arrivals(
    vehicle: Vehicle, path: SplinePath, start_speed_mps: float, stations_m: tuple[float, float]
) -> tuple[float, float]:
    """When the car gets to either station, undisturbed; a time after the scene if it does not."""
    driver = Driver(vehicle, path)
    state, found = driver.start(start_speed_mps), dict.fromkeys(stations_m, _LONGEST_WAY_S)
    for k in range(round(_LONGEST_WAY_S / PERIOD_S)):
        for station_m in stations_m:
            if found[station_m] == _LONGEST_WAY_S and state.values[0] >= station_m:
                found[station_m] = k * PERIOD_S
        if max(found.values()) < _LONGEST_WAY_S:
            break
        state = driver.drive(state, Action.TRACK, PERIOD_S)
    return found[stations_m[0]], found[stations_m[1]]
